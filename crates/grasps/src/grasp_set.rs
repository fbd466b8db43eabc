//! Grasps of an object, with how they were found.

use crate::Grasp;

/// Grasps of an object and how they were found.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct GraspSet {
    /// Reliable grasps, by kind.
    pub grasps: Vec<Grasp>,
    /// Palm poses proposed around the object; this and the next three are 0 where grasps of earlier searches were chosen
    /// among.
    pub proposed: usize,
    /// Proposals, varied ones too, whose hand closed with balanced forces.
    pub closed: usize,
    /// Of these, tried with the hand alone.
    pub tried: usize,
    /// Trials that lifted.
    pub lifted: usize,
    /// Grasps that lifted in the perturbed repeats too.
    pub reliable: usize,
    /// Of these, tried with arm and hand, and lifted there too.
    pub confirmed: [usize; 2],
}

impl GraspSet {
    /// Whether the grasps were chosen among those of earlier searches, by how they bear a hand beside its place
    /// ([`crate::tolerance`]).
    pub(crate) fn is_chosen(&self) -> bool {
        self.proposed == 0
    }

    /// These grasps, and those of another set after them, as more kinds; counts of both.
    pub fn followed_by(mut self, later: Self) -> Self {
        let kinds = self.grasps.last().map_or(0, |last| last.kind + 1);
        let later_kinds = later.grasps.into_iter();
        self.grasps.extend(later_kinds.map(|grasp| Grasp { kind: kinds + grasp.kind, ..grasp }));
        Self {
            grasps: self.grasps,
            proposed: self.proposed + later.proposed,
            closed: self.closed + later.closed,
            tried: self.tried + later.tried,
            lifted: self.lifted + later.lifted,
            reliable: self.reliable + later.reliable,
            confirmed: std::array::from_fn(|i| self.confirmed[i] + later.confirmed[i]),
        }
    }
}
