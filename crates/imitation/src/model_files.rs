//! The files of a model: weights, starts, configuration.

use crate::dagger::DaggerConfig;
use crate::encoder::TrainedEncoder;
use crate::lesson::Lesson;
use crate::nn::Params;
use anyhow::Result;
use dataset::store;
use policy::model::{ModelConfig, VERSION};
use policy::start::OBJECTS;
use robot::DOF;
use safetensors::SafeTensors;
use std::collections::{BTreeMap, HashMap};
use std::path::Path;

/// The bytes of a model's files.
pub struct ModelFiles {
    /// Encoder and decoder in half precision, the policy in half precision of which 6 bits of mantissa are kept, the
    /// whitening of z in single precision.
    pub weights: Vec<u8>,
    /// Start configurations with the z at which they were demonstrated, in half precision, and of which objects.
    pub starts: Vec<u8>,
    /// [`ModelConfig`] as JSON.
    pub config: Vec<u8>,
}

/// Start configurations that the model keeps of each way in which an object pose is grasped.
const STARTS_PER_WAY: usize = 2;

/// Bits of mantissa that a policy's weights keep in its file, of the ten of half precision. What is left out is zero, and
/// a packed file is a fifth smaller: 8.9 MB where it was 11.1.
const MANTISSA_BITS: u32 = 6;

/// Bytes of the three files of a model.
pub fn model_files(
    encoder: &TrainedEncoder,
    policy: &Params,
    config: &DaggerConfig,
    lessons: &[Lesson],
) -> Result<ModelFiles> {
    let whitening = encoder.whitening.tensors();
    let policy = policy.with_mantissa(MANTISSA_BITS)?.export(&[])?;
    let weights = merge(&[encoder.params.export(&whitening)?, policy], None)?;
    let (mut z, mut q) = (Vec::new(), Vec::new());
    let mut objects: Vec<(&str, usize)> = Vec::new();
    for lesson in lessons.iter().filter(|lesson| lesson.has_starts) {
        for trajectory in 0..lesson.demonstrations.trajectories().min(STARTS_PER_WAY) {
            let (first, _) = lesson.demonstrations.span(trajectory);
            let seen = &lesson.encodings[0];
            z.extend(&seen.z);
            let start = seen.in_front(&lesson.demonstrations.state(first).q);
            q.extend(start.iter().map(|x| *x as f32));
            match objects.last_mut().filter(|(name, _)| *name == &*lesson.object) {
                Some((_, count)) => *count += 1,
                None => objects.push((&lesson.object, 1)),
            }
        }
    }
    let count = q.len() / DOF;
    let mut table = Params::default();
    table.add("starts.z", &[count, config.policy.observation.size()], z)?;
    table.add("starts.q", &[count, DOF], q)?;
    let note = (OBJECTS.to_owned(), serde_json::to_string(&objects)?);
    let starts = merge(&[table.export(&[])?], Some(HashMap::from([note])))?;
    let config = serde_json::to_vec_pretty(&ModelConfig {
        version: VERSION,
        policy: config.policy.clone(),
    })?;
    Ok(ModelFiles { weights, starts, config })
}

/// Writes `weights.safetensors`, `starts.safetensors` and `config.json` to `out`.
pub fn write_model(
    out: &Path,
    encoder: &TrainedEncoder,
    policy: &Params,
    config: &DaggerConfig,
    lessons: &[Lesson],
) -> Result<()> {
    write_files(out, &model_files(encoder, policy, config, lessons)?)
}

/// Writes the files of a model to `out`.
pub fn write_files(out: &Path, files: &ModelFiles) -> Result<()> {
    store::write(&out.join("weights.safetensors"), &files.weights)?;
    store::write(&out.join("starts.safetensors"), &files.starts)?;
    store::write(&out.join("config.json"), &files.config)
}

/// One safetensors file out of several, with notes in its header.
fn merge(files: &[Vec<u8>], notes: Option<HashMap<String, String>>) -> Result<Vec<u8>> {
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
    Ok(safetensors::serialize(views, notes)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expert::Demonstrations;
    use crate::lesson::mean_configuration;
    use crate::nn::{self, autoencoder as twin};
    use policy::{Encoding, LATENT, Model, PolicyConfig, Whitening};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use robot::{JointVector, Tree};

    #[test]
    fn the_model_begins_where_the_demonstration_did_turned_to_the_bearing_that_is_seen() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let encoder = TrainedEncoder { params, whitening: Whitening::identity() };
        let rows: Vec<f32> = (0..4 * DOF).map(|i| 0.3 + 0.005 * (i % DOF) as f32).collect();
        let z = vec![0.5; LATENT];
        let lesson = Lesson {
            object: "mug.1".into(),
            pose: 0,
            demonstrations: Demonstrations::new(rows, vec![0, 2]),
            encodings: vec![Encoding { bearing: 0.3, z: z.clone() }],
            has_starts: true,
            near: Vec::new(),
        };
        let first = lesson.demonstrations.state(0).q;
        let mean = JointVector::from(mean_configuration(std::slice::from_ref(&lesson)));
        assert!((mean[0] - first[0] + 0.3).abs() < 1e-9 && (mean[5] - first[5]).abs() < 1e-9);

        let config = DaggerConfig::standard(PolicyConfig::tiny());
        let mut policy = Params::default();
        nn::network::init(&mut policy, &config.policy, &mut ChaCha8Rng::seed_from_u64(2)).unwrap();
        let files = model_files(&encoder, &policy, &config, &[lesson]).unwrap();
        let model = Model::load(&files.weights, &files.starts, &files.config, &tree).unwrap();
        for bearing in [0.3, -0.6] {
            let seen = Encoding { bearing, z: z.clone() };
            let start = model.starts.find(&seen, &tree.kinematics(&first).palm()).unwrap();
            assert!((start[0] - first[0] - (bearing - 0.3)).abs() < 1e-3, "{}", start[0]);
            assert!((start - first).rows(1, DOF - 1).amax() < 1e-3);
        }
        // Nearest is the object that it learned from, at the distance in z.
        let off = vec![0.75; LATENT];
        let (object, distance) = model.starts.most_like(&off).unwrap();
        assert!(object == "mug.1" && (distance - 0.25 * (LATENT as f32).sqrt()).abs() < 1e-5);
    }
}
