//! Inspection of attempts and interaction: contact forces, reconstruction, dragging, and the orientation
//! of imported meshes.

use geometry::Vec3;
use grasps::set::catalog::catalog_grasps;
use grasps::set::k_medoids;
use objects::import::{self, ImportContext, ImportOptions, OrientationReason};
use objects::object::Object;
use objects::shape_variant::ShapeVariant;
use policy::model::MODEL_FILES;
use rollout::{Attempt, Controller, FailureReason, Outcome, Phase, RolloutContext};
use std::path::Path;

/// Context with the policy `models/default`.
fn context() -> RolloutContext {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../models/default");
    let read = |name: &str| std::fs::read(folder.join(name)).unwrap();
    let files = MODEL_FILES.map(|(_, file)| read(file));
    let mut context = RolloutContext::new().unwrap();
    context.load_model(&files[0], &files[1], &files[2]).unwrap();
    context
}

#[test]
fn unstable_mesh_gets_the_orientation_of_similar_training_objects() {
    let context = context();
    for name in ["sugar_box", "bleach", "mustard"] {
        let mesh = Object::from_catalog(name).unwrap().mesh;
        let height = mesh.extent().z;
        // On an edge, rotated about two axes.
        let turn = geometry::Pose::new(Vec3::ZERO, Vec3::new(0.5, 0.3, 0.0));
        let vertices = mesh.vertices.iter().map(|v| turn * *v);
        let mut file: String = vertices.map(|v| format!("v {} {} {}\n", v.x, v.y, v.z)).collect();
        file.extend(
            mesh.triangles
                .iter()
                .map(|t| t.map(|i| i + 1))
                .map(|[a, b, c]| format!("f {a} {b} {c}\n")),
        );
        let import_context = ImportContext {
            choose_orientation: &|poses| context.most_familiar(poses),
            rests: &|object| scene::rests_on_table(&context.robot.config, object),
            ..ImportContext::NONE
        };
        let options = ImportOptions::default();
        let found =
            import::import_object("tilted.obj", file.as_bytes(), options, &import_context).unwrap();
        println!("{name}: {:?}, {} of {height} m high", found.orientation, found.object.size().z);
        assert_eq!(found.orientation.1, OrientationReason::ChosenByModel, "{name}");
        assert!(
            (found.object.size().z - height).abs() < 0.01 * height,
            "{name}: {:?}",
            found.orientation
        );
    }
}

fn start_planner_attempt(context: &RolloutContext, object: &Object) -> Attempt {
    Attempt::new(context, object, "sugar_box", None, 0, Controller::Planner).unwrap()
}

/// Sum of the contact forces on the object, divided by its weight.
fn force_over_weight(attempt: &Attempt, object: &Object) -> Vec3 {
    let force =
        attempt.contact_forces().iter().fold(Vec3::ZERO, |sum, contact| sum + contact.force);
    force / (object.mass * 9.81)
}

#[test]
fn contact_forces_balance_the_weight_on_the_table_and_in_the_hand() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let mut attempt = start_planner_attempt(&context, &object);
    let (mut on_table, mut in_hand) = (Vec::new(), Vec::new());
    while attempt.outcome().is_none() {
        attempt.step(&context);
        match attempt.phase() {
            Phase::Approach => on_table.push(force_over_weight(&attempt, &object)),
            Phase::Hold => in_hand.push(force_over_weight(&attempt, &object)),
            _ => {}
        }
    }
    assert!(attempt.outcome().unwrap().is_lifted());
    for (name, all) in [("table", on_table), ("hand", in_hand)] {
        assert!(all.len() > 10, "{name}");
        // Impulses of single steps vary; only their mean equals the weight.
        let mean = all.iter().fold(Vec3::ZERO, |sum, force| sum + *force) / all.len() as f32;
        println!("{name}: {mean} of the weight");
        assert!(mean.distance(Vec3::Z) < 0.1, "{name}: {mean}");
    }
}

#[test]
fn reconstruction_is_within_1_cm_of_the_observed_cloud() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    for seed in 0..5 {
        let policy = Controller::Policy;
        let attempt = Attempt::new(&context, &object, "sugar_box", None, seed, policy).unwrap();
        let made = attempt.reconstruction(&context).unwrap();
        let nearest = |point: &Vec3| {
            attempt.cloud().iter().map(|p| p.distance(*point)).fold(f32::INFINITY, f32::min)
        };
        let mean = made.iter().map(nearest).sum::<f32>() / made.len() as f32;
        assert!(mean < 0.01, "seed {seed}: mean error {mean} m");
    }
    // The planner does not use the encoder.
    assert!(start_planner_attempt(&context, &object).reconstruction(&context).is_none());
}

