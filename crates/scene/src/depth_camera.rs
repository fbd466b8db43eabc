//! Depth camera by ray casting. It renders the object's triangle mesh instead of its convex collision parts.

use crate::config::{CameraConfig, SceneConfig, vec3};
use geometry::{Pose, Vec3};
use mesh::Mesh;
use rapier3d::parry::bounding_volume::BoundingSphere;
use rapier3d::parry::query::Ray;
use rapier3d::parry::shape::{Cuboid, SharedShape, TriMesh};
use robot::{JointVector, KinematicTree, rotation};

/// Depth (m) along the optical axis, row-major from the upper left; 0 for pixels without a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Width (pixels).
    pub width: usize,
    /// Height (pixels).
    pub height: usize,
    /// Depth (m) of each pixel.
    pub depth: Vec<f32>,
}

/// A mesh or primitive shape that can be rendered.
pub struct RenderMesh {
    shape: SharedShape,
    world_from_mesh: Pose,
    bounding_sphere: BoundingSphere,
}

/// A pinhole depth camera at a fixed pose.
///
/// ```rust
/// use scene::SceneConfig;
/// use scene::depth_camera::{Camera, DepthImage};
/// let config = SceneConfig::standard()?.camera;
/// let camera = Camera::new(&config);
/// // All pixels measure a depth of 1 m: a plane at z = 1 m in the camera frame.
/// let (width, height) = (config.width, config.height);
/// let image = DepthImage { width, height, depth: vec![1.0; width * height] };
/// for world_point in camera.points(&image).into_iter().flatten() {
///     let point = camera.world_from_camera.inverse() * world_point;
///     assert!((point.z - 1.0).abs() < 1e-5);
/// }
/// # Ok::<(), scene::SceneError>(())
/// ```
#[derive(Clone, Debug)]
pub struct Camera {
    /// Pose of the camera: x to the right, y down, z along the optical axis.
    pub world_from_camera: Pose,
    width: usize,
    height: usize,
    /// Focal length (pixels).
    focal: f32,
    range: [f32; 2],
}

impl RenderMesh {
    /// A triangle mesh at the pose `world_from_mesh`; `None` if it has no triangles.
    pub fn from_mesh(mesh: &Mesh, world_from_mesh: &Pose) -> Option<Self> {
        let mesh = TriMesh::new(mesh.vertices.clone(), mesh.triangles.clone()).ok()?;
        Some(Self::new(SharedShape::new(mesh), *world_from_mesh))
    }

    /// A copy at another pose.
    pub fn at_pose(&self, world_from_surface: &Pose) -> Self {
        Self::new(self.shape.clone(), *world_from_surface)
    }

    /// Table and robot at the joint position `q` (rad): the background of every frame.
    pub fn background(config: &SceneConfig, tree: &KinematicTree, q: &JointVector) -> Vec<Self> {
        let table = SharedShape::new(Cuboid::new(vec3(config.table.half_extents)));
        let center = Pose::from_translation(vec3(config.table.center));
        let mut surfaces = vec![Self::new(table, center)];
        let kinematics = tree.forward_kinematics(q);
        for (body, world_from_body) in tree.bodies.iter().zip(&kinematics.world_from_body) {
            for shape in &body.shapes {
                let Some(solid) = shape.convex_shape() else { continue };
                let world_from_solid = rotation::to_pose(world_from_body) * solid.pose;
                surfaces.push(Self::new(solid.shape, world_from_solid));
            }
        }
        surfaces
    }

    fn new(shape: SharedShape, world_from_surface: Pose) -> Self {
        let sphere = shape.compute_bounding_sphere(&world_from_surface);
        Self { shape, world_from_mesh: world_from_surface, bounding_sphere: sphere }
    }

    /// Distance (m) to the hit along a ray with unit direction; `None` beyond `reach` (m).
    fn cast_ray(&self, ray: &Ray, reach: f32) -> Option<f32> {
        let offset = self.bounding_sphere.center - ray.origin;
        let along = offset.dot(ray.dir);
        let squared_offset = offset.length_squared() - along * along;
        if squared_offset > self.bounding_sphere.radius * self.bounding_sphere.radius
            || along < -self.bounding_sphere.radius
        {
            return None;
        }
        self.shape.cast_ray(&self.world_from_mesh, ray, reach, true)
    }
}

impl Camera {
    /// Places the camera; the image rows are parallel to the horizon.
    pub fn new(config: &CameraConfig) -> Self {
        let (position, target) = (vec3(config.position), vec3(config.target));
        let forward = (target - position).normalize();
        let right = forward.cross(Vec3::Z).normalize();
        let down = forward.cross(right);
        let rotation = glamx::Quat::from_mat3(&glamx::Mat3::from_cols(right, down, forward));
        let half_angle = 0.5 * config.hfov_deg.to_radians();
        Self {
            world_from_camera: Pose::from_parts(position, rotation.normalize()),
            width: config.width,
            height: config.height,
            focal: 0.5 * config.width as f32 / libm::tanf(half_angle),
            range: config.range,
        }
    }

