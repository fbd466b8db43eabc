//! A trained model for inference: encoder, policy, start configurations, configuration.

use crate::LATENT_DIM;
use crate::encoder::{Decoder, Encoder};
use crate::networks::{Network, ObservationKind, PolicyConfig};
use crate::observation::{Observation, canonicalize};
use crate::start_model::StartModel;
use crate::weights::{Tensors, WeightsError};
use geometry::Vec3;
use robot::KinematicTree;

/// Version of the meaning of weights, start configurations and configuration. 1: all in the base frame; 2:
/// canonical frame, with the object at azimuth 0; 3: several kinds of policies; 4: other field names.
pub const MODEL_VERSION: u32 = 4;

/// Encoder, decoder and policy, as safetensors.
pub const WEIGHTS_FILE: &str = "weights.safetensors";
/// [`StartModel`], as safetensors.
pub const STARTS_FILE: &str = "start_configurations.safetensors";
/// [`ModelConfig`], as JSON.
pub const CONFIG_FILE: &str = "config.json";

/// Files of a model by their name in the API, in the order of [`Model::load`].
pub const MODEL_FILES: [(&str, &str); 3] =
    [("weights", WEIGHTS_FILE), ("start_configurations", STARTS_FILE), ("config", CONFIG_FILE)];

/// The model's configuration file, [`CONFIG_FILE`].
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ModelConfig {
    /// [`MODEL_VERSION`] of the program that trained the model.
    pub version: u32,
    /// Observation, architecture and scales of the policy.
    pub policy: PolicyConfig,
    /// Number of start configurations from which the policy is rolled out, without physics, before an attempt. The one
    /// that leads nearest to the observed surface is used. 1: the nearest start, without a rollout.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub start_candidates: usize,
}

/// Maximum of [`ModelConfig::start_candidates`]; larger values are rejected as invalid.
const MAX_START_CANDIDATES: usize = 64;

fn one() -> usize {
    1
}

fn is_one(count: &usize) -> bool {
    *count == 1
}

impl ModelConfig {
    /// The configuration of a policy that uses the nearest start.
    pub fn new(policy: PolicyConfig) -> Self {
        Self { version: MODEL_VERSION, policy, start_candidates: 1 }
    }

    /// Parses a configuration; versions other than [`MODEL_VERSION`] are errors.
    pub fn parse(bytes: &[u8]) -> Result<Self, WeightsError> {
        #[derive(serde::Deserialize)]
        struct Versioned {
            #[serde(default = "default_version")]
            version: u32,
        }
        match serde_json::from_slice::<Versioned>(bytes)?.version {
            MODEL_VERSION => {
                let config: Self = serde_json::from_slice(bytes)?;
                if (1..=MAX_START_CANDIDATES).contains(&config.start_candidates) {
                    return Ok(config);
                }
                let value = config.start_candidates.to_string();
                Err(WeightsError::InvalidValue { name: "start_candidates".into(), value })
            }
            found => Err(WeightsError::Version { found, wanted: MODEL_VERSION }),
        }
    }
}

impl ModelConfig {
    /// All values in declaration order, in postcard's encoding. The model hash covers these bytes instead of
    /// the file's text, so that names and formatting do not contribute.
    pub fn canonical_bytes(&self) -> Vec<u8> {
        postcard::to_allocvec(self).expect("all fields are plain values")
    }
}

/// Version of a configuration without a version field.
fn default_version() -> u32 {
    1
}

