//! What an onlooker can see of an attempt and do to it: what the encoder makes of the cloud, what presses on the object,
//! and pulling at it.

use crate::attempt::Attempt;
use crate::likeness::Likeness;
use crate::workcell::Workcell;
use geometry::Vec3;
use policy::encoding::from_front;
use robot::JointState;
use scene::{Contact, Pull, Simulation};

/// Stiffness (N/m) of the spring of whoever pulls.
const STIFFNESS: f32 = 150.0;

/// The greatest force (N) of whoever pulls: what a finger pulls with.
const MOST_FORCE: f32 = 15.0;

impl Attempt {
    /// The cloud that z stands for (base frame, m), where a policy was told z of a cloud.
    pub fn reconstruction(&self, workcell: &Workcell) -> Option<Vec<Vec3>> {
        let (model, seen) = (workcell.model.as_ref()?, self.encoding.as_ref()?);
        let cloud = model.reconstruct(seen)?;
        Some(from_front(seen.bearing, &cloud))
    }

    /// How like what the model learned from the object looks, where a policy was told z of its cloud.
    pub fn likeness(&self, workcell: &Workcell) -> Option<Likeness> {
        Likeness::of(workcell.model.as_ref()?, self.encoding.as_ref()?, self.cloud())
    }

    /// What presses on the object.
    pub fn contacts(&self) -> Vec<Contact> {
        self.scene.contacts()
    }

    /// Pulls at a point of the object (its frame, m) towards a point (m), or lets go. An attempt that somebody pulled at
    /// while time went on is no longer its seed.
    pub fn pull(&mut self, pull: Option<(Vec3, Vec3)>) {
        let spring =
            |(point, towards)| Pull { point, towards, stiffness: STIFFNESS, most: MOST_FORCE };
        self.scene.pull(pull.map(spring));
        self.is_pulled = pull.is_some();
    }

    /// Whether somebody pulls now.
    pub fn is_pulled(&self) -> bool {
        self.is_pulled
    }

    /// Whether somebody pulled before there was a verdict.
    pub fn was_pulled(&self) -> bool {
        self.was_pulled
    }

    /// One control period after the verdict, which stays: the hand holds on, and the world goes on.
    pub fn linger(&mut self) {
        let state = JointState::at_rest(self.state.q);
        self.scene.follow(&state, &state);
    }
}