#[test]
fn dragging_pulls_the_object_from_the_hand_and_marks_the_attempt() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let mut attempt = start_planner_attempt(&context, &object);
    while attempt.phase() != Phase::Policy {
        attempt.step(&context);
    }
    let far = attempt.scene().object_pose().translation + Vec3::new(0.0, 0.6, 0.0);
    attempt.drag(Some((Vec3::ZERO, far)));
    let outcome = attempt.run(&context);
    assert!(matches!(outcome, Outcome::Failed { .. }) && attempt.was_disturbed(), "{outcome:?}");
    let moved = attempt.scene().object_pose().translation.y - (far.y - 0.6);
    assert!(moved > 0.1, "{moved}");
}

#[test]
fn drag_between_steps_has_no_effect() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let end = |is_pulled: bool| {
        let mut attempt = start_planner_attempt(&context, &object);
        while attempt.phase() != Phase::Policy {
            attempt.step(&context);
        }
        if is_pulled {
            attempt.drag(Some((Vec3::ZERO, Vec3::new(0.6, 0.6, 0.6))));
            attempt.drag(None);
        }
        attempt.run(&context);
        assert!(!attempt.was_disturbed());
        attempt.state_hash()
    };
    assert_eq!(end(true), end(false));
}

#[test]
fn steps_after_the_outcome_move_the_object_but_not_the_outcome() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let mut attempt = start_planner_attempt(&context, &object);
    let result = (attempt.run(&context), attempt.state_hash());
    let (ticks, steps) = (attempt.ticks(), attempt.scene().steps());
    let before = attempt.scene().object_pose().translation;
    attempt.drag(Some((Vec3::ZERO, before + Vec3::new(0.0, 0.0, 0.05))));
    for _ in 0..15 {
        attempt.step_after_outcome();
    }
    assert!(!attempt.was_disturbed() && attempt.is_disturbed());
    assert!(attempt.scene().object_pose().translation.distance(before) > 1e-4);
    attempt.drag(None);
    assert_eq!((attempt.outcome().unwrap(), attempt.state_hash()), result);
    assert!(attempt.ticks() == ticks && attempt.scene().steps() > steps);
    assert_eq!(attempt.recording().replay(&context, &object).unwrap(), (Some(result.0), result.1));
}

#[test]
fn evidence_measures_contacts_slip_and_height_at_the_outcome() {
    let (context, mut object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let mut attempt = start_planner_attempt(&context, &object);
    assert_eq!(attempt.evidence(), None, "before the outcome");
    let outcome = attempt.run(&context);
    let held = attempt.evidence().unwrap();
    assert!(outcome.is_lifted() && held.fingers >= 2 && !held.table && !held.arm, "{held:?}");
    assert!(held.height > 0.1 && held.slip.unwrap().distance < 0.03, "{held:?}");

    // Too heavy for the hand, which rises by 15 cm while the object stays on the table.
    object.mass = 30.0;
    let mut attempt = start_planner_attempt(&context, &object);
    assert!(!attempt.run(&context).is_lifted());
    let failed = attempt.evidence().unwrap();
    assert!(failed.table && failed.height < 0.01 && failed.max_height < 0.03, "{failed:?}");
    assert!(failed.slip.unwrap().distance > 0.1 && failed.max_fingers >= 2, "{failed:?}");
    let text = failed.explain(&context.robot.config.protocol);
    assert!(text.contains("Contacts: table (up to "), "{text}");
    assert!(text.contains("fingers during the lift). Slip in the hand: 1"), "{text}");
    let description = attempt.description().unwrap();
    assert!(description.starts_with("Slipped"), "it was gripped, not missed: {description}");
}

#[test]
fn attempt_reports_the_executed_grasp() {
    let (context, object) = (context(), Object::from_catalog("sugar_box").unwrap());
    let mut attempt = start_planner_attempt(&context, &object);
    assert_eq!(attempt.object_from_palm(&context), None);
    attempt.run(&context);
    let palm = attempt.object_from_palm(&context).unwrap();
    let grasps = catalog_grasps("sugar_box").unwrap().grasps;
    let distances =
        grasps.iter().map(|grasp| k_medoids::palm_distance(&grasp.object_from_palm, &palm));
    let min = distances.fold(f64::INFINITY, f64::min);
    assert!(min < 0.005, "{min} m from the nearest grasp of the planner");
}

#[test]
fn object_moving_without_contact_is_not_a_collision() {
    let context = context();
    let begin = |object: &Object| {
        let pose = Some([0.45, 0.1, 0.0]);
        Attempt::new(&context, object, "sugar_box", pose, 0, Controller::Policy).unwrap()
    };
    let object = Object::from_catalog("sugar_box").unwrap();
    let mut pulled = begin(&object);
    pulled.drag(Some((Vec3::ZERO, Vec3::new(0.45, 1.0, 0.2))));
    assert_eq!(pulled.run(&context), Outcome::Failed { reason: FailureReason::Disturbed });

    // Tall enough to obstruct the approach.
    let high = ShapeVariant { scale: Vec3::new(1.0, 1.0, 3.0), shoulder_drop: 0.0 };
    let outcome = begin(&object.scaled_variant("pillar", &high).unwrap()).run(&context);
    assert_eq!(outcome, Outcome::Failed { reason: FailureReason::Collided });
}
