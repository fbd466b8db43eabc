//! What an onlooker sees of an attempt and does to it: forces that bear the object's weight, a cloud that lies where the
//! object is, pulling, and how what somebody brings is laid.

#![allow(clippy::unwrap_used, reason = "a helper of a test fails by panicking too")]

use geometry::Vec3;
use geometry::brought::{self, Because, Told};
use geometry::object::Object;
use geometry::proportions::Proportions;
use grasps::built_in::built_in;
use grasps::cluster;
use rollout::{Attempt, Controller, Failure, Phase, Verdict, Workcell};
use scene::Simulation;
use std::path::Path;

/// A cell with `models/default`.
fn workcell() -> Workcell {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    let files = ["weights.safetensors", "starts.safetensors", "config.json"].map(read);
    let mut workcell = Workcell::new().unwrap();
    workcell.load_model(&files[0], &files[1], &files[2]).unwrap();
    workcell
}

#[test]
fn what_would_fall_over_stands_as_what_was_learned_does() {
    let workcell = workcell();
    for name in ["sugar_box", "bleach", "mustard"] {
        let mesh = Object::built_in(name).unwrap().mesh;
        let height = mesh.extent().z;
        // On its edge, turned about two axes.
        let turn = geometry::Pose::new(Vec3::ZERO, Vec3::new(0.5, 0.3, 0.0));
        let vertices = mesh.vertices.iter().map(|v| turn * *v);
        let mut file: String = vertices.map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
        file.extend(
            mesh.triangles
                .iter()
                .map(|t| t.map(|i| i + 1))
                .map(|[a, b, c]| format!("f {a} {b} {c}\n")),
        );
        let found =
            brought::read("tilted.obj", file.as_bytes(), Told::default(), &mut &workcell).unwrap();
        println!("{name}: {:?}, {} of {height} m high", found.stands, found.object.size().z);
        assert_eq!(found.stands.1, Because::Laid, "{name}");
        assert!(
            (found.object.size().z - height).abs() < 0.01 * height,
            "{name}: {:?}",
            found.stands
        );
    }
}

fn begin(workcell: &Workcell, object: &Object) -> Attempt {
    Attempt::begin(workcell, object, "sugar_box", None, 0, Controller::Planner).unwrap()
}

/// What presses on the object in all, over its weight.
fn borne(attempt: &Attempt, object: &Object) -> Vec3 {
    let force = attempt.contacts().iter().fold(Vec3::ZERO, |sum, contact| sum + contact.force);
    force / (object.mass * 9.81)
}

#[test]
fn forces_bear_the_weight_on_the_table_and_in_the_hand() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    let mut attempt = begin(&workcell, &object);
    let (mut on_table, mut in_hand) = (Vec::new(), Vec::new());
    while attempt.verdict().is_none() {
        attempt.tick(&workcell);
        match attempt.phase() {
            Phase::Approach => on_table.push(borne(&attempt, &object)),
            Phase::Hold => in_hand.push(borne(&attempt, &object)),
            _ => {}
        }
    }
    assert!(attempt.verdict().unwrap().is_lifted());
    for (name, all) in [("table", on_table), ("hand", in_hand)] {
        assert!(all.len() > 10, "{name}");
        // Impulses of single steps scatter; their mean bears the weight, and nothing else.
        let mean = all.iter().fold(Vec3::ZERO, |sum, force| sum + *force) / all.len() as f32;
        println!("{name}: {mean} of the weight");
        assert!(mean.distance(Vec3::Z) < 0.1, "{name}: {mean}");
    }
}

#[test]
fn the_reconstruction_lies_where_the_object_is() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    for seed in 0..5 {
        let policy = Controller::Policy;
        let attempt = Attempt::begin(&workcell, &object, "sugar_box", None, seed, policy).unwrap();
        let made = attempt.reconstruction(&workcell).unwrap();
        let nearest = |point: &Vec3| {
            attempt.cloud().iter().map(|p| p.distance(*point)).fold(f32::INFINITY, f32::min)
        };
        let mean = made.iter().map(nearest).sum::<f32>() / made.len() as f32;
        assert!(mean < 0.01, "seed {seed}: {mean} m off");
    }
    // The planner asks no encoder.
    assert!(begin(&workcell, &object).reconstruction(&workcell).is_none());
}

