//! Colliders of robot, table and object, and their collision groups.

use crate::config::{SceneConfig, SceneError, vec3};
use geometry::convex_shape::ConvexShape;
use objects::object::Object;
use rapier3d::prelude::{
    CoefficientCombineRule, ColliderBuilder, Group, InteractionGroups, InteractionTestMode,
};
use robot::hand_model::LinkRole;
use robot::tree::CollisionShape;
use robot::{ARM_DOF, KinematicTree};

/// Bits 0 to 7 are the arm bodies.
const PALM: u32 = 1 << 8;
/// Links of the fingers that overlap the palm ([`LinkRole::FingerBase`]).
const FINGER_BASES: u32 = 1 << 9;
const FINGERS: u32 = 1 << 10;
const OBJECT: u32 = 1 << 11;
const TABLE: u32 = 1 << 12;

/// Creates the colliders of one robot body.
pub(crate) fn body_colliders(
    tree: &KinematicTree,
    body: usize,
    friction: f32,
) -> Vec<ColliderBuilder> {
    tree.bodies[body]
        .shapes
        .iter()
        .filter_map(|shape| {
            let solid = shape.convex_shape()?;
            let builder = ColliderBuilder::new(solid.shape).position(solid.pose);
            let groups = robot_groups(tree, body, shape);
            Some(massless(builder).friction(friction).collision_groups(groups))
        })
        .collect()
}

/// Creates the collider of the table.
pub(crate) fn table_collider(config: &SceneConfig) -> ColliderBuilder {
    let half = vec3(config.table.half_extents);
    let all_others = !TABLE;
    massless(ColliderBuilder::cuboid(half.x, half.y, half.z))
        .friction(config.table.friction)
        .collision_groups(interaction_groups(TABLE, all_others))
}

/// Creates the colliders of an object, without mass: the rigid body has the mass.
pub(crate) fn object_colliders(object: &Object) -> Result<Vec<ColliderBuilder>, SceneError> {
    object
        .parts
        .iter()
        .enumerate()
        .map(|(part, points)| {
            let flat = || SceneError::FlatPart { name: object.name.clone(), part };
            let hull = ConvexShape::hull(points).ok_or_else(flat)?;
            Ok(massless(ColliderBuilder::new(hull.shape))
                .friction(object.friction)
                .collision_groups(interaction_groups(OBJECT, !OBJECT)))
        })
        .collect()
}

fn massless(builder: ColliderBuilder) -> ColliderBuilder {
    builder.density(0.0).friction_combine_rule(CoefficientCombineRule::GeometricMean)
}

fn interaction_groups(of: u32, with: u32) -> InteractionGroups {
    InteractionGroups::new(
        Group::from_bits_truncate(of),
        Group::from_bits_truncate(with),
        InteractionTestMode::And,
    )
}

/// Collision groups of a shape. Arm links collide only with arm links at a min number of joints away, because
/// nearer links overlap by design.
fn robot_groups(tree: &KinematicTree, body: usize, shape: &CollisionShape) -> InteractionGroups {
    let gap = tree.hand.self_collision.min_arm_joint_gap;
    let distant_arm =
        (0..=ARM_DOF).filter(|i| i.abs_diff(body) >= gap).map(|i| 1u32 << i).sum::<u32>();
    let hand = PALM | FINGER_BASES | FINGERS;
    let environment = OBJECT | TABLE;
    if body > ARM_DOF {
        let arm = (1 << ARM_DOF) - 1;
        return if shape.role == LinkRole::FingerBase {
            interaction_groups(FINGER_BASES, arm | FINGERS | FINGER_BASES | environment)
        } else {
            interaction_groups(FINGERS, arm | (1 << ARM_DOF) | hand | environment)
        };
    }
    if body == ARM_DOF {
        return interaction_groups(PALM | 1 << ARM_DOF, distant_arm | FINGERS | environment);
    }
    interaction_groups(1 << body, distant_arm | hand | environment)
}
