//! From depth image to point cloud: crop by workspace and table plane, thin to a fixed count.

use crate::camera::{Camera, DepthImage, Surface};
use crate::config::{Crop, SceneConfig, vec3};
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
            Some(surface) => self.clean_frame_of(surface),
            None => self.empty.clone(),
        }
    }

    /// One noisy frame of a surface.
    pub fn frame_of(&self, surface: Surface, rng: &mut impl Rng) -> DepthImage {
        noise::apply(&self.clean_frame_of(surface), &self.config.camera, rng)
    }

    fn clean_frame_of(&self, surface: Surface) -> DepthImage {
        self.camera.render(&[surface], Some(&self.empty))
    }

    /// The cloud of a frame, shape (num_points, 3), base frame; empty if nothing stands on the table.
    pub fn cloud(&self, frame: &DepthImage) -> Vec<Vec3> {
        let (min, max) = (vec3(self.config.crop.min), vec3(self.config.crop.max));
        let mut pixels = self.camera.points(frame);
        for pixel in &mut pixels {
            *pixel = pixel.filter(|p| p.cmpge(min).all() && p.cmple(max).all());
        }
        let points = without_strays(&pixels, frame.width, &self.config.crop);
        let chosen = cloud::farthest_points(&points, self.config.crop.num_points);
        chosen.into_iter().map(|i| points[i]).collect()
    }
}

/// The points that have enough points close by among the eight pixels around their own.
///
/// Farthest-point order takes every stray pixel there is, and the maxima of the encoder are made of
/// the outermost points.
fn without_strays(pixels: &[Option<Vec3>], width: usize, crop: &Crop) -> Vec<Vec3> {
    let height = pixels.len() / width.max(1);
    let has_company = |pixel: usize, point: Vec3| {
        let (column, row) = (pixel % width, pixel / width);
        let mut close = 0;
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let other = pixels[y * width + x];
                close += usize::from(other.is_some_and(|p| p.distance(point) < crop.near));
            }
        }
        // The point itself was counted too.
        close > crop.neighbors
    };
    let kept =
        |(pixel, point): (usize, &Option<Vec3>)| point.filter(|point| has_company(pixel, *point));
    pixels.iter().enumerate().filter_map(kept).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::object::Object;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rapier3d::parry::query::PointQuery;
    use rapier3d::parry::shape::TriMesh;

    /// Distance (m) of each point from the object's surface, sorted.
    fn distances(object: &Object, world_from_object: &Pose, points: &[Vec3]) -> Vec<f32> {
        let mesh = &object.mesh;
        let surface = TriMesh::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let distance = |point: &Vec3| surface.distance_to_point(world_from_object, *point, false);
        let mut distances: Vec<f32> = points.iter().map(distance).collect();
        distances.sort_by(f32::total_cmp);
        distances
    }

    #[test]
    fn the_cloud_of_an_object_lies_on_its_surface() {
        let config = SceneConfig::standard().unwrap();
        let eye = Eye::new(&config, &Tree::iiwa7_allegro().unwrap());
        let object = Object::built_in("sugar_box").unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for (x, y, yaw) in [(0.6, 0.0, 0.3), (0.42, -0.23, -2.0), (0.78, 0.23, 1.2)] {
            let pose = config.upright(x, y, yaw);
            let clean = eye.cloud(&eye.clean_frame(&object.mesh, &pose));
            assert_eq!(clean.len(), 512);
            let worst = distances(&object, &pose, &clean)[511];
            assert!(worst < 1e-4, "at {x} {y}: a point {worst} m off the surface");

            let noisy = eye.cloud(&eye.frame(&object.mesh, &pose, &mut rng));
            assert_eq!(noisy.len(), 512);
            let off = distances(&object, &pose, &noisy);
            let stray = off.iter().filter(|d| **d > 0.02).count();
            println!("at {x} {y}: half within {} m, {stray} of 512 stray", off[256]);
            assert!(off[256] < 0.003, "at {x} {y}: half is {} m off the surface", off[256]);
            assert!(off[490] < 0.010, "at {x} {y}: some are {} m off the surface", off[490]);
            assert!(stray < 3, "at {x} {y}: {stray} of 512 points are stray");
        }
    }

    #[test]
    fn an_empty_table_gives_no_points() {
        let config = SceneConfig::standard().unwrap();
        let eye = Eye::new(&config, &Tree::iiwa7_allegro().unwrap());
        let points = eye.cloud(&eye.empty);
        assert!(points.is_empty(), "{} points, the first one at {}", points.len(), points[0]);
    }
}
