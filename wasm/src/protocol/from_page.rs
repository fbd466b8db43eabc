//! What the page says.

use super::{PlanarPose, Pull};
use geometry::brought::Stands;
use geometry::mesh::Unit;
use serde::Deserialize;

/// From the page.
#[derive(Debug, Deserialize)]
#[serde(tag = "kind", rename_all = "camelCase", rename_all_fields = "camelCase")]
pub(crate) enum ToWorker {
    Load {
        object: String,
    },
    /// A mesh, or a demonstration or a recorded attempt (JSON).
    Upload {
        file_name: String,
        #[serde(with = "serde_bytes")]
        bytes: Vec<u8>,
        unit: Option<Unit>,
        mass_kg: Option<f32>,
        stands: Option<Stands>,
    },
    /// Act by the model of this id, gently: unless something is under way when it has come; `base` is where the page lies.
    Model {
        id: String,
        base: String,
        gently: bool,
    },
    Place {
        pose: PlanarPose,
    },
    /// The pose that an attempt with this seed draws.
    RandomPose {
        seed: u32,
    },
    Grasp {
        seed: u32,
    },
    Pause,
    Resume,
    Step,
    Reset,
    Speed {
        factor: f64,
    },
    /// Show how it was after this tick; resuming plays on from there.
    Seek {
        tick: usize,
    },
    /// Whether the moment is wanted with every frame; then those so far come, too.
    Watch {
        on: bool,
    },
    /// So many attempts of seeds from this one on, as fast as they go.
    Batch {
        seed: u32,
        attempts: u32,
        /// Said with all that comes of it.
        run: u32,
    },
    /// Pull at a point of the object (its frame) towards a point; null lets go.
    Pull {
        pull: Option<Pull>,
    },
    /// End the batch.
    Cancel,
    /// Write the attempt as a file.
    Export,
    /// Search grasps of what stands there; nothing else is heard meanwhile: a worker of its own is to be asked.
    Search {
        seed: u32,
    },
    /// An attempt with grasps that a search found.
    Follow {
        seed: u32,
        grasps: String,
        /// Hash of the object that they are of.
        object: String,
    },
    /// Panic, as a mistake in the program would: what the page makes of that can be tried.
    Panic,
}
