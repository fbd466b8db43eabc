//! Reading a dataset again: is every file what it was, does every row satisfy Eq. 6 and 7?

use crate::folder::Dataset;
use crate::lerobot::{ACTION, data_path};
use crate::manifest::Manifest;
use crate::part::STATE;
use crate::table;
use anyhow::{Context, Result, ensure};
use robot::DOF;
use scene::config::CONTROL_PERIOD;

/// Greatest error of Eq. 6 and 7 after rounding to single precision (rad, rad/s).
const ROUNDED: f64 = 1e-4;

impl Dataset {
    /// Checks hashes and rows; gives the number of rows. `progress` gets files done and their number.
    pub fn verify(&self, progress: &dyn Fn(usize, usize)) -> Result<usize> {
        Manifest::read(&self.dir)?.verify_files(&self.dir, progress)?;
        let files = self.file_of(self.config.objects.len(), 0);
        let mut rows = 0;
        for file in 0..files {
            progress(file, files);
            let path = data_path(&self.dir, file);
            if !path.exists() {
                // None of its poses has a demonstration.
                continue;
            }
            for group in 0..table::groups(&path)? {
                let batch = table::read_group(&path, group)?;
                let (states, actions) =
                    (table::floats(&batch, "observation.state")?, table::floats(&batch, "action")?);
                let frames = table::integers(&batch, "frame_index")?;
                check(states, actions, frames).with_context(|| format!("{}", path.display()))?;
                rows += frames.len();
            }
        }
        Ok(rows)
    }
}

/// Each row's action leads to its target, and that is where the next row is.
fn check(states: &[f32], actions: &[f32], frames: &[i64]) -> Result<()> {
    let dt = CONTROL_PERIOD;
    for row in 0..frames.len() {
        let at = |of: &[f32], width: usize, i: usize| f64::from(of[row * width + i]);
        let is_followed = frames.get(row + 1).is_some_and(|next| *next == frames[row] + 1);
        for i in 0..DOF {
            let (q, qd) = (at(states, STATE, i), at(states, STATE, DOF + i));
            let (qdd, target) = (at(actions, ACTION, i), at(actions, ACTION, DOF + i));
            let off = (q + dt * qd + 0.5 * dt * dt * qdd - target).abs();
            ensure!(off < ROUNDED, "row {row}, joint {i}: off Eq. 6 by {off}");
            if is_followed {
                let next = |i: usize| f64::from(states[(row + 1) * STATE + i]);
                let off = (qd + dt * qdd - next(DOF + i)).abs().max((target - next(i)).abs());
                ensure!(off < ROUNDED, "row {row}, joint {i}: off Eq. 7 by {off}");
            }
        }
    }
    Ok(())
}
