//! Checkpoints: parameters, optimiser state, what is under way and settings, so that training resumes where it was.

use crate::nn::Params;
use crate::nn::adam::AdamW;
use anyhow::{Context, Result, bail};
use dataset::store;
use safetensors::SafeTensors;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Counts the changes of what the same settings train: 3, the rate of a short training rises within a tenth of it.
const VERSION: u32 = 3;

/// Writes parameters, optimiser and the numbers of what else is under way, with the settings of the training. The
/// checkpoint that was there is kept beside it.
pub fn save(
    path: &Path,
    params: &Params,
    adam: &AdamW,
    under_way: &[f32],
    settings: &Value,
) -> Result<()> {
    let values = params.values()?;
    let count = [values.len()];
    let about = json!({ "version": VERSION, "steps": adam.steps, "settings": settings });
    let taken: Vec<f32> = adam.taken.iter().map(|steps| *steps as f32).collect();
    let tensors = [
        ("values", count.to_vec(), values.as_slice()),
        ("first", count.to_vec(), adam.first.as_slice()),
        ("second", count.to_vec(), adam.second.as_slice()),
        ("taken", vec![taken.len()], taken.as_slice()),
        ("under_way", vec![under_way.len()], under_way),
    ];
    let bytes = store::encode(&tensors, Some(about.to_string()))?;
    if path.exists() {
        std::fs::rename(path, before(path))
            .with_context(|| format!("cannot rename {}", path.display()))?;
    }
    store::write(path, &bytes)
}

/// Where the checkpoint before the last one is kept.
fn before(path: &Path) -> PathBuf {
    path.with_extension("before.safetensors")
}

/// Where a checkpoint of no use is put aside, so that the next one written does not take its place as the one before.
fn aside(path: &Path) -> PathBuf {
    path.with_extension("unusable.safetensors")
}

/// What to delete for a training to begin anew: the checkpoint, and those beside it.
fn all_of(path: &Path) -> String {
    format!("delete {}* to begin anew", path.with_extension("").display())
}

/// Removes what a killed process had half written in the place of a checkpoint.
fn remove_half_written(path: &Path) -> Result<()> {
    let Some(entries) = path.parent().and_then(|folder| folder.read_dir().ok()) else {
        return Ok(());
    };
    for entry in entries {
        let file = entry?.path();
        if store::is_half_written(&file) && file.file_stem() == path.file_stem() {
            std::fs::remove_file(&file)
                .with_context(|| format!("cannot remove {}", file.display()))?;
        }
    }
    Ok(())
}

/// Reads the last checkpoint, or the one before it if the last one is of no use: that one is put aside, and `warn` is told.
/// Gives what was under way. Nothing is read, and nothing is under way, if there is none. Fails if none of those that are
/// there is of use.
pub fn load(
    path: &Path,
    params: &Params,
    adam: &mut AdamW,
    settings: &Value,
    warn: &mut dyn FnMut(&str),
) -> Result<Vec<f32>> {
    remove_half_written(path)?;
    let before = before(path);
    if !path.exists() && !before.exists() {
        return Ok(Vec::new());
    }
    let why = match read(path, params, adam, settings) {
        Ok(under_way) => return Ok(under_way),
        Err(why) => why,
    };
    let under_way = match read(&before, params, adam, settings) {
        Ok(under_way) => under_way,
        // What is there says why, not what is missing.
        Err(of_before) if !path.exists() => return Err(of_before),
        Err(_) => return Err(why),
    };
    if path.exists() {
        std::fs::rename(path, aside(path))
            .with_context(|| format!("cannot rename {}", path.display()))?;
    }
    warn(&format!("{why:#}; going on from the one before it, of step {}", adam.steps));
    Ok(under_way)
}

/// Reads a checkpoint and gives what was under way; leaves `params` and `adam` as they are if it is of no use. Other
/// settings are refused: the rest of the training would be neither the old one nor the new one.
fn read(path: &Path, params: &Params, adam: &mut AdamW, settings: &Value) -> Result<Vec<f32>> {
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let damaged = || format!("{} is damaged; {}", path.display(), all_of(path));
    let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
    let (_, header) = SafeTensors::read_metadata(&bytes).with_context(damaged)?;
    let about = header.metadata().as_ref().and_then(|m| m.get("about")).with_context(damaged)?;
    let about: Value = serde_json::from_str(about).with_context(damaged)?;
    if about["version"] != VERSION {
        bail!("{} is of another version of this program; {}", path.display(), all_of(path));
    }
    let differ = differing(&about["settings"], settings);
    if !differ.is_empty() {
        bail!(
            "{} was begun with other settings ({}); choose another folder, or {}",
            path.display(),
            differ.join(", "),
            all_of(path)
        );
    }
    let steps = about["steps"].as_u64().with_context(damaged)?;
    let [values, first, second, taken, under_way] =
        ["values", "first", "second", "taken", "under_way"]
            .map(|name| store::values(&tensors, name).with_context(damaged));
    let (values, first, second, taken, under_way) = (values?, first?, second?, taken?, under_way?);
    if values.len() != params.count() {
        bail!("{} belongs to another network; choose another folder", path.display());
    }
    if [first.len(), second.len(), taken.len()] != [values.len(), values.len(), adam.taken.len()] {
        bail!(damaged());
    }
    params.set_values(&values)?;
    (adam.first, adam.second, adam.steps) = (first, second, steps);
    adam.taken = taken.into_iter().map(|steps| steps as u64).collect();
    Ok(under_way)
}

