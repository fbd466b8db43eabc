//! `ngf mesh inspect`: summary of a mesh file, and its convex decomposition for physics.

use crate::object_selection::read_mesh_file;
use anyhow::{Context, Result};
use files::atomic_file;
use mesh::{MeshSummary, Method};
use serde_json::json;
use std::fmt::Write;
use std::path::PathBuf;

/// Inspection of mesh files.
#[derive(clap::Subcommand)]
pub(crate) enum MeshCommand {
    /// Print size, volume, defects and convex decomposition of a mesh file
    Inspect(InspectArgs),
}

/// Input file and output folder.
#[derive(clap::Args)]
pub(crate) struct InspectArgs {
    #[arg(help = format!("Mesh file: {}", mesh::format_list()))]
    file: PathBuf,
    /// Output folder for mesh_summary.json and parts.obj (one OBJ object per convex part)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

/// Maximum vertices of a written convex part.
const MAX_HULL_VERTICES: usize = 256;

/// Runs the selected subcommand.
pub(crate) fn run(command: &MeshCommand) -> Result<()> {
    match command {
        MeshCommand::Inspect(options) => inspect(options),
    }
}

fn inspect(options: &InspectArgs) -> Result<()> {
    let file = &options.file;
    let invalid = || format!("{} is not a usable mesh", file.display());
    let bytes = read_mesh_file(file).with_context(|| format!("cannot read {}", file.display()))?;
    let import = mesh::import(&bytes, None).with_context(invalid)?;
    let summary = MeshSummary::of(&import).with_context(invalid)?;
    let parts = mesh::decompose(&import.mesh);
    let [x, y, z] = summary.extent_m.map(|side| 100.0 * side);
    println!("{x:.1} x {y:.1} x {z:.1} cm: {}", summary.unit_reason);
    let closed = if summary.watertight { "watertight" } else { "not watertight" };
    if let Some(from) = summary.simplified_from {
        println!("simplified from {from} triangles");
    }
    println!(
        "{} triangles, {closed}; {:.0} cm³{}; {} convex parts",
        summary.triangles,
        1e6 * summary.volume_m3,
        if summary.volume_from_hull { " (convex hull)" } else { "" },
        parts.hulls.len()
    );
    let Some(out) = &options.out else { return Ok(()) };
    let method = match parts.method {
        Method::Grid { resolution } => json!({ "name": "grid", "resolution": resolution }),
        Method::Hull => json!({ "name": "hull" }),
    };
    let mut summary = serde_json::to_value(&summary)?;
    summary["convex_parts"] = json!({ "count": parts.hulls.len(), "method": method });
    atomic_file::write(&out.join("mesh_summary.json"), &serde_json::to_vec_pretty(&summary)?)?;
    let mut text = String::new();
    let mut first = 1;
    for (i, part) in parts.hulls.iter().enumerate() {
        let Some(hull) = mesh::convex_hull(part, MAX_HULL_VERTICES) else { continue };
        writeln!(text, "o part_{i}")?;
        for v in &hull.vertices {
            writeln!(text, "v {} {} {}", v.x, v.y, v.z)?;
        }
        for [a, b, c] in &hull.triangles {
            writeln!(text, "f {} {} {}", a + first, b + first, c + first)?;
        }
        first += hull.vertices.len() as u32;
    }
    atomic_file::write(&out.join("parts.obj"), text.as_bytes())
}
