//! A model as it is shipped: encoder, policy, start configurations, configuration.

use crate::encoder::{Decoder, Encoder};
use crate::encoding::{Encoding, to_front};
use crate::network::{self, Network, NetworkConfig, Observation, PolicyConfig};
use crate::ngf::NgfConfig;
use crate::start::Starts;
use crate::weights::{Tensors, WeightsError};
use geometry::Vec3;
use robot::Tree;

/// What weights, starts and configuration mean: 1, everything in the base frame; 2, with the object in front; 3,
/// policies of several kinds.
pub const VERSION: u32 = 3;

/// The configuration that lies beside the weights.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct ModelConfig {
    /// [`VERSION`] of the program that trained it.
    pub version: u32,
    /// What the policy is told, sizes and scales of its networks.
    pub policy: PolicyConfig,
}

impl ModelConfig {
    /// Reads a configuration; one that means something else is an error.
    pub fn parse(bytes: &[u8]) -> Result<Self, WeightsError> {
        #[derive(serde::Deserialize)]
        struct Versioned {
            #[serde(default = "first")]
            version: u32,
        }
        /// That of version 2, when there was one kind of policy.
        #[derive(serde::Deserialize)]
        struct Fabric {
            ngf: NgfConfig,
        }
        match serde_json::from_slice::<Versioned>(bytes)?.version {
            VERSION => Ok(serde_json::from_slice(bytes)?),
            2 => {
                let network = NetworkConfig::Ngf(serde_json::from_slice::<Fabric>(bytes)?.ngf);
                let policy = PolicyConfig { observation: Observation::Cloud, network };
                Ok(Self { version: VERSION, policy })
            }
            found => Err(WeightsError::Version { found, wanted: VERSION }),
        }
    }
}

/// The version of what has none.
fn first() -> u32 {
    1
}

/// Everything that an attempt needs.
#[derive(Clone, Debug)]
pub struct Model {
    /// Point cloud -> z.
    pub encoder: Encoder,
    /// z -> point cloud.
    pub decoder: Decoder,
    /// What the policy is told of the object.
    pub observation: Observation,
    /// (q, q̇, z) -> q̈.
    pub network: Network,
    /// Where attempts begin.
    pub starts: Starts,
}

impl Model {
    /// Builds a model from the bytes of its three files.
    pub fn load(
        weights: &[u8],
        starts: &[u8],
        config: &[u8],
        tree: &Tree,
    ) -> Result<Self, WeightsError> {
        let config = ModelConfig::parse(config)?;
        let tensors = Tensors::parse(weights)?;
        Ok(Self {
            encoder: Encoder::load(&tensors)?,
            decoder: Decoder::load(&tensors)?,
            observation: config.policy.observation,
            network: Network::load(&tensors, &config.policy, &tree.limits)?,
            starts: Starts::load(starts, config.policy.observation.size(), tree)?,
        })
    }

    /// The cloud, turned to the front, that is in what the policy is told; `None` if only its position is.
    pub fn reconstruct(&self, told: &Encoding) -> Option<Vec<Vec3>> {
        let is_cloud = self.observation == Observation::Cloud;
        is_cloud.then(|| self.decoder.decode(&told.z))
    }