    /// Renders `surfaces` without noise, occluded by `occluder_depth` if given.
    pub fn render(
        &self,
        surfaces: &[RenderMesh],
        occluder_depth: Option<&DepthImage>,
    ) -> DepthImage {
        let mut depth = Vec::with_capacity(self.width * self.height);
        for row in 0..self.height {
            for column in 0..self.width {
                let pixel = self.ray_direction(column as f32, row as f32);
                let length = pixel.length();
                let direction = self.world_from_camera.rotation * (pixel / length);
                let ray = Ray::new(self.world_from_camera.translation, direction);
                let occluder = occluder_depth.map_or(0.0, |image| image.depth[depth.len()]);
                let mut reach =
                    if occluder > 0.0 { occluder * length } else { self.range[1] * length };
                let mut measured = occluder;
                for surface in surfaces {
                    if let Some(distance) = surface.cast_ray(&ray, reach) {
                        reach = distance;
                        measured = distance / length;
                    }
                }
                depth.push(if measured < self.range[0] { 0.0 } else { measured });
            }
        }
        DepthImage { width: self.width, height: self.height, depth }
    }

    /// Back-projects each pixel to a world point (m); `None` for pixels without a measurement.
    pub fn points(&self, image: &DepthImage) -> Vec<Option<Vec3>> {
        let point = |(pixel, &depth): (usize, &f32)| {
            let (column, row) = (pixel % self.width, pixel / self.width);
            let direction = self.ray_direction(column as f32, row as f32);
            (depth > 0.0).then(|| self.world_from_camera * (direction * depth))
        };
        image.depth.iter().enumerate().map(point).collect()
    }

    /// Direction through a pixel centre, camera frame, scaled to z = 1.
    fn ray_direction(&self, column: f32, row: f32) -> Vec3 {
        let x = (column + 0.5 - 0.5 * self.width as f32) / self.focal;
        let y = (row + 0.5 - 0.5 * self.height as f32) / self.focal;
        Vec3::new(x, y, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square in the plane x = `distance`, in front of a camera at the origin that points along x.
    fn wall(distance: f32, half: f32) -> RenderMesh {
        let corner = |y: f32, z: f32| Vec3::new(0.0, y * half, z * half);
        let mesh = Mesh {
            vertices: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
                .map(|(y, z)| corner(y, z))
                .to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        RenderMesh::from_mesh(&mesh, &Pose::from_translation(Vec3::X * distance)).unwrap()
    }

    fn camera() -> Camera {
        let config = SceneConfig::standard().unwrap().camera;
        Camera::new(&CameraConfig { position: [0.0; 3], target: [1.0, 0.0, 0.0], ..config })
    }

    #[test]
    fn wall_is_measured_at_its_distance() {
        let camera = camera();
        for distance in [0.4, 0.8, 1.5] {
            let image = camera.render(&[wall(distance, 2.0)], None);
            let worst = image.depth.iter().map(|d| (d - distance).abs()).fold(0.0, f32::max);
            assert!(worst < 0.001, "wall at {distance} m: depth off by {worst} m");
            let points: Vec<Vec3> = camera.points(&image).into_iter().flatten().collect();
            assert_eq!(points.len(), 160 * 120);
            let worst = points.iter().map(|p| (p.x - distance).abs()).fold(0.0, f32::max);
            assert!(worst < 0.001, "wall at {distance} m: points off by {worst} m");
        }
    }

    #[test]
    fn square_has_its_size_and_is_upright() {
        let camera = camera();
        let image = camera.render(&[wall(0.8, 0.1)], None);
        let points: Vec<Vec3> = camera.points(&image).into_iter().flatten().collect();
        // A pixel is 5 mm wide at 0.8 m; the outermost pixel centres are inside the edge.
        let pixel = 0.8 / camera.focal;
        for direction in [Vec3::Y, Vec3::Z, Vec3::NEG_Y, Vec3::NEG_Z] {
            let edge = points.iter().map(|p| p.dot(direction)).fold(0.0, f32::max);
            assert!(edge <= 0.1 && edge > 0.1 - pixel, "edge at {edge} m, wanted 0.1");
        }
        let (first, last) = (points[0], points[points.len() - 1]);
        assert!(first.z > 0.09 && first.y > 0.09, "the first row must be the upper one: {first}");
        assert!(last.z < -0.09 && last.y < -0.09, "the first column must be the left one: {last}");
    }

    #[test]
    fn near_surface_occludes_far_surface() {
        let camera = camera();
        let far = camera.render(&[wall(1.2, 2.0)], None);
        let both = camera.render(&[wall(0.8, 0.1)], Some(&far));
        let together = camera.render(&[wall(1.2, 2.0), wall(0.8, 0.1)], None);
        assert_eq!(both, together);
        let near = both.depth.iter().filter(|d| (**d - 0.8).abs() < 0.001).count();
        let behind = both.depth.iter().filter(|d| (**d - 1.2).abs() < 0.001).count();
        assert_eq!(near + behind, 160 * 120);
        assert!(near > 1000, "{near} pixels of the near wall");
    }

    #[test]
    fn surface_out_of_range_is_not_measured() {
        let camera = camera();
        for distance in [0.2, 1.7] {
            let image = camera.render(&[wall(distance, 2.0)], None);
            let measured = camera.points(&image).into_iter().flatten().count();
            assert_eq!(measured, 0, "a wall at {distance} m was measured");
        }
    }
}
