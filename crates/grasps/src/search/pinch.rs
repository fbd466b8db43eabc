//! Pinches of low objects: the fingertips slide along the table towards each other.
//!
//! Joints that close at fixed rates move the fingertips along arcs, which lead over the top of a rod of 15 mm. Here
//! inverse kinematics keeps the fingertips at one height, so that they also meet a displaced object.

use crate::RobotContext;
use crate::search::closing::{ClosedHand, closest_points};
use geometry::convex_shape::{ClosestPoints, ConvexShape};
use nalgebra::{Matrix3, Point3, SMatrix, SVector};
use objects::object::Object;
use rand::{Rng, RngExt};
use robot::hand_model::LinkRole;
use robot::tree::Primitive;
use robot::{
    ARM_DOF, FINGER_DOF, Isometry, JointVector, KinematicTree, NUM_FINGERS, Vector, rotation,
};
use serde::{Deserialize, Serialize};

/// Max height (m) of an object whose candidates include pinches.
pub(crate) const MAX_HEIGHT: f32 = 0.05;

/// Range of the distance (m) between fingertips and table.
const TABLE_GAP: [f64; 2] = [0.0015, 0.004];
/// Range of the height of the fingertips (fraction of the object's height), unless the table is too near.
const HEIGHT: [f64; 2] = [0.0, 0.6];
/// Max horizontal distance of the pinch from the centre of mass (fraction of the half extents).
const MAX_OFFSET: f64 = 0.4;
/// Range of the factor on the lateral distances between the fingers.
const SPREAD: [f64; 2] = [0.2, 1.0];
/// Range of the distance (m) of a fingertip from the object before it closes: more than the object is displaced by in
/// a repeat.
const OPENING: [f32; 2] = [0.018, 0.03];
/// Length of a fingertip's path (m), and distance (m) between the points at which it is computed.
const PATH_LENGTH: f64 = 0.075;
const PATH_STEP: f64 = 0.003;
/// Max distance (m) of a fingertip from its path.
const MAX_PATH_ERROR: f64 = 0.002;

/// Parameters of a pinch, object frame.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PinchPlan {
    /// Point (m) at which the paths of the fingertips end, but for their lateral offsets.
    center: [f64; 3],
    /// Angle (rad) of the horizontal direction from the thumb to the fingers.
    yaw: f64,
    /// Angle (rad) of the palm's normal from straight down, towards the thumb.
    tilt: f64,
    /// The centre along the palm's normal and along the fingers (m, palm frame).
    palm: [f64; 2],
    /// Factor on the lateral distances between the fingers.
    spread: f64,
    /// Index of the set of fingers that oppose the thumb.
    finger_set: usize,
    /// Distance (m) of a fingertip from the object before it closes.
    opening: f32,
}

impl PinchPlan {
    /// Samples a pinch in a horizontal direction near the centre of mass.
    pub(crate) fn sample(robot: &RobotContext, object: &Object, rng: &mut impl Rng) -> Self {
        let model = &robot.tree.hand.pinch;
        let [min, max] = object.bounds.map(rotation::to_vector);
        let half = (max - min) * 0.5;
        let mut draw = |[low, high]: [f64; 2]| rng.random_range(low..=high);
        let com = rotation::to_vector(object.center_of_mass);
        let lowest = fingertip_radius(&robot.tree) + draw(TABLE_GAP);
        let [x, y] = [half.x, half.y].map(|half| half * draw([-MAX_OFFSET, MAX_OFFSET]));
        let center = [com.x + x, com.y + y, lowest.max(draw(HEIGHT) * max.z)];
        let yaw = draw([-std::f64::consts::PI, std::f64::consts::PI]);
        let tilt = draw(model.tilt);
        let (palm, spread) = ([model.center_x, model.center_z].map(&mut draw), draw(SPREAD));
        Self {
            center,
            yaw,
            tilt,
            palm,
            spread,
            opening: rng.random_range(OPENING[0]..=OPENING[1]),
            finger_set: rng.random_range(0..model.finger_sets.len()),
        }
    }

