//! Datasets in which similar objects share grasps.

use configs::DatasetConfig;
use dataset::Dataset;
use grasps::RobotContext;
use objects::catalog::built_in_objects;
use progress::{NoProgress, Progress};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// Stops a run when a stage begins.
struct StopAt {
    stage: &'static str,
    has_begun: AtomicBool,
}

impl Progress for StopAt {
    fn update(&self, stage: &str, _done: usize, _total: usize) {
        self.has_begun.fetch_or(stage == self.stage, Ordering::Relaxed);
    }

    fn is_stopped(&self) -> bool {
        self.has_begun.load(Ordering::Relaxed)
    }
}

#[test]
fn stopped_dataset_with_shared_grasps_resumes_to_the_same_bytes() {
    let smoke = DatasetConfig::preset("smoke", 1).unwrap();
    let names = ["tin-1", "tin-2", "tin-3"].map(str::to_owned).to_vec();
    let config = DatasetConfig {
        encoder_objects: names.clone(),
        objects: names,
        poses: 3,
        round_poses: Some(2),
        trajectories: 1,
        overlap_grasps: true,
        consistent_grasps: true,
        encoder_clouds: 2,
        ..smoke
    };
    let objects = built_in_objects(config.all_objects()).unwrap();
    let robot = RobotContext::standard().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let generate = |dir: &Path, progress: &(dyn Progress + Sync)| {
        let dataset = datagen::create(dir, &config, &objects, true).unwrap();
        datagen::generate(&dataset, &robot, &objects, progress)
    };
    let [whole, stopped] = ["whole", "stopped"].map(|name| folder.path().join(name));
    let manifest = generate(&whole, &NoProgress).unwrap();
    let stop = StopAt { stage: "shared grasps, round 2", has_begun: AtomicBool::new(false) };
    let error = generate(&stopped, &stop).unwrap_err().to_string();
    assert!(error.contains("--resume"), "{error}");
    assert_eq!(generate(&stopped, &NoProgress).unwrap().hash, manifest.hash);
    // Tins are round, and their last pose is not demonstrated.
    let poses = Dataset::open(&whole).unwrap().read_poses(1).unwrap();
    assert!(poses[2].states.is_empty() && poses[2].clouds.concat().iter().all(|x| *x == 0.0));
    assert!(poses[..2].iter().all(|pose| pose.clouds.concat().iter().all(|x| *x != 0.0)));
    assert!(whole.join("grasps/tin-2.json").exists() && !whole.join("shards").exists());
    let dataset = Dataset::open(&whole).unwrap();
    for name in &dataset.config.objects {
        let ratings = datagen::read_grasp_ratings(&dataset, name).unwrap();
        assert_eq!(ratings.len(), datagen::read_grasps(&dataset, name).unwrap().grasps.len());
        assert!(ratings.iter().any(|rating| rating.success_rate > 0.3), "{name}: {ratings:?}");
    }
}
