//! Converts the figures of the robot's hand from TOML to JSON: the web build then needs only one parser.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

const HAND: &str = "../../assets/robot/iiwa7_allegro/hand.toml";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={HAND}");
    let hand: serde_json::Value = toml::from_str(&fs::read_to_string(HAND)?)?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("hand.json"), hand.to_string())?;
    Ok(())
}
