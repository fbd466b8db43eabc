//! Import of grasps: a JSON file of palm poses and hand joints. The hand is closed again and tried as in a
//! search.
//!
//! The frames are fixed, and the size of the object is checked. Object: z up, bottom at z = 0, bounding box
//! centred in x and y. Palm: x along its normal, y towards the index finger, z along the fingers.

use crate::search::candidates::CandidateConfig;
use objects::object::Object;
use robot::{HAND_DOF, Isometry, KinematicTree, Vector};

/// A file of grasps (JSON).
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspFile {
    /// Name of the object; informative only.
    pub object: String,
    /// Factor that converts the positions of `palm` and `size` to metres.
    pub scale: f64,
    /// Extent of the object's bounding box along x, y, z. Times `scale`, it must match the object, which
    /// checks frame and scale.
    pub size: [f64; 3],
    /// Names of the hand's joints, in the order of `joints`.
    pub joint_names: Vec<String>,
    /// Grasps of the object.
    pub grasps: Vec<GraspRow>,
}

/// One grasp of a file.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GraspRow {
    /// Palm in the object's frame: x, y, z (times `scale`: m), quaternion x, y, z, w.
    pub palm: [f64; 7],
    /// Joints (rad) of the closed hand.
    pub joints: Vec<f64>,
}

/// Why a file of grasps cannot be used.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ImportError {
    /// The file is not valid JSON, or a field is missing or unknown.
    #[error("the grasp file is not valid: {0}. See the documentation of `GraspFile`")]
    Parse(String),
    /// The size does not match the object's: wrong frame or scale.
    #[error(
        "the file's object has size {found:?} m, but {name} has {wanted:?} m; check frame and scale \
         (z up, bottom at z = 0, bounding box centred in x and y)"
    )]
    Size {
        /// Name of the object.
        name: String,
        /// Size of the object (m).
        wanted: [f32; 3],
        /// Size in the file (m).
        found: [f64; 3],
    },
    /// The joint names do not match the hand's.
    #[error(
        "the file has the joints {found:?}, but the hand has {wanted:?}; list each once, in any order"
    )]
    Joints {
        /// Joint names of the hand.
        wanted: Vec<String>,
        /// Joint names in the file.
        found: Vec<String>,
    },
    /// A grasp has an invalid value.
    #[error("grasp {row}: {what}")]
    Row {
        /// Index of the grasp.
        row: usize,
        /// Cause and cure.
        what: &'static str,
    },
}

/// An imported palm pose, and the hand posture from which the fingers close.
#[derive(Clone, Debug)]
pub struct ImportedGrasp {
    /// Pose of the palm in the object's frame.
    pub object_from_palm: Isometry,
    /// Hand joints (rad), slightly more open than in the file.
    pub pregrasp: [f64; HAND_DOF],
}

/// Maximum difference (m) between the sizes of file and object.
const SIZE_TOLERANCE: f64 = 0.003;
/// Maximum distance (m) of the palm from the object's origin.
const MAX_PALM_DISTANCE: f64 = 0.6;

impl GraspFile {
    /// Parses a file.
    pub fn parse(bytes: &[u8]) -> Result<Self, ImportError> {
        serde_json::from_slice(bytes).map_err(|error| ImportError::Parse(error.to_string()))
    }

    /// Checks the grasps against `object` and converts them: metres, and joints in the robot's order.
    pub fn convert(
        &self,
        tree: &KinematicTree,
        object: &Object,
    ) -> Result<Vec<ImportedGrasp>, ImportError> {
        let wanted = object.size().to_array();
        let found = self.size.map(|size| size * self.scale);
        let deviation = |i: usize| (found[i] - f64::from(wanted[i])).abs();
        if !(0..3).all(|i| deviation(i) <= SIZE_TOLERANCE) {
            let name = object.name.clone();
            return Err(ImportError::Size { name, wanted, found });
        }
        let names: Vec<String> =
            tree.joints[robot::ARM_DOF..].iter().map(|joint| joint.name.clone()).collect();
        let index_in_file = |name: &String| self.joint_names.iter().position(|other| other == name);
        let order: Option<Vec<usize>> = names.iter().map(index_in_file).collect();
        let order = order.filter(|_| self.joint_names.len() == HAND_DOF);
        let mismatch =
            || ImportError::Joints { wanted: names.clone(), found: self.joint_names.clone() };
        let order = order.ok_or_else(mismatch)?;
        self.grasps
            .iter()
            .enumerate()
            .map(|(row, grasp)| self.convert_row(tree, &order, row, grasp))
            .collect()
    }

