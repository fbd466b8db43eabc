//! Model card: training record and evaluation results, stored as `card.json` next to the weights.

use anyhow::{Context, Result};
use evaluation::EvaluationReport;
use files::atomic_file;
use objects::object::Object;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Adds reports to a card. A report replaces the one of the same policy, object and seed, unless that one has
/// more attempts. Entries of other weights, of another scene, or of an earlier version of a built-in object
/// are deleted; all other entries are unchanged.
pub(crate) fn update(path: &Path, reports: &[EvaluationReport]) -> Result<()> {
    let mut card: Map<String, Value> = match std::fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).with_context(|| {
            format!("{} is not a model card; delete it to create a new one", path.display())
        })?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Map::new(),
        Err(error) => return Err(error).context(format!("cannot read {}", path.display())),
    };
    let before = card.remove("evaluation");
    let mut entries: Vec<Value> =
        before.as_ref().and_then(Value::as_array).cloned().unwrap_or_default();
    for report in reports {
        let mut entry = serde_json::to_value(report)?;
        // Individual attempts are reproducible from their seeds.
        entry.as_object_mut().map(|entry| entry.remove("rows"));
        let same = |other: &Value, keys: &[&str]| keys.iter().all(|key| other[key] == entry[key]);
        if entries.iter().any(|other| !same(other, &["model_hash"])) {
            card.clear();
        }
        entries.retain(|other| same(other, &["model_hash", "scene_hash"]));
        // A mesh can be evaluated with different masses.
        let is_fixed = Object::from_catalog(&report.object).is_some();
        let is_other = |other: &Value| !same(other, &["object_hash"]);
        entries
            .retain(|other| !(is_fixed && same(other, &["policy", "object"]) && is_other(other)));
        let keys = ["policy", "object", "object_hash", "seed"];
        let attempts = |entry: &Value| entry["attempts"].as_u64().unwrap_or_default();
        let is_superseded =
            |other: &Value| same(other, &keys) && attempts(other) > attempts(&entry);
        if entries.iter().any(is_superseded) {
            continue;
        }
        entries.retain(|other| !same(other, &keys));
        entries.push(entry);
    }
    card.insert("evaluation".into(), json!(entries));
    atomic_file::write(path, &serde_json::to_vec_pretty(&card)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn report(policy: &str, lifted: usize) -> EvaluationReport {
        EvaluationReport {
            policy: policy.into(),
            object: "sugar_box".into(),
            attempts: 10,
            lifted,
            wilson95: [0.0, 1.0],
            failures: BTreeMap::new(),
            seed: 0,
            scene_hash: "s".into(),
            object_hash: "o".into(),
            orientation: None,
            model_hash: None,
            rows: Vec::new(),
        }
    }

    #[test]
    fn update_replaces_matching_reports_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card.json");
        std::fs::write(&path, r#"{"training": "two hours"}"#).unwrap();
        update(&path, &[report("policy", 3), report("zero z", 1)]).unwrap();
        update(&path, &[report("policy", 7)]).unwrap();
        let elsewhere = EvaluationReport { seed: 1000, ..report("policy", 5) };
        update(&path, &[elsewhere]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(card["training"], "two hours");
        let found: Vec<_> = card["evaluation"].as_array().unwrap().iter().collect();
        assert_eq!(found.len(), 3);
        assert_eq!((&found[2]["seed"], &found[2]["lifted"]), (&json!(1000), &json!(5)));
        assert_eq!((&found[1]["policy"], &found[1]["lifted"]), (&json!("policy"), &json!(7)));
        assert!(found[0].get("rows").is_none());
        // A report with fewer attempts does not replace one with more.
        update(&path, &[EvaluationReport { attempts: 5, ..report("policy", 1) }]).unwrap();
        let same: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(same, card);
        let mesh = |hash: &str| EvaluationReport {
            object: "mug.stl".into(),
            object_hash: hash.into(),
            ..report("policy", 2)
        };
        update(&path, &[mesh("light"), mesh("heavy")]).unwrap();
        let reshaped = EvaluationReport { object_hash: "other".into(), ..report("policy", 4) };
        update(&path, &[reshaped]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let found = card["evaluation"].as_array().unwrap();
        let lifted: Vec<_> = found.iter().map(|entry| entry["lifted"].as_u64().unwrap()).collect();
        assert_eq!(lifted, [1, 2, 2, 4], "the box has one shape, the mug two masses");
        let other = EvaluationReport { model_hash: Some("new".into()), ..report("policy", 9) };
        update(&path, &[other]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(
            card["evaluation"].as_array().map(Vec::len),
            Some(1),
            "entries of old weights are deleted"
        );
        assert!(card.get("training").is_none(), "{card}");
        std::fs::write(&path, "[").unwrap();
        assert!(update(&path, &[]).unwrap_err().to_string().contains("is not a model card"));
    }
}
