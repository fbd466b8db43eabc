#![allow(missing_docs, clippy::unwrap_used)]
use geometry::object::Object;
use grasps::{Robot, search};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
#[test]
fn probe() {
    let robot = Robot::standard().unwrap();
    for name in ["sugar_box", "bleach"] {
        let object = Object::built_in(name).unwrap();
        for (i, grasp) in
            rollout::workcell::built_in_grasps(name).unwrap().grasps.iter().enumerate()
        {
            let t = std::time::Instant::now();
            let Some(yaw) = search::easiest_yaw(&robot, &object, grasp) else {
                println!("{name} {i} none");
                continue;
            };
            let mut rng = ChaCha8Rng::seed_from_u64(20);
            let mut n = 0;
            for _ in 0..20 {
                let mut draw = |r: f32| rng.random_range(-r..=r);
                let b = [draw(0.005), draw(0.005), draw(0.0873)];
                n += usize::from(search::lifts(&robot, &object, grasp, yaw, Some(b)).unwrap());
            }
            println!("{name} {i}: {n} of 20, {:?}", t.elapsed());
        }
    }
}
