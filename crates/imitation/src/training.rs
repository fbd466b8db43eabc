//! From dataset to model: encoder, lessons, policy, and the files that are shipped.

use crate::autoencoder::{encode_all, to_front};
use crate::dagger::DaggerConfig;
use crate::expert::Demonstrations;
use crate::lesson::{self, Lesson};
use crate::nn::{Params, autoencoder as twin};
use anyhow::{Context, Result};
use dataset::Dataset;
use dataset::store;
use geometry::Vec3;
use policy::encoder::{WORKSPACE_MIDDLE, WORKSPACE_SCALE};
use policy::model::{ModelConfig, VERSION};
use policy::weights::Tensors;
use policy::{Encoding, Network, Observation, Whitening, network};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use robot::{DOF, JointState, JointVector, Tree, integrator};
use rollout::Library;
use safetensors::SafeTensors;
use scene::config::CONTROL_PERIOD;
use std::path::Path;

/// A trained encoder with the whitening of its z.
pub struct TrainedEncoder {
    /// Weights of encoder and decoder.
    pub params: Params,
    whitening: Whitening,
}

/// Start configurations that the model keeps of each object pose.
const STARTS_PER_POSE: usize = 2;

/// Every tenth object pose is held out.
pub fn is_held_out(index: usize) -> bool {
    index % 10 == 9
}

impl TrainedEncoder {
    /// Reads what [`crate::autoencoder::train`] wrote.
    pub fn load(dir: &Path) -> Result<Self> {
        let read = |file: &str| {
            std::fs::read(dir.join(file)).with_context(|| {
                format!("{} has no {file}; train the encoder first", dir.display())
            })
        };
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(&read("encoder.safetensors")?)?;
        let bytes = read("latent.safetensors")?;
        let whitening = Whitening::load(&Tensors::parse(&bytes)?)?;
        Ok(Self { params, whitening })
    }

    /// The encoder of a model, from its weights.
    pub fn of_model(weights: &[u8]) -> Result<Self> {
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(0))?;
        params.restore(weights)?;
        Ok(Self { params, whitening: Whitening::load(&Tensors::parse(weights)?)? })
    }

    /// What the decoder makes of a cloud that has been turned to the front.
    pub fn reconstruct(&self, front: &[Vec3]) -> Result<Vec<Vec3>> {
        let flat: Vec<f32> = front.iter().flat_map(|p| p.to_array()).collect();
        let made = twin::decode(&self.params, &twin::encode(&self.params, &[&flat])?)?;
        let middle = Vec3::from_array(WORKSPACE_MIDDLE);
        let points = made.flatten_all()?.to_vec1::<f32>()?;
        let point = |p: &[f32]| middle + Vec3::from_slice(p) * WORKSPACE_SCALE;
        Ok(points.chunks_exact(3).map(point).collect())
    }

    /// What a policy is told of clouds (base frame).
    pub(crate) fn observe(
        &self,
        observation: Observation,
        clouds: &[Vec<f32>],
    ) -> Result<Vec<Encoding>> {
        match observation {
            Observation::Cloud => self.encode(clouds),
            Observation::Position => Ok(clouds
                .iter()
                .map(|cloud| {
                    let (bearing, front) = policy::encoding::to_front(&twin::points(cloud));
                    Encoding { bearing, z: network::position(&front) }
                })
                .collect()),
        }
    }

    /// Encodes clouds (base frame).
    pub fn encode(&self, clouds: &[Vec<f32>]) -> Result<Vec<Encoding>> {
        let (bearings, front): (Vec<f64>, Vec<Vec<f32>>) =
            clouds.iter().map(|cloud| to_front(cloud)).unzip();
        let latents = encode_all(&self.params, &front)?;
        let encoding =
            |(bearing, z): (f64, &Vec<f32>)| Encoding { bearing, z: self.whitening.apply(z) };
        Ok(bearings.into_iter().zip(&latents).map(encoding).collect())
    }
}

