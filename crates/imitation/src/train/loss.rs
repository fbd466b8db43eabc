//! Eq. 2: imitation loss between policy and expert, in joint space and at the fingertips.

use anyhow::Result;
use candle_core::{Device, Tensor};
use robot::{DOF, JointVector, KinematicTree, NUM_FINGERS};

/// Number of fingertip coordinates.
const FINGERTIP_COORDS: usize = 3 * NUM_FINGERS;

/// Mean over states of √(|δ|² + w² Σ |J δ|²), in the unit of `predicted` (for accelerations rad/s²). δ =
/// `predicted` − `target`, shape (B, DOF); J is the position Jacobian of a fingertip at the configuration; w
/// = `fingertip_weight` (rad/m).
///
/// *Departure: Eq. 2 has only the joint term. One radian at the shoulder moves the fingertips by half a
/// metre, one radian at a finger joint by a few centimetres, and the fingertip positions decide whether the
/// grasp succeeds.*
pub fn joint_and_fingertip_error(
    tree: &KinematicTree,
    configurations: &[JointVector],
    predicted: &Tensor,
    target: &[JointVector],
    fingertip_weight: f64,
) -> Result<Tensor> {
    let count = configurations.len();
    let target: Vec<f32> = target.iter().flatten().map(|x| *x as f32).collect();
    let error = (predicted - Tensor::from_vec(target, (count, DOF), &Device::Cpu)?)?;
    let jacobian =
        |q: &JointVector| fingertip_jacobian(tree, q).map(|x| (fingertip_weight * x) as f32);
    let jacobians: Vec<f32> = configurations.iter().flat_map(jacobian).collect();
    let jacobians = Tensor::from_vec(jacobians, (count, FINGERTIP_COORDS, DOF), &Device::Cpu)?;
    let at_tips = jacobians.matmul(&error.unsqueeze(2)?)?.squeeze(2)?;
    let squares = (error.sqr()?.sum(1)? + at_tips.sqr()?.sum(1)?)?;
    // The small constant keeps the gradient of the norm finite where prediction and target agree.
    Ok((squares + 1e-6)?.sqrt()?.mean_all()?)
}

/// Position Jacobian (m/rad) of the four fingertips, shape (12, 23), row-major.
fn fingertip_jacobian(tree: &KinematicTree, q: &JointVector) -> [f64; FINGERTIP_COORDS * DOF] {
    let kinematics = tree.forward_kinematics(q);
    let mut rows = [0.0; FINGERTIP_COORDS * DOF];
    for (finger, (tip, position)) in tree.fingertips.iter().zip(kinematics.fingertips()).enumerate()
    {
        let jacobian = kinematics.point_jacobian(tip.body, &position);
        for axis in 0..3 {
            for joint in 0..DOF {
                rows[(3 * finger + axis) * DOF + joint] = jacobian[(axis, joint)];
            }
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn loss_combines_joint_and_fingertip_displacement() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let target = JointVector::from_fn(|i, _| libm::sin(3.0 * i as f64));
        let step = JointVector::from_fn(|i, _| libm::sin(2.0 * i as f64 + 1.0));
        let predicted: Vec<f32> = (target + step).iter().map(|x| *x as f32).collect();
        let predicted = Tensor::from_vec(predicted, (1, DOF), &Device::Cpu).unwrap();
        // Directional derivative of the fingertip positions along the step, by central differences.
        let h = 1e-6;
        let (plus, minus) = (q + step * h, q - step * h);
        let (plus, minus) = (
            tree.forward_kinematics(&plus).fingertips(),
            tree.forward_kinematics(&minus).fingertips(),
        );
        let rate = |(a, b): (&robot::Vector, &robot::Vector)| ((a - b) / (2.0 * h)).norm_squared();
        let tips: f64 = plus.iter().zip(&minus).map(rate).sum();
        for fingertip_weight in [0.0, 1.0, 3.0] {
            let found =
                joint_and_fingertip_error(&tree, &[q], &predicted, &[target], fingertip_weight)
                    .unwrap();
            let found = f64::from(found.to_scalar::<f32>().unwrap());
            let expected =
                f64::sqrt(step.norm_squared() + fingertip_weight * fingertip_weight * tips);
            assert!((found - expected).abs() < 1e-5 * expected, "got {found}, expected {expected}");
        }
    }

    #[test]
    fn loss_gradient_matches_central_differences() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let target = [JointVector::zeros()];
        let predicted = JointVector::from_fn(|i, _| libm::sin(2.0 * i as f64 + 1.0));
        let direction = JointVector::from_fn(|i, _| libm::cos(5.0 * i as f64));
        let row = |q: JointVector| -> Vec<f32> { q.iter().map(|x| *x as f32).collect() };
        let loss = |x: &Tensor| joint_and_fingertip_error(&tree, &[q], x, &target, 3.0).unwrap();
        let var = candle_core::Var::from_vec(row(predicted), (1, DOF), &Device::Cpu).unwrap();
        let store = loss(&var).backward().unwrap();
        let gradient = store.get(&var).unwrap().to_vec2::<f32>().unwrap().remove(0);
        let along: f64 = gradient.iter().zip(&direction).map(|(g, x)| f64::from(*g) * x).sum();
        let h = 1e-2;
        let at = |step: f64| {
            let x = row(predicted + direction * step);
            let x = Tensor::from_vec(x, (1, DOF), &Device::Cpu).unwrap();
            f64::from(loss(&x).to_scalar::<f32>().unwrap())
        };
        let slope = (at(h) - at(-h)) / (2.0 * h);
        assert!(
            (slope - along).abs() < 1e-3 * (1.0 + slope.abs()),
            "central difference {slope}, gradient {along}"
        );
    }

    #[test]
    fn loss_is_the_mean_over_states() {
        let tree = KinematicTree::iiwa7_allegro().unwrap();
        let [a, b] = [0.1, 0.4].map(JointVector::from_element);
        let predicted = Tensor::zeros((2, DOF), candle_core::DType::F32, &Device::Cpu).unwrap();
        let error = |q: &[JointVector], x: &Tensor, target: &[JointVector]| {
            let found = joint_and_fingertip_error(&tree, q, x, target, 3.0).unwrap();
            found.to_scalar::<f32>().unwrap()
        };
        let one = |q, row| error(&[q], &predicted.narrow(0, row, 1).unwrap(), &[b]);
        let both = error(&[a, b], &predicted, &[b, b]);
        assert!((both - 0.5 * (one(a, 0) + one(b, 1))).abs() < 1e-5 * both);
    }
}
