//! Checkpoints: parameters, optimiser state and settings, so that training resumes where it was.

use crate::nn::Params;
use crate::nn::adam::AdamW;
use anyhow::{Context, Result, bail};
use dataset::store;
use safetensors::SafeTensors;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::path::Path;

/// Writes parameters and optimiser, with the settings of the training.
pub fn save(path: &Path, params: &Params, adam: &AdamW, settings: &Value) -> Result<()> {
    let values = params.values()?;
    let count = [values.len()];
    let about = json!({ "steps": adam.steps, "settings": settings }).to_string();
    let tensors = [
        ("values", count.to_vec(), values.as_slice()),
        ("first", count.to_vec(), adam.first.as_slice()),
        ("second", count.to_vec(), adam.second.as_slice()),
    ];
    store::write(path, &store::encode(&tensors, Some(about))?)
}

/// Reads them back if the file is there; says whether it was. Other settings are refused: the rest of
/// the training would be neither the old one nor the new one.
pub fn load(path: &Path, params: &Params, adam: &mut AdamW, settings: &Value) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let damaged = || format!("{} is damaged; delete it to begin anew", path.display());
    let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
    let (_, header) = SafeTensors::read_metadata(&bytes)?;
    let about = header.metadata().as_ref().and_then(|m| m.get("about")).with_context(damaged)?;
    let about: Value = serde_json::from_str(about)?;
    let differ = differing(&about["settings"], settings);
    if !differ.is_empty() {
        bail!(
            "{} was begun with other settings ({}); choose another folder, or delete it to begin anew",
            path.display(),
            differ.join(", ")
        );
    }
    let values = store::values(&tensors, "values")?;
    if values.len() != params.count() {
        bail!("{} belongs to another network; choose another folder", path.display());
    }
    params.set_values(&values)?;
    let (first, second) = (store::values(&tensors, "first")?, store::values(&tensors, "second")?);
    if [first.len(), second.len()] != [values.len(); 2] {
        bail!(damaged());
    }
    (adam.first, adam.second) = (first, second);
    adam.steps = about["steps"].as_u64().with_context(damaged)?;
    Ok(true)
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

    #[test]
    fn a_checkpoint_restores_parameters_and_optimiser() {
        let path = std::env::temp_dir().join(format!("ngf-checkpoint-{}", std::process::id()));
        let mut params = Params::default();
        params.add("w", &[2], vec![1.0, -2.0]).unwrap();
        let mut adam = AdamW::new(2, 0.0);
        (adam.first, adam.second, adam.steps) = (vec![0.5, 0.1], vec![0.25, 0.01], 1);
        let values = params.values().unwrap();
        let settings = json!({ "rate": 0.1, "steps": 5 });
        save(&path, &params, &adam, &settings).unwrap();

        let mut again = AdamW::new(2, 0.0);
        params.set_values(&[0.0, 0.0]).unwrap();
        let other = json!({ "rate": 0.2, "steps": 5 });
        let refusal = load(&path, &params, &mut again, &other).unwrap_err().to_string();
        assert!(refusal.contains("other settings (rate)"), "{refusal}");
        assert!(load(&path, &params, &mut again, &settings).unwrap());
        assert_eq!(params.values().unwrap(), values);
        assert_eq!((again.first, again.second, again.steps), (adam.first, adam.second, 1));
        std::fs::write(&path, b"nonsense").unwrap();
        assert!(
            load(&path, &params, &mut AdamW::new(2, 0.0), &settings)
                .unwrap_err()
                .to_string()
                .contains("damaged")
        );
        std::fs::remove_file(&path).unwrap();
    }
}
