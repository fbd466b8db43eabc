//! The encoder: point cloud -> z by PointNet layers, and the decoder back (paper §III-D).
//!
//! A set-abstraction layer over neighbourhoods of 16 points, a second layer per neighbourhood, the
//! maximum over all of them, and a read-out of two layers. The first 128 points are the centres of the
//! neighbourhoods: z depends on which points come first, but neither on their order nor on that of the
//! others (where no two points are equally far from a centre).

use crate::encoding::{self, Encoding};
use crate::mlp::{Activation, Mlp};
use crate::weights::{Tensors, WeightsError};
use crate::whitening::Whitening;
use geometry::Vec3;

/// Length of z.
pub const LATENT: usize = 32;
/// Points of a cloud.
pub const CLOUD: usize = 512;
/// Neighbourhood centres: the first points of a cloud in farthest-point order.
pub const CENTERS: usize = 128;
/// Points in a neighbourhood.
pub const NEIGHBORS: usize = 16;
/// Scale (m) of offsets within a neighbourhood.
pub const LOCAL_SCALE: f32 = 0.02;
/// Middle of the workspace (m), base frame.
pub const WORKSPACE_MIDDLE: [f32; 3] = [0.6, 0.0, -0.15];
/// Scale (m) of positions in the workspace.
pub const WORKSPACE_SCALE: f32 = 0.2;

/// Widths of the shared layers on (offset, centre) of each neighbour.
pub const LOCAL_WIDTHS: [usize; 3] = [6, 32, 64];
/// Widths of the shared layers on (neighbourhood feature, centre).
pub const GLOBAL_WIDTHS: [usize; 3] = [67, 64, 256];
/// Widths of the read-out.
pub const READOUT_WIDTHS: [usize; 3] = [256, 128, LATENT];
/// Widths of the decoder.
pub const DECODER_WIDTHS: [usize; 4] = [LATENT, 256, 256, 3 * CLOUD];

/// What stands between the layers: PointNet's.
pub const RELU: Activation = Activation::Relu;

/// The encoder with the whitening of z.
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

/// Neighbourhoods of a cloud: for each centre the indices of its nearest points.
pub fn neighborhoods(cloud: &[Vec3]) -> Vec<[usize; NEIGHBORS]> {
    cloud[..CENTERS.min(cloud.len())]
        .iter()
        .map(|center| {
            let mut nearest = [(f32::INFINITY, 0usize); NEIGHBORS];
            for (i, point) in cloud.iter().enumerate() {
                let distance = center.distance_squared(*point);
                if distance < nearest[NEIGHBORS - 1].0 {
                    let slot = nearest.partition_point(|n| n.0 <= distance);
                    nearest[slot..].rotate_right(1);
                    nearest[slot] = (distance, i);
                }
            }
            nearest.map(|n| n.1)
        })
        .collect()
}

/// Inputs of the local layers for one neighbour: scaled offset, scaled centre.
pub fn local_input(center: Vec3, point: Vec3) -> [f32; 6] {
    let offset = (point - center) / LOCAL_SCALE;
    let place = global_position(center);
    [offset.x, offset.y, offset.z, place[0], place[1], place[2]]
}

/// A position in units of the workspace.
pub fn global_position(point: Vec3) -> [f32; 3] {
    ((point - Vec3::from_array(WORKSPACE_MIDDLE)) / WORKSPACE_SCALE).to_array()
}

impl Encoder {
    /// Reads the encoder's layers and the whitening of z.
    pub fn load(tensors: &Tensors) -> Result<Self, WeightsError> {
        Ok(Self {
            local: Mlp::load(tensors, "encoder.local", &LOCAL_WIDTHS, RELU)?,
            global: Mlp::load(tensors, "encoder.global", &GLOBAL_WIDTHS, RELU)?,
            readout: Mlp::load(tensors, "encoder.readout", &READOUT_WIDTHS, RELU)?,
            whitening: Whitening::load(tensors)?,
        })
    }

    /// Encodes a cloud (base frame) in farthest-point order; `None` if it is empty.
    pub fn encode(&self, cloud: &[Vec3]) -> Option<Encoding> {
        let (bearing, front) = encoding::to_front(cloud);
        Some(Encoding { bearing, z: self.whitening.apply(&self.raw(&front)?) })
    }

    /// z of a cloud that has been turned to the front, as the autoencoder knows it.
    pub fn raw(&self, cloud: &[Vec3]) -> Option<Vec<f32>> {
        if cloud.is_empty() {
            return None;
        }
        let mut strongest = vec![f32::NEG_INFINITY; GLOBAL_WIDTHS[2]];
        for (center, neighbors) in cloud.iter().zip(neighborhoods(cloud)) {
            let mut feature = vec![f32::NEG_INFINITY; LOCAL_WIDTHS[2]];
            for i in neighbors {
                keep_largest(
                    &mut feature,
                    &activated(&self.local, &local_input(*center, cloud[i])),
                );
            }
            feature.extend(global_position(*center));
            keep_largest(&mut strongest, &activated(&self.global, &feature));
        }
        Some(self.readout.apply(&strongest))
    }
}

impl Decoder {
    /// Reads the decoder's layers and the whitening of z.
    pub fn load(tensors: &Tensors) -> Result<Self, WeightsError> {
        Ok(Self {
            mlp: Mlp::load(tensors, "decoder", &DECODER_WIDTHS, RELU)?,
            whitening: Whitening::load(tensors)?,
        })
    }

    /// The cloud, turned to the front, that a whitened z stands for.
    pub fn decode(&self, z: &[f32]) -> Vec<Vec3> {
        cloud_of(&self.mlp.apply(&self.whitening.undo(z)))
    }
}