/// Names of the settings that differ.
fn differing(found: &Value, wanted: &Value) -> Vec<String> {
    let (Some(found), Some(wanted)) = (found.as_object(), wanted.as_object()) else {
        return if found == wanted { Vec::new() } else { vec!["all".into()] };
    };
    let names: BTreeSet<&String> = found.keys().chain(wanted.keys()).collect();
    names.into_iter().filter(|name| found.get(*name) != wanted.get(*name)).cloned().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A folder of its own, with parameters, optimiser and settings of a training.
    fn training(name: &str) -> (PathBuf, Params, AdamW, Value) {
        let folder = format!("ngf-checkpoint-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(folder);
        let mut params = Params::default();
        params.add("w", &[2], vec![1.0, -2.0]).unwrap();
        let mut adam = AdamW::new(&params, 0.0);
        (adam.first, adam.second) = (vec![0.5, 0.1], vec![0.25, 0.01]);
        (adam.steps, adam.taken) = (1, vec![1]);
        (folder.join("c.safetensors"), params, adam, json!({ "rate": 0.1, "steps": 5 }))
    }

    /// Loads into a fresh training; gives step, parameters and warnings.
    fn loaded(path: &Path, settings: &Value) -> Result<(u64, Vec<f32>, Vec<String>)> {
        let mut params = Params::default();
        params.add("w", &[2], vec![0.0, 0.0])?;
        let mut adam = AdamW::new(&params, 0.0);
        let mut warnings = Vec::new();
        let before = params.values()?;
        let outcome =
            load(path, &params, &mut adam, settings, &mut |text| warnings.push(text.to_owned()));
        if outcome.is_err() {
            assert_eq!((params.values()?, adam.steps), (before, 0), "half of it was read");
        }
        outcome.map(|_| (adam.steps, params.values().unwrap(), warnings))
    }

    #[test]
    fn a_checkpoint_restores_parameters_optimiser_and_what_was_under_way() {
        let (path, params, adam, settings) = training("restores");
        assert_eq!(loaded(&path, &settings).unwrap(), (0, vec![0.0, 0.0], vec![]));
        save(&path, &params, &adam, &[7.0, 0.1], &settings).unwrap();
        let values = params.values().unwrap();
        let mut again = AdamW::new(&params, 0.0);
        params.set_values(&[0.0, 0.0]).unwrap();
        let under_way =
            load(&path, &params, &mut again, &settings, &mut |text| panic!("{text}")).unwrap();
        assert_eq!(under_way, [7.0, 0.1]);
        assert_eq!(params.values().unwrap(), values);
        assert_eq!((again.first, again.second), (adam.first, adam.second));
        assert_eq!((again.steps, again.taken), (1, vec![1]));
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }

    #[test]
    fn what_is_of_no_use_is_refused_and_the_one_before_it_is_used() {
        let (path, params, mut adam, settings) = training("refused");
        let foreign = json!({ "rate": 0.2, "steps": 5 });
        save(&path, &params, &adam, &[], &settings).unwrap();
        // There is none before it.
        let refusal = loaded(&path, &foreign).unwrap_err().to_string();
        assert!(refusal.contains("other settings (rate)"), "{refusal}");
        adam.steps = 2;
        save(&path, &params, &adam, &[], &settings).unwrap();
        let whole = std::fs::read(&path).unwrap();
        let damaged = [&whole[..whole.len() / 2], &whole[..5], b"nonsense", b""];
        for bytes in damaged {
            std::fs::write(&path, bytes).unwrap();
            let (step, values, warnings) = loaded(&path, &settings).unwrap();
            assert_eq!((step, values), (1, vec![1.0, -2.0]));
            assert!(warnings.len() == 1 && warnings[0].contains("damaged"), "{warnings:?}");
            assert_eq!(std::fs::read(aside(&path)).unwrap(), bytes);
        }
        // What goes on from the one before it begins with writing one: damaged as well, that one is still there.
        save(&path, &params, &adam, &[], &settings).unwrap();
        std::fs::write(&path, b"nonsense").unwrap();
        assert_eq!(loaded(&path, &settings).unwrap().0, 1);
        save(&path, &params, &adam, &[], &foreign).unwrap();
        std::fs::write(before(&path), &whole).unwrap();
        let (step, _, warnings) = loaded(&path, &settings).unwrap();
        assert!(step == 2 && warnings[0].contains("other settings (rate)"), "{warnings:?}");
        // A run that was killed between keeping the old one and writing the new one, or while it wrote.
        let half = path.with_extension("part-1");
        std::fs::write(&half, &whole[..9]).unwrap();
        assert_eq!(loaded(&path, &settings).unwrap().0, 2);
        assert!(!half.exists());
        // Whoever deletes one of two hears of the other.
        let refusal = loaded(&path, &foreign).unwrap_err().to_string();
        assert!(refusal.contains("before.safetensors was begun with other"), "{refusal}");
        std::fs::write(before(&path), b"nonsense").unwrap();
        std::fs::write(&path, b"nonsense").unwrap();
        let refusal = loaded(&path, &settings).unwrap_err().to_string();
        assert!(refusal.contains("damaged"), "{refusal}");
        std::fs::remove_dir_all(path.parent().unwrap()).unwrap();
    }
}
