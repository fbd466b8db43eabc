//! Checkpoints: parameters, optimiser state, rollout states and settings, from which training resumes.

use crate::nn::Params;
use crate::nn::adam::AdamW;
use anyhow::{Context, Result, bail};
use files::{atomic_file, tensors};
use safetensors::SafeTensors;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Version of the file format and of the training that equal settings produce.
/// 3: warm-up is limited to a tenth of all steps. 4: tensors and settings renamed.
const VERSION: u32 = 4;

/// Writes parameters, optimiser state, serialised rollout states (`buffers`) and the training settings. An
/// existing checkpoint is renamed to the previous one.
pub fn save(
    path: &Path,
    params: &Params,
    adam: &AdamW,
    buffers: &[f32],
    settings: &Value,
) -> Result<()> {
    let values = params.values()?;
    let count = [values.len()];
    let metadata = json!({ "version": VERSION, "steps": adam.steps, "settings": settings });
    let param_steps: Vec<f32> = adam.param_steps.iter().map(|steps| *steps as f32).collect();
    let tensors = [
        ("params", count.to_vec(), values.as_slice()),
        ("first_moment", count.to_vec(), adam.first_moment.as_slice()),
        ("second_moment", count.to_vec(), adam.second_moment.as_slice()),
        ("param_steps", vec![param_steps.len()], param_steps.as_slice()),
        ("rollout_states", vec![buffers.len()], buffers),
    ];
    let bytes = tensors::encode(&tensors, Some(metadata.to_string()))?;
    if path.exists() {
        std::fs::rename(path, previous_path(path))
            .with_context(|| format!("cannot rename {}", path.display()))?;
    }
    atomic_file::write(path, &bytes)
}

/// Path of the previous checkpoint.
fn previous_path(path: &Path) -> PathBuf {
    path.with_extension("previous.safetensors")
}

/// Path to which an unusable checkpoint is renamed, so that the next [`save`] does not make it the previous
/// checkpoint.
fn unusable_path(path: &Path) -> PathBuf {
    path.with_extension("unusable.safetensors")
}

/// Hint for the user: which files to delete to restart the training.
fn restart_hint(path: &Path) -> String {
    format!("delete {}* to restart", path.with_extension("").display())
}

/// Removes partial checkpoint files of killed processes.
fn remove_partial_files(path: &Path) -> Result<()> {
    let Some(entries) = path.parent().and_then(|folder| folder.read_dir().ok()) else {
        return Ok(());
    };
    for entry in entries {
        let file = entry?.path();
        if atomic_file::is_partial(&file) && file.file_stem() == path.file_stem() {
            std::fs::remove_file(&file)
                .with_context(|| format!("cannot remove {}", file.display()))?;
        }
    }
    Ok(())
}

/// Reads the last checkpoint into `params` and `adam`, and returns the serialised rollout states. If the last
/// checkpoint is unusable, it is renamed, `warn` is called, and the previous one is read. Without any
/// checkpoint the result is empty. Fails if all existing checkpoints are unusable.
pub fn load(
    path: &Path,
    params: &Params,
    adam: &mut AdamW,
    settings: &Value,
    warn: &mut dyn FnMut(&str),
) -> Result<Vec<f32>> {
    remove_partial_files(path)?;
    let before = previous_path(path);
    if !path.exists() && !before.exists() {
        return Ok(Vec::new());
    }
    let error = match read(path, params, adam, settings) {
        Ok(buffers) => return Ok(buffers),
        Err(error) => error,
    };
    let buffers = match read(&before, params, adam, settings) {
        Ok(buffers) => buffers,
        // Report the error of the file that exists.
        Err(previous_error) if !path.exists() => return Err(previous_error),
        Err(_) => return Err(error),
    };
    if path.exists() {
        std::fs::rename(path, unusable_path(path))
            .with_context(|| format!("cannot rename {}", path.display()))?;
    }
    warn(&format!("{error:#}; resuming from the previous checkpoint, of step {}", adam.steps));
    Ok(buffers)
}

/// Reads a checkpoint and returns the serialised rollout states. On error, `params` and `adam` are unchanged.
/// Rejects other settings, because the result would match neither the old nor the new settings.
fn read(path: &Path, params: &Params, adam: &mut AdamW, settings: &Value) -> Result<Vec<f32>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let damaged = || format!("{} is damaged; {}", path.display(), restart_hint(path));
    let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
    let (_, header) = SafeTensors::read_metadata(&bytes).with_context(damaged)?;
    let metadata = header.metadata().as_ref().and_then(|m| m.get("about")).with_context(damaged)?;
    let metadata: Value = serde_json::from_str(metadata).with_context(damaged)?;
    if metadata["version"] != VERSION {
        bail!(
            "{} was written by another version of this program; {}",
            path.display(),
            restart_hint(path)
        );
    }
    let differ = differing_settings(&metadata["settings"], settings);
    if !differ.is_empty() {
        bail!(
            "{} was created with other settings ({}); choose another output folder, or {}",
            path.display(),
            differ.join(", "),
            restart_hint(path)
        );
    }
    let steps = metadata["steps"].as_u64().with_context(damaged)?;
    let [values, first, second, param_steps, buffers] =
        ["params", "first_moment", "second_moment", "param_steps", "rollout_states"]
            .map(|name| tensors::read_f32(&tensors, name).with_context(damaged));
    let (values, first, second, param_steps, buffers) =
        (values?, first?, second?, param_steps?, buffers?);
    if values.len() != params.count() {
        bail!("{} belongs to another network; choose another output folder", path.display());
    }
    let lengths = [first.len(), second.len(), param_steps.len()];
    if lengths != [values.len(), values.len(), adam.param_steps.len()] {
        bail!(damaged());
    }
    params.set_values(&values)?;
    (adam.first_moment, adam.second_moment, adam.steps) = (first, second, steps);
    adam.param_steps = param_steps.into_iter().map(|steps| steps as u64).collect();
    Ok(buffers)
}

