//! How many things the data engine makes in a second, on all threads.

use crate::bench::Row;
use anyhow::{Context, Result};
use geometry::object::Object;
use grasps::built_in::built_in;
use grasps::demonstration::{self, Demonstration, TrajectoryConfig};
use grasps::trial::{self, Endurance, Physics};
use grasps::{Posture, Robot, Setting, lift, place};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use robot::JointState;
use scene::cloud::Eye;
use std::time::Instant;

/// Poses of each object within reach, and demonstrations at each.
const POSES: usize = 12;
const DEMONSTRATIONS: usize = 4;

/// A grasp of an object that stands somewhere, with its lift.
struct Case<'a> {
    setting: Setting<'a>,
    posture: Posture,
    lift: Vec<JointState>,
}

/// Rows in things a second: sugar box and bleach bottle in turn.
pub(crate) fn rows(robot: &Robot) -> Result<Vec<Row>> {
    let objects = ["sugar_box", "bleach"].map(|name| (name, Object::built_in(name)));
    let mut cases = Vec::new();
    for (name, object) in &objects {
        let object = object.as_ref().context("a built-in object")?;
        cases.extend(cases_of(robot, name, object)?);
    }
    let trial = |physics| {
        per_second(&cases, |case| {
            let Case { setting, posture, lift } = case;
            trial::try_grasp(physics, setting, posture, lift, Endurance::BRIEF).map(|_| ())
        })
    };
    let plan = |case: &Case| -> Vec<Demonstration> {
        let palm = robot.tree.kinematics(&case.posture.touch).palm();
        let (place, bounds) = (&case.setting.world_from_object, &case.setting.object.bounds);
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let target = |_| {
            let region = &robot.config.target;
            demonstration::draw_target(region, bounds, place, &palm, &mut rng)
        };
        let targets: Vec<_> = (0..DEMONSTRATIONS).map(target).collect();
        let config = TrajectoryConfig::standard();
        let found = targets.iter().filter_map(|target| {
            demonstration::demonstrate(&case.setting, &case.posture, target, &config).ok()
        });
        found.collect()
    };
    let begin = Instant::now();
    let demonstrations: Vec<Vec<Demonstration>> = cases.par_iter().map(plan).collect();
    let planned = (cases.len() * DEMONSTRATIONS) as f64 / begin.elapsed().as_secs_f64();
    let pairs: Vec<(&Case, &Demonstration)> = cases
        .iter()
        .zip(&demonstrations)
        .flat_map(|(c, d)| d.iter().map(move |d| (c, d)))
        .collect();
    let replay = |physics| {
        per_second(&pairs, |(case, demonstration)| {
            let endurance = Endurance::BRIEF;
            demonstration.replay(physics, &case.setting, &case.lift, endurance).map(|_| ())
        })
    };
    let eye = Eye::new(&robot.config, &robot.tree);
    let seeds: Vec<u64> = (0..200).collect();
    let clouds = per_second(&seeds, |seed| {
        let mut rng = ChaCha8Rng::seed_from_u64(*seed);
        let [x, y, yaw] = place::random_pose(robot, &mut rng);
        let mesh = &cases[*seed as usize % cases.len()].setting.object.mesh;
        let frame = eye.frame(mesh, &robot.config.upright(x, y, yaw), &mut rng);
        std::hint::black_box(eye.cloud(&frame));
        Ok(())
    });
    let row = |name, value| Row { name, value, unit: "/s" };
    Ok(vec![
        row("grasp_trials_hand", trial(Physics::Hand)?),
        row("grasp_trials_full", trial(Physics::Full)?),
        row("fabric_trajectories", planned),
        row("replays_hand", replay(Physics::Hand)?),
        row("replays_full", replay(Physics::Full)?),
        row("clouds", clouds?),
    ])
}

fn cases_of<'a>(robot: &'a Robot, name: &str, object: &'a Object) -> Result<Vec<Case<'a>>> {
    let set = built_in(name).context("its grasps")?;
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let mut cases = Vec::new();
    while cases.len() < POSES {
        let [x, y, yaw] = place::random_pose(robot, &mut rng);
        let setting = Setting::new(robot, object, &robot.config.upright(x, y, yaw));
        let Some((_, posture)) = setting.options(&set.grasps).next() else { continue };
        let lift = lift::plan_after(&setting, &posture)?.context("a lift")?;
        cases.push(Case { setting, posture, lift });
    }
    Ok(cases)
}

/// Things a second when all threads work on them.
fn per_second<T: Sync>(
    things: &[T],
    work: impl Fn(&T) -> Result<(), scene::SceneError> + Sync + Send,
) -> Result<f64> {
    let begin = Instant::now();
    things.par_iter().try_for_each(work)?;
    Ok(things.len() as f64 / begin.elapsed().as_secs_f64())
}
