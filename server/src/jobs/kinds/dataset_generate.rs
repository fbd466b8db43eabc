//! Job kind `dataset.generate`: generates demonstrations and point clouds.

use super::command_line::{InputPaths, OUT_DIR, args, option_args};
use super::object_params::ObjectParams;
use super::param_checks::{Invalid, MAX_THREADS, check_range, string_enum, unknown_preset};
use super::{Cost, JobKind};
use crate::jobs::Inputs;
use crate::jobs::scheduler::OutputCollector;
use crate::store::StoreError;
use configs::dataset::{DatasetConfig, PRESETS};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::schema::Schema;

/// Parameters of dataset generation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct DatasetParams {
    /// Preset that sets the size of the dataset.
    #[serde(default = "default_preset")]
    #[schema(schema_with = presets)]
    pub(crate) preset: String,
    /// A single object instead of the objects of the preset.
    #[serde(flatten)]
    pub(crate) object_params: ObjectParams,
    /// Random seed.
    #[serde(default)]
    pub(crate) seed: u64,
    /// Threads; 0 = all cores.
    #[serde(default)]
    pub(crate) threads: usize,
    /// Add the noisy cloud of the episode to each row, as column `observation.pointcloud` (6 kB per row before
    /// compression).
    #[serde(default)]
    pub(crate) point_clouds: bool,
}

fn default_preset() -> String {
    "small".into()
}

/// Dataset presets, with a description of their sizes.
fn presets() -> Schema {
    let sizes = PRESETS.map(|(name, size)| format!("`{name}`: {size}"));
    let text = format!("Preset that sets the size of the dataset. {}.", sizes.join("; "));
    string_enum(PRESETS.map(|(name, _)| name))
        .default(Some(default_preset().into()))
        .description(Some(text))
        .into()
}

/// Reference run times (s). Preset `variants` (46,400 clouds, 4,400 demonstrations, 8 variants): 18 minutes;
/// `paper`: 50 minutes.
mod seconds {
    /// Grasp search for a mesh; built-in objects have stored grasps.
    pub(super) const GRASP_SEARCH: f64 = 120.0;
    /// Grasp transfer from an object to one of its variants, including trials.
    pub(super) const GRASP_TRANSFER: f64 = 75.0;
    pub(super) const DEMONSTRATION: f64 = 0.06;
    pub(super) const CLOUD: f64 = 0.0022;
}

/// Reference disk space (bytes).
mod bytes {
    pub(super) const DEMONSTRATION: f64 = 22_000.0;
    pub(super) const CLOUD: f64 = 18_400.0;
}

impl JobKind for DatasetParams {
    fn resolve(self) -> Result<Self, Invalid> {
        if DatasetConfig::preset(&self.preset, self.seed).is_none() {
            return Err(unknown_preset());
        }
        self.object_params.validate(false)?;
        check_range("threads", self.threads, 0, MAX_THREADS)?;
        Ok(self)
    }

    fn seed(&self) -> u64 {
        self.seed
    }

    fn has_mesh_size(&self) -> bool {
        self.object_params.has_mesh_size()
    }

    fn inputs(&self) -> Inputs {
        Inputs { mesh_id: self.object_params.mesh_id.clone(), ..Inputs::default() }
    }

    fn argv(&self, inputs: &InputPaths) -> Vec<String> {
        [
            args(["dataset", "generate", "--preset", &self.preset, "--out", OUT_DIR, "--resume"]),
            option_args("seed", Some(self.seed)),
            option_args("threads", Some(self.threads)),
            args(["--point-clouds"]).into_iter().filter(|_| self.point_clouds).collect(),
            self.object_params.argv(inputs.mesh),
        ]
        .concat()
    }

    async fn collect(&self, outputs: &mut OutputCollector<'_>) -> Result<(), StoreError> {
        outputs.store_dataset().await
    }

    fn cost(&self) -> Cost {
        let Some(config) = DatasetConfig::preset(&self.preset, self.seed) else {
            return Cost { seconds: 0.0, bytes: 0.0 };
        };
        let is_single_object =
            self.object_params.object.is_some() || self.object_params.mesh_id.is_some();
        let count = |objects: usize| if is_single_object { 1.0 } else { objects as f64 };
        let poses = count(config.objects.len()) * config.poses as f64;
        let demonstrations = poses * config.trajectories as f64;
        let clouds = poses * config.num_azimuths as f64
            + count(config.encoder_objects.len()) * config.encoder_clouds as f64;
        let variants = config.objects.iter().filter(|name| name.contains('.')).count();
        let grasps = match &self.object_params {
            object if object.mesh_id.is_some() => seconds::GRASP_SEARCH,
            object if object.object.is_some() => 0.0,
            _ => seconds::GRASP_TRANSFER * variants as f64,
        };
        Cost {
            seconds: grasps + seconds::DEMONSTRATION * demonstrations + seconds::CLOUD * clouds,
            bytes: bytes::DEMONSTRATION * demonstrations + bytes::CLOUD * clouds,
        }
    }

    fn is_comparable(&self, other: &Self) -> bool {
        self.preset == other.preset && self.object_params == other.object_params
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::kinds::param_checks::parse;
    use serde_json::json;

    #[test]
    fn unspecified_params_get_defaults() {
        let params = parse::<DatasetParams>(json!({})).unwrap().resolve().unwrap();
        assert_eq!((params.preset.as_str(), params.seed), ("small", 0));
    }

    #[test]
    fn estimate_grows_with_the_preset() {
        let of = |preset: &str| {
            parse::<DatasetParams>(json!({ "preset": preset })).unwrap().resolve().unwrap().cost()
        };
        let all = ["smoke", "small", "variants", "paper"].map(of);
        assert!(all.windows(2).all(|pair| pair[0].seconds < pair[1].seconds), "{all:?}");
        // Measured: 18 and 50 minutes, 1.05 GB.
        let Cost { seconds, bytes } = of("variants");
        assert!((700.0..1600.0).contains(&seconds) && (0.5e9..2e9).contains(&bytes), "{seconds}");
        let Cost { seconds, .. } = of("paper");
        assert!((2000.0..4500.0).contains(&seconds), "{seconds}");
    }
}
