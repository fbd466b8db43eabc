//! Converts the URDF and the figures of the hand to JSON: the web build then needs only one parser.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

#[path = "src/xml_element.rs"]
mod xml_element;

const ROBOT: &str = "../../assets/robot/iiwa7_allegro/robot.urdf";
const HAND: &str = "../../assets/robot/iiwa7_allegro/hand.toml";

fn main() -> Result<(), Box<dyn Error>> {
    let out = env::var("OUT_DIR")?;
    for input in [ROBOT, HAND, "src/xml_element.rs"] {
        println!("cargo::rerun-if-changed={input}");
    }
    let robot = xml_element::Element::parse(&fs::read_to_string(ROBOT)?)?;
    fs::write(Path::new(&out).join("urdf.json"), serde_json::to_string(&robot)?)?;
    let hand: serde_json::Value = toml::from_str(&fs::read_to_string(HAND)?)?;
    fs::write(Path::new(&out).join("hand.json"), hand.to_string())?;
    Ok(())
}
