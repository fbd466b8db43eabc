//! Collision queries of convex shapes.
//!
//! All colliders are cuboids, capsules and convex polyhedra. parry's own dispatcher also links the code for
//! voxels, height fields and triangle meshes, which the page would download. This one calls the same functions
//! for the same pairs, so results have the same bits.

use rapier3d::parry::math::{Pose, Real, Vector};
use rapier3d::parry::query::details::{
    self, ContactManifoldsWorkspace, NonlinearShapeCastMode, NormalConstraints, ShapeCastOptions,
};
use rapier3d::parry::query::{
    ClosestPoints, Contact, ContactManifold, NonlinearRigidMotion, PersistentQueryDispatcher,
    QueryDispatcher, ShapeCastHit, ShapeDistance, ShapeIntersection, Unsupported,
};
use rapier3d::parry::shape::{Shape, ShapeType, SupportMap};

/// Dispatcher of cuboids, capsules and convex polyhedra; all others are [`Unsupported`].
pub(crate) struct ConvexDispatcher;

fn support_maps<'a>(
    first: &'a dyn Shape,
    second: &'a dyn Shape,
) -> Result<(&'a dyn SupportMap, &'a dyn SupportMap), Unsupported> {
    first.as_support_map().zip(second.as_support_map()).ok_or(Unsupported)
}

impl QueryDispatcher for ConvexDispatcher {
    fn intersection_test(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        let (first, second) = support_maps(first, second)?;
        Ok(details::intersection_test_support_map_support_map(pose, first, second).into())
    }

    fn distance(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
    ) -> Result<ShapeDistance, Unsupported> {
        let (first, second) = support_maps(first, second)?;
        Ok(details::distance_support_map_support_map(pose, first, second).into())
    }

    fn contact(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        prediction: Real,
    ) -> Result<Option<Contact>, Unsupported> {
        let (first, second) = support_maps(first, second)?;
        Ok(details::contact_support_map_support_map(pose, first, second, prediction))
    }

    fn closest_points(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        max_dist: Real,
    ) -> Result<ClosestPoints, Unsupported> {
        let (first, second) = support_maps(first, second)?;
        Ok(details::closest_points_support_map_support_map(pose, first, second, max_dist))
    }

    fn cast_shapes(
        &self,
        pose: &Pose,
        velocity: Vector,
        first: &dyn Shape,
        second: &dyn Shape,
        options: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        let (first, second) = support_maps(first, second)?;
        Ok(details::cast_shapes_support_map_support_map(pose, velocity, first, second, options))
    }

    fn cast_shapes_nonlinear(
        &self,
        motion1: &NonlinearRigidMotion,
        shape1: &dyn Shape,
        motion2: &NonlinearRigidMotion,
        shape2: &dyn Shape,
        start: Real,
        end: Real,
        stop_at_penetration: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        let (first, second) = support_maps(shape1, shape2)?;
        let mode = if stop_at_penetration {
            NonlinearShapeCastMode::StopAtPenetration
        } else {
            NonlinearShapeCastMode::directional_toi(shape1, shape2)
        };
        Ok(details::cast_shapes_nonlinear_support_map_support_map(
            self, motion1, first, shape1, motion2, second, shape2, start, end, mode,
        ))
    }
}

impl<M, C> PersistentQueryDispatcher<M, C> for ConvexDispatcher
where
    M: Default + Clone + Send + Sync,
    C: Default + Copy + Send + Sync,
{
    fn contact_manifolds(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        prediction: Real,
        manifolds: &mut Vec<ContactManifold<M, C>>,
        _: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        if manifolds.is_empty() {
            manifolds.push(ContactManifold::new());
        }
        let manifold = &mut manifolds[0];
        self.contact_manifold_convex_convex(pose, first, second, None, None, prediction, manifold)
    }

    fn contact_manifold_convex_convex(
        &self,
        pose: &Pose,
        first: &dyn Shape,
        second: &dyn Shape,
        constraints1: Option<&dyn NormalConstraints>,
        constraints2: Option<&dyn NormalConstraints>,
        prediction: Real,
        manifold: &mut ContactManifold<M, C>,
    ) -> Result<(), Unsupported> {
        use details::{
            contact_manifold_capsule_capsule_shapes, contact_manifold_cuboid_cuboid_shapes,
            contact_manifold_pfm_pfm,
        };
        match (first.shape_type(), second.shape_type()) {
            (ShapeType::Cuboid, ShapeType::Cuboid) => {
                contact_manifold_cuboid_cuboid_shapes(pose, first, second, prediction, manifold);
            }
            (ShapeType::Capsule, ShapeType::Capsule) => {
                contact_manifold_capsule_capsule_shapes(pose, first, second, prediction, manifold);
            }
            _ => {
                let (first, border1) = first.as_polygonal_feature_map().ok_or(Unsupported)?;
                let (second, border2) = second.as_polygonal_feature_map().ok_or(Unsupported)?;
                contact_manifold_pfm_pfm(
                    pose,
                    first,
                    border1,
                    constraints1,
                    second,
                    border2,
                    constraints2,
                    prediction,
                    manifold,
                );
            }
        }
        Ok(())
    }
}
