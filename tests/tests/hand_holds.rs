//! The hand holds a box, at rest and shaken, in the scene of the protocol.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::Pose;
use geometry::object::Object;
use grasps::built_in::built_in;
use grasps::place::Planned;
use grasps::{Grasp, Posture, Robot, Setting, lift, trial};
use robot::{JointState, JointVector, integrator};
use scene::config::CONTROL_PERIOD;
use scene::{Hold, Scene, Simulation};

/// Follows accelerations tick by tick.
fn follow(scene: &mut Scene, state: &mut JointState, rows: &[JointVector]) {
    for qdd in rows {
        let next = integrator::step(state, qdd, CONTROL_PERIOD);
        scene.follow(state, &next);
        *state = next;
    }
}

/// The grasps of the sugar box.
fn grasps() -> Vec<Grasp> {
    built_in("sugar_box").unwrap().grasps
}

/// The sugar box in the middle of the workspace, with one of its grasps.
fn sugar_box(robot: &Robot, grasp: &Grasp) -> (Object, Pose, Posture) {
    let object = Object::built_in("sugar_box").unwrap();
    let anywhere = Setting::anywhere(robot, &object);
    let planned = Planned::easiest(&anywhere, grasp).unwrap().expect("within reach");
    let (pose, posture) = (planned.setting.world_from_object, planned.posture);
    (object, pose, posture)
}

/// Slip (m) of the box in a grasp at rest, and then while it is shaken.
fn slips(robot: &Robot, grasp: &Grasp) -> [f32; 2] {
    let (object, pose, posture) = sugar_box(robot, grasp);
    let (config, tree) = (&robot.config, &robot.tree);
    let mut scene = Scene::new(config, tree, &object, &pose, &posture.open).unwrap();
    let mut state = JointState::at_rest(posture.open);
    follow(&mut scene, &mut state, &trial::straight(&posture.open, &posture.touch, 16));
    follow(&mut scene, &mut state, &trial::straight(&posture.touch, &posture.squeeze, 10));
    state = JointState::at_rest(posture.squeeze);
    follow(&mut scene, &mut state, &[JointVector::zeros(); 9]);
    let lift = lift::plan(config, tree, &state).unwrap().expect("a lift");
    for pair in lift.windows(2) {
        scene.follow(&pair[0], &pair[1]);
    }
    let top = lift[lift.len() - 1];

    let mut at_rest = Hold::begin(&scene);
    for _ in 0..75 {
        scene.follow(&top, &top);
        at_rest.observe(&scene);
    }

    // The first joint swings by 0.15 rad at 1 Hz about a place beside the first one, so that position
    // and velocity belong together from the start: a sine would begin with a jump to 0.9 rad/s.
    let mut shaken = Hold::begin(&scene);
    let swung = |tick: usize| {
        let phase = std::f64::consts::TAU * tick as f64 * CONTROL_PERIOD;
        let mut state = top;
        state.q[0] += 0.15 * (1.0 - phase.cos());
        state.qd[0] = 0.15 * std::f64::consts::TAU * phase.sin();
        state
    };
    for tick in 0..90 {
        scene.follow(&swung(tick), &swung(tick + 1));
        shaken.observe(&scene);
    }
    let touching = scene.touching();
    if !touching.hand || touching.table || touching.arm {
        return [at_rest.slip, f32::INFINITY];
    }
    [at_rest.slip, shaken.slip]
}

/// All grasps of the box: the physics is on trial here, not one of them. A grasp may be poor, but where
/// friction creeps or contacts jump, all are.
#[test]
fn a_held_box_slips_little_at_rest_and_when_shaken() {
    let robot = Robot::standard().unwrap();
    let slips: Vec<[f32; 2]> = grasps().iter().map(|grasp| slips(&robot, grasp)).collect();
    for ([at_rest, shaken], grasp) in slips.iter().zip(grasps()) {
        println!(
            "kind {}: slip {:.2} mm in 2.5 s at rest, {:.2} mm in 3 s shaken",
            grasp.kind,
            1e3 * at_rest,
            1e3 * shaken
        );
    }
    assert!(slips.iter().all(|[at_rest, _]| *at_rest <= 0.002), "creeps at rest: {slips:?}");
    let firm = slips.iter().filter(|[_, shaken]| *shaken <= 0.008).count();
    assert!(4 * firm >= 3 * slips.len(), "only {firm} of {} are firm: {slips:?}", slips.len());
}

#[test]
fn free_motion_is_tracked_before_contact() {
    let robot = Robot::standard().unwrap();
    let (object, pose, posture) = sugar_box(&robot, &grasps()[0]);
    let (config, tree) = (&robot.config, &robot.tree);
    let home = config.home();
    let mut scene = Scene::new(config, tree, &object, &pose, &home).unwrap();
    let mut state = JointState::at_rest(home);
    let mut above = posture.open;
    // Over the object, the hand half closed in the air: arm and fingers move together.
    for i in 0..robot::ARM {
        above[i] = home[i] + 0.5 * (above[i] - home[i]);
    }
    for i in robot::ARM..robot::DOF {
        above[i] = 0.5 * (home[i] + posture.squeeze[i]);
    }
    let (mut worst, mut apart, mut fastest) = (0.0f64, 0.0f64, 0.0f64);
    for next in robot::spline::quintic(&home, &above, &tree.limits, CONTROL_PERIOD) {
        scene.follow(&state, &next);
        state = next;
        worst = worst.max((scene.joint_positions() - state.q).amax());
        let measured = scene.joint_velocities();
        apart = apart.max((measured - state.qd).norm());
        fastest = fastest.max(measured.norm());
    }
    println!("free motion: tracked within {worst:.4} rad");
    assert!(worst <= 0.02, "a joint is {worst} rad off its command, wanted at most 0.02");
    assert!(apart <= 0.2 * fastest, "velocities are {apart} rad/s off of {fastest}");
}
