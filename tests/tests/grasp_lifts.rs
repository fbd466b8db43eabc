//! Grasps that come with the project lift, also when the object stands a little beside its place.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::object::Object;
use grasps::{Robot, search};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

const REPEATS: usize = 20;
/// Greatest shift (m) and turn (rad, 5 degrees) of the object in a repeat.
const SHIFT: f32 = 0.005;
const TURN: f32 = 0.0873;

/// The first grasp of the object's set, in repeats: at least `wanted` must lift.
fn lifts_again(name: &str, wanted: usize) {
    let robot = Robot::standard().unwrap();
    let object = Object::built_in(name).unwrap();
    let grasp = &rollout::workcell::built_in_grasps(name).unwrap().unwrap().grasps[0];
    let yaw = search::easiest_yaw(&robot, &object, grasp).expect("a yaw within reach");
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let mut lost = Vec::new();
    for _ in 0..REPEATS {
        let mut draw = |reach: f32| rng.random_range(-reach..=reach);
        let beside = [draw(SHIFT), draw(SHIFT), draw(TURN)];
        if !search::lifts(&robot, &object, grasp, yaw, Some(beside)).unwrap() {
            lost.push(beside);
        }
    }
    let lifted = REPEATS - lost.len();
    println!("{name}: grasp 0 lifted in {lifted} of {REPEATS} repeats; lost beside {lost:?}");
    assert!(
        lifted >= wanted,
        "{name}: grasp 0 lifted in {lifted} of {REPEATS} repeats, wanted {wanted}; lost {lost:?}"
    );
}

#[test]
fn the_sugar_box_is_lifted_in_every_repeat() {
    lifts_again("sugar_box", 20);
}

#[test]
fn the_bleach_bottle_is_lifted_in_nearly_every_repeat() {
    lifts_again("bleach", 18);
}
