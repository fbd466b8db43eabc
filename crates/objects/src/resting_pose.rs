//! Poses in which an imported object can rest on the table, and the choice among them.

use crate::import::{ImportContext, Orientation, OrientationReason};
use crate::object::{DEFAULT_FRICTION, Object};
use glamx::DMat3;
use mesh::{MassProperties, Mesh, MeshError, StablePose};

/// Max number of stable poses offered to the user, the most stable ones.
pub const MAX_STABLE_POSES: usize = 6;
/// Max number of stable poses that are tested; a round object has many.
const MAX_TESTED_POSES: usize = 24;
/// Cosine of the max tilt (15 degrees) that counts as upright: the base of a scan is never flat.
const MAX_SETTLE_TILT_COS: f64 = 0.966;
/// Min tip angle (tangent) of an object that is taken for y-up: a phone or a book does not stand on its edge.
const MIN_Y_UP_TIP_ANGLE_TAN: f64 = 0.2;
/// Max number of vertices of the hull on which a pose is tested.
const MAX_HULL_VERTICES: usize = 256;

/// Stable poses of a mesh before the test.
pub(crate) struct Candidates {
    stable: Vec<StablePose>,
    is_stable_as_in_file: bool,
    is_y_up: bool,
}

/// Stable poses that are offered, and the one that is preferred to the orientation of the file.
pub(crate) struct OfferedPoses {
    pub(crate) stable: Vec<StablePose>,
    preferred: Option<(usize, OrientationReason)>,
    is_stable_as_in_file: bool,
}

impl Candidates {
    pub(crate) fn of(mesh: &Mesh, properties: &MassProperties, is_y_up: bool) -> Self {
        let center = properties.center_of_mass;
        let stable = mesh::stable_poses(&mesh.vertices, center);
        // All poses count here: a round body has many that are more stable than the upright one.
        let is_stable_as_in_file = stable.is_empty()
            || stable.iter().any(StablePose::is_identity)
            || mesh::is_stable(&mesh.vertices, center);
        Self { stable, is_stable_as_in_file, is_y_up }
    }

    /// The most stable poses that pass the test, and always the preferred one.
    pub(crate) fn offered(self, rests: &dyn Fn(&StablePose) -> bool) -> OfferedPoses {
        let y_up = self.stable.iter().position(|pose| {
            self.is_y_up && pose.is_y_up() && pose.tip_angle_tan >= MIN_Y_UP_TIP_ANGLE_TAN
        });
        let y_up = y_up.filter(|index| rests(&self.stable[*index]));
        let settled = settled_pose(&self.stable).filter(|_| !self.is_stable_as_in_file);
        let preferred = y_up.map(|index| (index, OrientationReason::YUpFile));
        let preferred = preferred.or(settled.map(|index| (index, OrientationReason::Settled)));
        let mut stable: Vec<StablePose> = Vec::new();
        let mut new_preferred = None;
        let mut beyond_max = None;
        for (index, pose) in self.stable.into_iter().enumerate() {
            let reason = preferred.filter(|(preferred, _)| *preferred == index);
            let has_room = stable.len() < MAX_STABLE_POSES;
            if let Some((_, reason)) = reason {
                new_preferred = Some((stable.len(), reason));
                match has_room {
                    true => stable.push(pose),
                    false => beyond_max = Some(pose),
                }
            } else if has_room && index < MAX_TESTED_POSES && rests(&pose) {
                stable.push(pose);
            }
        }
        stable.extend(beyond_max);
        let is_stable_as_in_file = self.is_stable_as_in_file || stable.is_empty();
        OfferedPoses { stable, preferred: new_preferred, is_stable_as_in_file }
    }
}

impl OfferedPoses {
    /// Orientation on the table, with the reason.
    pub(crate) fn choose(
        &self,
        mesh: &Mesh,
        given: Option<Orientation>,
        context: &ImportContext,
    ) -> (Orientation, OrientationReason) {
        match (given, self.preferred) {
            (Some(orientation), _) => (orientation, OrientationReason::Given),
            (None, Some((index, reason))) => (Orientation::StablePose(index), reason),
            (None, None) if self.is_stable_as_in_file => {
                (Orientation::AsInFile, OrientationReason::Given)
            }
            (None, None) => {
                let mut meshes =
                    self.stable.iter().map(|pose| mesh.clone().rotated(&pose.rotation));
                match (context.choose_orientation)(&mut meshes) {
                    Some(index) => {
                        (Orientation::StablePose(index), OrientationReason::ChosenByModel)
                    }
                    None => (Orientation::StablePose(0), OrientationReason::Unstable),
                }
            }
        }
    }
}

