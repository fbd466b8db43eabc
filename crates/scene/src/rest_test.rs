//! Rest test: whether an object stays in its pose on the table.

use crate::config::SceneConfig;
use crate::tabletop::TabletopWorld;
use geometry::Vec3;
use objects::object::Object;

/// Duration of the simulation (s).
const DURATION: f64 = 2.0;
/// Cosine of the max tilt (5 degrees): the base of a scan is uneven, so it may rock.
const MIN_TILT_COS: f32 = 0.9962;
/// Max displacement (fraction of the object's size); a ball rolls away.
const MAX_DISPLACEMENT: f32 = 0.2;

/// Whether an object that is placed on the table keeps its pose for two seconds of physics.
///
/// An object without a valid collision shape does not rest.
pub fn rests_on_table(config: &SceneConfig, object: &Object) -> bool {
    let (world, table) = TabletopWorld::create_world(config);
    let [x, y, _] = config.table.center;
    let placed = config.object_pose(x, y, 0.0);
    let Ok(mut tabletop) = TabletopWorld::add_object(world, table, config, object, &placed) else {
        return false;
    };
    let max_displacement = MAX_DISPLACEMENT * object.size().max_element();
    let center = object.center_of_mass;
    let start = placed * center;
    let num_steps = (DURATION / config.physics_dt()).round() as usize;
    for _ in 0..num_steps {
        tabletop.world.step();
        let pose = tabletop.object_pose();
        let tilt_cos = (pose.rotation * Vec3::Z).z;
        let displacement = (pose * center - start).length();
        // Also false if the pose is not finite.
        if !(tilt_cos >= MIN_TILT_COS && displacement <= max_displacement) {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use mesh::{MassProperties, Mesh, VolumeSource};

    /// Box with its centre of mass at a fraction of its width.
    fn cuboid(size: Vec3, center_at: f32) -> Object {
        let corner = |i: usize| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { 0.0 } else { size[axis] };
            Vec3::new(pick(0), pick(1), pick(2))
        };
        let corners: Vec<Vec3> = (0..8).map(corner).collect();
        let hull: Mesh = mesh::convex_hull(&corners, 8).unwrap();
        let inertia = [0, 1, 2].map(|row| {
            let mut values = [0.0; 3];
            values[row] = 1e-3 * size.element_product() / 6.0;
            values
        });
        let properties = MassProperties {
            volume: size.element_product().into(),
            center_of_mass: Vec3::new(center_at, 0.5, 0.5) * size,
            inertia,
            source: VolumeSource::Surface,
        };
        Object::with_properties("box", hull, vec![corners], 0.3, 0.8, properties)
    }

    #[test]
    fn box_rests_until_its_centre_of_mass_leaves_its_base() {
        let config = SceneConfig::standard().unwrap();
        let size = Vec3::new(0.04, 0.06, 0.12);
        for (center_at, is_resting) in [(0.5, true), (0.9, true), (1.1, false), (-0.1, false)] {
            assert_eq!(
                rests_on_table(&config, &cuboid(size, center_at)),
                is_resting,
                "{center_at}"
            );
        }
    }
}