#[test]
fn pulling_tears_the_object_out_of_the_hand_and_is_remembered() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    let mut attempt = begin(&workcell, &object);
    while attempt.phase() != Phase::Policy {
        attempt.tick(&workcell);
    }
    let far = attempt.scene().object_pose().translation + Vec3::new(0.0, 0.6, 0.0);
    attempt.pull(Some((Vec3::ZERO, far)));
    let verdict = attempt.run(&workcell);
    assert!(matches!(verdict, Verdict::Failed { .. }) && attempt.was_pulled(), "{verdict:?}");
    let moved = attempt.scene().object_pose().translation.y - (far.y - 0.6);
    assert!(moved > 0.1, "{moved}");
}

#[test]
fn a_pull_while_time_stands_still_changes_nothing() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    let end = |is_pulled: bool| {
        let mut attempt = begin(&workcell, &object);
        while attempt.phase() != Phase::Policy {
            attempt.tick(&workcell);
        }
        if is_pulled {
            attempt.pull(Some((Vec3::ZERO, Vec3::new(0.6, 0.6, 0.6))));
            attempt.pull(None);
        }
        attempt.run(&workcell);
        assert!(!attempt.was_pulled());
        attempt.state_hash()
    };
    assert_eq!(end(true), end(false));
}

#[test]
fn after_the_verdict_the_world_goes_on_and_the_verdict_stays() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    let mut attempt = begin(&workcell, &object);
    let told = (attempt.run(&workcell), attempt.state_hash());
    let (ticks, steps) = (attempt.ticks(), attempt.scene().steps());
    let before = attempt.scene().object_pose().translation;
    attempt.pull(Some((Vec3::ZERO, before + Vec3::new(0.0, 0.0, 0.05))));
    for _ in 0..15 {
        attempt.linger();
    }
    assert!(!attempt.was_pulled() && attempt.is_pulled());
    assert!(attempt.scene().object_pose().translation.distance(before) > 1e-4);
    attempt.pull(None);
    assert_eq!((attempt.verdict().unwrap(), attempt.state_hash()), told);
    assert!(attempt.ticks() == ticks && attempt.scene().steps() > steps);
    assert_eq!(attempt.episode().replay(&workcell, &object).unwrap(), (Some(told.0), told.1));
}

#[test]
fn a_report_tells_which_grasp_was_tried() {
    let (workcell, object) = (workcell(), Object::built_in("sugar_box").unwrap());
    let mut attempt = begin(&workcell, &object);
    assert_eq!(attempt.object_from_palm(&workcell), None);
    attempt.run(&workcell);
    let palm = attempt.object_from_palm(&workcell).unwrap();
    let grasps = built_in("sugar_box").unwrap().grasps;
    let far = grasps.iter().map(|grasp| cluster::distance(&grasp.object_from_palm, &palm));
    let least = far.fold(f64::INFINITY, f64::min);
    assert!(least < 0.005, "{least} m from every grasp that the planner knows");
}

#[test]
fn what_moves_untouched_was_not_run_into() {
    let workcell = workcell();
    let begin = |object: &Object| {
        let pose = Some([0.45, 0.1, 0.0]);
        Attempt::begin(&workcell, object, "sugar_box", pose, 0, Controller::Policy).unwrap()
    };
    let object = Object::built_in("sugar_box").unwrap();
    let mut pulled = begin(&object);
    pulled.pull(Some((Vec3::ZERO, Vec3::new(0.45, 1.0, 0.2))));
    assert_eq!(pulled.run(&workcell), Verdict::Failed { reason: Failure::Shifted });

    // So high that it is in the way.
    let high = Proportions { scale: Vec3::new(1.0, 1.0, 3.0), sink: 0.0 };
    let verdict = begin(&object.reshaped("pillar", &high).unwrap()).run(&workcell);
    assert_eq!(verdict, Verdict::Failed { reason: Failure::Collided });
}
