//! Grasps from elsewhere: a plain file with palm poses and hand joints, closed and tried like our own proposals.
//!
//! Frames are stated in the file and checked: the object's is z up, its bottom at z = 0, its bounding box
//! centred in x and y; the palm's is x along its normal, y towards the index finger, z along the fingers.

use crate::proposal::ProposalConfig;
use geometry::object::Object;
use robot::{FINGERS, HAND, Isometry, Tree, Vector};

/// A file of grasps (JSON).
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspFile {
    /// Name of the object, for people.
    pub object: String,
    /// Factor that makes the object's metres of the numbers in `palm`; 1 for metres.
    pub scale: f64,
    /// Extent of the object's bounding box along x, y, z, in the numbers of `palm`: times `scale` it must be
    /// the object's, which checks frame and scale.
    pub size: [f64; 3],
    /// Names of the hand's joints, in the order of `joints`.
    pub joint_names: Vec<String>,
    /// The grasps.
    pub grasps: Vec<GraspRow>,
}

/// A grasp of a file.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspRow {
    /// Palm in the object: x, y, z (times `scale`: m), quaternion x, y, z, w.
    pub palm: [f64; 7],
    /// Joints (rad) of the closed hand.
    pub joints: Vec<f64>,
}

/// Why a file of grasps cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ImportError {
    /// It is not such a file.
    #[error("the file of grasps is not valid: {0}. See the documentation of `GraspFile`")]
    Parse(String),
    /// Frame or scale are wrong.
    #[error(
        "the file's object is {found:?} m large, {name} is {wanted:?} m: check frame and scale \
         (z up, bottom at z = 0, bounding box centred in x and y)"
    )]
    Size {
        /// The object.
        name: String,
        /// Its size.
        wanted: [f32; 3],
        /// That of the file.
        found: [f64; 3],
    },
    /// Another hand.
    #[error("the file's joints are {found:?}; the hand has {wanted:?}, each once, in any order")]
    Joints {
        /// Names of the hand's joints.
        wanted: Vec<String>,
        /// Those of the file.
        found: Vec<String>,
    },
    /// A row is no grasp.
    #[error("grasp {row}: {what}")]
    Row {
        /// Index of the grasp.
        row: usize,
        /// What is wrong with it.
        what: &'static str,
    },
}

/// A palm pose with the hand as it is before it closes there.
#[derive(Clone, Debug)]
pub struct Imported {
    /// Pose of the palm in the object.
    pub object_from_palm: Isometry,
    /// Hand joints (rad) a little more open than in the file.
    pub open: [f64; HAND],
}

/// Greatest difference (m) of the sizes of file and object.
const SIZE_ERROR: f64 = 0.003;
/// How far (rad) the flexing joints of each finger are opened before they close again.
const OPENED: f64 = 0.35;
/// Palms farther than this (m) from the object's origin hold nothing.
const FARTHEST: f64 = 0.6;

impl GraspFile {
    /// Reads a file.
    pub fn parse(bytes: &[u8]) -> Result<Self, ImportError> {
        serde_json::from_slice(bytes).map_err(|error| ImportError::Parse(error.to_string()))
    }

    /// The file's grasps on `object`, joints in the robot's order.
    pub fn read(&self, tree: &Tree, object: &Object) -> Result<Vec<Imported>, ImportError> {
        let wanted = object.size().to_array();
        let found = self.size.map(|size| size * self.scale);
        let off = |i: usize| (found[i] - f64::from(wanted[i])).abs();
        if !(0..3).all(|i| off(i) <= SIZE_ERROR) {
            let name = object.name.clone();
            return Err(ImportError::Size { name, wanted, found });
        }
        let names: Vec<String> =
            tree.joints[robot::ARM..].iter().map(|joint| joint.name.clone()).collect();
        let place = |name: &String| self.joint_names.iter().position(|other| other == name);
        let order: Option<Vec<usize>> = names.iter().map(place).collect();
        let order = order.filter(|_| self.joint_names.len() == HAND);
        let foreign =
            || ImportError::Joints { wanted: names.clone(), found: self.joint_names.clone() };
        let order = order.ok_or_else(foreign)?;
        self.grasps
            .iter()
            .enumerate()
            .map(|(row, grasp)| self.row(tree, &order, row, grasp))
            .collect()
    }

