//! Inference of the policies: point cloud -> azimuth and z, then (q, q̇, z) -> q̈ in the canonical frame, in
//! which the object is at azimuth 0 (paper §III-B, §III-D).
//!
//! Plain Rust with a fixed order of every sum, so that an attempt has the same bits natively and in the
//! browser. Training uses other code, in `imitation`; tests compare both.

pub mod encoder;
pub mod model;
pub mod networks;
pub mod observation;
pub mod simd;
pub mod start_model;
pub mod weights;
pub mod whitening;

pub use encoder::Encoder;
pub use model::Model;
pub use networks::ngf::Ngf;
pub use networks::{Network, ObservationKind, PolicyConfig};
pub use observation::Observation;
pub use start_model::StartModel;
pub use weights::WeightsError;
pub use whitening::Whitening;

/// Dimension of z.
pub const LATENT_DIM: usize = 32;