    fn convert_row(
        &self,
        tree: &KinematicTree,
        order: &[usize],
        row: usize,
        grasp: &GraspRow,
    ) -> Result<ImportedGrasp, ImportError> {
        let error = |what| ImportError::Row { row, what };
        if grasp.joints.len() != HAND_DOF {
            return Err(error("expected 16 joints"));
        }
        if !grasp.palm.iter().chain(&grasp.joints).all(|x| x.is_finite()) {
            return Err(error("a value is not finite"));
        }
        let [x, y, z, i, j, k, w] = grasp.palm;
        let turn = nalgebra::Quaternion::new(w, i, j, k);
        if (turn.norm() - 1.0).abs() > 0.01 {
            return Err(error("the quaternion (x, y, z, w) must have length 1"));
        }
        let position = Vector::new(x, y, z) * self.scale;
        if position.norm() > MAX_PALM_DISTANCE {
            return Err(error("the palm is more than 0.6 m from the object; check the scale"));
        }
        let turn = nalgebra::UnitQuaternion::from_quaternion(turn);
        let mut open = [0.0; HAND_DOF];
        for (joint, &from) in order.iter().enumerate() {
            let limits = &tree.limits;
            let (lower, upper) =
                (limits.lower[robot::ARM_DOF + joint], limits.upper[robot::ARM_DOF + joint]);
            let opening =
                if robot::is_flexion_joint(joint) { tree.hand.opening.imported } else { 0.0 };
            let value = grasp.joints[from] - opening;
            if grasp.joints[from] < lower - 0.2 || grasp.joints[from] > upper + 0.2 {
                return Err(error("a joint is more than 0.2 rad beyond its limits"));
            }
            open[joint] = value.clamp(lower, upper);
        }
        Ok(ImportedGrasp {
            object_from_palm: Isometry::from_parts(position.into(), turn),
            pregrasp: open,
        })
    }
}

impl ImportedGrasp {
    /// Settings of the closing: from the imported posture; a colliding palm backs off by up to 12 mm.
    pub(crate) fn candidate_config(&self, standard: &CandidateConfig) -> CandidateConfig {
        CandidateConfig { pregrasp: self.pregrasp, max_backoff_steps: 3, ..standard.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::set::catalog::catalog_grasps;

    fn file(tree: &KinematicTree, object: &Object) -> GraspFile {
        let size = object.size().to_array().map(|x| 10.0 * f64::from(x));
        let grasp = &catalog_grasps("sugar_box").unwrap().grasps[0];
        let position = grasp.object_from_palm.translation.vector * 10.0;
        let turn = grasp.object_from_palm.rotation.coords;
        // Reversed names: the file defines the order.
        let mut joint_names: Vec<String> =
            tree.joints[robot::ARM_DOF..].iter().map(|joint| joint.name.clone()).collect();
        joint_names.reverse();
        let mut joints = grasp.grasp.to_vec();
        joints.reverse();
        let palm = [position.x, position.y, position.z, turn.x, turn.y, turn.z, turn.w];
        let grasps = vec![GraspRow { palm, joints }];
        GraspFile { object: "sugar_box".into(), scale: 0.1, size, joint_names, grasps }
    }

    #[test]
    fn imported_grasp_uses_scale_and_joint_order_of_file() {
        let (tree, object) =
            (KinematicTree::iiwa7_allegro().unwrap(), Object::from_catalog("sugar_box").unwrap());
        let bytes = serde_json::to_vec(&file(&tree, &object)).unwrap();
        let got = GraspFile::parse(&bytes).unwrap().convert(&tree, &object).unwrap();
        let wanted = &catalog_grasps("sugar_box").unwrap().grasps[0];
        let error =
            got[0].object_from_palm.translation.vector - wanted.object_from_palm.translation.vector;
        assert!(error.norm() < 1e-9, "{error}");
        let (lower, opening) = (tree.limits.lower[robot::ARM_DOF + 1], tree.hand.opening.imported);
        assert_eq!(got[0].pregrasp[0], wanted.grasp[0]);
        assert!((got[0].pregrasp[1] - (wanted.grasp[1] - opening).max(lower)).abs() < 1e-12);
    }

    #[test]
    fn invalid_file_is_rejected_with_its_cause() {
        let (tree, object) =
            (KinematicTree::iiwa7_allegro().unwrap(), Object::from_catalog("sugar_box").unwrap());
        let good = file(&tree, &object);
        let error = |change: &dyn Fn(&mut GraspFile)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.convert(&tree, &object).unwrap_err().to_string()
        };
        assert!(error(&|f| f.size[2] *= 10.0).contains("check frame and scale"));
        assert!(error(&|f| f.joint_names[3] = "little".into()).contains("little"));
        assert!(
            error(&|f| f.grasps[0].joints.truncate(15)).contains("grasp 0: expected 16 joints")
        );
        assert!(error(&|f| f.grasps[0].palm[6] = 3.0).contains("quaternion"));
        assert!(error(&|f| f.grasps[0].palm[0] = f64::NAN).contains("not finite"));
        assert!(error(&|f| f.scale = 10.0).contains("check frame and scale"));
        assert!(error(&|f| f.grasps[0].palm[2] = 90.0).contains("check the scale"));
        assert!(error(&|f| f.grasps[0].joints[5] = 4.0).contains("beyond its limits"));
        assert!(GraspFile::parse(b"{}").unwrap_err().to_string().contains("missing field"));
    }
}
