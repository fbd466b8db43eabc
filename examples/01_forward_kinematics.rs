//! Forward kinematics: palm pose, fingertip positions and the palm Jacobian.
//!
//! `cargo run -p examples --example 01_forward_kinematics`

use robot::{ARM_DOF, JointVector, KinematicTree};

fn main() -> anyhow::Result<()> {
    let tree = KinematicTree::iiwa7_allegro()?;
    // Arm bent over the table, hand open (rad).
    let arm = [0.0, 0.3, 0.0, -1.5, 0.0, 1.3, 0.8];
    let mut q = JointVector::zeros();
    q.as_mut_slice()[..ARM_DOF].copy_from_slice(&arm);

    let kinematics = tree.forward_kinematics(&q);
    let palm = kinematics.palm_pose();
    println!("palm at {:.3?} m", palm.translation.vector.as_slice());
    for (finger, tip) in ["index", "middle", "ring", "thumb"].iter().zip(kinematics.fingertips()) {
        println!("{finger:>6} tip at {:.3?} m", tip.as_slice());
    }

    // J q̇ predicts the motion of the palm to first order.
    let jacobian = kinematics.palm_jacobian();
    let step = 1e-4;
    let mut moved = q;
    moved[1] += step;
    let moved = tree.forward_kinematics(&moved).palm_pose().translation.vector;
    let predicted = palm.translation.vector + jacobian.column(1).fixed_rows::<3>(0) * step;
    let error = (moved - predicted).norm();
    println!("first-order prediction error for {step} rad: {error:.1e} m");
    anyhow::ensure!(error < 1e-7, "the Jacobian disagrees with a finite difference");
    Ok(())
}
