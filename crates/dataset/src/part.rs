//! What is made at one object pose, and its file while the dataset is in the making.

use crate::store::{self, values};
use anyhow::{Result, ensure};
use grasps::demonstration::{Demonstration, Flaw, Miss};
use grasps::trial::TrialOutcome;
use robot::DOF;
use safetensors::SafeTensors;
use scene::Loss;

/// Numbers in a state: joint positions and velocities.
pub const STATE: usize = 2 * DOF;
/// Points in a cloud.
pub const CLOUD: usize = 512;

/// What became of an attempt at a demonstration; [`Fate::ALL`] gives the names in the files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Fate {
    /// Replayed and lifted.
    Kept,
    /// The fabric did not come to rest or left the joint limits.
    Stuck,
    /// The motion ended too close to the grasp.
    Short,
    /// It went through object or table.
    Penetrates,
    /// Replayed: the object slipped or turned in the hand.
    Slipped,
    /// Replayed: it hung too low.
    Low,
    /// Replayed: it touched something that is not the hand, or nothing.
    Leaning,
    /// Physics left the finite numbers.
    NotFinite,
}

impl Fate {
    /// All fates with their names.
    pub const ALL: [(Self, &'static str); 8] = [
        (Self::Kept, "kept"),
        (Self::Stuck, "stuck"),
        (Self::Short, "short"),
        (Self::Penetrates, "penetrates"),
        (Self::Slipped, "slipped"),
        (Self::Low, "low"),
        (Self::Leaning, "leaning"),
        (Self::NotFinite, "not finite"),
    ];

    /// Its name in the files.
    pub fn name(self) -> &'static str {
        Self::ALL[self as usize].1
    }

    pub(crate) fn of_flaw(flaw: Flaw) -> Self {
        match flaw {
            Flaw::Planner => Self::Stuck,
            Flaw::Short => Self::Short,
            Flaw::Penetrates => Self::Penetrates,
        }
    }

    pub(crate) fn of_outcome(outcome: TrialOutcome) -> Self {
        match outcome {
            TrialOutcome::Lifted { .. } => Self::Kept,
            TrialOutcome::Lost(Loss::Slipped) => Self::Slipped,
            TrialOutcome::Lost(Loss::Low) => Self::Low,
            TrialOutcome::Lost(Loss::Leaning | Loss::Free) => Self::Leaning,
            TrialOutcome::NotFinite => Self::NotFinite,
        }
    }

    fn from_code(code: f32) -> Option<Self> {
        (code >= 0.0).then(|| Self::ALL[code as usize % Self::ALL.len()].0)
    }
}

/// One attempt at a demonstration.
#[derive(Clone, Debug, PartialEq)]
pub struct Attempt {
    /// Number of its target: the same targets, relative to the object, at every pose.
    pub target: usize,
    /// Index of its grasp in the object's set.
    pub grasp: usize,
    /// What became of it, replayed with the hand alone.
    pub fate: Fate,
    /// The same with arm and hand; `None` if it was not replayed so.
    pub full: Option<Fate>,
    /// The same with arm and hand, held for 2 s and shaken.
    pub endured: Option<Fate>,
    /// The same with arm and hand, object and friction a little off.
    pub perturbed: Option<Fate>,
    /// Rows, of 1/30 s; 0 if none could be planned.
    pub rows: usize,
    /// Row at which the fingers touch.
    pub touch: usize,
    /// How often the fabric got stuck before.
    pub restarts: usize,
    /// Least gap (m) of the robot's collision shapes from object and table up to `touch`: negative in
    /// penetration.
    pub clearance: f32,
    /// Root mean square of the joint jerk (rad/s³), norm over all joints, before `touch`.
    pub jerk: f32,
    /// Greatest slip (m) in the replay with the hand alone, if it lifted.
    pub slip: f32,
    /// Whether the arm can bring the palm to the target at all.
    pub in_reach: bool,
    /// Distance (m) and angle (rad) of the palm, where the fabric came to rest, from the target; 0 if it did not.
    pub miss: [f32; 2],
}

