//! Checkpoints: parameters and optimiser state, so that training resumes where it was.

use crate::nn::Params;
use crate::nn::adam::AdamW;
use crate::store;
use anyhow::{Context, Result, bail};
use safetensors::SafeTensors;
use std::path::Path;

/// Writes parameters and optimiser.
pub fn save(path: &Path, params: &Params, adam: &AdamW) -> Result<()> {
    let values = params.values()?;
    let count = [values.len()];
    let about = serde_json::json!({ "steps": adam.steps }).to_string();
    let tensors = [
        ("values", count.to_vec(), values.as_slice()),
        ("first", count.to_vec(), adam.first.as_slice()),
        ("second", count.to_vec(), adam.second.as_slice()),
    ];
    store::write(path, &store::encode(&tensors, Some(about))?)
}

/// Reads them back if the file is there; says whether it was.
pub fn load(path: &Path, params: &Params, adam: &mut AdamW) -> Result<bool> {
    if !path.exists() {
        return Ok(false);
    }
    let bytes = std::fs::read(path).with_context(|| format!("cannot read {}", path.display()))?;
    let damaged = || format!("{} is damaged; delete it to begin anew", path.display());
    let tensors = SafeTensors::deserialize(&bytes).with_context(damaged)?;
    let (_, header) = SafeTensors::read_metadata(&bytes)?;
    let about = header.metadata().as_ref().and_then(|m| m.get("about")).with_context(damaged)?;
    let about: serde_json::Value = serde_json::from_str(about)?;
    let values = store::values(&tensors, "values")?;
    if values.len() != params.count() {
        bail!("{} belongs to another network; choose another folder", path.display());
    }
    params.set_values(&values)?;
    adam.first = store::values(&tensors, "first")?;
    adam.second = store::values(&tensors, "second")?;
    adam.steps = about["steps"].as_u64().with_context(damaged)?;
    Ok(true)
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
        save(&path, &params, &adam).unwrap();

        let mut again = AdamW::new(2, 0.0);
        params.set_values(&[0.0, 0.0]).unwrap();
        assert!(load(&path, &params, &mut again).unwrap());
        assert_eq!(params.values().unwrap(), values);
        assert_eq!((again.first, again.second, again.steps), (adam.first, adam.second, 1));
        std::fs::write(&path, b"nonsense").unwrap();
        assert!(
            load(&path, &params, &mut AdamW::new(2, 0.0))
                .unwrap_err()
                .to_string()
                .contains("damaged")
        );
        std::fs::remove_file(&path).unwrap();
    }
}