    fn row(
        &self,
        tree: &Tree,
        order: &[usize],
        row: usize,
        grasp: &GraspRow,
    ) -> Result<Imported, ImportError> {
        let error = |what| ImportError::Row { row, what };
        if grasp.joints.len() != HAND {
            return Err(error("it does not have 16 joints"));
        }
        if !grasp.palm.iter().chain(&grasp.joints).all(|x| x.is_finite()) {
            return Err(error("it holds something that is no number"));
        }
        let [x, y, z, i, j, k, w] = grasp.palm;
        let turn = nalgebra::Quaternion::new(w, i, j, k);
        if (turn.norm() - 1.0).abs() > 0.01 {
            return Err(error("its quaternion (x, y, z, w) is not of length 1"));
        }
        let at = Vector::new(x, y, z) * self.scale;
        if at.norm() > FARTHEST {
            return Err(error("its palm is more than 0.6 m from the object: check the scale"));
        }
        let turn = nalgebra::UnitQuaternion::from_quaternion(turn);
        let mut open = [0.0; HAND];
        for (joint, &from) in order.iter().enumerate() {
            let flexes = joint % (HAND / FINGERS) != 0;
            let limits = &tree.limits;
            let (lower, upper) =
                (limits.lower[robot::ARM + joint], limits.upper[robot::ARM + joint]);
            let value = grasp.joints[from] - if flexes { OPENED } else { 0.0 };
            if grasp.joints[from] < lower - 0.2 || grasp.joints[from] > upper + 0.2 {
                return Err(error("a joint is more than 0.2 rad beyond its limits"));
            }
            open[joint] = value.clamp(lower, upper);
        }
        Ok(Imported { object_from_palm: Isometry::from_parts(at.into(), turn), open })
    }
}

impl Imported {
    /// How it is closed: from its own posture; a palm that collides backs off by 12 mm at most.
    pub(crate) fn config(&self, standard: &ProposalConfig) -> ProposalConfig {
        ProposalConfig { open: self.open, retreat_steps: 3, ..standard.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::built_in::built_in;

    fn file(tree: &Tree, object: &Object) -> GraspFile {
        let size = object.size().to_array().map(|x| 10.0 * f64::from(x));
        let grasp = &built_in("sugar_box").unwrap().grasps[0];
        let at = grasp.object_from_palm.translation.vector * 10.0;
        let turn = grasp.object_from_palm.rotation.coords;
        // The names in reverse: the order is the file's own.
        let mut joint_names: Vec<String> =
            tree.joints[robot::ARM..].iter().map(|joint| joint.name.clone()).collect();
        joint_names.reverse();
        let mut joints = grasp.touch.to_vec();
        joints.reverse();
        let palm = [at.x, at.y, at.z, turn.x, turn.y, turn.z, turn.w];
        let grasps = vec![GraspRow { palm, joints }];
        GraspFile { object: "sugar_box".into(), scale: 0.1, size, joint_names, grasps }
    }

    #[test]
    fn a_grasp_comes_in_with_its_scale_and_its_order_of_joints() {
        let (tree, object) =
            (Tree::iiwa7_allegro().unwrap(), Object::built_in("sugar_box").unwrap());
        let bytes = serde_json::to_vec(&file(&tree, &object)).unwrap();
        let got = GraspFile::parse(&bytes).unwrap().read(&tree, &object).unwrap();
        let wanted = &built_in("sugar_box").unwrap().grasps[0];
        let apart =
            got[0].object_from_palm.translation.vector - wanted.object_from_palm.translation.vector;
        assert!(apart.norm() < 1e-9, "{apart}");
        let lower = tree.limits.lower[robot::ARM + 1];
        assert_eq!(got[0].open[0], wanted.touch[0]);
        assert!((got[0].open[1] - (wanted.touch[1] - OPENED).max(lower)).abs() < 1e-12);
    }

    #[test]
    fn what_is_wrong_with_a_file_is_said() {
        let (tree, object) =
            (Tree::iiwa7_allegro().unwrap(), Object::built_in("sugar_box").unwrap());
        let good = file(&tree, &object);
        let error = |change: &dyn Fn(&mut GraspFile)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.read(&tree, &object).unwrap_err().to_string()
        };
        assert!(error(&|f| f.size[2] *= 10.0).contains("check frame and scale"));
        assert!(error(&|f| f.joint_names[3] = "little".into()).contains("little"));
        assert!(
            error(&|f| f.grasps[0].joints.truncate(15)).contains("grasp 0: it does not have 16")
        );
        assert!(error(&|f| f.grasps[0].palm[6] = 3.0).contains("quaternion"));
        assert!(error(&|f| f.grasps[0].palm[0] = f64::NAN).contains("no number"));
        assert!(error(&|f| f.scale = 10.0).contains("check frame and scale"));
        assert!(error(&|f| f.grasps[0].palm[2] = 90.0).contains("check the scale"));
        assert!(error(&|f| f.grasps[0].joints[5] = 4.0).contains("beyond its limits"));
        assert!(GraspFile::parse(b"{}").unwrap_err().to_string().contains("missing field"));
    }
}
