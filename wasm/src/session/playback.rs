//! Playback of files: demonstrations of a dataset, recorded attempts.

use super::Session;
use crate::object_import;
use crate::protocol::{Cloud, Failure, PlanarPose, PlaybackInfo};
use rollout::ReplayFile;

const REEXPORT_HINT: &str = "Export it again: a demonstration with `ngf dataset export-episode DIR N --out FILE`, an attempt \
                    with Share, Recording after it has ended.";

fn playback_info(file: ReplayFile) -> PlaybackInfo {
    match file {
        ReplayFile::Demonstration(file) => PlaybackInfo {
            description: format!("Demonstration, {}", file.description),
            closing_label: "Replaying a demonstration",
            final_state_hash: None,
        },
        ReplayFile::Recording(file) => PlaybackInfo {
            description: format!(
                "Recorded attempt: {}, seed {}",
                object_import::display_name(&file.object_name),
                file.seed
            ),
            closing_label: "Replaying a recorded attempt",
            final_state_hash: Some(file.final_state_hash),
        },
    }
}

impl Session {
    /// Starts the playback of a file with the current object or a built-in one.
    pub(crate) fn play_file(&mut self, file_name: &str, bytes: &[u8]) -> Result<Cloud, Failure> {
        let invalid = |cause: &str, hint: &str| Failure {
            code: "invalid_recording",
            message: format!("{file_name} cannot be replayed: {cause}."),
            hint: hint.into(),
        };
        let replay_file =
            ReplayFile::parse(bytes).map_err(|error| invalid(&error.to_string(), REEXPORT_HINT))?;
        if matches!(&replay_file, ReplayFile::Recording(file) if file.outcome.is_none()) {
            return Err(invalid("the attempt had not ended when it was saved", REEXPORT_HINT));
        }
        let (hash, name, [x, y, yaw]) = replay_file.object();
        let loaded = if self.object_hash == hash {
            None
        } else {
            Some(object_import::load_built_in(name).map_err(|_| {
                let cause =
                    format!("it was recorded with \"{name}\", which is not a built-in object");
                invalid(
                    &cause,
                    "Load the mesh of that object first, with the mass of the recording.",
                )
            })?)
        };
        let object = loaded.as_ref().map_or(&self.loaded.object, |loaded| &loaded.object);
        let attempt = replay_file.start_replay(&self.context, object).map_err(|error| {
            let hint = "Record it again with this version of the program and the current objects.";
            invalid(&error.to_string(), hint)
        })?;
        if let Some(loaded) = loaded {
            self.load(loaded);
        }
        (self.pose, self.pose_seed) = (PlanarPose { x, y, yaw }, None);
        self.playback = Some(playback_info(replay_file));
        Ok(self.start_attempt(attempt))
    }
}