    /// What the policy is told of a cloud (base frame) in farthest-point order; `None` if it is empty.
    pub fn observe(&self, cloud: &[Vec3]) -> Option<Encoding> {
        match self.observation {
            Observation::Cloud => self.encoder.encode(cloud),
            Observation::Position if cloud.is_empty() => None,
            Observation::Position => {
                let (bearing, front) = to_front(cloud);
                Some(Encoding { bearing, z: network::position(&front) })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LATENT;
    use crate::Whitening;
    use crate::encoder::{DECODER_WIDTHS, GLOBAL_WIDTHS, LOCAL_WIDTHS, READOUT_WIDTHS};
    use crate::ngf::PARTS;
    use robot::{DOF, JointState, JointVector};
    use safetensors::Dtype;
    use safetensors::tensor::TensorView;
    use std::collections::BTreeMap;

    type File = BTreeMap<String, (Vec<usize>, Vec<f32>)>;

    fn wave(count: usize, seed: usize) -> Vec<f32> {
        (0..count).map(|k| 0.05 * libm::sinf((k * k % 1009 + 31 * seed) as f32)).collect()
    }

    /// All tensors of a small model.
    fn weights() -> File {
        let config = NgfConfig::tiny();
        let mut networks: Vec<(&str, Vec<usize>)> =
            PARTS.iter().map(|part| (part.name, part.widths(&config).to_vec())).collect();
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

    /// Two object poses with two starts each.
    fn starts() -> File {
        let z = [0.0f32, 0.0, 1.0, 1.0].iter().flat_map(|z| [*z; LATENT]).collect();
        let q = [0.3f32, 0.45, 0.3, 0.45].iter().flat_map(|q| [*q; DOF]).collect();
        let rows = [("starts.z", LATENT, z), ("starts.q", DOF, q)];
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
        Model::load(weights, starts, config.as_bytes(), &Tree::iiwa7_allegro().unwrap())
    }

    fn config() -> String {
        serde_json::to_string(&ModelConfig { version: VERSION, policy: PolicyConfig::tiny() })
            .unwrap()
    }

    /// The message about weights that were changed.
    fn message(change: impl FnOnce(&mut File)) -> String {
        let mut file = weights();
        change(&mut file);
        load(&bytes(&file), &bytes(&starts()), &config()).unwrap_err().to_string()
    }

    #[test]
    fn a_sound_model_loads_and_acts() {
        let model = load(&bytes(&weights()), &bytes(&starts()), &config()).unwrap();
        let state = JointState::at_rest(JointVector::from_element(0.3));
        let object = Encoding { bearing: 0.3, z: vec![0.1; LATENT] };
        let qdd = object.acceleration(&model.network, &state);
        assert!(qdd.is_some());
        // Object and first joint turned alike: nothing changes.
        let mut turned = state;
        turned.q[0] += 0.25;
        let object = Encoding { bearing: 0.55, ..object };
        assert_eq!(object.acceleration(&model.network, &turned), qdd);
        assert_eq!(model.decoder.decode(&[0.1; LATENT]).len(), crate::encoder::CLOUD);
    }

    #[test]
    fn the_start_belongs_to_the_nearest_encoding_and_then_to_the_nearest_palm() {
        let model = load(&bytes(&weights()), &bytes(&starts()), &config()).unwrap();
        for (z, q) in [(0.2f32, 0.3), (0.2, 0.45), (0.9, 0.3), (0.9, 0.45)] {
            // Where the first joint is, at another bearing.
            let mut wanted = JointVector::from_element(f64::from(q as f32));
            wanted[0] += 0.4;
            let palm = Tree::iiwa7_allegro().unwrap().kinematics(&wanted).palm();
            let object = Encoding { bearing: 0.4, z: vec![z; LATENT] };
            let start = model.starts.find(&object, &palm).unwrap();
            assert!((start - wanted).amax() < 1e-6, "{} against {q}", start[0]);
        }
    }

    #[test]
    fn a_missing_tensor_is_named() {
        let message = message(|file| drop(file.remove("potential.2.bias")));
        assert!(message.contains("lack the tensor potential.2.bias"), "{message}");
    }

    #[test]
    fn a_wrong_shape_is_named_with_the_wanted_one() {
        let message = message(|file| {
            file.insert("encoder.local.0.weight".into(), (vec![3, 32], wave(96, 0)));
        });
        assert!(message.contains("encoder.local.0.weight should be [6, 32]"), "{message}");
        assert!(message.contains("found [3, 32]"), "{message}");
    }

    #[test]
    fn a_value_that_is_not_finite_is_named() {
        for bad in [f32::NAN, f32::INFINITY] {
            let message = message(|file| {
                let (_, values) = file.get_mut("damping.1.weight").unwrap();
                values[17] = bad;
            });
            assert!(message.contains("damping.1.weight holds a value that is not"), "{message}");
        }
    }

    #[test]
    fn a_damaged_file_is_told_from_a_foreign_one() {
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
        assert!(message.contains("start 0 is beyond the limits"), "{message}");
        let message = load(&whole, &starts, r#"{"version": 3}"#).unwrap_err().to_string();
        assert!(message.contains("configuration") && message.contains("policy"), "{message}");
        for (other, found) in [("{}", "version 1"), (r#"{"version": 4}"#, "version 4")] {
            let message = load(&whole, &starts, other).unwrap_err().to_string();
            assert!(message.contains(found) && message.contains("version 3"), "{message}");
        }
    }

    #[test]
    fn a_configuration_of_version_2_is_that_of_a_fabric_that_sees_clouds() {
        let old = serde_json::json!({ "version": 2, "ngf": NgfConfig::tiny() }).to_string();
        let new = ModelConfig::parse(old.as_bytes()).unwrap();
        assert_eq!((new.version, new.policy), (VERSION, PolicyConfig::tiny()));
    }

    #[test]
    fn a_setting_that_no_networks_can_be_built_from_is_named() {
        let tiny = NgfConfig::tiny;
        for (ngf, named) in [
            (NgfConfig { hidden: 0, ..tiny() }, "hidden = 0"),
            (NgfConfig { latent_scale: 0.0, ..tiny() }, "latent_scale = 0"),
            (NgfConfig { velocity_scale: -1.0, ..tiny() }, "velocity_scale = -1"),
        ] {
            let policy = PolicyConfig { network: NetworkConfig::Ngf(ngf), ..PolicyConfig::tiny() };
            let config = serde_json::to_string(&ModelConfig { version: VERSION, policy }).unwrap();
            let message = load(&bytes(&weights()), &bytes(&starts()), &config).unwrap_err();
            assert!(message.to_string().contains(named), "{message}");
        }
    }
}
