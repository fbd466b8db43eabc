//! Simulated depth sensor: noisy depth image, cropped and downsampled to a point cloud of fixed size.

use crate::config::{Crop, SceneConfig, vec3};
use crate::depth_camera::{Camera, DepthImage, RenderMesh};
use crate::depth_noise;
use geometry::{Pose, Vec3, point_cloud};
use mesh::Mesh;
use rand::Rng;
use robot::KinematicTree;

/// Depth camera with a pre-rendered background: the scene without the object, arm at home.
///
/// ```rust
/// use rand::SeedableRng;
/// use scene::SceneConfig;
/// use scene::depth_sensor::DepthSensor;
/// let (config, tree) = (SceneConfig::standard()?, robot::KinematicTree::iiwa7_allegro()?);
/// let sensor = DepthSensor::new(&config, &tree);
/// let bottle = objects::Object::from_catalog("bleach").expect("a built-in object");
/// let world_from_object = config.object_pose(0.6, 0.0, 0.3); // x, y (m), yaw (rad)
/// let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(0);
/// let image = sensor.capture(&bottle.mesh, &world_from_object, &mut rng);
/// let cloud = sensor.extract_cloud(&image); // base frame (m)
/// assert_eq!(cloud.len(), config.crop.num_points);
/// assert!(cloud.iter().all(|point| point.z > config.table_top()));
/// # Ok::<(), scene::SceneError>(())
/// ```
pub struct DepthSensor {
    /// The camera.
    pub camera: Camera,
    config: SceneConfig,
    background: DepthImage,
}

impl DepthSensor {
    /// Renders the background once. Objects are rendered in front of it.
    pub fn new(config: &SceneConfig, tree: &KinematicTree) -> Self {
        let camera = Camera::new(&config.camera);
        let surfaces = RenderMesh::background(config, tree, &config.home());
        let background = camera.render(&surfaces, None);
        Self { camera, config: config.clone(), background }
    }

    /// Captures one noisy depth image of the object.
    pub fn capture(&self, mesh: &Mesh, world_from_object: &Pose, rng: &mut impl Rng) -> DepthImage {
        depth_noise::apply(&self.render(mesh, world_from_object), &self.config.camera, rng)
    }

    /// Renders one depth image without sensor noise.
    pub fn render(&self, mesh: &Mesh, world_from_object: &Pose) -> DepthImage {
        match RenderMesh::from_mesh(mesh, world_from_object) {
            Some(surface) => self.render_mesh(surface),
            None => self.background.clone(),
        }
    }

    /// Captures one noisy depth image of a surface.
    pub fn capture_mesh(&self, surface: RenderMesh, rng: &mut impl Rng) -> DepthImage {
        depth_noise::apply(&self.render_mesh(surface), &self.config.camera, rng)
    }

    fn render_mesh(&self, surface: RenderMesh) -> DepthImage {
        self.camera.render(&[surface], Some(&self.background))
    }

    /// Extracts the point cloud of a depth image, shape (num_points, 3), base frame; empty without an object.
    pub fn extract_cloud(&self, frame: &DepthImage) -> Vec<Vec3> {
        let (min, max) = (vec3(self.config.crop.min), vec3(self.config.crop.max));
        let mut pixels = self.camera.points(frame);
        for pixel in &mut pixels {
            *pixel = pixel.filter(|p| p.cmpge(min).all() && p.cmple(max).all());
        }
        let points = remove_outliers(&pixels, frame.width, &self.config.crop);
        let selected = point_cloud::farthest_point_sampling(&points, self.config.crop.num_points);
        selected.into_iter().map(|i| points[i]).collect()
    }
}

/// Keeps the points with enough close points among the eight neighbouring pixels.
///
/// Farthest-point sampling would select every outlier, and the encoder's max pooling depends on the outermost
/// points.
fn remove_outliers(pixels: &[Option<Vec3>], width: usize, crop: &Crop) -> Vec<Vec3> {
    let height = pixels.len() / width.max(1);
    let has_neighbors = |pixel: usize, point: Vec3| {
        let (column, row) = (pixel % width, pixel / width);
        let mut count = 0;
        for y in row.saturating_sub(1)..(row + 2).min(height) {
            for x in column.saturating_sub(1)..(column + 2).min(width) {
                let other = pixels[y * width + x];
                count +=
                    usize::from(other.is_some_and(|p| p.distance(point) < crop.neighbor_radius));
            }
        }
        // The count includes the point itself.
        count > crop.min_neighbors
    };
    let inlier =
        |(pixel, point): (usize, &Option<Vec3>)| point.filter(|point| has_neighbors(pixel, *point));
    pixels.iter().enumerate().filter_map(inlier).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use objects::object::Object;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rapier3d::parry::query::PointQuery;
    use rapier3d::parry::shape::TriMesh;

    /// Sorted distances (m) of the points from the object's surface.
    fn distances(object: &Object, world_from_object: &Pose, points: &[Vec3]) -> Vec<f32> {
        let mesh = &object.mesh;
        let surface = TriMesh::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let distance = |point: &Vec3| surface.distance_to_point(world_from_object, *point, false);
        let mut distances: Vec<f32> = points.iter().map(distance).collect();
        distances.sort_by(f32::total_cmp);
        distances
    }

    #[test]
    fn object_cloud_is_on_its_surface() {
        let config = SceneConfig::standard().unwrap();
        let sensor = DepthSensor::new(&config, &KinematicTree::iiwa7_allegro().unwrap());
        let object = Object::from_catalog("sugar_box").unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        for (x, y, yaw) in [(0.6, 0.0, 0.3), (0.42, -0.23, -2.0), (0.78, 0.23, 1.2)] {
            let pose = config.object_pose(x, y, yaw);
            let clean = sensor.extract_cloud(&sensor.render(&object.mesh, &pose));
            assert_eq!(clean.len(), 512);
            let worst = distances(&object, &pose, &clean)[511];
            assert!(worst < 1e-4, "at {x} {y}: a point {worst} m off the surface");

            let noisy = sensor.extract_cloud(&sensor.capture(&object.mesh, &pose, &mut rng));
            assert_eq!(noisy.len(), 512);
            let off = distances(&object, &pose, &noisy);
            let outliers = off.iter().filter(|d| **d > 0.02).count();
            println!("at {x} {y}: median distance {} m, {outliers} of 512 outliers", off[256]);
            assert!(off[256] < 0.003, "at {x} {y}: median distance to the surface {} m", off[256]);
            assert!(off[490] < 0.010, "at {x} {y}: 96th percentile to the surface {} m", off[490]);
            assert!(outliers < 3, "at {x} {y}: {outliers} of 512 points are outliers");
        }
    }

    #[test]
    fn empty_table_has_empty_cloud() {
        let config = SceneConfig::standard().unwrap();
        let sensor = DepthSensor::new(&config, &KinematicTree::iiwa7_allegro().unwrap());
        let points = sensor.extract_cloud(&sensor.background);
        assert!(points.is_empty(), "{} points, the first one at {}", points.len(), points[0]);
    }
}
