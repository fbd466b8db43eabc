//! Lists the grasp sets of `assets/grasps`, one JSON file per catalogue object.

use std::error::Error;
use std::fmt::Write;
use std::path::Path;
use std::{env, fs};

const GRASPS: &str = "../../assets/grasps";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={GRASPS}");
    let folder = fs::canonicalize(GRASPS)?;
    let mut files: Vec<_> = fs::read_dir(&folder)?
        .map(|entry| Ok(entry?.path()))
        .collect::<Result<_, std::io::Error>>()?;
    files.sort();
    let mut rows = String::new();
    for file in files {
        let name = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        writeln!(rows, "({name:?}, include_str!({file:?})),")?;
    }
    let out = env::var("OUT_DIR")?;
    fs::write(Path::new(&out).join("grasp_sets.rs"), format!("&[\n{rows}]\n"))?;
    Ok(())
}