    /// A similar pinch: each length differs by up to `shift` (m), each angle by up to `turn` (rad). The height stays,
    /// because fingertips touch the table otherwise.
    pub(crate) fn perturbed(&self, shift: f64, turn: f64, rng: &mut impl Rng) -> Self {
        let mut near = |value: f64, reach: f64| value + rng.random_range(-reach..=reach);
        let [x, y, z] = self.center;
        Self {
            center: [near(x, shift), near(y, shift), z],
            yaw: near(self.yaw, turn),
            tilt: near(self.tilt, turn),
            palm: self.palm.map(|length| near(length, shift)),
            spread: near(self.spread, turn),
            ..*self
        }
    }

    /// Palm pose (m), object frame.
    pub(crate) fn object_from_palm(&self, tree: &KinematicTree) -> Isometry {
        // The palm's normal is its x axis; a quarter turn about y points it straight down.
        let down = std::f64::consts::FRAC_PI_2 + self.tilt;
        let turn = rotation::from_axis_angle(&Vector::z(), self.yaw)
            * rotation::from_axis_angle(&Vector::y(), down);
        let [x, z] = self.palm;
        let lateral = self.mean_base(tree);
        let position = Vector::from(self.center) - turn * Vector::new(x, lateral, z);
        Isometry::from_parts(position.into(), turn)
    }

    /// Mean lateral position (m, palm frame) of the bases of the fingers that oppose the thumb.
    fn mean_base(&self, tree: &KinematicTree) -> f64 {
        let fingers = self.fingers(tree);
        fingers.iter().map(|finger| finger_base(tree, *finger)).sum::<f64>() / fingers.len() as f64
    }

    fn fingers<'a>(&self, tree: &'a KinematicTree) -> &'a [usize] {
        let sets = &tree.hand.pinch.finger_sets;
        sets.get(self.finger_set).map_or(&[], |fingers| fingers)
    }

    /// Lateral offset (m) of the path of each fingertip; `None` for an unused finger.
    fn lateral_offsets(&self, tree: &KinematicTree) -> [Option<f64>; NUM_FINGERS] {
        let mean = self.mean_base(tree);
        let mut offsets = [None; NUM_FINGERS];
        for finger in self.fingers(tree) {
            offsets[*finger] = Some(self.spread * (finger_base(tree, *finger) - mean));
        }
        offsets[NUM_FINGERS - 1] = Some(0.0);
        offsets
    }
}

/// Radius (m) of the rounded fingertips.
fn fingertip_radius(tree: &KinematicTree) -> f64 {
    let shapes = &tree.bodies[tree.fingertips[0].body].shapes;
    let radius = shapes.iter().find_map(|shape| match (shape.role, shape.primitive) {
        (LinkRole::Distal, Primitive::Capsule { radius, .. }) => Some(radius),
        _ => None,
    });
    radius.unwrap_or(0.0)
}

/// Lateral position (m) of a finger's base in the palm frame.
fn finger_base(tree: &KinematicTree, finger: usize) -> f64 {
    let kinematics = tree.forward_kinematics(&JointVector::zeros());
    let base = kinematics.world_from_body[ARM_DOF + FINGER_DOF * finger + 1];
    (kinematics.palm_pose().inverse() * base).translation.y
}

/// A pinch with open and with closed fingers.
pub(crate) struct ClosedPinch {
    pub(crate) pregrasp: JointVector,
    pub(crate) closed: ClosedHand,
}

impl PinchPlan {
    /// Moves the fingertips along their paths until they touch one of `shapes`.
    ///
    /// `open` contains the arm joints, `shapes` and `world_from_object` are in the frame of its base. `None` if a
    /// finger misses the object or cannot follow its path.
    pub(crate) fn close(
        &self,
        robot: &RobotContext,
        open: &JointVector,
        world_from_object: &Isometry,
        shapes: &[ConvexShape],
        contact_distance: f32,
    ) -> Option<ClosedPinch> {
        let lateral = self.lateral_offsets(&robot.tree);
        let direction = rotation::from_axis_angle(&Vector::z(), self.yaw) * Vector::x();
        let across = Vector::z().cross(&direction);
        let (mut pregrasp, mut grasp) = (*open, *open);
        let mut contacts = [None; NUM_FINGERS];
        for finger in 0..NUM_FINGERS {
            let first = ARM_DOF + FINGER_DOF * finger;
            let Some(lateral) = lateral[finger] else {
                // A straight finger is above the table.
                for i in first + 1..first + FINGER_DOF {
                    (pregrasp[i], grasp[i]) = (0.0, 0.0);
                }
                continue;
            };
            let side = if finger == NUM_FINGERS - 1 { -1.0 } else { 1.0 };
            let target = |distance: f64| {
                let center = Vector::from(self.center);
                let point = center + direction * (side * distance) + across * lateral;
                (world_from_object * Point3::from(point)).coords
            };
            let path = FingerPath { robot, finger, shapes, contact_distance };
            let closed = path.follow(open, &target, self.opening)?;
            for i in first..first + FINGER_DOF {
                (pregrasp[i], grasp[i]) = (closed.open[i], closed.touching[i]);
            }
            contacts[finger] = Some(closed.contact);
        }
        let hand = robot::hand_joints(&grasp);
        Some(ClosedPinch { pregrasp, closed: ClosedHand { hand, contacts } })
    }
}