/// Names of the settings that differ.
fn differing_settings(found: &Value, expected: &Value) -> Vec<String> {
    let (Some(found), Some(expected)) = (found.as_object(), expected.as_object()) else {
        return if found == expected { Vec::new() } else { vec!["all".into()] };
    };
    let names: BTreeSet<&String> = found.keys().chain(expected.keys()).collect();
    names.into_iter().filter(|name| found.get(*name) != expected.get(*name)).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Checkpoint path in a new folder, with parameters, optimiser and settings of a training.
    fn training(name: &str) -> (PathBuf, Params, AdamW, Value) {
        let folder = format!("ngf-checkpoint-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(folder);
        let mut params = Params::default();
        params.add("w", &[2], vec![1.0, -2.0]).unwrap();
        let mut adam = AdamW::new(&params, 0.0);
        (adam.first_moment, adam.second_moment) = (vec![0.5, 0.1], vec![0.25, 0.01]);
        (adam.steps, adam.param_steps) = (1, vec![1]);
        (folder.join("c.safetensors"), params, adam, json!({ "learning_rate": 0.1, "steps": 5 }))
    }

    /// Loads into a new training; returns step, parameters and warnings.
    fn loaded(path: &Path, settings: &Value) -> Result<(u64, Vec<f32>, Vec<String>)> {
        let mut params = Params::default();
        params.add("w", &[2], vec![0.0, 0.0])?;
        let mut adam = AdamW::new(&params, 0.0);
        let mut warnings = Vec::new();
        let before = params.values()?;
        let outcome =
            load(path, &params, &mut adam, settings, &mut |text| warnings.push(text.to_owned()));
        if outcome.is_err() {
            assert_eq!(
                (params.values()?, adam.steps),
                (before, 0),
                "a failed load changed the parameters"
            );
        }
        outcome.map(|_| (adam.steps, params.values().unwrap(), warnings))
    }

    #[test]
    fn checkpoint_restores_parameters_optimiser_and_rollout_states() {
        let (path, params, adam, settings) = training("restores");
        assert_eq!(loaded(&path, &settings).unwrap(), (0, vec![0.0, 0.0], vec![]));
        save(&path, &params, &adam, &[7.0, 0.1], &settings).unwrap();
        let values = params.values().unwrap();
        let mut restored = AdamW::new(&params, 0.0);
        params.set_values(&[0.0, 0.0]).unwrap();
        let buffers =
            load(&path, &params, &mut restored, &settings, &mut |text| panic!("{text}")).unwrap();
        assert_eq!(buffers, [7.0, 0.1]);
        assert_eq!(params.values().unwrap(), values);
        assert_eq!(
            (restored.first_moment, restored.second_moment),
            (adam.first_moment, adam.second_moment)
        );
        assert_eq!((restored.steps, restored.param_steps), (1, vec![1]));
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }

    #[test]
    fn corrupt_checkpoint_falls_back_to_previous() {
        let (path, params, mut adam, settings) = training("rejected");
        let foreign = json!({ "learning_rate": 0.2, "steps": 5 });
        save(&path, &params, &adam, &[], &settings).unwrap();
        // Without a previous checkpoint, the error is returned.
        let error = loaded(&path, &foreign).unwrap_err().to_string();
        assert!(error.contains("other settings (learning_rate)"), "{error}");
        adam.steps = 2;
        save(&path, &params, &adam, &[], &settings).unwrap();
        let complete = std::fs::read(&path).unwrap();
        let damaged = [&complete[..complete.len() / 2], &complete[..5], b"nonsense", b""];
        for bytes in damaged {
            std::fs::write(&path, bytes).unwrap();
            let (step, values, warnings) = loaded(&path, &settings).unwrap();
            assert_eq!((step, values), (1, vec![1.0, -2.0]));
            assert!(warnings.len() == 1 && warnings[0].contains("damaged"), "{warnings:?}");
            assert_eq!(std::fs::read(unusable_path(&path)).unwrap(), bytes);
        }
        // The resumed run writes a new checkpoint. If that one is damaged too, the previous one is still
        // available.
        save(&path, &params, &adam, &[], &settings).unwrap();
        std::fs::write(&path, b"nonsense").unwrap();
        assert_eq!(loaded(&path, &settings).unwrap().0, 1);
        save(&path, &params, &adam, &[], &foreign).unwrap();
        std::fs::write(previous_path(&path), &complete).unwrap();
        let (step, _, warnings) = loaded(&path, &settings).unwrap();
        assert!(
            step == 2 && warnings[0].contains("other settings (learning_rate)"),
            "{warnings:?}"
        );
        // The process was killed after the rename of the old checkpoint, or while it wrote the new one.
        let partial = path.with_extension("part-1");
        std::fs::write(&partial, &complete[..9]).unwrap();
        assert_eq!(loaded(&path, &settings).unwrap().0, 2);
        assert!(!partial.exists());
        // With only the previous checkpoint left, the error refers to that file.
        let error = loaded(&path, &foreign).unwrap_err().to_string();
        assert!(error.contains("previous.safetensors was created with other"), "{error}");
        std::fs::write(previous_path(&path), b"nonsense").unwrap();
        std::fs::write(&path, b"nonsense").unwrap();
        let error = loaded(&path, &settings).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }
}
