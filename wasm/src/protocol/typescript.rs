//! TypeScript declarations of the messages, in `web/src/demo/worker/protocol.ts`.
//!
//! `UPDATE_EXPECT=1 cargo test -p wasm typescript` writes the file.

use super::telemetry::TermNorms;
use super::*;
use crate::statistics::Tally;
use mesh::{FORMATS, Unit};
use objects::import::{Orientation, OrientationReason};
use policy::model::MODEL_FILES;
use serde_json::json;
use std::collections::BTreeMap;
use std::path::Path;
use ts_rs::{Config, TS};

/// The generated file, relative to this crate.
const FILE: &str = "../web/src/demo/worker/protocol.ts";

const HEAD: &str = "\
// Messages between the page and its worker, generated from wasm/src/protocol. Do not edit.
//
// Metres, radians, kilograms, seconds; z is up; quaternions are x, y, z, w. The worker generates the texts
// about objects and attempts; the page only displays them.
";

/// Declaration of one type, with its documentation.
fn declare<T: TS>(config: &Config) -> String {
    let docs = T::docs().unwrap_or_default();
    format!("\n{docs}export {}\n", T::decl(config))
}

/// Union of the JSON values of an enumeration without fields.
fn union(name: &str, doc: &str, variants: &[impl Serialize]) -> String {
    let values: Vec<String> =
        variants.iter().map(|variant| serde_json::to_string(variant).unwrap()).collect();
    format!("\n/**\n * {doc}\n */\nexport type {name} = {};\n", values.join(" | "))
}

/// Types of crates below this one, which do not depend on the generator.
fn foreign_types() -> String {
    let units = [Unit::Metre, Unit::Centimetre, Unit::Millimetre, Unit::Inch];
    let reasons = [
        OrientationReason::Given,
        OrientationReason::YUpFile,
        OrientationReason::Settled,
        OrientationReason::Unstable,
        OrientationReason::ChosenByModel,
    ];
    // A new variant does not compile here until it is added above.
    for unit in units {
        match unit {
            Unit::Metre | Unit::Centimetre | Unit::Millimetre | Unit::Inch => (),
        }
    }
    for reason in reasons {
        match reason {
            OrientationReason::Given
            | OrientationReason::YUpFile
            | OrientationReason::Settled
            | OrientationReason::Unstable
            | OrientationReason::ChosenByModel => (),
        }
    }
    assert_eq!(json!(Orientation::AsInFile), json!("asInFile"));
    assert_eq!(json!(Orientation::StablePose(2)), json!({ "stablePose": 2 }));
    [
        union("Unit", "Unit of length of a mesh file.", &units),
        union("OrientationReason", "Reason of an orientation.", &reasons),
        "\n/**\n * Orientation of the file, or a stable pose by index; 0 is the most stable one.\n */\n\
         export type Orientation = \"asInFile\" | { stablePose: number };\n"
            .to_owned(),
    ]
    .concat()
}

/// Constants of the Rust code that the page needs before the worker runs.
fn constants() -> String {
    let extensions: Vec<&str> =
        FORMATS.iter().flat_map(|format| format.extensions).copied().collect();
    format!(
        "\n/**\n * Names of mesh formats, for messages.\n */\nexport const MESH_FORMATS = {};\n\
         \n/**\n * File extensions of mesh formats, without a dot.\n */\nexport const MESH_EXTENSIONS: readonly string[] = {};\n\
         \n/**\n * Files of a model by their name in the API.\n */\nexport const MODEL_FILES: Record<string, string> = {};\n",
        json!(mesh::format_list()),
        serde_json::to_string(&extensions).unwrap(),
        json!(BTreeMap::from(MODEL_FILES))
    )
}

fn generate() -> String {
    let config = Config::default();
    let mut out = [HEAD, &constants(), &foreign_types()].concat();
    let mut add = |declare: fn(&Config) -> String| out.push_str(&declare(&config));
    add(declare::<Phase>);
    add(declare::<PlanarPose>);
    add(declare::<Drag>);
    add(declare::<Shape>);
    add(declare::<Link>);
    add(declare::<Table>);
    add(declare::<Rectangle>);
    add(declare::<DepthCamera>);
    add(declare::<BuiltIn>);
    add(declare::<Joint>);
    add(declare::<ObjectInfo>);
    add(declare::<PlaybackInfo>);
    add(declare::<Tally>);
    add(declare::<TermNorms>);
    add(declare::<TelemetrySample>);
    add(declare::<ProgressUnit>);
    add(declare::<Ready>);
    add(declare::<ObjectLoaded>);
    add(declare::<Frame>);
    add(declare::<Cloud>);
    add(declare::<Progress>);
    add(declare::<Model>);
    add(declare::<Outcome>);
    add(declare::<AttemptFinished>);
    add(declare::<GraspsFound>);
    add(declare::<SavedFile>);
    add(declare::<Failure>);
    add(declare::<Event>);
    add(declare::<Request>);
    out
}

#[test]
fn typescript_matches_messages() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(FILE);
    let generated = generate();
    if std::env::var_os("UPDATE_EXPECT").is_some() {
        std::fs::write(&path, &generated).unwrap();
    }
    let found = std::fs::read_to_string(&path).unwrap();
    assert!(
        found == generated,
        "{FILE} is outdated; write it with UPDATE_EXPECT=1 cargo test -p wasm typescript"
    );
}
