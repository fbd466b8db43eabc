//! Shard: all data of one object pose, stored in one file until the dataset is assembled.

use anyhow::{Context, Result, bail, ensure};
use dataset_manifest::KEPT;
use files::tensors::{self, read_f32};
use robot::{DOF, JointState, JointVector};
use safetensors::SafeTensors;

/// Dimension of a state: joint positions, then velocities.
pub const STATE_DIM: usize = 2 * DOF;
/// Points per cloud.
pub const CLOUD_POINTS: usize = 512;

/// Outcome of a trial; [`DemoOutcome::ALL`] lists the names in files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum DemoOutcome {
    /// Lifted in the replay.
    Kept,
    /// The planner did not converge, or the motion exceeded the joint limits.
    NotConverged,
    /// The motion ended too close to the grasp.
    TooShort,
    /// The planned motion penetrated the object or the table.
    Collision,
    /// In the replay, the object slipped or rotated in the hand.
    Slipped,
    /// In the replay, the object was not lifted high enough.
    TooLow,
    /// In the replay, the object was not in contact with the hand, or touched something else.
    ForeignContact,
    /// The simulation diverged.
    NotFinite,
}

impl DemoOutcome {
    /// All outcomes with their names in files, ordered by code.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Kept, KEPT),
        (Self::NotConverged, "not_converged"),
        (Self::TooShort, "too_short"),
        (Self::Collision, "collision"),
        (Self::Slipped, "slipped"),
        (Self::TooLow, "too_low"),
        (Self::ForeignContact, "foreign_contact"),
        (Self::NotFinite, "not_finite"),
    ];

    /// Name in files.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    /// Outcome of a code in a shard; `None` for -1, an outcome that was not measured.
    fn from_code(code: f32) -> Result<Option<Self>> {
        if code == -1.0 {
            return Ok(None);
        }
        let outcome =
            Self::ALL.get(code as usize).filter(|(outcome, _)| *outcome as u8 as f32 == code);
        let Some((outcome, _)) = outcome else { bail!("no outcome has the code {code}") };
        Ok(Some(*outcome))
    }
}

/// One trial of a demonstration.
#[derive(Clone, Debug, PartialEq)]
pub struct DemoTrial {
    /// Index of the pre-grasp target. Targets are the same at every pose, relative to the object.
    pub target: usize,
    /// Index of the grasp in the grasp set of the object.
    pub grasp: usize,
    /// Outcome of planning and of the replay.
    pub outcome: DemoOutcome,
    /// Outcome of the replay with a 2 s hold and shaking; `None` if not replayed.
    pub shaken: Option<DemoOutcome>,
    /// Outcome of the replay with perturbed object pose and friction; `None` if not replayed.
    pub perturbed: Option<DemoOutcome>,
    /// Number of rows (1/30 s each); 0 if planning failed.
    pub num_frames: usize,
    /// Row at which the fingers make contact.
    pub contact_row: usize,
    /// Number of planner restarts before success.
    pub restarts: usize,
    /// Minimum distance (m) of the collision shapes of the robot to object and table up to contact; negative
    /// in penetration.
    pub clearance: f32,
    /// RMS joint jerk (rad/s³), norm over all joints, before contact.
    pub jerk: f32,
    /// Maximum slip (m) in the replay, if it lifted.
    pub slip: f32,
    /// Whether the arm can reach the pre-grasp target.
    pub is_reachable: bool,
    /// Distance (m) and angle (rad) of the palm from the target after the planner converged; 0 if it did not.
    pub goal_error: [f32; 2],
}

impl DemoTrial {
    const NUM_VALUES: usize = 14;

    fn to_values(&self) -> [f32; Self::NUM_VALUES] {
        let code =
            |outcome: Option<DemoOutcome>| outcome.map_or(-1.0, |outcome| outcome as u8 as f32);
        [
            self.target as f32,
            self.grasp as f32,
            code(Some(self.outcome)),
            code(self.shaken),
            code(self.perturbed),
            self.num_frames as f32,
            self.contact_row as f32,
            self.restarts as f32,
            self.clearance,
            self.jerk,
            self.slip,
            f32::from(u8::from(self.is_reachable)),
            self.goal_error[0],
            self.goal_error[1],
        ]
    }