/// The lessons of a dataset: those to learn from, of the first `poses` poses of each object, and all that are held out.
pub fn lessons(
    dataset: &Dataset,
    encoder: &TrainedEncoder,
    observation: Observation,
    poses: usize,
) -> Result<(Vec<Lesson>, Vec<Lesson>)> {
    let (mut taught, mut held_out) = (Vec::new(), Vec::new());
    for object in 0..dataset.config.objects.len() {
        for (index, record) in dataset.poses(object)?.into_iter().enumerate() {
            let is_left_out = index >= poses && !is_held_out(index);
            if is_left_out || record.offsets.len() < 2 {
                continue;
            }
            let encodings = encoder.observe(observation, &record.clouds)?;
            let ways = Demonstrations::new(record.states, record.offsets).by_grasp();
            let seen = encodings.chunks_exact(encodings.len() / record.turns.len().max(1));
            for (turn, encodings) in record.turns.iter().zip(seen) {
                let lessons = if is_held_out(index) { &mut held_out } else { &mut taught };
                lessons.extend(ways.iter().map(|way| Lesson {
                    pose: object * dataset.config.poses + index,
                    demonstrations: way.turned(*turn),
                    encodings: encodings.to_vec(),
                    has_starts: *turn == 0.0,
                    near: Vec::new(),
                }));
            }
        }
    }
    let among = lesson::starts(&taught);
    lesson::introduce(&mut taught, &among);
    lesson::introduce(&mut held_out, &among);
    Ok((taught, held_out))
}

/// The demonstrations that models trained on a dataset have the starts of.
pub fn library(dataset: &Dataset) -> Result<Library> {
    let mut library = Library::default();
    for object in 0..dataset.config.objects.len() {
        for (index, record) in dataset.poses(object)?.into_iter().enumerate() {
            let Some(cloud) = record.clouds.first().filter(|_| !is_held_out(index)) else {
                continue;
            };
            let (bearing, _) = policy::encoding::to_front(&twin::points(cloud));
            let seen = Encoding { bearing, z: Vec::new() };
            let demonstrations = Demonstrations::new(record.states, record.offsets);
            for trajectory in 0..demonstrations.trajectories() {
                let (first, end) = demonstrations.span(trajectory);
                library.add(&seen, (first..end).map(|row| demonstrations.state(row)));
            }
        }
    }
    Ok(library)
}

/// The mean configuration (rad) of all demonstrations, with the object in front.
pub fn mean_configuration(lessons: &[Lesson]) -> [f64; DOF] {
    let mut sum = JointVector::zeros();
    let mut rows = 0;
    for Lesson { demonstrations, encodings, .. } in lessons {
        sum += (0..demonstrations.rows())
            .map(|row| encodings[0].in_front(&demonstrations.state(row).q))
            .sum::<JointVector>();
        rows += demonstrations.rows();
    }
    (sum / rows.max(1) as f64).into()
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

/// The bytes of a model's files.
pub struct ModelFiles {
    /// Encoder, decoder and policy in half precision.
    pub weights: Vec<u8>,
    /// Start configurations with the z at which they were demonstrated, in half precision.
    pub starts: Vec<u8>,
    /// [`ModelConfig`] as JSON.
    pub config: Vec<u8>,
}

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
    let weights = merge(&[encoder.params.export(&whitening)?, policy])?;
    let (mut z, mut q) = (Vec::new(), Vec::new());
    for lesson in lessons.iter().filter(|lesson| lesson.has_starts) {
        for trajectory in 0..lesson.demonstrations.trajectories().min(STARTS_PER_POSE) {
            let (first, _) = lesson.demonstrations.span(trajectory);
            let seen = &lesson.encodings[0];
            z.extend(&seen.z);
            let start = seen.in_front(&lesson.demonstrations.state(first).q);
            q.extend(start.iter().map(|x| *x as f32));
        }
    }
    let count = q.len() / DOF;
    let mut table = Params::default();
    table.add("starts.z", &[count, config.policy.observation.size()], z)?;
    table.add("starts.q", &[count, DOF], q)?;
    let starts = table.export(&[])?;
    let config = serde_json::to_vec_pretty(&ModelConfig {
        version: VERSION,
        policy: config.policy.clone(),
    })?;
    Ok(ModelFiles { weights, starts, config })
}

