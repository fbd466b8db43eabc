//! Grasps that similar objects share: each object also gets the grasps that its neighbours prefer, if its own
//! search has found none like them.

use crate::generate::{FileBatch, Generator, SURFACE_POINTS, read_json};
use crate::grasp_options::{PoseOptions, describe};
use crate::grasp_order::{GraspOrder, NeighborGrasp, order_grasps};
use anyhow::{Context, Result};
#[cfg(doc)]
use configs::DatasetConfig;
use files::atomic_file;
use geometry::surface_sampling;
use grasps::search::SearchConfig;
use grasps::search::grasp_rating::GraspRating;
use grasps::search::transfer::adapt;
use grasps::set::k_medoids::palm_distance;
use grasps::set::symmetry::expand_by_symmetry;
use grasps::{Grasp, GraspSet, RobotContext};
use robot::{Isometry, Vector, rotation};
use std::path::PathBuf;

/// Rounds: the distance (m) from the median of its neighbours beyond which a preferred grasp is replaced, if theirs can
/// be adapted to the object.
const TOLERANCES: [f32; 5] = [0.04, 0.04, 0.03, 0.025, 0.02];

/// Maximum number of grasps of similar objects that are tried on an object in a round.
const MAX_WANTED: usize = 4;

/// Orders and ratings of the grasps in a dataset. Both are empty without [`DatasetConfig::consistent_grasps`].
#[derive(Default)]
pub(crate) struct ConsistentGrasps {
    /// Order of the grasps at every pose of every object.
    pub(crate) orders: Vec<GraspOrder>,
    /// Ratings of the grasps of every object.
    pub(crate) ratings: Vec<Vec<GraspRating>>,
}

