//! Model export: weights, start configurations and configuration.

use crate::data::demo_group::DemoGroup;
use crate::models::encoder::TrainedEncoder;
use crate::nn::Params;
use anyhow::Result;
use configs::DaggerConfig;
use files::atomic_file;
use policy::model::{CONFIG_FILE, ModelConfig, STARTS_FILE, WEIGHTS_FILE};
use policy::start_model::OBJECTS_KEY;
use robot::DOF;
use safetensors::SafeTensors;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// Contents of a model's three files.
pub struct ModelFiles {
    /// Safetensors. Encoder and decoder: half precision. Policy: half precision with a 6-bit mantissa.
    /// Whitening of z: single precision.
    pub weights: Vec<u8>,
    /// Safetensors, half precision: start configurations with the z of their demonstrations, and the object
    /// names.
    pub starts: Vec<u8>,
    /// [`ModelConfig`] as JSON.
    pub config: Vec<u8>,
}

/// Max. number of exported start configurations per grasp of an object pose.
const STARTS_PER_GRASP: usize = 2;

/// Mantissa bits of exported policy weights; half precision has ten. The other bits are zero, which reduces
/// the compressed file by a fifth, from 11.1 MB to 8.9 MB.
const MANTISSA_BITS: u32 = 6;

/// Builds the three files of a model.
pub fn model_files(
    encoder: &TrainedEncoder,
    policy: &Params,
    config: &DaggerConfig,
    groups: &[DemoGroup],
) -> Result<ModelFiles> {
    let whitening = encoder.whitening.tensors();
    let policy = policy.round_mantissa(MANTISSA_BITS)?.export(&[])?;
    let weights = merge_safetensors(&[encoder.params.export(&whitening)?, policy], None)?;
    let (mut z, mut q) = (Vec::new(), Vec::new());
    let mut objects: Vec<(&str, usize)> = Vec::new();
    for group in groups.iter().filter(|group| group.has_starts) {
        for trajectory in 0..group.demonstrations.num_trajectories().min(STARTS_PER_GRASP) {
            let (first, _) = group.demonstrations.row_range(trajectory);
            let observation = &group.encodings[0];
            z.extend(observation.features());
            let start = observation.to_canonical(&group.demonstrations.state(first).q);
            q.extend(start.iter().map(|x| *x as f32));
            match objects.last_mut().filter(|(name, _)| *name == &*group.object) {
                Some((_, count)) => *count += 1,
                None => objects.push((&group.object, 1)),
            }
        }
    }
    let count = q.len() / DOF;
    let mut table = Params::default();
    table.add("starts.z", &[count, config.policy.observation.num_features()], z)?;
    table.add("starts.q", &[count, DOF], q)?;
    let metadata = HashMap::from([(OBJECTS_KEY.to_owned(), serde_json::to_string(&objects)?)]);
    let starts = merge_safetensors(&[table.export(&[])?], Some(metadata))?;
    let config = serde_json::to_vec_pretty(&ModelConfig::new(config.policy.clone()))?;
    Ok(ModelFiles { weights, starts, config })
}

/// Exports a model to the folder `out`, see [`policy::model::MODEL_FILES`].
pub fn write_model(
    out: &Path,
    encoder: &TrainedEncoder,
    policy: &Params,
    config: &DaggerConfig,
    groups: &[DemoGroup],
) -> Result<()> {
    write_files(out, &model_files(encoder, policy, config, groups)?)
}

/// Writes the three files of a model to `out`.
pub fn write_files(out: &Path, files: &ModelFiles) -> Result<()> {
    atomic_file::write(&out.join(WEIGHTS_FILE), &files.weights)?;
    atomic_file::write(&out.join(STARTS_FILE), &files.starts)?;
    atomic_file::write(&out.join(CONFIG_FILE), &files.config)
}

/// Merges several safetensors files into one, with `metadata` in its header.
fn merge_safetensors(
    files: &[Vec<u8>],
    metadata: Option<HashMap<String, String>>,
) -> Result<Vec<u8>> {
    let parsed = files
        .iter()
        .map(|bytes| Ok(SafeTensors::deserialize(bytes)?))
        .collect::<Result<Vec<_>>>()?;
    let mut views = BTreeMap::new();
    for tensors in &parsed {
        for name in tensors.names() {
            views.insert(name.to_owned(), tensors.tensor(name)?);
        }
    }
    Ok(safetensors::serialize(views, metadata)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::demo_group::mean_configuration;
    use crate::nn::networks::{self, autoencoder as net};
    use crate::train::expert::DemoTrajectories;
    use policy::{LATENT_DIM, Model, Observation, PolicyConfig, Whitening};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::{JointVector, KinematicTree};

    #[test]
    fn exported_model_returns_the_demonstrated_start_at_the_observed_azimuth() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let mut params = Params::default();
        net::init(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let encoder = TrainedEncoder { params, whitening: Whitening::identity() };
        let rows: Vec<f32> = (0..4 * DOF).map(|i| 0.3 + 0.005 * (i % DOF) as f32).collect();
        let z = vec![0.5; LATENT_DIM];
        let group = DemoGroup {
            object: "mug.1".into(),
            pose: 0,
            demonstrations: DemoTrajectories::new(rows, vec![0, 2]),
            encodings: vec![Observation { azimuth: 0.3, latent: z.clone() }],
            has_starts: true,
            neighbor_starts: Vec::new(),
        };
        let first = group.demonstrations.state(0).q;
        let mean = JointVector::from(mean_configuration(std::slice::from_ref(&group)));
        assert!((mean[0] - first[0] + 0.3).abs() < 1e-9 && (mean[5] - first[5]).abs() < 1e-9);

        let config = DaggerConfig::standard(PolicyConfig::tiny());
        let mut policy = Params::default();
        networks::init(&mut policy, &config.policy, &mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let files = model_files(&encoder, &policy, &config, &[group]).unwrap();
        let model = Model::load(&files.weights, &files.starts, &files.config, &tree).unwrap();
        for azimuth in [0.3, -0.6] {
            let observation = Observation { azimuth, latent: z.clone() };
            let start = model
                .start_model
                .find(&observation, &tree.forward_kinematics(&first).palm_pose())
                .unwrap();
            assert!((start[0] - first[0] - (azimuth - 0.3)).abs() < 1e-3, "{}", start[0]);
            assert!((start - first).rows(1, DOF - 1).amax() < 1e-3);
        }
        // The nearest training object, with its distance in z.
        let other = vec![0.75; LATENT_DIM];
        let (object, distance) = model.start_model.nearest_training_object(&other).unwrap();
        assert!(object == "mug.1" && (distance - 0.25 * (LATENT_DIM as f32).sqrt()).abs() < 1e-5);
    }
}