/// One safetensors file out of several.
fn merge(files: &[Vec<u8>]) -> Result<Vec<u8>> {
    let parsed = files
        .iter()
        .map(|bytes| Ok(SafeTensors::deserialize(bytes)?))
        .collect::<Result<Vec<_>>>()?;
    let mut views = std::collections::BTreeMap::new();
    for tensors in &parsed {
        for name in tensors.names() {
            views.insert(name.to_owned(), tensors.tensor(name)?);
        }
    }
    Ok(safetensors::serialize(views, None)?)
}

/// Free roll-outs of the policy from where attempts with the objects of lessons may begin: distance (m) of the
/// fingertips at the end from where the demonstrations have them, the mean over the four tips, sorted. Lessons that no
/// pose nearby is grasped alike with are left out.
pub fn fingertip_errors(tree: &Tree, policy: &Network, lessons: &[&Lesson]) -> Vec<f64> {
    let error = |lesson: &Lesson, start: &JointVector| {
        let object = &lesson.encodings[lesson.encodings.len() - 1];
        let mut state = JointState::at_rest(object.at_bearing(start));
        for _ in 0..FREE_STEPS {
            let lost = || JointVector::repeat(f64::NAN);
            let qdd = object.acceleration(policy, &state).unwrap_or_else(lost);
            state = integrator::step(&state, &qdd, CONTROL_PERIOD);
        }
        let end = lesson.demonstrations.state(lesson.demonstrations.rows() - 1).q;
        let apart = tips_apart(tree, &state.q, &end);
        if apart.is_finite() { apart } else { f64::INFINITY }
    };
    let of_lesson = |lesson: &&Lesson| {
        lesson.near.iter().take(2).map(|start| error(lesson, start)).collect::<Vec<_>>()
    };
    let mut errors: Vec<f64> = lessons.par_iter().flat_map_iter(of_lesson).collect();
    errors.sort_by(f64::total_cmp);
    errors
}

/// The greatest λ_max(B) + β (1/s) of a fabric in the states of demonstrations; `None` of another network.
pub fn greatest_damping(policy: &Network, lessons: &[&Lesson]) -> Option<f64> {
    let of_lesson = |lesson: &&Lesson| {
        let (object, rows) = (&lesson.encodings[0], lesson.demonstrations.rows());
        let row = |row| {
            let state = object.state_in_front(&lesson.demonstrations.state(row));
            policy.greatest_damping(&state, &object.z)
        };
        (0..rows).step_by(EVERY_ROW).filter_map(row).reduce(f64::max)
    };
    lessons.par_iter().filter_map(of_lesson).reduce_with(f64::max)
}

/// Rows between two at which the damping is looked at.
const EVERY_ROW: usize = 10;

/// Distance (m) between the fingertips of two postures, the mean over the four tips.
fn tips_apart(tree: &Tree, a: &JointVector, b: &JointVector) -> f64 {
    let (a, b) = (tree.kinematics(a).tips(), tree.kinematics(b).tips());
    a.iter().zip(&b).map(|(a, b)| (a - b).norm()).sum::<f64>() / 4.0
}

/// Control periods of a free roll-out: as long as the policy may act in an attempt.
const FREE_STEPS: usize = 120;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::nn;
    use policy::{LATENT, Model, PolicyConfig};

    #[test]
    fn the_model_begins_where_the_demonstration_did_turned_to_the_bearing_that_is_seen() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let mut params = Params::default();
        twin::init(&mut params, &mut ChaCha8Rng::seed_from_u64(1)).unwrap();
        let encoder = TrainedEncoder { params, whitening: Whitening::identity() };
        let rows: Vec<f32> = (0..4 * DOF).map(|i| 0.01 * (i % DOF) as f32).collect();
        let z = vec![0.5; LATENT];
        let lesson = Lesson {
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
    }
}