/// Index of the pose in which the mesh settles from the orientation of its file, if it tilts by under 15
/// degrees.
fn settled_pose(poses: &[StablePose]) -> Option<usize> {
    let tilt_cos = |index: &usize| poses[*index].tilt_cos();
    let nearest = (0..poses.len()).max_by(|a, b| tilt_cos(a).total_cmp(&tilt_cos(b)))?;
    (tilt_cos(&nearest) > MAX_SETTLE_TILT_COS).then_some(nearest)
}

/// The rotated mesh with its convex hull as the only part: the table touches nothing else.
pub(crate) fn object_on_hull(
    mesh: &Mesh,
    properties: &MassProperties,
    rotation: &DMat3,
    kg: f32,
) -> Result<Object, MeshError> {
    let hull = mesh::convex_hull(&mesh.vertices, MAX_HULL_VERTICES).ok_or(MeshError::Flat)?;
    let hull = hull.rotated(rotation);
    let (parts, properties) = (vec![hull.vertices.clone()], properties.clone().rotated(rotation));
    Ok(Object::with_properties("", hull, parts, kg, DEFAULT_FRICTION, properties))
}

#[cfg(test)]
mod tests {
    use crate::import::{
        FIRST_POSE, ImportContext, ImportOptions, ImportedObject, Orientation, OrientationReason,
        import_object,
    };
    use mesh::UpAxis;

    /// Text STL or OBJ of a box (mm).
    fn file(is_stl: bool, low: [i32; 3], high: [i32; 3]) -> String {
        let pick = |i: usize, axis: usize| if i >> axis & 1 == 0 { low[axis] } else { high[axis] };
        let corner = |i: usize| format!("{} {} {}", pick(i, 0), pick(i, 1), pick(i, 2));
        let quads =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        if !is_stl {
            let vertices = (0..8).map(|i| format!("v {}\n", corner(i)));
            let faces =
                triangles.map(|t| t.map(|i| i + 1)).map(|[a, b, c]| format!("f {a} {b} {c}\n"));
            return vertices.chain(faces).collect();
        }
        let facet = |t: [usize; 3]| {
            let vertices = t.map(|i| format!("vertex {}\n", corner(i))).concat();
            format!("facet normal 0 0 0\nouter loop\n{vertices}endloop\nendfacet\n")
        };
        format!("solid box\n{}endsolid box\n", triangles.map(facet).collect::<String>())
    }

    fn import(text: &str, options: ImportOptions, context: &ImportContext) -> ImportedObject {
        import_object("box", text.as_bytes(), options, context).unwrap()
    }

    #[test]
    fn flat_object_drawn_from_its_edge_lies() {
        for (name, low, high, height_mm) in [
            ("phone", [-37, 0, -4], [37, 150, 4], 8.0),
            ("book", [0, 0, -10], [150, 210, 10], 20.0),
            ("plate", [0, 0, -5], [100, 60, 5], 10.0),
        ] {
            for is_stl in [true, false] {
                let text = file(is_stl, low, high);
                let found = import(&text, ImportOptions::default(), &ImportContext::NONE);
                let height = 1000.0 * found.object.size().z;
                assert!((height - height_mm).abs() < 1e-3, "{name}, STL {is_stl}: {height} mm");
            }
        }
    }

    #[test]
    fn box_with_y_up_stands_in_formats_that_define_no_axis() {
        let [low, high] = [[-30, 0, -30], [30, 120, 30]];
        let found = import(&file(false, low, high), ImportOptions::default(), &ImportContext::NONE);
        assert_eq!(found.orientation.1, OrientationReason::YUpFile);
        assert!((found.object.size().z - 0.12).abs() < 1e-6);
        // STL is z up, unless another axis is given.
        let lying = import(&file(true, low, high), ImportOptions::default(), &ImportContext::NONE);
        assert!((lying.object.size().z - 0.06).abs() < 1e-6);
        let options = ImportOptions { up: Some(UpAxis::Y), ..ImportOptions::default() };
        let given = import(&file(true, low, high), options, &ImportContext::NONE);
        assert!((given.object.size().z - 0.12).abs() < 1e-6);
        assert_eq!(given.orientation, (Orientation::AsInFile, OrientationReason::Given));
    }

    #[test]
    fn pose_that_fails_the_rest_test_is_not_offered() {
        let text = file(false, [0, 0, 0], [40, 60, 120]);
        let lying_only = ImportContext {
            rests: &|object| object.size().z < 0.1,
            choose_orientation: FIRST_POSE,
            ..ImportContext::NONE
        };
        let found = import(&text, ImportOptions::default(), &lying_only);
        assert_eq!(found.num_stable_poses, 4, "two of six faces are 120 mm high");
        let standing = ImportContext { rests: &|object| object.size().z > 0.1, ..lying_only };
        let options = ImportOptions {
            orientation: Some(Orientation::StablePose(0)),
            ..ImportOptions::default()
        };
        let found = import(&text, options, &standing);
        assert_eq!(found.num_stable_poses, 2);
        assert!((found.object.size().z - 0.12).abs() < 1e-6);
    }
}
