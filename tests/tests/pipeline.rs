//! The whole path at toy size: demonstrations, encoder, policy, model files, an attempt.

use dataset::generate::{Alone, built_in_objects};
use dataset::{Dataset, DatasetConfig};
use geometry::object::Object;
use grasps::Robot;
use imitation::autoencoder::{self, AutoencoderConfig};
use imitation::dagger::{self, DaggerConfig};
use imitation::encoder::TrainedEncoder;
use imitation::lesson::Lesson;
use imitation::split;
use imitation::watcher::Progress;
use policy::{Observation, PolicyConfig};
use robot::JointVector;
use rollout::{Attempt, Controller, Workcell};
use std::path::Path;

#[test]
fn a_tiny_model_is_made_and_acts() {
    let folder = tempfile::tempdir().unwrap();
    let (data, out) = (folder.path().join("data"), folder.path().join("model"));
    let robot = Robot::standard().unwrap();
    let smoke = DatasetConfig::preset("smoke", 1).unwrap();
    let config = DatasetConfig { poses: 10, trajectories: 2, ..smoke };
    let objects = built_in_objects(config.all_objects()).unwrap();
    let dataset = Dataset::create(&data, config.clone(), &objects, false).unwrap();
    dataset.generate(&robot, &objects, &Alone).unwrap();
    let rows = dataset.verify(&|_, _| ()).unwrap();
    let records = dataset.poses(0).unwrap();
    assert_eq!(rows, records.iter().map(|record| record.offsets.last().unwrap()).sum::<usize>());
    let other = DatasetConfig { seed: 2, ..config };
    let other = Dataset::create(&data, other, &objects, false);
    assert!(other.err().unwrap().to_string().contains("another configuration"));

    let steps = AutoencoderConfig { steps: 4, batch: 4, ..AutoencoderConfig::standard() };
    autoencoder::train(&dataset, &steps, &out, &mut |_: &Progress| Ok(true)).unwrap();
    let encoder = TrainedEncoder::load(&out).unwrap();
    let (taught, held_out) = split::lessons(&dataset, &encoder, Observation::Cloud, 3).unwrap();
    assert_eq!(taught.len(), 3 * dataset.config.turns, "each pose at each bearing");
    assert!(taught.iter().all(|lesson| lesson.pose < 3));
    assert!(!held_out.is_empty() && held_out.iter().all(|lesson| lesson.pose == 9));
    // Where an attempt with what is held out may begin is known from what is taught alone.
    let mut near = held_out.iter().flat_map(|lesson| &lesson.near);
    let is_taught = |start: &JointVector| {
        taught.iter().flat_map(Lesson::starts).any(|q| (q - start).norm() < 1e-9)
    };
    assert!(near.all(is_taught));
    let steps =
        DaggerConfig { steps: 50, batch: 8, ..DaggerConfig::standard(PolicyConfig::tiny()) };
    let mut losses = Vec::new();
    let tree = &robot.tree;
    let params = dagger::train(&taught, tree, &steps, None, &out, &mut |now: &Progress| {
        losses.push(now.loss);
        Ok(true)
    })
    .unwrap()
    .unwrap();
    assert!(losses.len() == 1 && losses[0].is_finite(), "{losses:?}");
    imitation::model_files::write_model(&out, &encoder, &params, &steps, &taught).unwrap();

    // A run that is stopped and goes on ends in the same weights.
    let stopped = folder.path().join("stopped");
    let longer = DaggerConfig { steps: 100, span: 20, ..steps.clone() };
    let train = |until: u64, out: &Path| {
        let mut told = Vec::new();
        let mut look_on = |now: &Progress| {
            told.push(now.step);
            Ok(now.step < until)
        };
        let trained = dagger::train(&taught, tree, &longer, None, out, &mut look_on).unwrap();
        (trained.map(|params| params.values().unwrap()), told)
    };
    assert_eq!(train(40, &stopped), (None, vec![20, 40]));
    let (resumed, told) = train(u64::MAX, &stopped);
    assert_eq!(told, [50, 60, 80, 100], "it goes on where it was stopped");
    let (whole, _) = train(u64::MAX, &folder.path().join("whole"));
    assert!(resumed.is_some() && resumed == whole, "a resumed run differs");

    // Training goes on from a model where it stopped, but for the rounding of its weights to 6 bits of mantissa.
    let weights = std::fs::read(out.join("weights.safetensors")).unwrap();
    let no_steps = DaggerConfig { steps: 0, ..steps };
    let elsewhere = folder.path().join("again");
    let again =
        dagger::train(&taught, tree, &no_steps, Some(&weights), &elsewhere, &mut |_: &Progress| {
            Ok(true)
        });
    let again = again.unwrap().unwrap().values().unwrap();
    let pairs = params.values().unwrap().into_iter().zip(again);
    assert!(pairs.into_iter().all(|(a, b)| (a - b).abs() <= a.abs() / 128.0 + 1e-6));

    let mut workcell = Workcell::new().unwrap();
    let read = |file: &str| std::fs::read(out.join(file)).unwrap();
    let files = ["weights.safetensors", "starts.safetensors", "config.json"].map(read);
    workcell.load_model(&files[0], &files[1], &files[2]).unwrap();
    let object = Object::built_in("sugar_box").unwrap();
    let run = || {
        let mut attempt =
            Attempt::begin(&workcell, &object, "sugar_box", None, 5, Controller::Policy).unwrap();
        (attempt.run(&workcell), attempt.state_hash())
    };
    assert_eq!(run(), run(), "an attempt is its seed");
}
