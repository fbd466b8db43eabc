//! An object in the hand, as a grasp holds it.

use crate::report::canvas::Canvas;
use crate::report::view::{Facet, View, facets};
use crate::report::{INK, QUIET};
use geometry::object::Object;
use grasps::{Grasp, Robot};
use robot::{ARM, DOF, rotation};

/// Size of a picture (pixels), and pixels a metre.
const SIZE: [f32; 2] = [170.0, 210.0];
const SCALE: f32 = 430.0;

const OBJECT: [f32; 3] = [0.95, 0.75, 0.45];
const HAND: [f32; 3] = [0.55, 0.62, 0.70];
const TIPS: [f32; 3] = [0.30, 0.55, 0.85];

/// Grasp number `index` on its object, and how many poses it serves.
pub(crate) fn picture(
    robot: &Robot,
    object: &Object,
    grasp: &Grasp,
    index: usize,
    poses: usize,
) -> Canvas {
    let mut canvas = Canvas::new(SIZE[0], SIZE[1]);
    let mut all: Vec<Facet> = facets(&object.mesh, OBJECT).collect();
    let q = robot::join(&[0.0; ARM], &grasp.touch);
    let kinematics = robot.tree.kinematics(&q);
    let object_from_world = grasp.object_from_palm * kinematics.palm().inverse();
    for body in ARM..=DOF {
        let pose = rotation::to_pose(&(object_from_world * kinematics.world_from_body[body]));
        for solid in robot.solids.of_body(body) {
            let is_distal = body > ARM && (body - ARM).is_multiple_of(4);
            let color = if is_distal { TIPS } else { HAND };
            all.extend(facets(&solid.moved(&pose).mesh(), color));
        }
    }
    // From where palm and object stand side by side.
    let palm = object_from_world * kinematics.palm();
    let away = palm.translation.vector;
    let azimuth = libm::atan2(away.y, away.x).to_degrees() as f32 + 65.0;
    let height = 0.5 * object.bounds[1].z.max(away.z as f32 + 0.05);
    let center = [0.5 * SIZE[0], 0.52 * SIZE[1] + SCALE * height];
    View::new(azimuth, 18.0).draw(&mut canvas, &all, SCALE, center);
    canvas.text([4.0, 14.0], 12.0, INK, &format!("grasp {index}, kind {}", grasp.kind));
    canvas.text([4.0, 28.0], 10.0, QUIET, &format!("serves {poses} poses"));
    canvas
}

/// Pictures side by side.
pub(crate) fn row(pictures: Vec<Canvas>) -> String {
    let columns = pictures.len().clamp(1, 7);
    let rows = pictures.len().div_ceil(columns);
    let mut all = Canvas::new(SIZE[0] * columns as f32, SIZE[1] * rows as f32);
    for (i, picture) in pictures.iter().enumerate() {
        let at = [SIZE[0] * (i % columns) as f32, SIZE[1] * (i / columns) as f32];
        all.place(at, picture);
    }
    all.svg("The grasps on the object")
}
