//! Verification of a dataset: file hashes, and Eq. 6 and 7 in every row.

use crate::dataset::Dataset;
use crate::lerobot::{ACTION_DIM, data_file_path};
use crate::manifest;
use crate::parquet_io;
use crate::shard::STATE_DIM;
use anyhow::{Context, Result, ensure};
use dataset_manifest::Manifest;
use progress::Progress;
use robot::DOF;
use robot::integrator::CONTROL_DT;

/// Maximum error of Eq. 6 and 7 after rounding to single precision (rad, rad/s).
const F32_TOLERANCE: f64 = 1e-4;

impl Dataset {
    /// Checks hashes and rows; returns the number of rows.
    pub fn verify(&self, progress: &dyn Progress) -> Result<usize> {
        manifest::verify_files(&Manifest::read(&self.dir)?, &self.dir, progress)?;
        let files = self.file_index(self.config.objects.len(), 0);
        let mut rows = 0;
        for file in 0..files {
            progress.update("check rows", file, files);
            let path = data_file_path(&self.dir, file);
            if !path.exists() {
                // No pose of this file has a demonstration.
                continue;
            }
            for group in 0..parquet_io::num_row_groups(&path)? {
                let batch = parquet_io::read_group(&path, group)?;
                let (states, actions) = (
                    parquet_io::floats(&batch, "observation.state")?,
                    parquet_io::floats(&batch, "action")?,
                );
                let frames = parquet_io::integers(&batch, "frame_index")?;
                check_rows(states, actions, frames)
                    .with_context(|| format!("{}", path.display()))?;
                rows += frames.len();
            }
        }
        Ok(rows)
    }
}

/// Checks that the action of each row leads to its target, and that the next row starts there.
fn check_rows(states: &[f32], actions: &[f32], frames: &[i64]) -> Result<()> {
    let dt = CONTROL_DT;
    for row in 0..frames.len() {
        let at = |of: &[f32], width: usize, i: usize| f64::from(of[row * width + i]);
        let has_next = frames.get(row + 1).is_some_and(|next| *next == frames[row] + 1);
        for i in 0..DOF {
            let (q, qd) = (at(states, STATE_DIM, i), at(states, STATE_DIM, DOF + i));
            let (qdd, target) = (at(actions, ACTION_DIM, i), at(actions, ACTION_DIM, DOF + i));
            let error = (q + dt * qd + 0.5 * dt * dt * qdd - target).abs();
            ensure!(error < F32_TOLERANCE, "row {row}, joint {i}: violates Eq. 6 by {error}");
            if has_next {
                let next = |i: usize| f64::from(states[(row + 1) * STATE_DIM + i]);
                let error = (qd + dt * qdd - next(DOF + i)).abs().max((target - next(i)).abs());
                ensure!(error < F32_TOLERANCE, "row {row}, joint {i}: violates Eq. 7 by {error}");
            }
        }
    }
    Ok(())
}
