//! The grasps of one object, with the counts of the search.

use crate::Grasp;

/// Grasps of one object, and how many candidates passed each step of the search.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct GraspSet {
    /// Robust grasps, in order of their cluster.
    pub grasps: Vec<Grasp>,
    /// Candidate palm poses, perturbed ones included. This and the next count are 0 if the grasps were selected
    /// from earlier searches.
    pub num_candidates: usize,
    /// Candidates whose closed hand has balanced contact forces.
    pub num_closed: usize,
    /// Closed candidates that were tried in physics.
    pub num_tried: usize,
    /// Trials that lifted the object.
    pub num_lifted: usize,
    /// Grasps that also lifted the object in the perturbed repeats.
    pub num_robust: usize,
}

impl GraspSet {
    /// Whether the grasps were selected from earlier searches by their robustness to hand pose error
    /// ([`crate::search::robustness`]).
    pub(crate) fn is_curated(&self) -> bool {
        self.num_candidates == 0
    }

    /// Appends the grasps of another set as further clusters and adds the counts.
    ///
    /// ```rust
    /// let text =
    ///     include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../assets/grasps/sugar_box.json"));
    /// let set: grasps::GraspSet = serde_json::from_str(text)?;
    /// let (count, num_clusters) = (set.grasps.len(), set.grasps[set.grasps.len() - 1].cluster + 1);
    /// // Clusters are tried in order, so all grasps of the first set precede those of the later one.
    /// let chained = set.clone().chain(set);
    /// assert_eq!(chained.grasps.len(), 2 * count);
    /// assert_eq!(chained.grasps[count].cluster, num_clusters);
    /// # Ok::<(), serde_json::Error>(())
    /// ```
    pub fn chain(mut self, later: Self) -> Self {
        let num_clusters = self.grasps.last().map_or(0, |last| last.cluster + 1);
        let later_grasps = later.grasps.into_iter();
        self.grasps.extend(
            later_grasps.map(|grasp| Grasp { cluster: num_clusters + grasp.cluster, ..grasp }),
        );
        Self {
            grasps: self.grasps,
            num_candidates: self.num_candidates + later.num_candidates,
            num_closed: self.num_closed + later.num_closed,
            num_tried: self.num_tried + later.num_tried,
            num_lifted: self.num_lifted + later.num_lifted,
            num_robust: self.num_robust + later.num_robust,
        }
    }
}
