//! Hyperparameters by name: `--set KEY=VALUE`.

use anyhow::{Context, Result, anyhow, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

/// Applies assignments `KEY=VALUE` to a configuration.
///
/// A key is the path of a field, with periods between the names: `gains.position`, `noise.0`. A value is
/// JSON; other text is a string. `T` must reject unknown fields.
pub(super) fn apply<T: Serialize + DeserializeOwned>(
    config: &T,
    assignments: &[String],
) -> Result<T> {
    let mut fields = serde_json::to_value(config)?;
    for assignment in assignments {
        let (key, value) = assignment
            .split_once('=')
            .with_context(|| format!("--set {assignment}: write KEY=VALUE"))?;
        let value = serde_json::from_str(value).unwrap_or_else(|_| value.into());
        set(&mut fields, key, value).with_context(|| format!("--set {assignment}"))?;
        // Checked one by one, so that the error names the assignment.
        serde_json::from_value::<T>(fields.clone())
            .map_err(|error| anyhow!("--set {assignment}: {error}"))?;
    }
    Ok(serde_json::from_value(fields)?)
}

/// Sets the field at `key`. Its parents must exist; the field itself may be one that is left out while it
/// has no value.
fn set(fields: &mut Value, key: &str, value: Value) -> Result<()> {
    let (parents, name) = key.rsplit_once('.').unwrap_or(("", key));
    let mut parent = fields;
    for segment in parents.split('.').filter(|segment| !segment.is_empty()) {
        let names = names(parent);
        parent = child(parent, segment)
            .with_context(|| format!("no field {segment}; its siblings are {names}"))?;
    }
    match parent {
        Value::Object(object) => {
            object.insert(name.to_owned(), value);
        }
        Value::Array(_) => {
            *child(parent, name).with_context(|| format!("no entry {name}"))? = value;
        }
        _ => bail!("{parents} has no fields"),
    }
    Ok(())
}

fn child<'a>(parent: &'a mut Value, name: &str) -> Option<&'a mut Value> {
    match parent {
        Value::Object(object) => object.get_mut(name),
        Value::Array(entries) => entries.get_mut(name.parse::<usize>().ok()?),
        _ => None,
    }
}

fn names(parent: &Value) -> String {
    let names: Vec<&str> =
        parent.as_object().into_iter().flatten().map(|(name, _)| name.as_str()).collect();
    names.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use configs::DaggerConfig;
    use policy::PolicyConfig;
    use policy::networks::NetworkConfig;

    fn standard() -> DaggerConfig {
        DaggerConfig::standard(PolicyConfig::tiny())
    }

    fn apply_all(assignments: &[&str]) -> Result<DaggerConfig> {
        let assignments: Vec<String> = assignments.iter().map(|text| (*text).to_owned()).collect();
        apply(&standard(), &assignments)
    }

    #[test]
    fn assignments_set_nested_and_absent_fields() {
        let config = apply_all(&[
            "weight_decay=0.01",
            "gains.position=100",
            "noise.2=0.5",
            "policy.network.ngf.potential_position_scale=4",
        ])
        .unwrap();
        assert_eq!((config.weight_decay, config.gains.position), (0.01, 100.0));
        assert_eq!((config.noise[2], config.noise[0]), (0.5, standard().noise[0]));
        let NetworkConfig::Ngf(ngf) = config.policy.network else { panic!("not a fabric") };
        assert_eq!(ngf.potential_position_scale, Some(4.0));
        let unchanged = apply_all(&[]).unwrap();
        assert_eq!(format!("{unchanged:?}"), format!("{:?}", standard()));
    }

    #[test]
    fn wrong_assignments_are_errors_that_name_them() {
        for (assignment, part) in [
            ("weight_decay", "write KEY=VALUE"),
            ("weight_decya=0.1", "unknown field `weight_decya`"),
            ("steps=many", "expected u64"),
            ("gains.mass=1", "unknown field `mass`"),
            ("policy.network.mlp.hidden=[3]", "siblings are ngf"),
            ("noise.3=1", "no entry 3"),
            ("steps.x=1", "has no fields"),
        ] {
            let error = format!("{:#}", apply_all(&[assignment]).unwrap_err());
            assert!(error.contains(assignment) && error.contains(part), "{assignment}: {error}");
        }
    }
}
