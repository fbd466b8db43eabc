//! What is played from a file: a demonstration of a dataset, or an attempt that was recorded.

use super::Stage;
use crate::protocol::{Cloud, Failure, PlanarPose, Played};
use crate::upload;
use rollout::Tape;

const CURE: &str = "Write it again: a demonstration with `ngf dataset episode DIR N --out FILE`, an attempt with Share, \
                    Episode once it has ended.";

fn played(tape: Tape) -> Played {
    match tape {
        Tape::Demonstration(file) => Played {
            what: format!("Demonstration: {}", file.demonstration),
            closes: "A demonstration closes the hand",
            end: None,
        },
        Tape::Episode(file) => Played {
            what: format!("Recorded attempt: {}, seed {}", upload::label(&file.name), file.seed),
            closes: "A recorded attempt closes the hand",
            end: Some(file.state_hash),
        },
    }
}

impl Stage {
    /// Begins to play a file, with the object that stands there or a built-in one.
    pub(crate) fn play(&mut self, file_name: &str, bytes: &[u8]) -> Result<Cloud, Failure> {
        let unusable = |cause: &str, cure: &str| Failure {
            code: "recording_unusable",
            cause: format!("{file_name} cannot be played: {cause}."),
            cure: cure.into(),
        };
        let tape = Tape::read(bytes).map_err(|error| unusable(&error.to_string(), CURE))?;
        if matches!(&tape, Tape::Episode(file) if file.verdict.is_none()) {
            return Err(unusable("its attempt had not ended when it was written", CURE));
        }
        let (hash, name, [x, y, yaw]) = tape.object();
        let loaded = if self.object == hash {
            None
        } else {
            Some(upload::built_in(name).map_err(|_| {
                let cause = format!("it was made with \"{name}\", which is not here");
                unusable(&cause, "Load that object's mesh first; its mass must be the one it was made with, too.")
            })?)
        };
        let object = loaded.as_ref().map_or(&self.loaded.object, |loaded| &loaded.object);
        let attempt = tape.begin(&self.workcell, object).map_err(|error| {
            let cure = "Make it again with this version of the program, and objects as they are.";
            unusable(&error.to_string(), cure)
        })?;
        if let Some(loaded) = loaded {
            self.load(loaded);
        }
        (self.pose, self.pose_seed) = (PlanarPose { x, y, yaw }, None);
        self.played = Some(played(tape));
        Ok(self.set_off(attempt))
    }
}
