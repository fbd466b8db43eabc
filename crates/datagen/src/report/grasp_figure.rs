//! Figure of an object in the hand at contact.

use crate::report::projection::{Facet, Projection, facets};
use crate::report::{INK, MUTED};
use files::svg::Canvas;
use grasps::{Grasp, RobotContext};
use objects::object::Object;
use robot::{ARM_DOF, DOF, FINGER_DOF, rotation};

/// Figure size (pixels), and scale (pixels per metre).
const SIZE: [f32; 2] = [170.0, 210.0];
const SCALE: f32 = 430.0;

const OBJECT_COLOR: [f32; 3] = [0.95, 0.75, 0.45];
const HAND_COLOR: [f32; 3] = [0.55, 0.62, 0.70];
const FINGERTIP_COLOR: [f32; 3] = [0.30, 0.55, 0.85];

/// Draws grasp `index` on its object, labeled with the number of poses that it covers.
pub(crate) fn draw_grasp(
    robot: &RobotContext,
    object: &Object,
    grasp: &Grasp,
    index: usize,
    poses: usize,
) -> Canvas {
    let mut canvas = Canvas::new(SIZE[0], SIZE[1]);
    let mut all: Vec<Facet> = facets(&object.mesh, OBJECT_COLOR).collect();
    let q = robot::joint_vector(&[0.0; ARM_DOF], &grasp.grasp);
    let kinematics = robot.tree.forward_kinematics(&q);
    let object_from_world = grasp.object_from_palm * kinematics.palm_pose().inverse();
    for body in ARM_DOF..=DOF {
        let pose = rotation::to_pose(&(object_from_world * kinematics.world_from_body[body]));
        for solid in robot.collision_model.body_shapes(body) {
            let is_distal = body > ARM_DOF && (body - ARM_DOF).is_multiple_of(FINGER_DOF);
            let color = if is_distal { FINGERTIP_COLOR } else { HAND_COLOR };
            all.extend(facets(&solid.transformed(&pose).mesh(), color));
        }
    }
    // View azimuth from which palm and object appear next to each other.
    let palm = object_from_world * kinematics.palm_pose();
    let away = palm.translation.vector;
    let azimuth = libm::atan2(away.y, away.x).to_degrees() as f32 + 65.0;
    let height = 0.5 * object.bounds[1].z.max(away.z as f32 + 0.05);
    let center = [0.5 * SIZE[0], 0.52 * SIZE[1] + SCALE * height];
    Projection::new(azimuth, 18.0).draw(&mut canvas, &all, SCALE, center);
    canvas.text([4.0, 14.0], 12.0, INK, &format!("grasp {index}, cluster {}", grasp.cluster));
    canvas.text([4.0, 28.0], 10.0, MUTED, &format!("covers {poses} poses"));
    canvas
}

/// Arranges figures in a grid.
pub(crate) fn figure_grid(pictures: Vec<Canvas>) -> String {
    let columns = pictures.len().clamp(1, 7);
    let rows = pictures.len().div_ceil(columns);
    let mut all = Canvas::new(SIZE[0] * columns as f32, SIZE[1] * rows as f32);
    for (i, picture) in pictures.iter().enumerate() {
        let at = [SIZE[0] * (i % columns) as f32, SIZE[1] * (i / columns) as f32];
        all.embed(at, picture);
    }
    all.svg("The grasps on the object")
}
