//! Search: many proposals, the strongest ones tried in physics and varied, the reliable ones clustered.

use crate::grasp::{self, Grasp};
use crate::kind::{self, Scored, half_turn};
use crate::proposal::{self, ProposalConfig, propose};
use crate::squeeze::Squeeze;
use crate::trial::{self, TrialOutcome};
use crate::{Robot, cluster};
use geometry::Pose;
use geometry::object::Object;
use geometry::solid::Solid;
use rand::{Rng, RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use robot::Isometry;
use scene::SceneError;

/// How long is searched and what counts as reliable.
#[derive(Clone, Debug)]
pub struct SearchConfig {
    /// Palm poses proposed.
    pub proposals: usize,
    /// Best proposals that are tried in physics.
    pub trials: usize,
    /// Reliable grasps among these that are enough.
    pub enough: usize,
    /// Medoids of the most reliable grasps, around which and then around whose half turns is searched
    /// again.
    pub centers: usize,
    /// Palm poses proposed around each of these at most.
    pub variants: usize,
    /// Lifting grasps around one of these that are enough.
    pub enough_variants: usize,
    /// How far such palm poses lie from it along each axis (m).
    pub palm_shift: f64,
    /// How far they are turned about each axis (rad).
    pub palm_turn: f64,
    /// Perturbed repeats of a trial that lifted.
    pub repeats: usize,
    /// Of these, how many must lift again.
    pub least_lifted: usize,
    /// Greatest shift of the object in a repeat along x and y (m).
    pub object_shift: f32,
    /// Greatest turn of the object in a repeat (rad).
    pub object_turn: f32,
    /// Kinds of grasps that remain after clustering (paper §II-A: N = 7).
    pub kinds: usize,
    /// What is proposed.
    pub proposal: ProposalConfig,
}

impl SearchConfig {
    /// The paper's N; the other figures are ours. Repeats are perturbed by about what a policy that sees
    /// one cloud is off.
    pub fn paper(robot: &Robot) -> Self {
        Self {
            proposals: 60_000,
            trials: 200,
            enough: 20,
            centers: 6,
            variants: 1500,
            enough_variants: 5,
            palm_shift: 0.008,
            palm_turn: 0.1,
            repeats: 10,
            least_lifted: 7,
            object_shift: 0.015,
            object_turn: 0.2,
            kinds: 7,
            proposal: ProposalConfig::standard(&robot.config),
        }
    }
}

/// Grasps of an object and how they were found.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct GraspSet {
    /// Reliable grasps, by kind.
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

/// A search under way.
struct Search<'a> {
    robot: &'a Robot,
    object: &'a Object,
    config: &'a SearchConfig,
    table: Solid,
    /// Where the object stands in the repeats, the same for every grasp: x, y (m), yaw (rad).
    beside: Vec<[f32; 3]>,
    rng: ChaCha8Rng,
    closed: usize,
    tried: usize,
}

/// Searches grasps of `object`, and gives all that are reliable too; `progress` gets the share done.
pub fn search(
    robot: &Robot,
    object: &Object,
    config: &SearchConfig,
    seed: u64,
    mut progress: impl FnMut(f32),
) -> Result<(GraspSet, Vec<Scored>), SceneError> {
    let mut table = grasp::table_solid(&robot.config);
    table.pose.translation -=
        robot.config.upright(middle(robot).0, middle(robot).1, 0.0).translation;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut draw = |reach: f32| rng.random_range(-reach..=reach);
    let [shift, turn] = [config.object_shift, config.object_turn];
    let beside = (0..config.repeats).map(|_| [draw(shift), draw(shift), draw(turn)]).collect();
    let mut search = Search { robot, object, config, table, beside, rng, closed: 0, tried: 0 };
    let mut scored = search.around_the_object(&mut |share| progress(0.5 * share))?;
    for (round, is_turned) in [false, true].into_iter().enumerate() {
        let progress = &mut |share| progress(0.5 + 0.25 * (round as f32 + share));
        scored.extend(search.around(&scored, is_turned, progress)?);
    }
    let lifted = scored.len();
    let reliable: Vec<_> =
        scored.into_iter().filter(|found| found.again >= config.least_lifted).collect();
    let reach = reach(robot, object, &reliable);
    let set = GraspSet {
        grasps: kind::kinds(object, &reliable, &reach, config.kinds),
        proposed: config.proposals,
        closed: search.closed,
        tried: search.tried,
        lifted,
        reliable: reliable.len(),
    };
    Ok((set, reliable))
}

