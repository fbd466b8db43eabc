//! The object files as JSON: people write TOML, and the page has room for one reader, not for two.

use std::error::Error;
use std::path::Path;
use std::{env, fs};

const OBJECTS: &str = "../../assets/objects";

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo::rerun-if-changed={OBJECTS}");
    let out = env::var("OUT_DIR")?;
    for family in fs::read_dir(OBJECTS)? {
        let family = family?;
        let folder = Path::new(&out).join(family.file_name());
        fs::create_dir_all(&folder)?;
        for file in fs::read_dir(family.path())? {
            let path = file?.path();
            let text = fs::read_to_string(&path)?;
            let object: serde_json::Value =
                toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
            let name = path.with_extension("json");
            fs::write(folder.join(name.file_name().unwrap_or_default()), object.to_string())?;
        }
    }
    Ok(())
}
