//! End-to-end pipeline at toy size: demonstrations, encoder, policy, model files, attempt.

use configs::{AutoencoderConfig, DaggerConfig, DatasetConfig};
use grasps::RobotContext;
use imitation::data::demo_group::DemoGroup;
use imitation::data::split;
use imitation::models::encoder::TrainedEncoder;
use imitation::train::autoencoder;
use imitation::train::callback::TrainingStatus;
use imitation::train::dagger;
use objects::catalog::built_in_objects;
use objects::object::Object;
use policy::model::MODEL_FILES;
use policy::{ObservationKind, PolicyConfig};
use progress::NoProgress;
use robot::JointVector;
use rollout::{Attempt, Controller, RolloutContext};
use std::path::Path;

#[test]
fn tiny_model_is_trained_resumed_and_executed() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("model"));
    let robot = RobotContext::standard().unwrap();
    let smoke = DatasetConfig::preset("smoke", 1).unwrap();
    let config = DatasetConfig { poses: 10, trajectories: 2, ..smoke };
    let objects = built_in_objects(config.all_objects()).unwrap();
    let dataset = datagen::create(&data, &config, &objects, false).unwrap();
    datagen::generate(&dataset, &robot, &objects, &NoProgress).unwrap();
    let rows = dataset.verify(&NoProgress).unwrap();
    let records = dataset.read_poses(0).unwrap();
    assert_eq!(rows, records.iter().map(|record| record.offsets.last().unwrap()).sum::<usize>());
    let other = DatasetConfig { seed: 2, ..config };
    let other = datagen::create(&data, &other, &objects, false);
    assert!(other.err().unwrap().to_string().contains("another configuration"));

    let steps = AutoencoderConfig {
        steps: 4,
        batch: 4,
        grasp_weight: 0.5,
        ..AutoencoderConfig::standard()
    };
    autoencoder::train(&dataset, &steps, &out, &mut |_: &TrainingStatus| Ok(true)).unwrap();
    let encoder = TrainedEncoder::load(&out).unwrap();
    let (train, held_out) =
        split::train_val_split(std::slice::from_ref(&dataset), &encoder, ObservationKind::Cloud, 3)
            .unwrap();
    assert_eq!(train.len(), 3 * dataset.config.num_azimuths, "one group per pose and azimuth");
    assert!(train.iter().all(|lesson| lesson.pose < 3));
    assert!(!held_out.is_empty() && held_out.iter().all(|lesson| lesson.pose == 9));
    // Start configurations of held-out groups come from training groups only.
    let mut near = held_out.iter().flat_map(|lesson| &lesson.neighbor_starts);
    let is_in_train = |start: &JointVector| {
        train.iter().flat_map(DemoGroup::starts).any(|q| (q - start).norm() < 1e-9)
    };
    assert!(near.all(is_in_train));
    let steps =
        DaggerConfig { steps: 50, batch: 8, ..DaggerConfig::standard(PolicyConfig::tiny()) };
    let mut losses = Vec::new();
    let tree = &robot.tree;
    let params = dagger::train(&train, tree, &steps, None, &out, &mut |now: &TrainingStatus| {
        losses.push(now.loss);
        Ok(true)
    })
    .unwrap()
    .unwrap();
    assert!(losses.len() == 1 && losses[0].is_finite(), "{losses:?}");
    imitation::models::export::write_model(&out, &encoder, &params, &steps, &train).unwrap();

    // An interrupted and resumed run gives the same weights as an uninterrupted one.
    let stopped = folder.path().join("stopped");
    let longer = DaggerConfig { steps: 100, checkpoint_every: 20, ..steps.clone() };
    let run = |until: u64, out: &Path| {
        let mut reported = Vec::new();
        let mut callback = |now: &TrainingStatus| {
            reported.push(now.step);
            Ok(now.step < until)
        };
        let trained = dagger::train(&train, tree, &longer, None, out, &mut callback).unwrap();
        (trained.map(|params| params.values().unwrap()), reported)
    };
    assert_eq!(run(40, &stopped), (None, vec![20, 40]));
    let (resumed, reported) = run(u64::MAX, &stopped);
    assert_eq!(reported, [50, 60, 80, 100], "the run did not resume at step 40");
    let (uninterrupted, _) = run(u64::MAX, &folder.path().join("whole"));
    assert!(resumed.is_some() && resumed == uninterrupted, "the resumed run differs");

    // Training from model files starts at their weights, rounded to 6 bits of mantissa.
    let weights = std::fs::read(out.join("weights.safetensors")).unwrap();
    let no_steps = DaggerConfig { steps: 0, ..steps };
    let elsewhere = folder.path().join("again");
    let again = dagger::train(
        &train,
        tree,
        &no_steps,
        Some(&weights),
        &elsewhere,
        &mut |_: &TrainingStatus| Ok(true),
    );
    let again = again.unwrap().unwrap().values().unwrap();
    let pairs = params.values().unwrap().into_iter().zip(again);
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= a.abs() / 128.0 + 1e-6));

    let mut context = RolloutContext::new().unwrap();
    let read = |file: &str| std::fs::read(out.join(file)).unwrap();
    let files = MODEL_FILES.map(|(_, file)| read(file));
    context.load_model(&files[0], &files[1], &files[2]).unwrap();
    let object = Object::from_catalog("sugar_box").unwrap();
    let attempt = || {
        let mut attempt =
            Attempt::new(&context, &object, "sugar_box", None, 5, Controller::Policy).unwrap();
        (attempt.run(&context), attempt.state_hash())
    };
    assert_eq!(attempt(), attempt(), "the attempt is not reproducible from its seed");
}