impl Search<'_> {
    /// Palm poses all around the object, and of those that close the strongest: each that lifts, with
    /// its repeats that lifted.
    fn around_the_object(
        &mut self,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<Scored>, SceneError> {
        let config = self.config;
        let mut found = Vec::new();
        for i in 0..config.proposals {
            let palm = proposal::draw_palm(self.object, &config.proposal, &mut self.rng);
            found.extend(self.close(palm));
            if i % 256 == 0 {
                progress(0.5 * i as f32 / config.proposals as f32);
            }
        }
        found.sort_by(|a, b| b.1.reserve.total_cmp(&a.1.reserve));
        found.truncate(config.trials);
        let mut scored = Vec::new();
        for (i, (grasp, _)) in found.iter().enumerate() {
            progress(0.5 + 0.5 * i as f32 / found.len() as f32);
            scored.extend(self.scored(grasp)?);
            let reliable = scored.iter().filter(|found| found.again >= config.least_lifted);
            if reliable.count() == config.enough {
                break;
            }
        }
        Ok(scored)
    }

    /// The same around the best of these, or around their half turns.
    fn around(
        &mut self,
        scored: &[Scored],
        is_turned: bool,
        progress: &mut dyn FnMut(f32),
    ) -> Result<Vec<Scored>, SceneError> {
        let config = self.config;
        let mut best: Vec<&Scored> = scored.iter().collect();
        best.sort_by_key(|found| std::cmp::Reverse(found.again));
        best.truncate(3 * config.centers);
        let poses: Vec<_> = best.iter().map(|found| found.grasp.object_from_palm).collect();
        let mut centers: Vec<Isometry> = cluster::medoids(poses.len(), config.centers, |a, b| {
            cluster::distance(&poses[a], &poses[b])
        })
        .into_iter()
        .map(|i| poses[i])
        .collect();
        if is_turned {
            centers.iter_mut().for_each(|pose| *pose = half_turn(self.object, pose));
        }
        let mut scored = Vec::new();
        for (i, center) in centers.iter().enumerate() {
            progress(i as f32 / centers.len() as f32);
            let before = scored.len();
            for _ in 0..config.variants {
                let (shift, turn) = (config.palm_shift, config.palm_turn);
                let palm = proposal::vary_palm(center, shift, turn, &mut self.rng);
                if let Some((grasp, _)) = self.close(palm) {
                    scored.extend(self.scored(&grasp)?);
                }
                if scored.len() == before + config.enough_variants {
                    break;
                }
            }
        }
        Ok(scored)
    }

    /// The grasp that closing at a palm pose gives.
    fn close(&mut self, palm: Isometry) -> Option<(Grasp, Squeeze)> {
        let (tree, solids) = (&self.robot.tree, &self.robot.solids);
        let (config, rng) = (&self.config.proposal, &mut self.rng);
        let found = propose(tree, solids, self.object, &self.table, config, palm, rng).ok();
        self.closed += usize::from(found.is_some());
        found
    }

    /// The grasp, if it lifts where it is easiest to reach, and how many of the perturbed repeats lifted
    /// too; these end where more than half are lost.
    fn scored(&mut self, grasp: &Grasp) -> Result<Option<Scored>, SceneError> {
        let (robot, object, config) = (self.robot, self.object, self.config);
        let Some(yaw) = easiest_yaw(robot, object, grasp) else { return Ok(None) };
        self.tried += 1;
        if !lifts(robot, object, grasp, yaw, None)? {
            return Ok(None);
        }
        let mut lost = 0;
        for beside in &self.beside {
            lost += usize::from(!lifts(robot, object, grasp, yaw, Some(*beside))?);
            if 2 * lost > config.repeats {
                return Ok(Some(Scored { grasp: grasp.clone(), again: 0 }));
            }
        }
        Ok(Some(Scored { grasp: grasp.clone(), again: config.repeats - lost }))
    }
}

/// Object poses at which the reach of a kind is counted.
pub const REACH_POSES: usize = 200;

/// The object poses at which reach is counted.
fn reach_poses(robot: &Robot) -> Vec<Pose> {
    // A generator of its own: attempts are numbered by their seeds, and none of them is looked at here.
    let mut rng = ChaCha8Rng::from_seed(*b"where a kind of grasp is in reac");
    (0..REACH_POSES)
        .map(|_| random_pose(robot, &mut rng))
        .map(|[x, y, yaw]| robot.config.upright(x, y, yaw))
        .collect()
}

/// For each kind of a set the number of object poses, of [`REACH_POSES`], at which it is the first one
/// within reach.
pub fn poses_served(robot: &Robot, object: &Object, grasps: &[Grasp]) -> Vec<usize> {
    let mut served = vec![0; grasps.iter().map(|grasp| grasp.kind + 1).max().unwrap_or(0)];
    for pose in reach_poses(robot) {
        if let Some((first, _)) = robot.options(grasps, object, &pose).first() {
            served[grasps[*first].kind] += 1;
        }
    }
    served
}

/// Whether each grasp is in reach at each of a number of object poses.
fn reach(robot: &Robot, object: &Object, found: &[Scored]) -> Vec<Vec<bool>> {
    let poses = reach_poses(robot);
    let within = |grasp: &Grasp, pose| robot.reach(grasp, object, pose).is_some();
    let row = |found: &Scored| poses.iter().map(|pose| within(&found.grasp, pose)).collect();
    found.iter().map(row).collect()
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
    let outcome = trial::try_grasp(config, tree, object, &pose, &posture, trial::HOLD_SECONDS)?;
    Ok(matches!(outcome, TrialOutcome::Lifted { .. }))
}

/// Draws a pose of the object uniformly over the workspace.
pub fn random_pose(robot: &Robot, rng: &mut impl Rng) -> [f32; 3] {
    let [x, y] = [robot.config.workspace.x, robot.config.workspace.y];
    let pi = std::f32::consts::PI;
    [rng.random_range(x[0]..x[1]), rng.random_range(y[0]..y[1]), rng.random_range(-pi..pi)]
}
