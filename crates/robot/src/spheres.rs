//! Spheres that cover the robot, for the planner's distances.

use crate::{Tree, UrdfError, Vector};

/// A sphere fixed to a body.
#[derive(Clone, Debug)]
pub struct Sphere {
    /// Body index.
    pub body: usize,
    /// Centre (m), body frame.
    pub center: Vector,
    /// Radius (m).
    pub radius: f64,
    /// URDF link that it covers.
    pub link: String,
}

#[derive(serde::Deserialize)]
struct File {
    spheres: Vec<Row>,
}

#[derive(serde::Deserialize)]
struct Row {
    link: String,
    center: [f64; 3],
    radius: f64,
}

impl Tree {
    /// The spheres of `assets/robot/spheres.json`, moved into body frames.
    pub fn spheres(&self) -> Result<Vec<Sphere>, UrdfError> {
        let text = include_str!("../../../assets/robot/spheres.json");
        let file: File = serde_json::from_str(text)
            .map_err(|error| UrdfError::Tree(format!("spheres.json: {error}")))?;
        file.spheres
            .into_iter()
            .map(|row| {
                let Some(frame) = self.frames.get(&row.link) else {
                    return Err(UrdfError::Tree(format!("spheres.json: no link {}", row.link)));
                };
                let center =
                    frame.body_from_frame.transform_point(&Vector::from(row.center).into());
                let (body, center) = (frame.body, center.coords);
                Ok(Sphere { body, center, radius: row.radius, link: row.link })
            })
            .collect()
    }
}
