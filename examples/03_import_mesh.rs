//! Imports a mesh file: unit, repairs, mass, orientation and convex parts.
//!
//! `cargo run -p examples --example 03_import_mesh [FILE]`

use objects::import::{ImportContext, ImportOptions, import_object};
use scene::{SceneConfig, rests_on_table};

/// A box of 60 x 40 x 120 mm, in millimetres, as OBJ.
const BOX: &str = "v 0 0 0\nv 60 0 0\nv 60 40 0\nv 0 40 0\nv 0 0 120\nv 60 0 120\nv 60 40 120\n\
                   v 0 40 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

fn main() -> anyhow::Result<()> {
    let (name, bytes) = match std::env::args().nth(1) {
        Some(path) => (path.clone(), std::fs::read(path)?),
        None => ("box.obj".into(), BOX.as_bytes().to_vec()),
    };
    // Options override the defaults for unit, size, mass and orientation.
    let options = ImportOptions { mass: Some(0.25), ..ImportOptions::default() };
    // A stable pose is offered only if the object stays in it in the simulation.
    let config = SceneConfig::standard()?;
    let rests = |object: &_| rests_on_table(&config, object);
    let context = ImportContext { rests: &rests, ..ImportContext::NONE };
    let imported = import_object(&name, &bytes, options, &context)?;

    let object = &imported.object;
    println!("{name}: {}", imported.unit.reason);
    println!("size {:.3?} m, mass {} kg", object.size().to_array(), object.mass);
    println!(
        "watertight: {}, {} triangles",
        imported.repair.watertight,
        object.mesh.triangles.len()
    );
    println!("{} stable poses, orientation {:?}", imported.num_stable_poses, imported.orientation);
    println!("{} convex parts", object.parts.len());

    // The mesh library alone knows nothing of this project.
    let properties = mesh::solid_properties(&object.mesh, imported.repair.watertight)?;
    println!("volume {:.1} cm³", 1e6 * properties.volume);
    Ok(())
}
