//! `ngf mesh`: what a mesh file is to this program, and the convex parts that physics takes for it.

use crate::objects::read;
use anyhow::{Context, Result};
use dataset::store;
use geometry::mesh::{self, Method, Report};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Which file, and where to write what was found.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Mesh file: OBJ, STL, PLY, OFF, GLB or glTF.
    file: PathBuf,
    /// Folder for report.json and parts.obj, the convex parts as an object each.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Corners of a hull that is written; its part may have fewer.
const HULL_POINTS: usize = 256;

/// Reads the file and says what it is.
pub(crate) fn run(options: &Options) -> Result<()> {
    let file = &options.file;
    let unusable = || format!("{} cannot be used", file.display());
    let bytes = read(file).with_context(|| format!("cannot read {}", file.display()))?;
    let import = mesh::import(&bytes, None).with_context(unusable)?;
    let report = Report::of(&import).with_context(unusable)?;
    let parts = mesh::convex_parts_or_hull(&import.mesh);
    let [x, y, z] = report.extent_m.map(|side| 100.0 * side);
    println!("{x:.1} x {y:.1} x {z:.1} cm: {}", report.reason);
    let closed = if report.watertight { "closed" } else { "open" };
    if let Some(from) = report.simplified_from {
        println!("{from} triangles are too many, and were made fewer");
    }
    println!(
        "{} triangles, {closed}; {:.0} cm³{}; {} convex parts",
        report.triangles,
        1e6 * report.volume_m3,
        if report.weighed_by_hull { " of its hull" } else { "" },
        parts.hulls.len()
    );
    let Some(out) = &options.out else { return Ok(()) };
    let method = match parts.method {
        Method::Decomposed { resolution } => json!({ "name": "cut", "resolution": resolution }),
        Method::Hull => json!({ "name": "hull" }),
    };
    let mut told = serde_json::to_value(&report)?;
    told["parts"] = json!({ "count": parts.hulls.len(), "method": method });
    store::write(&out.join("report.json"), &serde_json::to_vec_pretty(&told)?)?;
    let mut text = String::new();
    let mut first = 1;
    for (i, part) in parts.hulls.iter().enumerate() {
        let Some(hull) = mesh::hull(part, HULL_POINTS) else { continue };
        writeln!(text, "o part_{i}")?;
        for v in &hull.vertices {
            writeln!(text, "v {} {} {}", v.x, v.y, v.z)?;
        }
        for [a, b, c] in &hull.triangles {
            writeln!(text, "f {} {} {}", a + first, b + first, c + first)?;
        }
        first += hull.vertices.len() as u32;
    }
    store::write(&out.join("parts.obj"), text.as_bytes())
}
