//! Generates the catalogue from `assets/objects`: one folder per family with a `family.toml`, one TOML file per
//! object. The files are converted to JSON, so that the WebAssembly module needs only one parser.

use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::{env, fs};
use toml::{Table, Value};

const OBJECTS: &str = "../../assets/objects";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={OBJECTS}");
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let mut families = Vec::new();
    for entry in fs::read_dir(OBJECTS)? {
        let path = entry?.path();
        families.push((parse(&path.join("family.toml"))?, path));
    }
    families.sort_by_key(|(family, _)| order(family));
    let mut rows = String::new();
    for (family, path) in families {
        write_family(&family, &path, &out, &mut rows)?;
    }
    fs::write(out.join("catalog.rs"), format!("&[\n{rows}]\n"))?;
    Ok(())
}

/// Writes the JSON files of a family and appends its catalogue entries to `rows`.
fn write_family(
    family: &Table,
    path: &Path,
    out: &Path,
    rows: &mut String,
) -> Result<(), Box<dyn Error>> {
    let family_name = stem(path);
    let folder = out.join(&family_name);
    fs::create_dir_all(&folder)?;
    let mut objects = Vec::new();
    for entry in fs::read_dir(path)? {
        let file = entry?.path();
        if stem(&file) != "family" {
            objects.push((stem(&file), parse(&file)?));
        }
    }
    objects.sort_by_key(|(name, object)| (order(object), name.clone()));
    for (name, mut object) in objects {
        let reference = family.get("reference").and_then(Value::as_str).unwrap_or(&name).to_owned();
        let is_held_out = is_held_out(family) || is_held_out(&object);
        for key in ["order", "held_out"] {
            object.remove(key);
        }
        let json = folder.join(&name).with_extension("json");
        fs::write(&json, serde_json::to_string(&object)?)?;
        writeln!(
            rows,
            "CatalogEntry {{ name: {name:?}, family: {family_name:?}, reference: {reference:?}, \
             is_held_out: {is_held_out}, text: include_str!({json:?}) }},"
        )?;
    }
    Ok(())
}

fn parse(path: &Path) -> Result<Table, Box<dyn Error>> {
    let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
    Ok(toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?)
}

fn stem(path: &Path) -> String {
    path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

/// Position in the catalogue; files without `order` come last.
fn order(table: &Table) -> i64 {
    table.get("order").and_then(Value::as_integer).unwrap_or(i64::MAX)
}

fn is_held_out(table: &Table) -> bool {
    table.get("held_out").and_then(Value::as_bool).unwrap_or(false)
}
