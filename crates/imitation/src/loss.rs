//! Eq. 2: how far what a policy does is from what the expert does, in the joints and at the fingertips.

use anyhow::Result;
use candle_core::{Device, Tensor};
use robot::{DOF, FINGERS, JointVector, Tree};

/// Numbers that say where the fingertips are.
const TIPS: usize = 3 * FINGERS;

/// Mean over states of √(|δ|² + w² Σ |J δ|²), rad/s²: δ is what differs from what is `wanted` there, J the Jacobian of a
/// fingertip's place in the configuration, w = `tip_weight` (rad/m).
///
/// *Departure: Eq. 2 has the joints alone. A radian of the shoulder moves the fingertips by half a metre, one of a finger
/// by a few centimetres, and it is there that an object is touched or missed.*
pub fn joint_and_tip_error(
    tree: &Tree,
    configurations: &[JointVector],
    made: &Tensor,
    wanted: &[JointVector],
    tip_weight: f64,
) -> Result<Tensor> {
    let count = configurations.len();
    let wanted: Vec<f32> = wanted.iter().flatten().map(|x| *x as f32).collect();
    let off = (made - Tensor::from_vec(wanted, (count, DOF), &Device::Cpu)?)?;
    let lever = |q: &JointVector| tip_jacobian(tree, q).map(|x| (tip_weight * x) as f32);
    let levers: Vec<f32> = configurations.iter().flat_map(lever).collect();
    let levers = Tensor::from_vec(levers, (count, TIPS, DOF), &Device::Cpu)?;
    let at_tips = levers.matmul(&off.unsqueeze(2)?)?.squeeze(2)?;
    let squares = (off.sqr()?.sum(1)? + at_tips.sqr()?.sum(1)?)?;
    // The small addend keeps the norm's gradient finite where policy and expert agree.
    Ok((squares + 1e-6)?.sqrt()?.mean_all()?)
}

/// Jacobian (m/rad) of the places of the four fingertips, shape (12, 23), row after row.
fn tip_jacobian(tree: &Tree, q: &JointVector) -> [f64; TIPS * DOF] {
    let kinematics = tree.kinematics(q);
    let mut rows = [0.0; TIPS * DOF];
    for (finger, (tip, place)) in tree.tips.iter().zip(kinematics.tips()).enumerate() {
        let jacobian = kinematics.point_jacobian(tip.body, &place);
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
    fn it_is_the_way_of_joints_and_fingertips() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let wanted = JointVector::from_fn(|i, _| libm::sin(3.0 * i as f64));
        let step = JointVector::from_fn(|i, _| libm::sin(2.0 * i as f64 + 1.0));
        let made: Vec<f32> = (wanted + step).iter().map(|x| *x as f32).collect();
        let made = Tensor::from_vec(made, (1, DOF), &Device::Cpu).unwrap();
        // How far the tips go when the configuration goes a little way along the step.
        let h = 1e-6;
        let (there, back) = (q + step * h, q - step * h);
        let (there, back) = (tree.kinematics(&there).tips(), tree.kinematics(&back).tips());
        let way = |(a, b): (&robot::Vector, &robot::Vector)| ((a - b) / (2.0 * h)).norm_squared();
        let tips: f64 = there.iter().zip(&back).map(way).sum();
        for tip_weight in [0.0, 1.0, 3.0] {
            let found = joint_and_tip_error(&tree, &[q], &made, &[wanted], tip_weight).unwrap();
            let found = f64::from(found.to_scalar::<f32>().unwrap());
            let expected = f64::sqrt(step.norm_squared() + tip_weight * tip_weight * tips);
            assert!((found - expected).abs() < 1e-5 * expected, "{found} against {expected}");
        }
    }

    #[test]
    fn its_gradient_is_its_slope() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let q = JointVector::from_fn(|i, _| 0.3 * libm::cos(i as f64));
        let wanted = [JointVector::zeros()];
        let made = JointVector::from_fn(|i, _| libm::sin(2.0 * i as f64 + 1.0));
        let way = JointVector::from_fn(|i, _| libm::cos(5.0 * i as f64));
        let row = |made: JointVector| -> Vec<f32> { made.iter().map(|x| *x as f32).collect() };
        let loss = |made: &Tensor| joint_and_tip_error(&tree, &[q], made, &wanted, 3.0).unwrap();
        let var = candle_core::Var::from_vec(row(made), (1, DOF), &Device::Cpu).unwrap();
        let store = loss(&var).backward().unwrap();
        let gradient = store.get(&var).unwrap().to_vec2::<f32>().unwrap().remove(0);
        let along: f64 = gradient.iter().zip(&way).map(|(g, x)| f64::from(*g) * x).sum();
        let h = 1e-2;
        let at = |share: f64| {
            let made = Tensor::from_vec(row(made + way * share), (1, DOF), &Device::Cpu).unwrap();
            f64::from(loss(&made).to_scalar::<f32>().unwrap())
        };
        let slope = (at(h) - at(-h)) / (2.0 * h);
        assert!((slope - along).abs() < 1e-3 * (1.0 + slope.abs()), "{slope} against {along}");
    }

    #[test]
    fn it_is_the_mean_over_states() {
        let tree = Tree::iiwa7_allegro().unwrap();
        let [a, b] = [0.1, 0.4].map(JointVector::from_element);
        let made = Tensor::zeros((2, DOF), candle_core::DType::F32, &Device::Cpu).unwrap();
        let error = |q: &[JointVector], made: &Tensor, wanted: &[JointVector]| {
            let found = joint_and_tip_error(&tree, q, made, wanted, 3.0).unwrap();
            found.to_scalar::<f32>().unwrap()
        };
        let one = |q, row| error(&[q], &made.narrow(0, row, 1).unwrap(), &[b]);
        let both = error(&[a, b], &made, &[b, b]);
        assert!((both - 0.5 * (one(a, 0) + one(b, 1))).abs() < 1e-5 * both);
    }
}