    fn from_values(x: &[f32]) -> Result<Self> {
        Ok(Self {
            target: x[0] as usize,
            grasp: x[1] as usize,
            outcome: DemoOutcome::from_code(x[2])?.context("a trial has no outcome")?,
            shaken: DemoOutcome::from_code(x[3])?,
            perturbed: DemoOutcome::from_code(x[4])?,
            num_frames: x[5] as usize,
            contact_row: x[6] as usize,
            restarts: x[7] as usize,
            clearance: x[8],
            jerk: x[9],
            slip: x[10],
            is_reachable: x[11] > 0.5,
            goal_error: [x[12], x[13]],
        })
    }
}

/// All data of one object pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseShard {
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Maximum joint difference (rad) to the posture of the same grasp for an object shifted by 2 cm or
    /// rotated by 0.1 rad.
    pub max_joint_jump: f32,
    /// Trials in order.
    pub trials: Vec<DemoTrial>,
    /// First row of each kept demonstration, then the number of rows.
    pub offsets: Vec<usize>,
    /// Joint positions (rad) and velocities (rad/s), shape (rows, [`STATE_DIM`]), of all kept demonstrations
    /// in sequence.
    pub states: Vec<f32>,
    /// Joint accelerations (rad/s²) applied at each row, shape (rows, DOF).
    pub accelerations: Vec<f32>,
    /// Joint positions (rad) after each acceleration, shape (rows, DOF).
    pub targets: Vec<f32>,
    /// Angles (rad) by which object and demonstrations are rotated about the vertical axis of the robot; the
    /// first is 0.
    pub azimuths: Vec<f32>,
    /// Noisy clouds, shape (azimuths, clouds, [`CLOUD_POINTS`], 3).
    pub noisy: Vec<f32>,
    /// Clean clouds, shape (azimuths, [`CLOUD_POINTS`], 3).
    pub clean: Vec<f32>,
}

impl PoseShard {
    /// Adds a demonstration (N + 1 states, N accelerations) without its last state, which equals the target of the last row.
    pub fn push(&mut self, states: &[JointState], accelerations: &[JointVector]) {
        for (pair, qdd) in states.windows(2).zip(accelerations) {
            let state = pair[0].q.iter().chain(pair[0].qd.iter());
            self.states.extend(state.map(|x| *x as f32));
            self.accelerations.extend(qdd.iter().map(|x| *x as f32));
            self.targets.extend(pair[1].q.iter().map(|x| *x as f32));
        }
        self.offsets.push(self.num_rows());
    }

    /// Completes the shard of a pose without demonstrations: all clouds are zero.
    pub fn fill_empty(&mut self, [azimuths, clouds]: [usize; 2]) {
        self.offsets = vec![0];
        self.azimuths = vec![0.0; azimuths];
        self.clean = vec![0.0; azimuths * 3 * CLOUD_POINTS];
        self.noisy = vec![0.0; azimuths * clouds * 3 * CLOUD_POINTS];
    }

    /// Number of rows of all kept demonstrations.
    pub fn num_rows(&self) -> usize {
        self.states.len() / STATE_DIM
    }

    /// Kept trials, in the order of the demonstrations.
    pub fn kept(&self) -> impl Iterator<Item = &DemoTrial> {
        self.trials.iter().filter(|trial| trial.outcome == DemoOutcome::Kept)
    }

    /// Safetensors file of the shard.
    pub fn encode(&self) -> Result<Vec<u8>> {
        let rows = self.num_rows();
        let offsets: Vec<f32> = self.offsets.iter().map(|&i| i as f32).collect();
        let trials: Vec<f32> = self.trials.iter().flat_map(DemoTrial::to_values).collect();
        let clouds = |points: &[f32]| vec![points.len() / (3 * CLOUD_POINTS), CLOUD_POINTS, 3];
        let [x, y, yaw] = self.pose;
        tensors::encode(
            &[
                ("pose", vec![4], &[x, y, yaw, self.max_joint_jump]),
                ("trials", vec![self.trials.len(), DemoTrial::NUM_VALUES], &trials),
                ("offsets", vec![offsets.len()], &offsets),
                ("states", vec![rows, STATE_DIM], &self.states),
                ("accelerations", vec![rows, DOF], &self.accelerations),
                ("targets", vec![rows, DOF], &self.targets),
                ("azimuths", vec![self.azimuths.len()], &self.azimuths),
                ("noisy", clouds(&self.noisy), &self.noisy),
                ("clean", clouds(&self.clean), &self.clean),
            ],
            None,
        )
    }

