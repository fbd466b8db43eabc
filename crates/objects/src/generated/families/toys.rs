//! Toys: letters, random assemblies of primitives, vehicles.

use super::{cuboid, grounded, loft, lying, rotation};
use crate::generated::draw::Draw;
use crate::generated::{Draft, Stance};
use crate::solid::Solid;
use geometry::{Pose, Vec3};
use std::f32::consts::{FRAC_PI_2, TAU};

/// L, T, Y or U of bars with the same thickness, on any stable side.
pub(super) fn letter(draw: &mut Draw) -> Draft {
    let thickness = draw.uniform(0.018, 0.06);
    let width = draw.uniform(0.018, 0.04);
    let arm = |length: f32, at: Vec3, angle: f32| {
        let bar = cuboid(0.5 * length, 0.5 * width, thickness, 9.0);
        let along = Vec3::X * (0.5 * length);
        bar.moved(along).placed(&Pose::from_parts(at, rotation(Vec3::Z, angle)))
    };
    let length = draw.uniform(0.06, 0.16);
    let other = draw.uniform(0.04, 0.11);
    let solid = match draw.index(4) {
        0 => arm(length, Vec3::ZERO, 0.0).union(arm(other, Vec3::X * (0.5 * width), FRAC_PI_2)),
        1 => {
            let middle = Vec3::X * (0.5 * length);
            arm(length, Vec3::ZERO, 0.0).union(arm(other, middle, FRAC_PI_2))
        }
        2 => (0..3)
            .map(|k| arm(0.6 * length, Vec3::ZERO, k as f32 * TAU / 3.0))
            .reduce(Solid::union)
            .unwrap_or_default(),
        _ => {
            let ends =
                [0.5 * width, length - 0.5 * width].map(|x| arm(other, Vec3::X * x, FRAC_PI_2));
            ends.into_iter().fold(arm(length, Vec3::ZERO, 0.0), Solid::union)
        }
    };
    Draft { solid, density: draw.uniform(150.0, 900.0), stance: Stance::AnyStable }
}

/// Ball, box or cylinder about the origin.
fn primitive(draw: &mut Draw) -> Solid {
    let [a, b, c] = std::array::from_fn(|_| draw.uniform(0.015, 0.04));
    match draw.index(3) {
        0 => {
            let rows = [-0.9f32, -0.5, 0.0, 0.5, 0.9].map(|z| {
                let r = a * (1.0 - z * z).sqrt();
                [a * z, r, r, 2.0]
            });
            Solid::from(&loft(&rows))
        }
        1 => cuboid(a, b, 2.0 * c, draw.uniform(5.0, 10.0)).moved(Vec3::Z * -c),
        _ => cuboid(a, a, 2.0 * c, 2.0).moved(Vec3::Z * -c),
    }
}

/// Two to four primitives, each partly inside the one before, on any stable side.
pub(super) fn toy(draw: &mut Draw) -> Draft {
    let mut solid = primitive(draw);
    for _ in 0..1 + draw.index(3) {
        let [_, high] = solid.mesh.bounds();
        let angle = draw.uniform(0.0, TAU);
        let (sin, cos) = libm::sincosf(angle);
        let reach = draw.uniform(0.3, 0.9);
        let lift = draw.uniform(0.0, 0.9);
        let center = Vec3::new(reach * cos * high.x, reach * sin * high.y, lift * high.z);
        let tilt = rotation(Vec3::new(cos, sin, 0.0), draw.uniform(-0.6, 0.6));
        let next = primitive(draw).placed(&Pose::from_parts(center, tilt));
        solid = solid.union(next);
    }
    Draft { solid, density: draw.uniform(150.0, 900.0), stance: Stance::AnyStable }
}

/// Car, boat or train: a low body, a cabin and wheels.
pub(super) fn vehicle(draw: &mut Draw) -> Draft {
    let [a, b] = [draw.uniform(0.035, 0.095), draw.uniform(0.016, 0.035)];
    let clearance = draw.uniform(0.004, 0.01);
    let body = draw.uniform(0.016, 0.03);
    let exponent = draw.uniform(3.0, 8.0);
    let mut solid = cuboid(a, b, body, exponent).moved(Vec3::Z * clearance);
    if draw.chance(0.7) {
        let cabin =
            cuboid(a * draw.uniform(0.3, 0.6), 0.85 * b, draw.uniform(0.012, 0.03), exponent);
        let x = a * draw.uniform(-0.4, 0.2);
        solid = solid.union(cabin.moved(Vec3::new(x, 0.0, clearance + 0.95 * body)));
    }
    let wheel = draw.uniform(0.7, 1.1) * 0.5 * (body + clearance);
    for x in [-0.6 * a, 0.6 * a] {
        let axle =
            Solid::from(&loft(&[[-1.05 * b, wheel, wheel, 2.0], [1.05 * b, wheel, wheel, 2.0]]));
        let turn = Pose::from_parts(Vec3::new(x, 0.0, wheel), rotation(Vec3::Z, FRAC_PI_2));
        solid = solid.union(lying(axle).placed(&turn));
    }
    Draft { solid: grounded(solid), density: draw.uniform(150.0, 900.0), stance: Stance::AsDrawn }
}
