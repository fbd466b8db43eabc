//! Converts the scene file from TOML to JSON, so that the WebAssembly module needs only one parser.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

const SCENE: &str = "../../assets/scene/scene.toml";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={SCENE}");
    let scene: serde_json::Value = toml::from_str(&fs::read_to_string(SCENE)?)?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("scene.json"), scene.to_string())?;
    Ok(())
}