/// Motion of one fingertip towards the object.
struct FingerPath<'a> {
    robot: &'a RobotContext,
    finger: usize,
    shapes: &'a [ConvexShape],
    contact_distance: f32,
}

/// Joints of a finger before and after its motion.
struct ClosedFinger {
    open: JointVector,
    touching: JointVector,
    /// Touching body, and its closest points.
    contact: (usize, ClosestPoints),
}

impl FingerPath<'_> {
    /// Follows `target` (m, distance from the end of the path to a point) from the far end on. `opening` (m) is the
    /// distance from the object at which the motion begins.
    fn follow(
        &self,
        start: &JointVector,
        target: &dyn Fn(f64) -> Vector,
        opening: f32,
    ) -> Option<ClosedFinger> {
        let mut q = *start;
        let mut free: Vec<(f32, JointVector)> = Vec::new();
        for step in 0..=(PATH_LENGTH / PATH_STEP) as usize {
            let point = target(PATH_LENGTH - PATH_STEP * step as f64);
            let (next, error) = reach(&self.robot.tree, &q, self.finger, &point);
            if error > MAX_PATH_ERROR {
                match free.is_empty() {
                    // The path begins where the finger can reach it.
                    true => continue,
                    false => return None,
                }
            }
            q = next;
            let nearest = self.nearest(&q);
            let gap = nearest.as_ref().map_or(f32::INFINITY, |(_, points)| points.distance);
            if gap > self.contact_distance {
                free.push((gap, q));
                continue;
            }
            let (last_gap, last) = *free.last()?;
            let fraction = (last_gap - self.contact_distance) / (last_gap - gap).max(1e-6);
            let touching = last + (q - last) * f64::from(fraction.clamp(0.0, 1.0));
            let (_, open) = *free.iter().rev().find(|(gap, _)| *gap >= opening)?;
            return Some(ClosedFinger { open, touching, contact: nearest? });
        }
        None
    }

    /// The link of the finger that is nearest to the object, except the first, with its closest points.
    fn nearest(&self, q: &JointVector) -> Option<(usize, ClosestPoints)> {
        let RobotContext { tree, collision_model, .. } = self.robot;
        let kinematics = tree.forward_kinematics(q);
        let first = ARM_DOF + FINGER_DOF * self.finger;
        let points =
            |body| Some((body, closest_points(collision_model, &kinematics, body, self.shapes)?));
        let all = (first + 2..=first + FINGER_DOF).rev().filter_map(points);
        all.min_by(|a, b| a.1.distance.total_cmp(&b.1.distance))
    }
}