impl Attempt {
    /// Whether its motion came to rest at the target.
    pub fn is_arrival(&self) -> bool {
        let [distance, angle] = self.miss.map(f64::from);
        self.rows > 0 && Miss { distance, angle }.is_arrival()
    }

    const NUMBERS: usize = 15;

    fn numbers(&self) -> [f32; Self::NUMBERS] {
        let code = |fate: Option<Fate>| fate.map_or(-1.0, |fate| fate as u8 as f32);
        [
            self.target as f32,
            self.grasp as f32,
            code(Some(self.fate)),
            code(self.full),
            code(self.endured),
            code(self.perturbed),
            self.rows as f32,
            self.touch as f32,
            self.restarts as f32,
            self.clearance,
            self.jerk,
            self.slip,
            f32::from(u8::from(self.in_reach)),
            self.miss[0],
            self.miss[1],
        ]
    }

    fn from_numbers(x: &[f32]) -> Self {
        Self {
            target: x[0] as usize,
            grasp: x[1] as usize,
            fate: Fate::from_code(x[2]).unwrap_or(Fate::Stuck),
            full: Fate::from_code(x[3]),
            endured: Fate::from_code(x[4]),
            perturbed: Fate::from_code(x[5]),
            rows: x[6] as usize,
            touch: x[7] as usize,
            restarts: x[8] as usize,
            clearance: x[9],
            jerk: x[10],
            slip: x[11],
            in_reach: x[12] > 0.5,
            miss: [x[13], x[14]],
        }
    }
}

/// Everything at one object pose.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// x, y (m), yaw (rad).
    pub pose: [f32; 3],
    /// Greatest difference (rad) of a joint to the same grasp's posture for an object 2 cm or 0.1 rad beside.
    pub jump: f32,
    /// Attempts in their order.
    pub attempts: Vec<Attempt>,
    /// First row of each kept demonstration, and the number of rows.
    pub offsets: Vec<usize>,
    /// Joint positions (rad) and velocities (rad/s), shape (rows, [`STATE`]), all kept demonstrations one after
    /// another.
    pub states: Vec<f32>,
    /// Joint accelerations (rad/s²) that follow, shape (rows, DOF).
    pub accelerations: Vec<f32>,
    /// Joint positions (rad) that are reached by them, shape (rows, DOF).
    pub targets: Vec<f32>,
    /// Angles (rad) by which object and demonstrations are turned about the robot's vertical axis; the
    /// first one is 0.
    pub turns: Vec<f32>,
    /// Noisy clouds, shape (turns, clouds, [`CLOUD`], 3).
    pub noisy: Vec<f32>,
    /// Clouds without noise, shape (turns, [`CLOUD`], 3).
    pub clean: Vec<f32>,
}

impl Part {
    /// Adds a demonstration; all rows but the last state, which the last row's target says.
    pub(crate) fn push(&mut self, demonstration: &Demonstration) {
        let states = &demonstration.states;
        for (pair, qdd) in states.windows(2).zip(&demonstration.accelerations) {
            let state = pair[0].q.iter().chain(pair[0].qd.iter());
            self.states.extend(state.map(|x| *x as f32));
            self.accelerations.extend(qdd.iter().map(|x| *x as f32));
            self.targets.extend(pair[1].q.iter().map(|x| *x as f32));
        }
        self.offsets.push(self.rows());
    }

    /// Rows of all kept demonstrations.
    pub fn rows(&self) -> usize {
        self.states.len() / STATE
    }

    /// Attempts that were kept, in the order of the demonstrations.
    pub fn kept(&self) -> impl Iterator<Item = &Attempt> {
        self.attempts.iter().filter(|attempt| attempt.fate == Fate::Kept)
    }

