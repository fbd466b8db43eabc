//! Grasps adapted to a policy: at every object pose, one near the policy's final configuration.

use crate::generate::{FileBatch, Generator, read_grasp_ratings, read_grasps, read_json};
use crate::grasp_order::GraspOrder;
use crate::shared_grasps::ConsistentGrasps;
use anyhow::{Context, Result};
use dataset::Dataset;
use dataset::dataset::PoseRecord;
use files::atomic_file;
use grasps::search::grasp_rating::{
    GraspRating, LOWERINGS, MAX_FINGERTIP_HEIGHT, lowest_fingertip,
};
use grasps::search::nearby_grasp::{
    MIN_REPEAT_SUCCESSES, NearbyGrasp, Neighborhood, find_nearby_grasp,
};
use grasps::{GraspBranch, GraspSet, RobotContext};
use objects::object::Object;
use robot::JointVector;

/// Final configurations (rad, base frame) of a policy at poses of an object, for their first clouds; `None` if there is
/// none.
pub type PolicyEnds<'a> = dyn Fn(&Object, &[PoseRecord]) -> Vec<Option<JointVector>> + Sync + 'a;

/// A dataset, and the final configurations of a policy at its object poses.
#[derive(Clone, Copy)]
pub struct AdaptationSource<'a> {
    /// The dataset whose grasps are adapted.
    pub dataset: &'a Dataset,
    /// The policy.
    pub policy_ends: &'a PolicyEnds<'a>,
}

/// The adapted grasp of an object pose.
#[derive(serde::Serialize, serde::Deserialize)]
struct PoseGrasp {
    /// Index of the grasp that the source demonstrates.
    demonstrated: usize,
    nearby: Option<NearbyGrasp>,
}

impl Generator<'_> {
    /// Writes the grasps of every object: those of the source, then one per pose that is near the policy's final
    /// configuration there. The latter is preferred, the demonstrated grasp of the source follows.
    pub(crate) fn generate_adapted_grasps(
        &self,
        source: &AdaptationSource,
    ) -> Result<ConsistentGrasps> {
        let (dataset, names) = (self.dataset, &self.dataset.config.objects);
        let path = |i: usize| dataset.adapted_grasps_path(&names[i]);
        let stage = FileBatch::new("grasps near the policy", names.len(), self.progress, path);
        stage.write_bytes(|i| Ok(serde_json::to_vec(&self.adapt_grasps(source, i)?)?))?;
        let mut consistent = ConsistentGrasps::default();
        for (i, name) in names.iter().enumerate() {
            let mut set = read_grasps(source.dataset, name)?;
            let mut ratings = read_grasp_ratings(source.dataset, name)?;
            ratings.resize(set.grasps.len(), GraspRating::default());
            for pose in read_json::<Vec<Option<PoseGrasp>>>(&path(i))? {
                let order = pose.map(|pose| prefer(pose, self.robot, &mut set, &mut ratings));
                consistent.orders.push(order.unwrap_or_default());
            }
            atomic_file::write(&dataset.grasps_path(name), &serde_json::to_vec_pretty(&set)?)?;
            atomic_file::write(&dataset.ratings_path(name), &serde_json::to_vec(&ratings)?)?;
            consistent.ratings.push(ratings);
        }
        Ok(consistent)
    }

    /// Grasps near the policy's final configurations, for each pose that the source demonstrates.
    fn adapt_grasps(
        &self,
        source: &AdaptationSource,
        index: usize,
    ) -> Result<Vec<Option<PoseGrasp>>> {
        let name = &self.dataset.config.objects[index];
        let object = self.object(name)?;
        let grasps = read_grasps(source.dataset, name)?.grasps;
        let ratings = read_grasp_ratings(source.dataset, name)?;
        let demonstrated = source.dataset.demonstrated_grasps(index)?;
        // Poses without demonstrations have no clouds.
        let mut records = source.dataset.read_poses(index)?;
        let mut is_demonstrated = demonstrated.iter().map(Option::is_some);
        records.retain(|_| is_demonstrated.next().unwrap_or(false));
        let mut ends = records.iter().zip((source.policy_ends)(object, &records));
        let mut found = Vec::new();
        for (number, demonstrated) in demonstrated.into_iter().enumerate() {
            let Some(demonstrated) = demonstrated else {
                found.push(None);
                continue;
            };
            let grasp = grasps.get(demonstrated);
            let grasp = grasp.with_context(|| format!("{name}: no grasp {demonstrated}"))?;
            let nearby = match ends.next() {
                Some((record, Some(end))) => {
                    let placed = self.placed_above_tables(object, record.pose);
                    let rating = ratings.get(demonstrated).copied().unwrap_or_default();
                    let near = Neighborhood {
                        end: &end,
                        demonstrated: grasp,
                        lowerings: &self.lowerings(&end, rating),
                        seed: (index * self.dataset.config.poses + number) as u64,
                    };
                    find_nearby_grasp(self.robot, &placed, near)?
                }
                _ => None,
            };
            found.push(Some(PoseGrasp { demonstrated, nearby }));
        }
        Ok(found)
    }

    /// Indices in [`LOWERINGS`] that are tried at a configuration (rad), that of the demonstrated grasp first.
    fn lowerings(&self, end: &JointVector, demonstrated: GraspRating) -> Vec<usize> {
        let is_low = lowest_fingertip(self.robot, end) < MAX_FINGERTIP_HEIGHT;
        let others = (0..LOWERINGS.len()).filter(|other| is_low && *other != demonstrated.lowering);
        std::iter::once(demonstrated.lowering).chain(others).collect()
    }
}

/// Adds the adapted grasp of a pose to the set. Returns the order of the grasps at this pose.
fn prefer(
    pose: PoseGrasp,
    robot: &RobotContext,
    set: &mut GraspSet,
    ratings: &mut Vec<GraspRating>,
) -> GraspOrder {
    let mut preferred = Vec::new();
    if let Some(NearbyGrasp { grasp, lowering, ik_seed, repeat_successes, .. }) = pose.nearby {
        preferred.push(GraspBranch { ik_seed, grasp: set.grasps.len() });
        set.grasps.push(grasp);
        let success_rate = repeat_successes as f32 / MIN_REPEAT_SUCCESSES as f32;
        ratings.push(GraspRating { success_rate, lowering });
    }
    let demonstrated = |ik_seed| GraspBranch { ik_seed, grasp: pose.demonstrated };
    preferred.extend((0..robot.num_ik_seeds()).map(demonstrated));
    GraspOrder { preferred, ..GraspOrder::default() }
}
