//! Inspection of an attempt (reconstruction, familiarity, contact forces), and dragging of the object.

use crate::attempt::Attempt;
use crate::familiarity::Familiarity;
use crate::rollout_context::RolloutContext;
use geometry::Vec3;
use policy::observation::cloud_from_canonical;
use robot::JointState;
use scene::{ContactForce, DragSpring, Simulation};

/// Stiffness (N/m) of the drag spring.
const DRAG_STIFFNESS: f32 = 150.0;

/// Max force (N) of the drag spring, about the force of a finger.
const MAX_DRAG_FORCE: f32 = 15.0;

impl Attempt {
    /// Reconstructs the point cloud from z (base frame, m); `None` without a point-cloud policy.
    pub fn reconstruction(&self, context: &RolloutContext) -> Option<Vec<Vec3>> {
        let (model, observation) = (context.model.as_ref()?, self.observation.as_ref()?);
        let cloud = model.reconstruct(observation)?;
        Some(cloud_from_canonical(observation.azimuth, &cloud))
    }

    /// Familiarity of the object to the model; `None` without a point-cloud policy.
    pub fn familiarity(&self, context: &RolloutContext) -> Option<Familiarity> {
        Familiarity::measure(context.model.as_ref()?, self.observation.as_ref()?, self.cloud())
    }

    /// Current contact forces on the object.
    pub fn contact_forces(&self) -> Vec<ContactForce> {
        self.scene.contact_forces()
    }

    /// Drags a point of the object (m, object frame) towards a target (m, world frame); `None` releases it. A
    /// drag during a step makes the attempt irreproducible from its seed.
    pub fn drag(&mut self, drag: Option<(Vec3, Vec3)>) {
        let spring = |(point, target)| DragSpring {
            point,
            target,
            stiffness: DRAG_STIFFNESS,
            max_force: MAX_DRAG_FORCE,
        };
        self.scene.set_drag_spring(drag.map(spring));
        self.is_disturbed = drag.is_some();
    }

    /// Whether the user is dragging the object.
    pub fn is_disturbed(&self) -> bool {
        self.is_disturbed
    }

    /// Whether the user dragged the object before the outcome.
    pub fn was_disturbed(&self) -> bool {
        self.was_disturbed
    }

    /// Steps one control period after the outcome, which does not change. The hand keeps its
    /// commanded position.
    pub fn step_after_outcome(&mut self) {
        let state = JointState::at_rest(self.commanded.q);
        self.scene.track(&state, &state);
    }
}