    pub(crate) fn encode(&self) -> Result<Vec<u8>> {
        let rows = self.rows();
        let offsets: Vec<f32> = self.offsets.iter().map(|&i| i as f32).collect();
        let attempts: Vec<f32> = self.attempts.iter().flat_map(Attempt::numbers).collect();
        let clouds = |points: &[f32]| vec![points.len() / (3 * CLOUD), CLOUD, 3];
        let [x, y, yaw] = self.pose;
        store::encode(
            &[
                ("pose", vec![4], &[x, y, yaw, self.jump]),
                ("attempts", vec![self.attempts.len(), Attempt::NUMBERS], &attempts),
                ("offsets", vec![offsets.len()], &offsets),
                ("states", vec![rows, STATE], &self.states),
                ("accelerations", vec![rows, DOF], &self.accelerations),
                ("targets", vec![rows, DOF], &self.targets),
                ("turns", vec![self.turns.len()], &self.turns),
                ("noisy", clouds(&self.noisy), &self.noisy),
                ("clean", clouds(&self.clean), &self.clean),
            ],
            None,
        )
    }

    pub(crate) fn decode(bytes: &[u8]) -> Result<Self> {
        let tensors = SafeTensors::deserialize(bytes)?;
        let read = |name: &str| values(&tensors, name);
        let pose = read("pose")?;
        ensure!(pose.len() == 4, "a pose has four numbers, found {}", pose.len());
        let attempts = read("attempts")?;
        let part = Self {
            pose: [pose[0], pose[1], pose[2]],
            jump: pose[3],
            attempts: attempts.chunks_exact(Attempt::NUMBERS).map(Attempt::from_numbers).collect(),
            offsets: read("offsets")?.iter().map(|&first| first as usize).collect(),
            states: read("states")?,
            accelerations: read("accelerations")?,
            targets: read("targets")?,
            turns: read("turns")?,
            noisy: read("noisy")?,
            clean: read("clean")?,
        };
        let rows = part.rows();
        ensure!(
            part.offsets.first() == Some(&0)
                && part.offsets.is_sorted()
                && part.offsets.last() == Some(&rows),
            "its demonstrations do not fill its {rows} rows"
        );
        Ok(part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn part() -> Part {
        let attempt = |fate, full| Attempt {
            target: 3,
            grasp: 1,
            fate,
            full,
            endured: full,
            perturbed: None,
            rows: 40,
            touch: 30,
            restarts: 1,
            clearance: 0.004,
            jerk: 12.0,
            slip: 0.001,
            in_reach: true,
            miss: [0.01, 0.05],
        };
        Part {
            pose: [0.5, 0.1, -1.0],
            jump: 0.2,
            attempts: vec![
                attempt(Fate::Kept, Some(Fate::Low)),
                attempt(Fate::Penetrates, None),
                attempt(Fate::Kept, Some(Fate::Kept)),
            ],
            offsets: vec![0, 2, 3],
            states: (0..3 * STATE).map(|x| x as f32).collect(),
            accelerations: vec![0.5; 3 * DOF],
            targets: vec![0.25; 3 * DOF],
            turns: vec![0.0, 0.2],
            noisy: vec![0.25; 4 * 3 * CLOUD],
            clean: vec![0.5; 2 * 3 * CLOUD],
        }
    }

    #[test]
    fn a_part_comes_back_as_it_was() {
        let back = Part::decode(&part().encode().unwrap()).unwrap();
        assert_eq!(back, part());
        assert_eq!(back.kept().count(), 2);
    }

    #[test]
    fn fates_have_the_codes_of_their_names() {
        for (i, (fate, name)) in Fate::ALL.into_iter().enumerate() {
            assert_eq!((fate as usize, fate.name()), (i, name));
            assert_eq!(Fate::from_code(i as f32), Some(fate));
        }
        assert_eq!(Fate::from_code(-1.0), None);
    }

    #[test]
    fn a_torn_part_is_an_error() {
        let torn = Part { offsets: vec![0, 2, 9], ..part() };
        let message = Part::decode(&torn.encode().unwrap()).unwrap_err().to_string();
        assert!(message.contains("do not fill its 3 rows"), "{message}");
        let bytes = part().encode().unwrap();
        assert!(Part::decode(&bytes[..bytes.len() - 9]).is_err() && Part::decode(b"{}").is_err());
    }
}
