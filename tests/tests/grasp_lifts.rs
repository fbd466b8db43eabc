//! Grasps that come with the project lift, also when the object stands a little beside its place.

use geometry::object::Object;
use grasps::{Robot, search};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Greatest shift (m) and turn (rad, 5 degrees) of the object.
const SHIFT: f32 = 0.005;
const TURN: f32 = 0.0873;
const REPEATS: usize = 20;

/// How many of the perturbed repeats of a grasp lift.
fn lifted(robot: &Robot, name: &str, index: usize, threads: usize) -> usize {
    let object = Object::built_in(name).unwrap();
    let grasp = &rollout::workcell::built_in_grasps(name).unwrap().grasps[index];
    let yaw = search::easiest_yaw(robot, &object, grasp).expect("a yaw within reach");
    let mut rng = ChaCha8Rng::seed_from_u64(20);
    let mut draw = |reach: f32| rng.random_range(-reach..=reach);
    let places: Vec<[f32; 3]> =
        (0..REPEATS).map(|_| [draw(SHIFT), draw(SHIFT), draw(TURN)]).collect();
    let lifts =
        |place: &&[f32; 3]| search::lifts(robot, &object, grasp, yaw, Some(**place)).unwrap();
    std::thread::scope(|scope| {
        let share = |places| scope.spawn(move || <[_]>::iter(places).filter(lifts).count());
        let shares: Vec<_> = places.chunks(REPEATS / threads).map(share).collect();
        shares.into_iter().map(|share| share.join().unwrap()).sum()
    })
}