/// The cloud (m, base frame) whose positions in the workspace a decoder gives one after another.
pub fn cloud_of(positions: &[f32]) -> Vec<Vec3> {
    let middle = Vec3::from_array(WORKSPACE_MIDDLE);
    let points = positions.chunks_exact(3);
    points.map(|p| middle + Vec3::from_slice(p) * WORKSPACE_SCALE).collect()
}

/// Layers with the activation after the last one too.
fn activated(mlp: &Mlp, x: &[f32]) -> Vec<f32> {
    mlp.apply(x).into_iter().map(|y| mlp.activation.apply(y)).collect()
}

fn keep_largest(largest: &mut [f32], values: &[f32]) {
    for (largest, value) in largest.iter_mut().zip(values) {
        *largest = largest.max(*value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mlp::Dense;

    fn mlp(widths: &[usize]) -> Mlp {
        let wave = |k: usize| libm::sinf((k * k + 7 * k + widths[0]) as f32);
        let dense = |pair: &[usize]| Dense {
            weight: (0..pair[0] * pair[1])
                .map(|k| half::f16::from_f32(wave(k) / (pair[0] as f32).sqrt()))
                .collect(),
            bias: (0..pair[1]).map(|k| 0.1 * wave(k + 3)).collect(),
        };
        Mlp { layers: widths.windows(2).map(dense).collect(), activation: RELU }
    }

    fn encoder() -> Encoder {
        Encoder {
            local: mlp(&LOCAL_WIDTHS),
            global: mlp(&GLOBAL_WIDTHS),
            readout: mlp(&READOUT_WIDTHS),
            whitening: Whitening::identity(),
        }
    }

    /// Points of which no two have the same distance from a third.
    fn cloud() -> Vec<Vec3> {
        let wave = |k: usize| libm::sinf((k * k % 977) as f32 * 1.7 + k as f32);
        (0..CLOUD)
            .map(|k| {
                Vec3::from_array(WORKSPACE_MIDDLE)
                    + 0.1 * Vec3::new(wave(3 * k), wave(3 * k + 1), wave(3 * k + 2))
            })
            .collect()
    }

    #[test]
    fn the_order_of_centers_and_of_the_others_does_not_matter() {
        let (encoder, mut cloud) = (encoder(), cloud());
        let z = encoder.raw(&cloud).unwrap();
        assert!(z.len() == LATENT && z.iter().all(|z| z.is_finite()));
        cloud[CENTERS..].reverse();
        assert_eq!(encoder.raw(&cloud).unwrap(), z, "the others reversed");
        cloud[..CENTERS].rotate_left(40);
        cloud[CENTERS..].swap(0, 200);
        assert_eq!(encoder.raw(&cloud).unwrap(), z, "the centres rotated");
    }

    #[test]
    fn it_matters_which_points_are_centers() {
        let (encoder, mut cloud) = (encoder(), cloud());
        let z = encoder.raw(&cloud).unwrap();
        for k in 0..CENTERS {
            cloud.swap(k, CENTERS + k);
        }
        assert_ne!(encoder.raw(&cloud).unwrap(), z);
    }

    #[test]
    fn a_point_stands_for_its_place() {
        let (encoder, cloud) = (encoder(), cloud());
        let shifted: Vec<Vec3> = cloud.iter().map(|p| *p + Vec3::X * 0.05).collect();
        assert_ne!(encoder.raw(&shifted), encoder.raw(&cloud), "z tells where the cloud is");
    }

    #[test]
    fn a_cloud_that_is_turned_about_the_robot_has_the_same_z() {
        let (encoder, cloud) = (encoder(), cloud());
        let front = encoder.encode(&cloud).unwrap();
        let turn = geometry::Pose::new(Vec3::ZERO, Vec3::Z * 0.4);
        let turned: Vec<Vec3> = cloud.iter().map(|p| turn * *p).collect();
        let other = encoder.encode(&turned).unwrap();
        assert!((other.bearing - front.bearing - 0.4).abs() < 1e-5);
        let size = front.z.iter().map(|z| z.abs()).fold(0.0, f32::max);
        let off = front.z.iter().zip(&other.z).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(off < 1e-3 * size, "off by {off} of {size}");
        let moved = encoder.raw(&turned).unwrap();
        let raw = encoder.raw(&cloud).unwrap();
        let apart = raw.iter().zip(&moved).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        assert!(apart > 0.01 * size, "z would not tell a turn: {apart} of {size}");
    }

    #[test]
    fn neighborhoods_are_the_nearest_points_with_the_center_first() {
        let cloud = cloud();
        let all = neighborhoods(&cloud);
        assert_eq!(all.len(), CENTERS);
        for (center, neighbors) in all.iter().enumerate() {
            assert_eq!(neighbors[0], center);
            let distance = |i: usize| cloud[center].distance_squared(cloud[i]);
            let farthest = distance(neighbors[NEIGHBORS - 1]);
            assert!(neighbors.is_sorted_by(|a, b| distance(*a) <= distance(*b)));
            let nearer = (0..CLOUD).filter(|i| distance(*i) < farthest).count();
            assert_eq!(nearer, NEIGHBORS - 1);
        }
    }

    #[test]
    fn few_points_have_an_encoding_and_none_have_not() {
        let encoder = encoder();
        assert!(encoder.encode(&[]).is_none());
        let z = encoder.encode(&cloud()[..1]).unwrap();
        assert!(z.z.iter().all(|z| z.is_finite()), "{z:?}");
    }
}
