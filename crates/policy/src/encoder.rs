//! Point cloud encoder (point cloud -> z) of PointNet layers, and its decoder (paper §III-D).
//!
//! A cloud is in farthest-point order: each point is the one farthest from all points before it.
//!
//! One set-abstraction layer over neighbourhoods of 16 points, a second layer per neighbourhood, the maximum
//! over all of them, and a two-layer read-out. The first 128 points are the neighbourhood centres. z depends
//! on the choice of these points, but not on their order or on that of the other points. (Exception: two
//! points at the same distance from a centre.)

use crate::LATENT_DIM;
use crate::networks::mlp::{Activation, Mlp};
use crate::observation::{self, Observation};
use crate::weights::{Tensors, WeightsError};
use crate::whitening::Whitening;
use geometry::Vec3;

/// Number of points of a cloud.
pub const CLOUD_POINTS: usize = 512;
/// Number of neighbourhood centres: the first points of a cloud in farthest-point order.
pub const NUM_CENTERS: usize = 128;
/// Number of points in a neighbourhood.
pub const NUM_NEIGHBORS: usize = 16;
/// Scale (m) of offsets within a neighbourhood.
pub const LOCAL_SCALE: f32 = 0.02;
/// Centre of the workspace (m, base frame).
pub const WORKSPACE_CENTER: [f32; 3] = [0.6, 0.0, -0.15];
/// Scale (m) of positions in the workspace.
pub const WORKSPACE_SCALE: f32 = 0.2;

/// Layer widths of the MLP that is shared by all neighbours; inputs: offset and centre.
pub const LOCAL_WIDTHS: [usize; 3] = [6, 32, 64];
/// Layer widths of the MLP that is shared by all neighbourhoods; inputs: neighbourhood feature and centre.
pub const GLOBAL_WIDTHS: [usize; 3] = [67, 64, 256];
/// Layer widths of the read-out.
pub const READOUT_WIDTHS: [usize; 3] = [256, 128, LATENT_DIM];
/// Layer widths of the decoder.
pub const DECODER_WIDTHS: [usize; 4] = [LATENT_DIM, 256, 256, 3 * CLOUD_POINTS];

/// Activation of encoder and decoder, as in PointNet.
pub const ENCODER_ACTIVATION: Activation = Activation::Relu;

/// The encoder, with the whitening of z.
#[derive(Clone, Debug)]
pub struct Encoder {
    local: Mlp,
    global: Mlp,
    readout: Mlp,
    whitening: Whitening,
}

/// The decoder: z -> 512 points.
#[derive(Clone, Debug)]
pub struct Decoder {
    mlp: Mlp,
    whitening: Whitening,
}

/// Neighbourhoods of a cloud: for each centre, the indices of its nearest points.
pub fn neighborhoods(cloud: &[Vec3]) -> Vec<[usize; NUM_NEIGHBORS]> {
    cloud[..NUM_CENTERS.min(cloud.len())]
        .iter()
        .map(|center| {
            let mut nearest = [(f32::INFINITY, 0usize); NUM_NEIGHBORS];
            for (i, point) in cloud.iter().enumerate() {
                let distance = center.distance_squared(*point);
                if distance < nearest[NUM_NEIGHBORS - 1].0 {
                    let slot = nearest.partition_point(|n| n.0 <= distance);
                    nearest[slot..].rotate_right(1);
                    nearest[slot] = (distance, i);
                }
            }
            nearest.map(|n| n.1)
        })
        .collect()
}

/// Inputs of the local MLP for one neighbour: scaled offset, scaled centre.
pub fn local_input(center: Vec3, point: Vec3) -> [f32; 6] {
    let offset = (point - center) / LOCAL_SCALE;
    let place = normalized_position(center);
    [offset.x, offset.y, offset.z, place[0], place[1], place[2]]
}

/// A position (m) in workspace units: centred and scaled.
pub fn normalized_position(point: Vec3) -> [f32; 3] {
    ((point - Vec3::from_array(WORKSPACE_CENTER)) / WORKSPACE_SCALE).to_array()
}