/// Damped least squares: joints with a fingertip at `target` (m, world frame), and the remaining distance (m).
fn reach(
    tree: &KinematicTree,
    start: &JointVector,
    finger: usize,
    target: &Vector,
) -> (JointVector, f64) {
    const MAX_STEPS: usize = 40;
    const DAMPING: f64 = 1e-5;
    const TOLERANCE: f64 = 2e-4;
    const MAX_JOINT_STEP: f64 = 0.3;
    const LIMIT_MARGIN: f64 = 0.02;
    let first = ARM_DOF + FINGER_DOF * finger;
    let tip = &tree.fingertips[finger];
    let mut q = *start;
    let mut best = (q, f64::INFINITY);
    for _ in 0..MAX_STEPS {
        let kinematics = tree.forward_kinematics(&q);
        let position = kinematics.frame_pose(tip).translation.vector;
        let error = target - position;
        let distance = error.norm();
        if distance < best.1 {
            best = (q, distance);
        }
        if distance < TOLERANCE {
            break;
        }
        let jacobian = kinematics.point_jacobian(tip.body, &position);
        let own: SMatrix<f64, 3, FINGER_DOF> = jacobian.fixed_columns::<FINGER_DOF>(first).into();
        let damped = own * own.transpose() + Matrix3::identity() * DAMPING;
        let Some(inverse) = damped.try_inverse() else { break };
        let step: SVector<f64, FINGER_DOF> = own.transpose() * (inverse * error);
        let scale = (MAX_JOINT_STEP / step.amax().max(1e-9)).min(1.0);
        for (i, step) in (first..).zip(step.iter()) {
            let (lower, upper) = (tree.limits.lower[i], tree.limits.upper[i]);
            q[i] = (q[i] + scale * step).clamp(lower + LIMIT_MARGIN, upper - LIMIT_MARGIN);
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn fingertip_reaches_a_point_within_its_workspace() {
        let robot = RobotContext::standard().unwrap();
        let tree = &robot.tree;
        let open = robot::joint_vector(&[0.0; ARM_DOF], &robot.config.robot.open);
        for finger in 0..NUM_FINGERS {
            let first = ARM_DOF + FINGER_DOF * finger;
            let mut q = open;
            for (i, flexion) in (first..).zip([0.1_f64, 0.5, 0.6, 0.4]) {
                q[i] = flexion.clamp(tree.limits.lower[i] + 0.1, tree.limits.upper[i] - 0.1);
            }
            let target = tree.forward_kinematics(&q).fingertips()[finger];
            let (found, error) = reach(tree, &open, finger, &target);
            assert!(error < 2e-4, "finger {finger}: {error} m");
            let others = (0..robot::DOF).filter(|i| !(first..first + FINGER_DOF).contains(i));
            assert!(others.into_iter().all(|i| found[i] == open[i]), "other joints do not move");
            assert!(tree.limits.contains(&found, 0.0));
            let far = target + Vector::new(0.0, 0.0, 1.0);
            assert!(reach(tree, &open, finger, &far).1 > 0.5);
        }
    }

    #[test]
    fn fingertips_keep_their_height_above_the_table_and_meet_the_object() {
        let robot = RobotContext::standard().unwrap();
        let tree = &robot.tree;
        let object = Object::from_catalog("hammer").unwrap();
        assert!(object.size().z <= MAX_HEIGHT, "{}", object.size());
        let open = robot::joint_vector(&[0.0; ARM_DOF], &robot.config.robot.open);
        let palm = tree.forward_kinematics(&open).palm_pose();
        let mut rng = ChaCha8Rng::seed_from_u64(0);
        let mut num_closed = 0;
        for _ in 0..200 {
            let plan = PinchPlan::sample(&robot, &object, &mut rng);
            let world_from_object = palm * plan.object_from_palm(tree).inverse();
            let pose = rotation::to_pose(&world_from_object);
            let shapes: Vec<ConvexShape> = crate::set::grasp::object_shapes(&object, &pose);
            let Some(pinch) = plan.close(&robot, &open, &world_from_object, &shapes, 5e-4) else {
                continue;
            };
            num_closed += 1;
            let lateral = plan.lateral_offsets(tree);
            let touch = robot::joint_vector(&[0.0; ARM_DOF], &pinch.closed.hand);
            let [before, after] = [&pinch.pregrasp, &touch].map(|q| {
                let tips = tree.forward_kinematics(q).fingertips();
                tips.map(|tip| (world_from_object.inverse() * Point3::from(tip)).coords)
            });
            for finger in (0..NUM_FINGERS).filter(|finger| lateral[*finger].is_some()) {
                let heights = [before[finger].z, after[finger].z];
                assert!(heights.iter().all(|z| (z - plan.center[2]).abs() < 0.004), "{heights:?}");
                let moved = (after[finger] - before[finger]).norm();
                assert!(moved > 0.6 * f64::from(plan.opening), "{moved} m");
                let (_, points) = pinch.closed.contacts[finger].unwrap();
                assert!(points.distance < 0.001, "{} m", points.distance);
            }
        }
        assert!(num_closed > 5, "{num_closed} of 200 pinches closed");
    }
}
