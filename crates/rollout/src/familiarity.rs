//! Familiarity of an object: its similarity to the training objects of a model.

use crate::attempt::{Attempt, sample_pose_with_rng};
use crate::rollout_context::RolloutContext;
use geometry::{Pose, Vec3, point_cloud};
use mesh::Mesh;
use objects::catalog::parse_variant;
use policy::observation::cloud_from_canonical;
use policy::{Model, Observation};
use scene::depth_camera::RenderMesh;

/// How similar an observed object is to the training objects of a model.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Familiarity {
    /// Mean distance (m) between point cloud and reconstruction; small for objects similar to training data.
    pub reconstruction_error: f32,
    /// Nearest training object in latent space, if the model stores the training objects.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nearest: Option<NearestObject>,
}

/// A training object and its distance in latent space.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct NearestObject {
    /// Name of the training object.
    pub object: String,
    /// Distance in whitened z: 1 is a standard deviation of a latent dimension over the training data.
    pub distance: f32,
}

impl NearestObject {
    /// Name of the object. For a shape variant, the name of its base object.
    pub fn base_name(&self) -> &str {
        parse_variant(&self.object).map_or(&self.object, |(base, _)| base)
    }
}

/// Number of views per orientation of a mesh: the object poses of seeds 0, 1, ...
const NUM_VIEWS: u64 = 4;

impl Familiarity {
    /// Measures the familiarity of a cloud (m, base frame) and its observation; `None` if the policy observes
    /// only the position.
    pub fn measure(model: &Model, observation: &Observation, cloud: &[Vec3]) -> Option<Self> {
        let (_, canonical) = policy::observation::canonicalize(cloud);
        let error =
            point_cloud::mean_nearest_distance(&model.reconstruct(observation)?, &canonical);
        let nearest = model.start_model.nearest_training_object(&observation.latent);
        let nearest =
            nearest.map(|(object, distance)| NearestObject { object: object.into(), distance });
        Some(Self { reconstruction_error: error, nearest })
    }
}

impl Attempt {
    /// Reconstructs the point cloud from z (base frame, m); `None` without a point-cloud policy.
    pub fn reconstruction(&self, context: &RolloutContext) -> Option<Vec<Vec3>> {
        let (model, observation) = (context.model.as_ref()?, self.observation()?);
        let cloud = model.reconstruct(observation)?;
        Some(cloud_from_canonical(observation.azimuth, &cloud))
    }

    /// Familiarity of the object to the model; `None` without a point-cloud policy.
    pub fn familiarity(&self, context: &RolloutContext) -> Option<Familiarity> {
        Familiarity::measure(context.model.as_ref()?, self.observation()?, self.cloud())
    }
}

impl RolloutContext {
    /// Index of the most familiar mesh: min mean [`Familiarity::reconstruction_error`] over several views.
    /// `None` without a point-cloud model.
    pub fn most_familiar(&self, meshes: impl Iterator<Item = Mesh>) -> Option<usize> {
        let model = self.model.as_ref()?;
        let total_error = |mesh: Mesh| {
            let offset = mesh.offset_to_ground();
            let surface = RenderMesh::from_mesh(&mesh.translated(offset), &Pose::IDENTITY)?;
            let errors = (0..NUM_VIEWS).map(|seed| {
                let ([x, y, yaw], mut rng) = sample_pose_with_rng(&self.robot, seed);
                let placed = surface.at_pose(&self.robot.config.object_pose(x, y, yaw));
                let cloud = self.sensor.extract_cloud(&self.sensor.capture_mesh(placed, &mut rng));
                let likeness = Familiarity::measure(model, &model.observe(&cloud)?, &cloud)?;
                Some(likeness.reconstruction_error)
            });
            errors.sum::<Option<f32>>()
        };
        let errors =
            meshes.enumerate().filter_map(|(index, mesh)| Some((index, total_error(mesh)?)));
        let best = errors.min_by(|(_, a), (_, b)| a.total_cmp(b));
        best.map(|(index, _)| index)
    }
}