impl Encoder {
    /// Loads the encoder's layers and the whitening of z.
    pub fn load(tensors: &Tensors) -> Result<Self, WeightsError> {
        Ok(Self {
            local: Mlp::load(tensors, "encoder.local", &LOCAL_WIDTHS, ENCODER_ACTIVATION)?,
            global: Mlp::load(tensors, "encoder.global", &GLOBAL_WIDTHS, ENCODER_ACTIVATION)?,
            readout: Mlp::load(tensors, "encoder.readout", &READOUT_WIDTHS, ENCODER_ACTIVATION)?,
            whitening: Whitening::load(tensors)?,
        })
    }

    /// Encodes a cloud (m, base frame) in farthest-point order; `None` if it is empty.
    pub fn encode(&self, cloud: &[Vec3]) -> Option<Observation> {
        let (azimuth, canonical) = observation::canonicalize(cloud);
        Some(Observation {
            azimuth,
            latent: self.whitening.apply(&self.encode_unwhitened(&canonical)?),
        })
    }

    /// z before whitening, of a cloud (m) in the canonical frame; `None` if it is empty.
    pub fn encode_unwhitened(&self, cloud: &[Vec3]) -> Option<Vec<f32>> {
        if cloud.is_empty() {
            return None;
        }
        let mut max_features = vec![f32::NEG_INFINITY; GLOBAL_WIDTHS[2]];
        for (center, neighbors) in cloud.iter().zip(neighborhoods(cloud)) {
            let inputs = neighbors.map(|i| local_input(*center, cloud[i]));
            let mut feature = vec![f32::NEG_INFINITY; LOCAL_WIDTHS[2]];
            for of_neighbor in
                apply_activated(&self.local, inputs.as_flattened()).chunks(feature.len())
            {
                max_in_place(&mut feature, of_neighbor);
            }
            feature.extend(normalized_position(*center));
            max_in_place(&mut max_features, &apply_activated(&self.global, &feature));
        }
        Some(self.readout.apply(&max_features))
    }
}

impl Decoder {
    /// Loads the decoder's layers and the whitening of z.
    pub fn load(tensors: &Tensors) -> Result<Self, WeightsError> {
        Ok(Self {
            mlp: Mlp::load(tensors, "decoder", &DECODER_WIDTHS, ENCODER_ACTIVATION)?,
            whitening: Whitening::load(tensors)?,
        })
    }

    /// Decodes a whitened z to a cloud (m) in the canonical frame.
    pub fn decode(&self, z: &[f32]) -> Vec<Vec3> {
        points_from_output(&self.mlp.apply(&self.whitening.inverse(z)))
    }
}

/// Converts decoder outputs, positions in workspace units, to points (m).
pub fn points_from_output(positions: &[f32]) -> Vec<Vec3> {
    let middle = Vec3::from_array(WORKSPACE_CENTER);
    let points = positions.chunks_exact(3);
    points.map(|p| middle + Vec3::from_slice(p) * WORKSPACE_SCALE).collect()
}

/// Outputs of the layers for a batch, with the activation also after the last one.
fn apply_activated(mlp: &Mlp, x: &[f32]) -> Vec<f32> {
    mlp.apply(x).into_iter().map(|y| mlp.activation.apply(y)).collect()
}