    /// Inverse of [`PoseShard::encode`]; fails if the offsets do not cover the rows.
    pub fn decode(bytes: &[u8]) -> Result<Self> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let read = |name: &str| read_f32(&tensors, name);
        let pose = read("pose")?;
        ensure!(pose.len() == 4, "expected four pose values, found {}", pose.len());
        let trials = read("trials")?;
        let shard = Self {
            pose: [pose[0], pose[1], pose[2]],
            max_joint_jump: pose[3],
            trials: trials
                .chunks_exact(DemoTrial::NUM_VALUES)
                .map(DemoTrial::from_values)
                .collect::<Result<_>>()?,
            offsets: read("offsets")?.iter().map(|&first| first as usize).collect(),
            states: read("states")?,
            accelerations: read("accelerations")?,
            targets: read("targets")?,
            azimuths: read("azimuths")?,
            noisy: read("noisy")?,
            clean: read("clean")?,
        };
        let rows = shard.num_rows();
        ensure!(
            shard.offsets.first() == Some(&0)
                && shard.offsets.is_sorted()
                && shard.offsets.last() == Some(&rows),
            "the offsets of the demonstrations do not cover its {rows} rows"
        );
        Ok(shard)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shard() -> PoseShard {
        let trial = |fate, shaken| DemoTrial {
            target: 3,
            grasp: 1,
            outcome: fate,
            shaken,
            perturbed: None,
            num_frames: 40,
            contact_row: 30,
            restarts: 1,
            clearance: 0.004,
            jerk: 12.0,
            slip: 0.001,
            is_reachable: true,
            goal_error: [0.01, 0.05],
        };
        PoseShard {
            pose: [0.5, 0.1, -1.0],
            max_joint_jump: 0.2,
            trials: vec![
                trial(DemoOutcome::Kept, Some(DemoOutcome::TooLow)),
                trial(DemoOutcome::Collision, None),
                trial(DemoOutcome::Kept, Some(DemoOutcome::Kept)),
            ],
            offsets: vec![0, 2, 3],
            states: (0..3 * STATE_DIM).map(|x| x as f32).collect(),
            accelerations: vec![0.5; 3 * DOF],
            targets: vec![0.25; 3 * DOF],
            azimuths: vec![0.0, 0.2],
            noisy: vec![0.25; 4 * 3 * CLOUD_POINTS],
            clean: vec![0.5; 2 * 3 * CLOUD_POINTS],
        }
    }

    #[test]
    fn shard_round_trips() {
        let back = PoseShard::decode(&shard().encode().unwrap()).unwrap();
        assert_eq!(back, shard());
        assert_eq!(back.kept().count(), 2);
    }

    #[test]
    fn outcome_codes_match_names() {
        for (i, (outcome, name)) in DemoOutcome::ALL.into_iter().enumerate() {
            assert_eq!((outcome as usize, outcome.name()), (i, name));
            assert_eq!(DemoOutcome::from_code(i as f32).unwrap(), Some(outcome));
        }
        assert_eq!(DemoOutcome::from_code(-1.0).unwrap(), None);
        for invalid in [8.0, 0.5, -2.0, f32::NAN] {
            assert!(DemoOutcome::from_code(invalid).is_err(), "{invalid}");
        }
    }

    #[test]
    fn decode_fails_when_shard_is_corrupt() {
        let corrupt = PoseShard { offsets: vec![0, 2, 9], ..shard() };
        let message = PoseShard::decode(&corrupt.encode().unwrap()).unwrap_err().to_string();
        assert!(message.contains("do not cover its 3 rows"), "{message}");
        let bytes = shard().encode().unwrap();
        assert!(
            PoseShard::decode(&bytes[..bytes.len() - 9]).is_err()
                && PoseShard::decode(b"{}").is_err()
        );
    }
}