/// All parts of a model that an attempt needs.
///
/// ```rust
/// use geometry::Vec3;
/// use robot::{JointState, KinematicTree};
/// let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/default");
/// let read = |name: &str| std::fs::read(format!("{folder}/{name}"));
/// let (weights, config) = (read("weights.safetensors")?, read("config.json")?);
/// let tree = KinematicTree::iiwa7_allegro()?;
/// let starts = read("start_configurations.safetensors")?;
/// let model = policy::Model::load(&weights, &starts, &config, &tree)?;
/// // 512 points of a wall to the left of the robot (base frame, m).
/// let point = |i: usize| Vec3::new(0.02 * (i % 8) as f32 - 0.07, 0.6, 0.005 * (i / 8) as f32);
/// let cloud: Vec<Vec3> = (0..512).map(point).collect();
/// let observation = model.observe(&cloud).expect("a cloud with points");
/// assert!((observation.azimuth - std::f64::consts::FRAC_PI_2).abs() < 1e-3); // rad
/// assert_eq!(observation.latent.len(), policy::LATENT_DIM);
/// let q = robot::joint_vector(&tree.hand.arm.nominal, &[0.3; robot::HAND_DOF]);
/// let qdd = model.network.acceleration(&JointState::at_rest(q), &observation); // rad/s²
/// assert!(qdd.is_some_and(|qdd| qdd.norm() > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Model {
    /// Point cloud -> z.
    pub encoder: Encoder,
    /// z -> point cloud.
    pub decoder: Decoder,
    /// Whether the policy observes z or the position of the cloud.
    pub observation_kind: ObservationKind,
    /// (q, q̇, observation) -> q̈.
    pub network: Network,
    /// Start configurations of attempts.
    pub start_model: StartModel,
    /// [`ModelConfig::start_candidates`].
    pub start_candidates: usize,
}

impl Model {
    /// Builds a model from the bytes of weights, start configurations and configuration.
    pub fn load(
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
        tree: &KinematicTree,
    ) -> Result<Self, WeightsError> {
        let config = ModelConfig::parse(config)?;
        let tensors = Tensors::parse(weights)?;
        Ok(Self {
            encoder: Encoder::load(&tensors)?,
            decoder: Decoder::load(&tensors)?,
            observation_kind: config.policy.observation,
            network: Network::load(&tensors, &config.policy, tree)?,
            start_candidates: config.start_candidates,
            start_model: StartModel::load(starts, config.policy.observation.num_features(), tree)?,
        })
    }

    /// Decodes an observation to a cloud (m) in the canonical frame; `None` for a position.
    pub fn reconstruct(&self, observation: &Observation) -> Option<Vec<Vec3>> {
        let has_latent = self.observation_kind.has_latent();
        has_latent.then(|| self.decoder.decode(&observation.latent[..LATENT_DIM]))
    }