fn max_in_place(largest: &mut [f32], values: &[f32]) {
    for (largest, value) in largest.iter_mut().zip(values) {
        *largest = largest.max(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks::mlp::Dense;

    fn mlp(widths: &[usize]) -> Mlp {
        let wave = |k: usize| libm::sinf((k * k + 7 * k + widths[0]) as f32);
        let dense = |pair: &[usize]| Dense {
            weight: (0..pair[0] * pair[1])
                .map(|k| half::f16::from_f32(wave(k) / (pair[0] as f32).sqrt()))
                .collect(),
            bias: (0..pair[1]).map(|k| 0.1 * wave(k + 3)).collect(),
        };
        Mlp { layers: widths.windows(2).map(dense).collect(), activation: ENCODER_ACTIVATION }
    }

    fn encoder() -> Encoder {
        Encoder {
            local: mlp(&LOCAL_WIDTHS),
            global: mlp(&GLOBAL_WIDTHS),
            readout: mlp(&READOUT_WIDTHS),
            whitening: Whitening::identity(),
        }
    }

    /// A cloud without two points at the same distance from a third.
    fn cloud() -> Vec<Vec3> {
        let wave = |k: usize| libm::sinf((k * k % 977) as f32 * 1.7 + k as f32);
        (0..CLOUD_POINTS)
            .map(|k| {
                Vec3::from_array(WORKSPACE_CENTER)
                    + 0.1 * Vec3::new(wave(3 * k), wave(3 * k + 1), wave(3 * k + 2))
            })
            .collect()
    }

    #[test]
    fn encoding_ignores_order_within_centers_and_within_other_points() {
        let (encoder, mut cloud) = (encoder(), cloud());
        let z = encoder.encode_unwhitened(&cloud).unwrap();
        assert!(z.len() == LATENT_DIM && z.iter().all(|z| z.is_finite()));
        cloud[NUM_CENTERS..].reverse();
        assert_eq!(encoder.encode_unwhitened(&cloud).unwrap(), z, "other points reversed");
        cloud[..NUM_CENTERS].rotate_left(40);
        cloud[NUM_CENTERS..].swap(0, 200);
        assert_eq!(encoder.encode_unwhitened(&cloud).unwrap(), z, "centres rotated");
    }

    #[test]
    fn encoding_depends_on_choice_of_centers() {
        let (encoder, mut cloud) = (encoder(), cloud());
        let z = encoder.encode_unwhitened(&cloud).unwrap();
        for k in 0..NUM_CENTERS {
            cloud.swap(k, NUM_CENTERS + k);
        }
        assert_ne!(encoder.encode_unwhitened(&cloud).unwrap(), z);
    }

    #[test]
    fn encoding_depends_on_position_of_cloud() {
        let (encoder, cloud) = (encoder(), cloud());
        let shifted: Vec<Vec3> = cloud.iter().map(|p| *p + Vec3::X * 0.05).collect();
        assert_ne!(
            encoder.encode_unwhitened(&shifted),
            encoder.encode_unwhitened(&cloud),
            "z must depend on the position of the cloud"
        );
    }

    #[test]
    fn encoding_is_invariant_to_azimuth() {
        let (encoder, cloud) = (encoder(), cloud());
        let canonical = encoder.encode(&cloud).unwrap();
        let turn = geometry::Pose::new(Vec3::ZERO, Vec3::Z * 0.4);
        let turned: Vec<Vec3> = cloud.iter().map(|p| turn * *p).collect();
        let other = encoder.encode(&turned).unwrap();
        assert!((other.azimuth - canonical.azimuth - 0.4).abs() < 1e-5);
        let size = canonical.latent.iter().map(|z| z.abs()).fold(0.0, f32::max);
        let error = canonical
            .latent
            .iter()
            .zip(&other.latent)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(error < 1e-3 * size, "error {error}, magnitude {size}");
        let moved = encoder.encode_unwhitened(&turned).unwrap();
        let raw = encoder.encode_unwhitened(&cloud).unwrap();
        let difference = raw.iter().zip(&moved).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(
            difference > 0.01 * size,
            "z must depend on a rotation of the raw cloud: {difference} of {size}"
        );
    }

    #[test]
    fn neighborhoods_are_nearest_points_with_center_first() {
        let cloud = cloud();
        let all = neighborhoods(&cloud);
        assert_eq!(all.len(), NUM_CENTERS);
        for (center, neighbors) in all.iter().enumerate() {
            assert_eq!(neighbors[0], center);
            let distance = |i: usize| cloud[center].distance_squared(cloud[i]);
            let max_distance = distance(neighbors[NUM_NEIGHBORS - 1]);
            assert!(neighbors.is_sorted_by(|a, b| distance(*a) <= distance(*b)));
            let nearer = (0..CLOUD_POINTS).filter(|i| distance(*i) < max_distance).count();
            assert_eq!(nearer, NUM_NEIGHBORS - 1);
        }
    }

    #[test]
    fn small_cloud_is_encoded_and_empty_cloud_is_not() {
        let encoder = encoder();
        assert!(encoder.encode(&[]).is_none());
        let z = encoder.encode(&cloud()[..1]).unwrap();
        assert!(z.latent.iter().all(|z| z.is_finite()), "{z:?}");
    }
}
