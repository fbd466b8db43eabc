//! Grasp search: independent of the number of threads, and able to grasp low objects.

use geometry::Vec3;
use grasps::search::{GraspSearch, GraspTester, SearchConfig, search};
use grasps::{PlacedObject, RobotContext};
use objects::import::{ImportContext, ImportOptions, import_object};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use rollout::{Attempt, Controller, RolloutContext};
use std::sync::Arc;

#[test]
fn grasps_do_not_depend_on_the_number_of_threads() {
    let robot = RobotContext::standard().unwrap();
    let object = Object::from_catalog("sugar_box").unwrap();
    let config = SearchConfig { max_tested: 4, ..SearchConfig::quick(&robot) };
    let (parallel, _) = search(&robot, &object, &config, 3, &|_| ()).unwrap();
    // One task after the other, on one thread and in reverse.
    let tester = GraspTester::new(&robot, &object, &config, 3);
    let mut serial = GraspSearch::new(config.clone());
    loop {
        let batch = serial.next_batch(&robot, &object);
        if batch.is_empty() {
            break;
        }
        let results = batch.iter().rev().map(|task| tester.execute(task));
        let mut results: Vec<_> = results.collect::<Result<_, _>>().unwrap();
        results.reverse();
        serial.complete(results);
    }
    let json = |set| serde_json::to_string(set).unwrap();
    assert_eq!(json(&serial.finish().0), json(&parallel));
    assert!(!parallel.grasps.is_empty());
}

/// A can as low and wide as one of tuna. Without a stop at the table, the outer fingers close into the table.
#[test]
fn low_can_is_lifted_by_fingers_above_the_table() {
    let context = RolloutContext::new().unwrap();
    let robot = &context.robot;
    let can = Object::from_catalog("soup_can").unwrap();
    let shape = ShapeVariant { scale: Vec3::new(1.26, 1.26, 0.33), shoulder_drop: 0.0 };
    let can = can.scaled_variant("low can", &shape).unwrap().with_mass(0.17);
    assert!(can.size().z < 0.035, "{:?}", can.size());
    let config = SearchConfig::quick(robot);
    let (set, _) = search(robot, &can, &config, 0, &|_| ()).unwrap();
    assert!(!set.grasps.is_empty(), "{set:?}");

    let at_origin = PlacedObject::at_origin(robot, &can);
    for grasp in &set.grasps {
        let postures = (0..8).filter_map(|step| {
            let placed = at_origin.at_pose(&robot.config.object_pose(0.65, 0.0, 0.8 * step as f32));
            placed.plan(grasp).map(|posture| placed.clearance(&posture.grasp, 0.05))
        });
        let clearances: Vec<f32> = postures.collect();
        assert!(!clearances.is_empty(), "a selected grasp is out of reach");
        assert!(clearances.iter().all(|clearance| *clearance > -0.001), "{clearances:?}");
    }
    let grasps = Arc::new(set.grasps);
    let lifts = |seed: &u64| {
        let controller = Controller::PlannedGrasps(grasps.clone());
        let attempt = Attempt::new(&context, &can, "low can", None, *seed, controller);
        attempt.unwrap().run(&context).is_lifted()
    };
    let lifted = (0..6).filter(lifts).count();
    assert!(lifted >= 4, "{lifted} of 6 lifted");
}

/// OBJ of a prism with `sides` sides that lies along x (mm).
fn lying_prism(sides: usize, radius: f64, length: f64) -> String {
    let corner = |i: usize, x: f64| {
        let (sin, cos) = (std::f64::consts::TAU * (i as f64 + 0.5) / sides as f64).sin_cos();
        format!("v {x} {} {}\n", radius * cos, radius * sin)
    };
    let ends = [-0.5 * length, 0.5 * length];
    let vertices = ends.iter().flat_map(|&x| (0..sides).map(move |i| corner(i, x)));
    let next = |i: usize| (i + 1) % sides;
    let quads = (0..sides).map(|i| {
        let [a, b] = [i + 1, next(i) + 1];
        format!("f {a} {b} {} {}\n", b + sides, a + sides)
    });
    let end = |corners: Vec<usize>| {
        let names: Vec<String> = corners.iter().map(usize::to_string).collect();
        format!("f {}\n", names.join(" "))
    };
    let caps = [end((1..=sides).rev().collect()), end((sides + 1..=2 * sides).collect())];
    vertices.chain(quads).chain(caps).collect()
}

/// The fingertips are thicker than the rod: they must slide along the table, and press gently.
#[test]
fn rod_of_15_mm_is_pinched() {
    let context = RolloutContext::new().unwrap();
    let robot = &context.robot;
    let options = ImportOptions { mass: Some(0.03), ..ImportOptions::default() };
    let text = lying_prism(16, 7.5, 150.0);
    let rod = import_object("rod.obj", text.as_bytes(), options, &ImportContext::NONE).unwrap();
    let rod = rod.object;
    assert!((rod.size().z - 0.015).abs() < 0.001, "{:?}", rod.size());
    let (set, _) = search(robot, &rod, &SearchConfig::paper(robot), 0, &|_| ()).unwrap();
    assert!(!set.grasps.is_empty(), "{set:?}");
    let at_origin = PlacedObject::at_origin(robot, &rod);
    let (_, posture) = at_origin
        .at_pose(&robot.config.object_pose(0.6, 0.0, 0.0))
        .reachable(&set.grasps)
        .next()
        .expect("a grasp is in reach");
    let tips = robot.tree.forward_kinematics(&posture.grasp).fingertips();
    let top = robot.config.table.center[2] + robot.config.table.half_extents[2];
    let lowest = tips.iter().map(|tip| tip.z as f32 - top).fold(f32::INFINITY, f32::min);
    assert!(lowest < 0.02, "the lowest fingertip is {lowest} m above the table");
    let grasps = Arc::new(set.grasps);
    let lifts = |seed: &u64| {
        let controller = Controller::PlannedGrasps(grasps.clone());
        let attempt = Attempt::new(&context, &rod, "rod", None, *seed, controller);
        attempt.unwrap().run(&context).is_lifted()
    };
    let lifted = (0..6).filter(lifts).count();
    assert!(lifted >= 2, "{lifted} of 6 lifted");
}
