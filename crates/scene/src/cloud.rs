//! From depth image to point cloud: crop by workspace and table plane, thin to a fixed count.

use crate::camera::{Camera, DepthImage, Surface};
use crate::config::{SceneConfig, vec3};
use crate::noise;
use geometry::mesh::Mesh;
use geometry::{Pose, Vec3, cloud};
use rand::Rng;
use robot::Tree;

/// The fixed camera with its view of the empty scene, arm at home.
pub struct Eye {
    /// The camera.
    pub camera: Camera,
    config: SceneConfig,
    empty: DepthImage,
}

impl Eye {
    /// Renders the empty scene once; objects are then drawn in front of it.
    pub fn new(config: &SceneConfig, tree: &Tree) -> Self {
        let camera = Camera::new(&config.camera);
        let surroundings = Surface::of_surroundings(config, tree, &config.home());
        let empty = camera.render(&surroundings, None);
        Self { camera, config: config.clone(), empty }
    }

    /// One noisy frame of the object on the table.
    pub fn frame(&self, mesh: &Mesh, world_from_object: &Pose, rng: &mut impl Rng) -> DepthImage {
        noise::apply(&self.clean_frame(mesh, world_from_object), &self.config.camera, rng)
    }

    /// One frame without the sensor's errors.
    pub fn clean_frame(&self, mesh: &Mesh, world_from_object: &Pose) -> DepthImage {
        match Surface::of_mesh(mesh, world_from_object) {
            Some(surface) => self.camera.render(&[surface], Some(&self.empty)),
            None => self.empty.clone(),
        }
    }

    /// The cloud of a frame, shape (num_points, 3), base frame; empty if nothing stands on the table.
    pub fn cloud(&self, frame: &DepthImage) -> Vec<Vec3> {
        let (min, max) = (vec3(self.config.crop.min), vec3(self.config.crop.max));
        let mut points = self.camera.points(frame);
        points.retain(|p| p.cmpge(min).all() && p.cmple(max).all());
        let chosen = cloud::farthest_points(&points, self.config.crop.num_points);
        chosen.into_iter().map(|i| points[i]).collect()
    }
}
