//! Dragging of the object by the user.

use geometry::Vec3;
use scene::{DragSpring, Scene};

/// Stiffness (N/m) of the drag spring.
const DRAG_STIFFNESS: f32 = 150.0;

/// Max force (N) of the drag spring, about the force of a finger.
const MAX_DRAG_FORCE: f32 = 15.0;

/// Whether the user drags the object. An attempt that was disturbed is not reproducible from its seed.
#[derive(Default)]
pub(crate) struct Disturbance {
    is_active: bool,
    was_active: bool,
}

impl Disturbance {
    /// Drags a point of the object (m, object frame) towards a target (m, world frame); `None` releases it.
    pub(crate) fn drag(&mut self, scene: &mut Scene, drag: Option<(Vec3, Vec3)>) {
        let spring = |(point, target)| DragSpring {
            point,
            target,
            stiffness: DRAG_STIFFNESS,
            max_force: MAX_DRAG_FORCE,
        };
        scene.set_drag_spring(drag.map(spring));
        self.is_active = drag.is_some();
    }

    /// Records that the attempt is stepped now. A drag between two steps has no effect.
    pub(crate) fn record_step(&mut self) {
        self.was_active |= self.is_active;
    }

    pub(crate) fn is_active(&self) -> bool {
        self.is_active
    }

    /// Whether the user dragged the object during a step.
    pub(crate) fn was_active(&self) -> bool {
        self.was_active
    }
}
