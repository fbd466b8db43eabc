//! How like what a model learned from an object looks.

use crate::attempt::drawn_pose;
use crate::workcell::Workcell;
use geometry::brought::Guide;
use geometry::catalog::base_of;
use geometry::mesh::Mesh;
use geometry::{Pose, Vec3, cloud};
use policy::{Encoding, Model};
use scene::camera::Surface;

/// What a model makes of what it sees.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Likeness {
    /// How far (m) what the encoder makes of the cloud is from the cloud: little for what is like that it learned from.
    pub off: f32,
    /// What of that it looks like most, where the model tells what it learned from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub most: Option<Nearest>,
}

/// The object whose encoding is nearest.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Nearest {
    /// Its name.
    pub object: String,
    /// Distance of its z, which is whitened: one is a standard deviation of one number of what was learned from.
    pub distance: f32,
}

impl Nearest {
    /// Name of the object; one of other proportions counts as the one that it is made of.
    pub fn base(&self) -> &str {
        base_of(&self.object).map_or(&self.object, |(base, _)| base)
    }
}

/// Looks at each side of a mesh, of attempts from seeds 0 on.
const LOOKS: u64 = 4;

impl Likeness {
    /// Of a cloud and what was seen in it; `None` if the model is told no z of a cloud.
    pub fn of(model: &Model, seen: &Encoding, cloud: &[Vec3]) -> Option<Self> {
        let (_, front) = policy::encoding::to_front(cloud);
        let off = cloud::apart(&model.reconstruct(seen)?, &front);
        let most = model.starts.most_like(&seen.z);
        let most = most.map(|(object, distance)| Nearest { object: object.into(), distance });
        Some(Self { off, most })
    }
}

impl Workcell {
    /// Which of these meshes looks most like what the model learned from, by the mean of [`Likeness::off`] of a few looks;
    /// `None` without a model that sees clouds.
    pub fn most_familiar(&self, meshes: impl Iterator<Item = Mesh>) -> Option<usize> {
        let model = self.model.as_ref()?;
        let off = |mesh: Mesh| {
            let footing = mesh.footing();
            let surface = Surface::of_mesh(&mesh.translated(footing), &Pose::IDENTITY)?;
            let looks = (0..LOOKS).map(|seed| {
                let ([x, y, yaw], mut rng) = drawn_pose(&self.robot, seed);
                let standing = surface.moved(&self.robot.config.upright(x, y, yaw));
                let cloud = self.eye.cloud(&self.eye.frame_of(standing, &mut rng));
                let likeness = Likeness::of(model, &model.observe(&cloud)?, &cloud)?;
                Some(likeness.off)
            });
            looks.sum::<Option<f32>>()
        };
        let seen = meshes.enumerate().filter_map(|(side, mesh)| Some((side, off(mesh)?)));
        let nearest = seen.min_by(|(_, a), (_, b)| a.total_cmp(b));
        nearest.map(|(side, _)| side)
    }
}

/// Lays what would fall over as it looks most like what the model learned from.
impl Guide for &Workcell {
    fn lay(&mut self, sides: impl Iterator<Item = Mesh>) -> Option<usize> {
        self.most_familiar(sides)
    }
}
