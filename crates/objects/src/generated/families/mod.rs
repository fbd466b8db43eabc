//! Families of generated objects.
//!
//! Sizes are those of household objects. All lengths are in metres, densities in kg/m³: a carton of food has
//! about 300, water 1,000, plastic 1,000, ceramics 2,200; tools mix wood and steel.

mod packages;
mod round;
mod tools;
mod toys;
mod vessels;

use super::Draft;
use super::draw::Draw;
use crate::loft::{Loft, Section};
use crate::solid::Solid;
use geometry::{Pose, Vec3};
use glamx::Quat;

/// Family of generated objects.
pub struct Family {
    /// First part of the names of its objects.
    pub name: &'static str,
    /// Whether the whole family is held out: policies are measured on it and never trained.
    pub is_held_out: bool,
    /// Number of objects used by training or evaluation.
    pub count: u32,
    /// Draws a solid.
    pub(super) draw: fn(&mut Draw) -> Draft,
}

impl Family {
    /// Names of the objects used by training or evaluation.
    pub fn names(&self) -> impl Iterator<Item = String> + use<> {
        let name = self.name;
        (0..self.count).map(move |number| super::name(name, number))
    }

    /// Use of the family's objects, as text.
    pub fn usage(&self) -> &'static str {
        if self.is_held_out { "held out" } else { "train" }
    }
}

const fn training(name: &'static str, draw: fn(&mut Draw) -> Draft) -> Family {
    Family { name, is_held_out: false, count: 24, draw }
}

const fn held_out(name: &'static str, draw: fn(&mut Draw) -> Draft) -> Family {
    Family { name, is_held_out: true, count: 12, draw }
}

/// All families.
pub const FAMILIES: &[Family] = &[
    training("carton", packages::carton),
    training("tin", packages::tin),
    training("bottle", packages::bottle),
    training("plate", packages::plate),
    training("bowl", vessels::bowl),
    training("cup", vessels::cup),
    training("pitcher", vessels::pitcher),
    training("ring", vessels::ring),
    training("ellipsoid", round::ellipsoid),
    training("bent", round::bent),
    training("cone", round::cone),
    training("rod", tools::rod),
    training("striker", tools::striker),
    training("paddle", tools::paddle),
    training("drill", tools::drill),
    training("clamp", tools::clamp),
    training("letter", toys::letter),
    training("toy", toys::toy),
    held_out("tray", vessels::tray),
    held_out("basket", vessels::basket),
    held_out("vase", vessels::vase),
    held_out("soap", round::soap),
    held_out("wrench", tools::wrench),
    held_out("dumbbell", tools::dumbbell),
    held_out("vehicle", toys::vehicle),
];

/// Loft of sections: height, half-widths, exponent.
fn loft(rows: &[[f32; 4]]) -> Loft {
    let section = |&[height, a, b, exponent]: &[f32; 4]| Section {
        height,
        half: [a, b],
        exponent,
        center: [0.0; 2],
    };
    Loft { sections: rows.iter().map(section).collect() }
}

/// Box of half-widths `a`, `b` and height `h`, upright on z = 0. `exponent` above 6 gives sharp edges.
fn cuboid(a: f32, b: f32, h: f32, exponent: f32) -> Solid {
    Solid::from(&loft(&[[0.0, a, b, exponent], [h, a, b, exponent]]))
}

/// Rotation by `angle` (rad) about `axis`.
fn rotation(axis: Vec3, angle: f32) -> Quat {
    let (sin, cos) = libm::sincosf(0.5 * angle);
    let v = axis * sin;
    Quat::from_xyzw(v.x, v.y, v.z, cos)
}

/// A solid along z, laid along x: z becomes x, and x becomes -z.
fn lying(solid: Solid) -> Solid {
    solid.placed(&Pose::from_parts(Vec3::ZERO, rotation(Vec3::Y, std::f32::consts::FRAC_PI_2)))
}

/// The solid moved up or down so that its lowest point is at z = 0.
fn grounded(solid: Solid) -> Solid {
    let [low, _] = solid.mesh.bounds();
    solid.moved(Vec3::new(0.0, 0.0, -low.z))
}

/// `count` numbers from 0 to 1 at equal intervals.
fn steps(count: usize) -> impl Iterator<Item = f32> {
    (0..count).map(move |i| i as f32 / (count - 1) as f32)
}
