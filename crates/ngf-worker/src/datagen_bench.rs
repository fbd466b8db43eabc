//! Throughput of data generation on all threads, in items per second.

use crate::bench::Row;
use anyhow::{Context, Result};
use grasps::plan::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::plan::{lift, object_poses};
use grasps::search::trial::{self, TrialProtocol};
use grasps::set::catalog::catalog_grasps;
use grasps::{PlacedObject, Posture, RobotContext};
use objects::object::Object;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use robot::JointState;
use scene::depth_sensor::DepthSensor;
use std::time::Instant;

/// Reachable poses per object, and demonstrations per pose.
const POSES_PER_OBJECT: usize = 12;
const DEMOS_PER_POSE: usize = 4;

/// A reachable grasp of a placed object, with its lift.
pub(crate) struct Case<'a> {
    pub(crate) placed: PlacedObject<'a>,
    pub(crate) posture: Posture,
    pub(crate) lift: Vec<JointState>,
}

/// Benchmark rows in items per second, for the sugar box and the bleach bottle.
pub(crate) fn rows(robot: &RobotContext) -> Result<Vec<Row>> {
    let objects = ["sugar_box", "bleach"].map(|name| (name, Object::from_catalog(name)));
    let mut cases = Vec::new();
    for (name, object) in &objects {
        let object = object.as_ref().context("built-in object is missing")?;
        cases.extend(cases_of(robot, name, object, POSES_PER_OBJECT)?);
    }
    let trials = per_second(&cases, |case| {
        let Case { placed: setting, posture, lift } = case;
        trial::try_grasp(setting, posture, lift, TrialProtocol::SHORT).map(|_| ())
    });
    let plan = |case: &Case| -> Vec<Demonstration> {
        let palm = robot.tree.forward_kinematics(&case.posture.grasp).palm_pose();
        let (place, bounds) = (&case.placed.world_from_object, &case.placed.object.bounds);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let target = |_| demonstration::sample_pregrasp_pose(robot, bounds, place, &palm, &mut rng);
        let targets: Vec<_> = (0..DEMOS_PER_POSE).map(target).collect();
        let config = TrajectoryConfig::standard();
        let found = targets.iter().filter_map(|target| {
            demonstration::demonstrate(&case.placed, &case.posture, target, &config).ok()
        });
        found.collect()
    };
    let start = Instant::now();
    let demonstrations: Vec<Vec<Demonstration>> = cases.par_iter().map(plan).collect();
    let planned = (cases.len() * DEMOS_PER_POSE) as f64 / start.elapsed().as_secs_f64();
    let pairs: Vec<(&Case, &Demonstration)> = cases
        .iter()
        .zip(&demonstrations)
        .flat_map(|(c, d)| d.iter().map(move |d| (c, d)))
        .collect();
    let replays = per_second(&pairs, |(case, demonstration)| {
        demonstration.replay(&case.placed, &case.lift, TrialProtocol::SHORT).map(|_| ())
    });
    let eye = DepthSensor::new(&robot.config, &robot.tree);
    let seeds: Vec<u64> = (0..200).collect();
    let clouds = per_second(&seeds, |seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(*seed);
        let [x, y, yaw] = object_poses::sample_planar_pose(robot, &mut rng);
        let mesh = &cases[*seed as usize % cases.len()].placed.object.mesh;
        let frame = eye.capture(mesh, &robot.config.object_pose(x, y, yaw), &mut rng);
        std::hint::black_box(eye.extract_cloud(&frame));
        Ok(())
    });
    let row = |name, value| Row { name, value, unit: "/s" };
    Ok(vec![
        row("grasp_trials", trials?),
        row("fabric_trajectories", planned),
        row("replays", replays?),
        row("clouds", clouds?),
    ])
}

/// The first `count` reachable grasps of a built-in object, each at a random pose (seed 0).
pub(crate) fn cases_of<'a>(
    robot: &'a RobotContext,
    name: &str,
    object: &'a Object,
    count: usize,
) -> Result<Vec<Case<'a>>> {
    let set = catalog_grasps(name).filter(|set| !set.grasps.is_empty());
    let set = set.with_context(|| format!("{name} has no grasps; name another object"))?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut cases = Vec::new();
    while cases.len() < count {
        let [x, y, yaw] = object_poses::sample_planar_pose(robot, &mut rng);
        let placed = PlacedObject::new(robot, object, &robot.config.object_pose(x, y, yaw));
        let Some((_, posture)) = placed.reachable(&set.grasps).next() else { continue };
        let Some(lift) = lift::plan_from_grasp(&placed, &posture)? else { continue };
        cases.push(Case { placed, posture, lift });
    }
    Ok(cases)
}

/// Items per second with all threads working.
fn per_second<T: Sync>(
    items: &[T],
    work: impl Fn(&T) -> Result<(), scene::SceneError> + Sync + Send,
) -> Result<f64> {
    let start = Instant::now();
    items.par_iter().try_for_each(work)?;
    Ok(items.len() as f64 / start.elapsed().as_secs_f64())
}
