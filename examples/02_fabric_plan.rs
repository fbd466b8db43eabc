//! A geometric fabric plans a palm motion above a table (paper §III-A).
//!
//! `cargo run -p examples --example 02_fabric_plan`

use fabrics::terms::repulsion::Obstacle;
use fabrics::{Fabric, FabricConfig, Goal, PlannerConfig, planner};
use geometry::convex_shape::ConvexShape;
use geometry::{Pose, Vec3};
use robot::{JointState, KinematicTree};

fn main() -> anyhow::Result<()> {
    let tree = KinematicTree::iiwa7_allegro()?;
    let hand = [0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 0.0, 0.3, 0.3, 0.3, 1.3, 0.6, 0.34, 0.61];
    let q = robot::joint_vector(&[0.0, 0.3, 0.0, -1.5, 0.0, 1.3, 0.79], &hand);

    // The fabric is a sum of terms: posture, palm and hand attraction, joint limits, repulsion.
    let half_extents = Vec3::new(0.4, 0.55, 0.05);
    let table = ConvexShape::cuboid(half_extents)
        .transformed(&Pose::from_translation(Vec3::new(0.6, 0.0, -0.05)));
    let obstacle = Obstacle { shapes: vec![table], first_active_body: 3 };
    let fabric = Fabric::new(&tree, q, vec![obstacle], FabricConfig::demonstration())?;

    // Move the palm by 15 cm to the left and by 5 cm upwards.
    let mut palm = tree.forward_kinematics(&q).palm_pose();
    palm.translation.vector += nalgebra::vector![0.0, 0.15, 0.05];
    let goal = Goal { palm, hand };
    let config = PlannerConfig::demonstration();
    let plan = planner::plan(&fabric, &JointState::at_rest(q), &goal, &config)
        .ok_or_else(|| anyhow::anyhow!("the state became non-finite"))?;

    let reached = tree.forward_kinematics(&plan.last().q).palm_pose();
    let error = (reached.translation.vector - palm.translation.vector).norm();
    let seconds = plan.accelerations.len() as f64 * config.dt;
    println!(
        "{seconds:.2} s, {} steps, palm {:.1} mm from the goal",
        plan.accelerations.len(),
        1e3 * error
    );
    anyhow::ensure!(error < 0.01, "the goal was not reached");
    Ok(())
}
