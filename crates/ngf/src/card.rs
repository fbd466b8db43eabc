//! The card of a model: what trained it, and how well it does, kept as `card.json` beside its weights.

use anyhow::{Context, Result};
use dataset::store;
use geometry::object::Object;
use imitation::evaluation::Report;
use serde_json::{Map, Value, json};
use std::path::Path;

/// Puts reports into a card: each replaces that of the same policy, object and seed, unless that one is of more attempts.
/// What was said of other weights goes, and counts of another scene or of a built-in object that was another then; the
/// rest stays as it was.
pub(crate) fn update(path: &Path, reports: &[Report]) -> Result<()> {
    let mut card: Map<String, Value> = match std::fs::read(path) {
        Ok(bytes) => serde_json::from_slice(&bytes).with_context(|| {
            format!("{} is not a card: delete it to begin anew", path.display())
        })?,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Map::new(),
        Err(error) => return Err(error).context(format!("cannot read {}", path.display())),
    };
    let before = card.remove("evaluation");
    let mut entries: Vec<Value> =
        before.as_ref().and_then(Value::as_array).cloned().unwrap_or_default();
    for report in reports {
        let mut entry = serde_json::to_value(report)?;
        // The attempts themselves follow from the seeds.
        entry.as_object_mut().map(|entry| entry.remove("rows"));
        let same = |other: &Value, keys: &[&str]| keys.iter().all(|key| other[key] == entry[key]);
        if entries.iter().any(|other| !same(other, &["model_hash"])) {
            card.clear();
        }
        entries.retain(|other| same(other, &["model_hash", "scene_hash"]));
        // A mesh may be tried with one mass and with another.
        let is_fixed = Object::built_in(&report.object).is_some();
        let is_other = |other: &Value| !same(other, &["object_hash"]);
        entries
            .retain(|other| !(is_fixed && same(other, &["policy", "object"]) && is_other(other)));
        let keys = ["policy", "object", "object_hash", "seed"];
        let attempts = |entry: &Value| entry["attempts"].as_u64().unwrap_or_default();
        let is_known = |other: &Value| same(other, &keys) && attempts(other) > attempts(&entry);
        if entries.iter().any(is_known) {
            continue;
        }
        entries.retain(|other| !same(other, &keys));
        entries.push(entry);
    }
    card.insert("evaluation".into(), json!(entries));
    store::write(path, &serde_json::to_vec_pretty(&card)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn report(policy: &str, lifted: usize) -> Report {
        Report {
            policy: policy.into(),
            object: "sugar_box".into(),
            attempts: 10,
            lifted,
            wilson95: [0.0, 1.0],
            failures: BTreeMap::new(),
            seed: 0,
            scene_hash: "s".into(),
            object_hash: "o".into(),
            stands: None,
            model_hash: None,
            rows: Vec::new(),
        }
    }

    #[test]
    fn a_report_replaces_its_predecessor_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("card.json");
        std::fs::write(&path, r#"{"training": "two hours"}"#).unwrap();
        update(&path, &[report("policy", 3), report("zero z", 1)]).unwrap();
        update(&path, &[report("policy", 7)]).unwrap();
        let elsewhere = Report { seed: 1000, ..report("policy", 5) };
        update(&path, &[elsewhere]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(card["training"], "two hours");
        let found: Vec<_> = card["evaluation"].as_array().unwrap().iter().collect();
        assert_eq!(found.len(), 3);
        assert_eq!((&found[2]["seed"], &found[2]["lifted"]), (&json!(1000), &json!(5)));
        assert_eq!((&found[1]["policy"], &found[1]["lifted"]), (&json!("policy"), &json!(7)));
        assert!(found[0].get("rows").is_none());
        // Fewer attempts say less.
        update(&path, &[Report { attempts: 5, ..report("policy", 1) }]).unwrap();
        let same: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(same, card);
        let mesh = |hash: &str| Report {
            object: "mug.stl".into(),
            object_hash: hash.into(),
            ..report("policy", 2)
        };
        update(&path, &[mesh("light"), mesh("heavy")]).unwrap();
        let reshaped = Report { object_hash: "other".into(), ..report("policy", 4) };
        update(&path, &[reshaped]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let found = card["evaluation"].as_array().unwrap();
        let lifted: Vec<_> = found.iter().map(|entry| entry["lifted"].as_u64().unwrap()).collect();
        assert_eq!(lifted, [1, 2, 2, 4], "the box has another shape, the mug two masses");
        let other = Report { model_hash: Some("new".into()), ..report("policy", 9) };
        update(&path, &[other]).unwrap();
        let card: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        assert_eq!(card["evaluation"].as_array().map(Vec::len), Some(1), "old weights go");
        assert!(card.get("training").is_none(), "{card}");
        std::fs::write(&path, "[").unwrap();
        assert!(update(&path, &[]).unwrap_err().to_string().contains("is not a card"));
    }
}