impl Generator<'_> {
    /// Writes the grasps of every object, those of similar objects included.
    pub(crate) fn generate_consistent_grasps(&self) -> Result<ConsistentGrasps> {
        let (dataset, names) = (self.dataset, &self.dataset.config.objects);
        let path = |name: &str, rounds: usize| {
            let is_last = rounds == TOLERANCES.len();
            if is_last {
                dataset.grasps_path(name)
            } else {
                dataset.shared_grasps_path(name, rounds)
            }
        };
        self.generate_grasps(|name| path(name, 0))?;
        let (mut sets, mut orders) = (Vec::new(), Vec::new());
        let mut ratings = vec![Vec::new(); names.len()];
        for rounds in 0..=TOLERANCES.len() {
            if rounds > 0 {
                let label = format!("shared grasps, round {rounds}");
                let path = |i: usize| path(&names[i], rounds);
                let stage = FileBatch::new(&label, names.len(), self.progress, path);
                stage.write_bytes(|i| {
                    let object = self.object(&names[i])?;
                    let tolerance = f64::from(TOLERANCES[rounds - 1]);
                    let orders = &orders[i * self.dataset.config.poses..]
                        [..self.num_demonstrated_poses(object)];
                    let wanted = self.wanted_grasps(&sets, orders, i, tolerance);
                    let (config, seed) = (SearchConfig::paper(self.robot), dataset.config.seed);
                    let mut adapted = adapt(self.robot, object, &wanted, &config, seed)?;
                    adapted.grasps = expand_by_symmetry(object, &adapted.grasps);
                    Ok(serde_json::to_vec_pretty(&sets[i].clone().chain(adapted))?)
                })?;
            }
            sets = self.read_sets(|name| path(name, rounds))?;
            ratings = self.rate_grasps(&sets, &ratings, rounds)?;
            let next = TOLERANCES.get(rounds).copied().unwrap_or(f32::INFINITY);
            orders = order_grasps(&self.find_options(&sets, &ratings, rounds)?, next);
        }
        Ok(ConsistentGrasps { orders, ratings })
    }

    fn read_sets(&self, path: impl Fn(&str) -> PathBuf) -> Result<Vec<GraspSet>> {
        let names = self.dataset.config.objects.iter();
        names.map(|name| read_json(&path(name))).collect()
    }

    /// Ratings of all grasps, per object. `known`: those of the first grasps of each set.
    fn rate_grasps(
        &self,
        sets: &[GraspSet],
        known: &[Vec<GraspRating>],
        rounds: usize,
    ) -> Result<Vec<Vec<GraspRating>>> {
        let names = &self.dataset.config.objects;
        let path = |i: usize| match rounds == TOLERANCES.len() {
            true => self.dataset.ratings_path(&names[i]),
            false => self.dataset.shared_ratings_path(&names[i], rounds),
        };
        let label = format!("ratings of grasps, round {rounds}");
        FileBatch::new(&label, names.len(), self.progress, path).write_bytes(|i| {
            let (object, grasps) = (self.object(&names[i])?, &sets[i].grasps);
            let mut ratings = known[i].clone();
            for grasp in &grasps[ratings.len()..] {
                // Turned copies of a grasp of a round object have its rating.
                let is_copy = |other: &&Grasp| {
                    (other.pregrasp, other.grasp, other.squeeze)
                        == (grasp.pregrasp, grasp.grasp, grasp.squeeze)
                };
                let original = grasps[..ratings.len()].iter().rposition(|other| is_copy(&other));
                ratings.push(match original {
                    Some(original) => ratings[original],
                    None => GraspRating::of(self.robot, object, grasp)?,
                });
            }
            Ok(serde_json::to_vec(&ratings)?)
        })?;
        (0..names.len()).map(|i| read_json(&path(i))).collect()
    }

    /// Reachable grasps at every pose of every object, after some rounds.
    fn find_options(
        &self,
        sets: &[GraspSet],
        ratings: &[Vec<GraspRating>],
        rounds: usize,
    ) -> Result<Vec<PoseOptions>> {
        let names = &self.dataset.config.objects;
        let path = |i: usize| self.dataset.options_path(&names[i], rounds);
        let label = format!("reach of grasps, round {rounds}");
        FileBatch::new(&label, names.len(), self.progress, path).write_bytes(|i| {
            let object = self.object(&names[i])?;
            let surface = surface_sampling::sample_surface(&object.mesh, SURFACE_POINTS);
            let of_pose = |pose: [f32; 3]| {
                let placed = self.placed_above_tables(object, pose);
                PoseOptions::find(&placed, &sets[i].grasps, &ratings[i], describe(&surface, pose))
            };
            let count = self.num_demonstrated_poses(object);
            let poses = (0..self.dataset.config.poses).map(|index| (index, self.pose(i, index)));
            let options = poses.map(|(index, pose)| match index < count {
                true => of_pose(pose),
                false => PoseOptions { descriptor: describe(&surface, pose), options: Vec::new() },
            });
            PoseOptions::encode(&options.collect::<Vec<_>>())
        })?;
        let mut all = Vec::new();
        for i in 0..names.len() {
            let options = PoseOptions::decode(&atomic_file::read(&path(i))?);
            let damaged = || format!("{} is damaged; delete it and resume", path(i).display());
            all.extend(options.with_context(damaged)?);
        }
        Ok(all)
    }

    /// Palm poses (object frame) of grasps that neighbours of an object's poses prefer and that it does not have, with
    /// these grasps. The first serves most poses. `orders`: those of the object's poses.
    fn wanted_grasps(
        &self,
        sets: &[GraspSet],
        orders: &[GraspOrder],
        object: usize,
        tolerance: f64,
    ) -> Vec<(Isometry, Grasp)> {
        let poses = self.dataset.config.poses;
        let missing = orders.iter().enumerate().filter_map(|(index, order)| {
            let NeighborGrasp { pose, grasp } = order.missing?;
            let grasp = &sets[pose / poses].grasps[grasp];
            let from = self.pose(pose / poses, pose % poses);
            let palm = move_palm(self.robot, grasp, from, self.pose(object, index));
            Some((palm, grasp.clone()))
        });
        most_wanted(missing.collect(), tolerance)
    }
}

