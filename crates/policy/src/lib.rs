//! The networks as they run: point cloud -> bearing and z, and (q, q̇, z) -> q̈ with the object turned
//! to the front (paper §III-B, §III-D).
//!
//! Plain Rust with a fixed order of every sum, so that an attempt has the same bits natively and in
//! the browser. Training lives elsewhere and is held to this code by tests.

pub mod baseline;
pub mod encoder;
pub mod encoding;
pub mod fourier;
pub mod head;
pub mod lanes;
pub mod mlp;
pub mod model;
pub mod network;
pub mod ngf;
pub mod start;
pub mod weights;
pub mod whitening;

pub use encoder::{Encoder, LATENT};
pub use encoding::Encoding;
pub use model::Model;
pub use network::{Network, Observation, PolicyConfig};
pub use ngf::Ngf;
pub use start::Starts;
pub use weights::WeightsError;
pub use whitening::Whitening;
