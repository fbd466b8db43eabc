//! `ngf mesh inspect`: summary of a mesh file, and its convex decomposition for physics.

use crate::mesh_file::{MeshFile, MeshSizeOptions, import_error};
use anyhow::Result;
use files::atomic_file;
use mesh::{ConvexDecomposition, MeshSummary, Method, VolumeSource};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Inspection of mesh files.
#[derive(clap::Subcommand)]
pub(crate) enum MeshCommand {
    /// Print size, volume, defects and convex decomposition of a mesh file
    Inspect(InspectArgs),
}

/// Input file and output folder.
#[derive(clap::Args)]
pub(crate) struct InspectArgs {
    #[arg(help = format!("Mesh file: {}, or a ZIP archive with one", mesh::format_list()))]
    file: PathBuf,
    #[command(flatten)]
    size: MeshSizeOptions,
    /// Output folder for mesh_summary.json and parts.obj (one OBJ object per convex part)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Print the content of mesh_summary.json instead of text
    #[arg(long)]
    json: bool,
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
    let file = MeshFile::open(&options.file)?;
    let invalid = |error| import_error(&options.file, error);
    let import = mesh::import_with_files(&file.bytes, &options.size.mesh_options(), &file.files());
    let import = import.map_err(invalid)?;
    let summary = MeshSummary::of(&import).map_err(invalid)?;
    let parts = mesh::decompose(&import.mesh);
    let json = summary_json(&summary, &parts)?;
    match options.json {
        true => println!("{}", serde_json::to_string_pretty(&json)?),
        false => print_summary(&summary, &parts),
    }
    match &options.out {
        Some(out) => write_files(out, &json, &parts),
        None => Ok(()),
    }
}

fn print_summary(summary: &MeshSummary, parts: &ConvexDecomposition) {
    let [x, y, z] = summary.extent_m.map(|side| 100.0 * side);
    println!("{x:.1} x {y:.1} x {z:.1} cm: {}", summary.unit_reason);
    let closed = if summary.watertight { "watertight" } else { "not watertight" };
    if let Some(from) = summary.simplified_from {
        println!("simplified from {from} triangles");
    }
    println!(
        "{} triangles, {closed}; {:.0} cm³{}; {} convex parts, which fill {:.1} % of the hollows",
        summary.triangles,
        1e6 * summary.volume_m3,
        volume_note(summary.volume_source),
        parts.hulls.len(),
        100.0 * parts.filled_fraction
    );
    if summary.removed_debris > 0 {
        println!("pieces of debris removed: {}", summary.removed_debris);
    }
    if summary.filled_holes > 0 {
        println!("small holes closed: {}", summary.filled_holes);
    }
    if summary.appears_y_up {
        println!("the file appears to be y-up; if it is not, give --up");
    }
}

/// Content of `mesh_summary.json`.
fn summary_json(summary: &MeshSummary, parts: &ConvexDecomposition) -> Result<Value> {
    let method = match parts.method {
        Method::Planes => "planes",
        Method::Hull => "hull",
    };
    let mut summary = serde_json::to_value(summary)?;
    summary["convex_parts"] = json!({
        "count": parts.hulls.len(),
        "method": method,
        "filled_fraction": parts.filled_fraction,
    });
    Ok(summary)
}

/// Writes `mesh_summary.json` and `parts.obj`.
fn write_files(out: &Path, summary: &Value, parts: &ConvexDecomposition) -> Result<()> {
    atomic_file::write(&out.join("mesh_summary.json"), &serde_json::to_vec_pretty(summary)?)?;
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

/// Note on the solid whose volume is printed; empty for a closed surface.
fn volume_note(source: VolumeSource) -> &'static str {
    match source {
        VolumeSource::Surface => "",
        VolumeSource::ClosedSurfaces => " (without open surfaces)",
        VolumeSource::Union => " (common volume of overlapping solids counted once)",
        VolumeSource::ConvexParts => " (convex parts)",
        VolumeSource::Hull => " (convex hull)",
    }
}
