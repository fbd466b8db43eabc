//! Spheres that cover the robot, for distance computations of the motion planner.

use crate::{KinematicTree, UrdfError, Vector};

/// A sphere fixed to a body.
#[derive(Clone, Debug)]
pub struct Sphere {
    /// Index of the body.
    pub body: usize,
    /// Centre (m), body frame.
    pub center: Vector,
    /// Radius (m).
    pub radius: f64,
    /// Name of the URDF link that the sphere covers.
    pub link: String,
}

#[derive(serde::Deserialize)]
struct SphereFile {
    spheres: Vec<SphereRow>,
}

/// A sphere of the file, link frame (m).
#[derive(Clone, Debug, serde::Deserialize)]
pub(crate) struct SphereRow {
    link: String,
    center: [f64; 3],
    radius: f64,
}

/// Parses `collision_spheres.json` in the folder of a robot.
pub(crate) fn parse(text: &str) -> Result<Vec<SphereRow>, UrdfError> {
    let file: SphereFile = serde_json::from_slice(text.as_bytes())
        .map_err(|error| UrdfError::Tree(format!("collision_spheres.json: {error}")))?;
    Ok(file.spheres)
}

impl KinematicTree {
    /// Transforms the spheres to body frames. An error names a link that does not exist.
    pub fn collision_spheres(&self) -> Result<Vec<Sphere>, UrdfError> {
        self.spheres
            .iter()
            .map(|row| {
                let Some(frame) = self.frames.get(&row.link) else {
                    return Err(UrdfError::Tree(format!(
                        "collision_spheres.json: unknown link {}",
                        row.link
                    )));
                };
                let center =
                    frame.body_from_frame.transform_point(&Vector::from(row.center).into());
                let (body, center) = (frame.body, center.coords);
                Ok(Sphere { body, center, radius: row.radius, link: row.link.clone() })
            })
            .collect()
    }
}