/// Palm pose (object frame) at a pose `to`, that relates to robot and position of the object as a grasp does at `from`.
fn move_palm(robot: &RobotContext, grasp: &Grasp, from: [f32; 3], to: [f32; 3]) -> Isometry {
    let world_from_object =
        |[x, y, yaw]: [f32; 3]| rotation::to_isometry(&robot.config.object_pose(x, y, yaw));
    // Frame at the object, with x away from the robot.
    let world_from_facing = |[x, y, _]: [f32; 3]| {
        let at = world_from_object([x, y, 0.0]).translation;
        let azimuth = libm::atan2(f64::from(y), f64::from(x));
        Isometry::from_parts(at, rotation::from_axis_angle(&Vector::z(), azimuth))
    };
    let facing_from_palm =
        world_from_facing(from).inverse() * world_from_object(from) * grasp.object_from_palm;
    world_from_object(to).inverse() * world_from_facing(to) * facing_from_palm
}

/// Representatives of palm poses, those with the most others nearby first. Palm poses within `tolerance` (m, by
/// [`palm_distance`]) count as one.
fn most_wanted(mut palms: Vec<(Isometry, Grasp)>, tolerance: f64) -> Vec<(Isometry, Grasp)> {
    let mut selected = Vec::new();
    while selected.len() < MAX_WANTED && !palms.is_empty() {
        let is_near = |a: &Isometry, b: &Isometry| palm_distance(a, b) < tolerance;
        let count = |one: &Isometry| palms.iter().filter(|other| is_near(one, &other.0)).count();
        // Ties select the first.
        let best = palms.iter().rev().max_by_key(|(palm, _)| count(palm)).cloned();
        let Some(best) = best else { break };
        palms.retain(|(palm, _)| !is_near(&best.0, palm));
        selected.push(best);
    }
    selected
}

#[cfg(test)]
mod tests {
    use super::*;
    use robot::HAND_DOF;

    fn grasp(x: f64) -> Grasp {
        let [pregrasp, touch, squeeze] = [[0.0; HAND_DOF]; 3];
        let object_from_palm = Isometry::translation(x, 0.02, 0.1);
        Grasp { cluster: 0, object_from_palm, pregrasp, grasp: touch, squeeze }
    }

    #[test]
    fn moved_palm_has_the_same_pose_relative_to_robot_and_object() {
        let robot = RobotContext::standard().unwrap();
        let grasp = grasp(0.05);
        let from = [0.6, 0.1, 0.7];
        let same = move_palm(&robot, &grasp, from, from);
        assert!(palm_distance(&same, &grasp.object_from_palm) < 1e-6);
        // Object and grasp turn together about the robot.
        let turned = dataset::planar_pose::rotate_pose(from, 0.5);
        let same = move_palm(&robot, &grasp, from, turned);
        assert!(palm_distance(&same, &grasp.object_from_palm) < 1e-6);
        // The object turns, the palm does not.
        let [x, y, yaw] = from;
        let moved = move_palm(&robot, &grasp, from, [x, y, yaw + 0.4]);
        let wanted = rotation::rotation_z(-0.4) * grasp.object_from_palm;
        assert!(palm_distance(&moved, &wanted) < 1e-6);
    }

    #[test]
    fn most_wanted_palm_comes_first() {
        let palms = [0.0, 0.2, 0.21, 0.22, 0.4, 0.41, 0.6, 0.8, 1.0]
            .map(|x| (Isometry::translation(x, 0.0, 0.0), grasp(x)));
        let found: Vec<f64> =
            most_wanted(palms.to_vec(), 0.04).iter().map(|(palm, _)| palm.translation.x).collect();
        assert_eq!(found, [0.2, 0.4, 0.0, 0.6]);
        assert!(most_wanted(Vec::new(), 0.04).is_empty());
    }
}