    /// Observes a cloud (m, base frame) in farthest-point order; `None` if it is empty.
    pub fn observe(&self, cloud: &[Vec3]) -> Option<Observation> {
        let (azimuth, canonical) = canonicalize(cloud);
        let z = match self.observation_kind.has_latent() {
            true => self.encoder.encode(cloud)?.latent,
            false if cloud.is_empty() => return None,
            false => Vec::new(),
        };
        Some(Observation { azimuth, latent: self.observation_kind.values(z, &canonical) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Whitening;
    use crate::encoder::{DECODER_WIDTHS, GLOBAL_WIDTHS, LOCAL_WIDTHS, READOUT_WIDTHS};
    use crate::networks::NetworkConfig;
    use crate::networks::ngf::{NgfConfig, SUBNETWORKS};
    use robot::{DOF, JointState, JointVector};
    use safetensors::Dtype;
    use safetensors::tensor::TensorView;
    use std::collections::BTreeMap;

    type File = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

    fn wave(count: usize, seed: usize) -> Vec<f32> {
        (0..count).map(|k| 0.05 * libm::sinf((k * k % 1009 + 31 * seed) as f32)).collect()
    }

    /// Tensors of a small model.
    fn weights() -> File {
        let config = NgfConfig::tiny();
        let mut networks: Vec<(&str, Vec<usize>)> =
            SUBNETWORKS.iter().map(|part| (part.name, part.widths(&config).to_vec())).collect();
        networks.extend([
            ("encoder.local", LOCAL_WIDTHS.to_vec()),
            ("encoder.global", GLOBAL_WIDTHS.to_vec()),
            ("encoder.readout", READOUT_WIDTHS.to_vec()),
            ("decoder", DECODER_WIDTHS.to_vec()),
        ]);
        let mut file = File::new();
        for (name, widths) in networks {
            for (i, pair) in widths.windows(2).enumerate() {
                let (inputs, outputs) = (pair[0], pair[1]);
                let weight = (vec![inputs, outputs], wave(inputs * outputs, i));
                file.insert(format!("{name}.{i}.weight"), weight);
                file.insert(format!("{name}.{i}.bias"), (vec![outputs], wave(outputs, i + 9)));
            }
        }
        for (name, shape, values) in Whitening::identity().tensors() {
            file.insert(name.into(), (shape, values.to_vec()));
        }
        file
    }

    /// Start configurations of two object poses, two each.
    fn starts() -> File {
        let z = [0.0f32, 0.0, 1.0, 1.0].iter().flat_map(|z| [*z; LATENT_DIM]).collect();
        let q = [0.3f32, 0.45, 0.3, 0.45].iter().flat_map(|q| [*q; DOF]).collect();
        let rows = [("starts.z", LATENT_DIM, z), ("starts.q", DOF, q)];
        rows.map(|(name, size, values)| (name.to_owned(), (vec![4, size], values))).into()
    }

    fn bytes(file: &File) -> Vec<u8> {
        let data: Vec<(&String, &Vec<usize>, Vec<u8>)> = file
            .iter()
            .map(|(name, (shape, x))| {
                (name, shape, x.iter().flat_map(|x| x.to_le_bytes()).collect())
            })
            .collect();
        let view =
            |shape: &[usize], data| TensorView::new(Dtype::F32, shape.to_vec(), data).unwrap();
        safetensors::serialize(data.iter().map(|(n, s, data)| (*n, view(s, data))), None).unwrap()
    }

    fn load(weights: &[u8], starts: &[u8], config: &str) -> Result<Model, WeightsError> {
        Model::load(weights, starts, config.as_bytes(), &KinematicTree::iiwa7_allegro().unwrap())
    }

    fn config() -> String {
        serde_json::to_string(&ModelConfig::new(PolicyConfig::tiny())).unwrap()
    }

    /// Error text of loading modified weights.
    fn message(change: impl FnOnce(&mut File)) -> String {
        let mut file = weights();
        change(&mut file);
        load(&bytes(&file), &bytes(&starts()), &config()).unwrap_err().to_string()
    }

    #[test]
    fn valid_model_loads_and_predicts_accelerations() {
        let model = load(&bytes(&weights()), &bytes(&starts()), &config()).unwrap();
        let state = JointState::at_rest(JointVector::from_element(0.3));
        let object = Observation { azimuth: 0.3, latent: vec![0.1; LATENT_DIM] };
        let qdd = model.network.acceleration(&state, &object);
        assert!(qdd.is_some());
        // A common rotation of object and first joint changes nothing.
        let mut turned = state;
        turned.q[0] += 0.25;
        let object = Observation { azimuth: 0.55, ..object };
        assert_eq!(model.network.acceleration(&turned, &object), qdd);
        assert_eq!(model.decoder.decode(&[0.1; LATENT_DIM]).len(), crate::encoder::CLOUD_POINTS);
    }

    #[test]
    fn start_has_nearest_latent_and_then_nearest_palm() {
        let model = load(&bytes(&weights()), &bytes(&starts()), &config()).unwrap();
        for (z, q) in [(0.2f32, 0.3), (0.2, 0.45), (0.9, 0.3), (0.9, 0.45)] {
            // The first joint is rotated to another azimuth.
            let mut wanted = JointVector::from_element(f64::from(q as f32));
            wanted[0] += 0.4;
            let palm =
                KinematicTree::iiwa7_allegro().unwrap().forward_kinematics(&wanted).palm_pose();
            let object = Observation { azimuth: 0.4, latent: vec![z; LATENT_DIM] };
            let start = model.start_model.find(&object, &palm).unwrap();
            assert!((start - wanted).amax() < 1e-6, "{} against {q}", start[0]);
        }
    }

    #[test]
    fn missing_tensor_is_named_in_the_error() {
        let message = message(|file| drop(file.remove("potential.2.bias")));
        assert!(message.contains("missing tensor potential.2.bias"), "{message}");
    }

    #[test]
    fn wrong_shape_is_named_with_the_expected_one() {
        let message = message(|file| {
            file.insert("encoder.local.0.weight".into(), (vec![3, 32], wave(96, 0)));
        });
        assert!(message.contains("encoder.local.0.weight must have shape [6, 32]"), "{message}");
        assert!(message.contains("found [3, 32]"), "{message}");
    }

    #[test]
    fn value_that_is_not_finite_is_named() {
        for bad in [f32::NAN, f32::INFINITY] {
            let message = message(|file| {
                let (_, values) = file.get_mut("damping.1.weight").unwrap();
                values[17] = bad;
            });
            assert!(
                message.contains("damping.1.weight has a value that is not finite"),
                "{message}"
            );
        }
    }

    #[test]
    fn damaged_file_and_wrong_file_give_different_errors() {
        let (whole, starts) = (bytes(&weights()), bytes(&starts()));
        for end in [0, 5, 100, whole.len() / 2, whole.len() - 1] {
            let message = load(&whole[..end], &starts, &config()).unwrap_err().to_string();
            assert!(message.contains("damaged"), "{end} bytes: {message}");
        }
        let message = load(&starts, &starts, &config()).unwrap_err().to_string();
        assert!(message.contains("another architecture"), "{message}");
        let message = load(&whole, &whole, &config()).unwrap_err().to_string();
        assert!(message.contains("starts.q"), "{message}");
        let far = (vec![4, DOF], vec![9.0; 4 * DOF]);
        let mut beyond = self::starts();
        beyond.insert("starts.q".into(), far);
        let message = load(&whole, &bytes(&beyond), &config()).unwrap_err().to_string();
        assert!(message.contains("start configuration 0 exceeds the joint limits"), "{message}");
        let message = load(&whole, &starts, r#"{"version": 4}"#).unwrap_err().to_string();
        assert!(message.contains("configuration") && message.contains("policy"), "{message}");
        for (other, found) in [("{}", "version 1"), (r#"{"version": 5}"#, "version 5")] {
            let message = load(&whole, &starts, other).unwrap_err().to_string();
            assert!(message.contains(found) && message.contains("version 4"), "{message}");
        }
    }

    #[test]
    fn invalid_configuration_value_is_named() {
        let tiny = NgfConfig::tiny;
        for (ngf, expected) in [
            (NgfConfig { hidden: 0, ..tiny() }, "hidden = 0"),
            (NgfConfig { latent_scale: 0.0, ..tiny() }, "latent_scale = 0"),
            (NgfConfig { velocity_scale: -1.0, ..tiny() }, "velocity_scale = -1"),
        ] {
            let policy = PolicyConfig { network: NetworkConfig::Ngf(ngf), ..PolicyConfig::tiny() };
            let config = serde_json::to_string(&ModelConfig::new(policy)).unwrap();
            let message = load(&bytes(&weights()), &bytes(&starts()), &config).unwrap_err();
            assert!(message.to_string().contains(expected), "{message}");
        }
        for count in [0, 65] {
            let config =
                ModelConfig { start_candidates: count, ..ModelConfig::new(PolicyConfig::tiny()) };
            let config = serde_json::to_string(&config).unwrap();
            let message = load(&bytes(&weights()), &bytes(&starts()), &config).unwrap_err();
            assert!(message.to_string().contains("start_candidates"), "{message}");
        }
    }

    #[test]
    fn configuration_without_start_candidates_has_the_bytes_of_earlier_versions() {
        let config = ModelConfig::new(PolicyConfig::tiny());
        let text = serde_json::to_string(&config).unwrap();
        assert!(!text.contains("start_candidates"));
        assert_eq!(ModelConfig::parse(text.as_bytes()).unwrap().start_candidates, 1);
        let more = ModelConfig { start_candidates: 8, ..config.clone() };
        assert_ne!(more.canonical_bytes(), config.canonical_bytes());
        let text = serde_json::to_string(&more).unwrap();
        assert_eq!(ModelConfig::parse(text.as_bytes()).unwrap().start_candidates, 8);
    }
}
