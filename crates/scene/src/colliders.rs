//! Collision shapes of robot, table and object, and who may touch whom.

use crate::config::{SceneConfig, SceneError, vec3};
use geometry::object::Object;
use geometry::solid::Solid;
use rapier3d::prelude::{
    CoefficientCombineRule, ColliderBuilder, Group, InteractionGroups, InteractionTestMode,
};
use robot::tree::Shape;
use robot::{ARM, Tree};

/// Arm bodies take bits 0 to 7.
const PALM: u32 = 1 << 8;
/// First links of the fingers, and of the thumb the second too: they sit in the palm.
const BASES: u32 = 1 << 9;
const FINGERS: u32 = 1 << 10;
const OBJECT: u32 = 1 << 11;
const TABLE: u32 = 1 << 12;

/// Colliders of one robot body.
pub(crate) fn of_body(tree: &Tree, body: usize, friction: f32) -> Vec<ColliderBuilder> {
    tree.bodies[body]
        .shapes
        .iter()
        .filter_map(|shape| {
            let solid = shape.solid()?;
            let builder = ColliderBuilder::new(solid.shape).position(solid.pose);
            Some(plain(builder).friction(friction).collision_groups(groups_of(body, shape)))
        })
        .collect()
}

/// The table's collider.
pub(crate) fn of_table(config: &SceneConfig) -> ColliderBuilder {
    let half = vec3(config.table.half);
    let others = !TABLE;
    plain(ColliderBuilder::cuboid(half.x, half.y, half.z))
        .friction(config.table.friction)
        .collision_groups(groups(TABLE, others))
}

/// The colliders of an object, without mass: the body carries it.
pub(crate) fn of_object(object: &Object) -> Result<Vec<ColliderBuilder>, SceneError> {
    object
        .parts
        .iter()
        .enumerate()
        .map(|(part, points)| {
            let flat = || SceneError::FlatPart { name: object.name.clone(), part };
            let hull = Solid::hull(points).ok_or_else(flat)?;
            Ok(plain(ColliderBuilder::new(hull.shape))
                .friction(object.friction)
                .collision_groups(groups(OBJECT, !OBJECT)))
        })
        .collect()
}

fn plain(builder: ColliderBuilder) -> ColliderBuilder {
    builder.density(0.0).friction_combine_rule(CoefficientCombineRule::GeometricMean)
}

fn groups(of: u32, with: u32) -> InteractionGroups {
    InteractionGroups::new(
        Group::from_bits_truncate(of),
        Group::from_bits_truncate(with),
        InteractionTestMode::And,
    )
}

/// Arm links collide with those at least three joints away; neighbours overlap by design.
fn groups_of(body: usize, shape: &Shape) -> InteractionGroups {
    let arm_at_least = |distance: usize| {
        (0..=ARM).filter(|i| i.abs_diff(body) >= distance).map(|i| 1u32 << i).sum::<u32>()
    };
    let hand = PALM | BASES | FINGERS;
    let outside = OBJECT | TABLE;
    if body > ARM {
        let is_base = shape.link.ends_with("_link_0") || shape.link == "thumb_link_1";
        let arm = (1 << ARM) - 1;
        return if is_base {
            groups(BASES, arm | FINGERS | BASES | outside)
        } else {
            groups(FINGERS, arm | (1 << ARM) | hand | outside)
        };
    }
    if body == ARM {
        return groups(PALM | 1 << ARM, arm_at_least(3) | FINGERS | outside);
    }
    groups(1 << body, arm_at_least(3) | hand | outside)
}
