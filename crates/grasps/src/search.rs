//! Search: many proposals, the strongest ones tried in physics, the reliable ones clustered.

use crate::grasp::{self, Grasp};
use crate::proposal::{ProposalConfig, propose};
use crate::trial::{self, TrialOutcome};
use crate::{Robot, cluster};
use geometry::object::Object;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use scene::SceneError;

/// How long is searched and what counts as reliable.
#[derive(Clone, Debug)]
pub struct SearchConfig {
    /// Palm poses proposed.
    pub proposals: usize,
    /// Best proposals that are tried in physics.
    pub trials: usize,
    /// Perturbed repeats of a trial that lifted.
    pub repeats: usize,
    /// Of these, how many must lift again.
    pub least_lifted: usize,
    /// Greatest shift of the object in a repeat (m).
    pub shift: f32,
    /// Greatest turn of the object in a repeat (rad).
    pub turn: f32,
    /// Grasps that remain after clustering (paper §II-A: N = 7).
    pub clusters: usize,
    /// What is proposed.
    pub proposal: ProposalConfig,
}

impl SearchConfig {
    /// The paper's N; the other figures are ours.
    pub fn paper(robot: &Robot) -> Self {
        Self {
            proposals: 60_000,
            trials: 200,
            repeats: 6,
            least_lifted: 6,
            shift: 0.005,
            turn: 0.087,
            clusters: 7,
            proposal: ProposalConfig::standard(robot.config.robot.open),
        }
    }
}

/// Grasps of an object and how they were found.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct GraspSet {
    /// Medoids of the reliable grasps.
    pub grasps: Vec<Grasp>,
    /// Palm poses proposed.
    pub proposed: usize,
    /// Proposals whose hand closed with balanced forces.
    pub closed: usize,
    /// Trials in physics.
    pub tried: usize,
    /// Trials that lifted.
    pub lifted: usize,
    /// Grasps that lifted in the perturbed repeats too.
    pub reliable: usize,
}

/// Searches grasps of `object`; `progress` gets the share done.
pub fn search(
    robot: &Robot,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
    mut progress: impl FnMut(f32),
) -> Result<GraspSet, SceneError> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut table = grasp::table_solid(&robot.config);
    table.pose.translation -=
        robot.config.upright(middle(robot).0, middle(robot).1, 0.0).translation;
    let mut found = Vec::new();
    for i in 0..config.proposals {
        let proposal = &config.proposal;
        found.extend(propose(&robot.tree, &robot.solids, object, &table, proposal, &mut rng).ok());
        if i % 256 == 0 {
            progress(0.3 * i as f32 / config.proposals as f32);
        }
    }
    let closed = found.len();
    found.sort_by(|a, b| b.1.reserve.total_cmp(&a.1.reserve));
    found.truncate(config.trials);

    let (mut tried, mut lifted, mut reliable) = (0, 0, Vec::new());
    for (i, (grasp, _)) in found.iter().enumerate() {
        progress(0.3 + 0.7 * i as f32 / found.len() as f32);
        let Some(yaw) = easiest_yaw(robot, object, grasp) else { continue };
        tried += 1;
        if !lifts(robot, object, grasp, yaw, None)? {
            continue;
        }
        lifted += 1;
        let mut again = 0;
        for _ in 0..config.repeats {
            let mut draw = |reach: f32| rng.random_range(-reach..=reach);
            let shift = [draw(config.shift), draw(config.shift), draw(config.turn)];
            again += usize::from(lifts(robot, object, grasp, yaw, Some(shift))?);
        }
        if again >= config.least_lifted {
            reliable.push(grasp.clone());
        }
    }
    let poses: Vec<_> = reliable.iter().map(|grasp| grasp.object_from_palm).collect();
    let medoids = cluster::medoids(&poses, config.clusters);
    Ok(GraspSet {
        grasps: medoids.into_iter().map(|i| reliable[i].clone()).collect(),
        proposed: config.proposals,
        closed,
        tried,
        lifted,
        reliable: reliable.len(),
    })
}

/// Where trials take place: the middle of the workspace.
pub(crate) fn middle(robot: &Robot) -> (f32, f32) {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    (0.5 * (x[0] + x[1]), 0.5 * (y[0] + y[1]))
}

/// The yaw, of twelve, at which the arm is nearest to its nominal posture.
pub fn easiest_yaw(robot: &Robot, object: &Object, grasp: &Grasp) -> Option<f32> {
    let (x, y) = middle(robot);
    let mut best: Option<(f64, f32)> = None;
    for step in 0..12 {
        let yaw = step as f32 * (std::f32::consts::TAU / 12.0);
        let pose = robot.config.upright(x, y, yaw);
        let Some(posture) = robot.reach(grasp, object, &pose) else { continue };
        let distance = (posture.open - robot.nominal).norm();
        if best.is_none_or(|(least, _)| distance < least) {
            best = Some((distance, yaw));
        }
    }
    best.map(|(_, yaw)| yaw)
}

/// Whether a grasp planned for the object in the middle lifts it there, or `[x, y, yaw]` beside it.
pub fn lifts(
    robot: &Robot,
    object: &Object,
    grasp: &Grasp,
    yaw: f32,
    beside: Option<[f32; 3]>,
) -> Result<bool, SceneError> {
    let (x, y) = middle(robot);
    let Some(posture) = robot.reach(grasp, object, &robot.config.upright(x, y, yaw)) else {
        return Ok(false);
    };
    let [dx, dy, dyaw] = beside.unwrap_or_default();
    let pose = robot.config.upright(x + dx, y + dy, yaw + dyaw);
    let (config, tree) = (&robot.config, &robot.tree);
    let outcome = trial::try_grasp(config, tree, object, &pose, &posture, HOLD_SECONDS)?;
    Ok(matches!(outcome, TrialOutcome::Lifted { .. }))
}

/// Shorter than the protocol's hold: what slips at all slips within the first half second.
const HOLD_SECONDS: f64 = 0.5;

/// Draws a pose of the object uniformly over the workspace.
pub fn random_pose(robot: &Robot, rng: &mut impl Rng) -> [f32; 3] {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [rng.random_range(x[0]..x[1]), rng.random_range(y[0]..y[1]), rng.random_range(-pi..pi)]
}
