//! Packages: cartons, tins, bottles, plates.

use super::{cuboid, grounded, loft, lying};
use crate::generated::draw::Draw;
use crate::generated::{Draft, Stance};
use crate::solid::Solid;

/// Box from 1.5 to 27 cm, on any stable side.
pub(super) fn carton(draw: &mut Draw) -> Draft {
    let mut sides = [draw.scale(0.015, 0.09), draw.scale(0.03, 0.16), draw.scale(0.05, 0.27)];
    sides.sort_by(f32::total_cmp);
    let [a, b, c] = sides;
    let solid = cuboid(0.5 * a, 0.5 * b, c, draw.uniform(7.0, 14.0));
    Draft { solid, density: draw.uniform(150.0, 900.0), stance: Stance::AnyStable }
}

/// Can or cylinder, upright or lying.
pub(super) fn tin(draw: &mut Draw) -> Draft {
    let radius = draw.scale(0.014, 0.055);
    let height = draw.scale(0.015f32.max(0.4 * radius), 0.24f32.min(9.0 * radius));
    let lip = draw.uniform(0.0, 0.002);
    let solid = Solid::from(&loft(&[
        [0.0, radius - lip, radius - lip, 2.0],
        [0.1 * height, radius, radius, 2.0],
        [0.9 * height, radius, radius, 2.0],
        [height, radius - lip, radius - lip, 2.0],
    ]));
    let solid = match height > 3.0 * radius && draw.chance(0.3) {
        true => grounded(lying(solid)),
        false => solid,
    };
    Draft { solid, density: draw.uniform(250.0, 1100.0), stance: Stance::AsDrawn }
}

/// Bottle with a shoulder and a neck, upright; flat ones also lying.
pub(super) fn bottle(draw: &mut Draw) -> Draft {
    let a = draw.uniform(0.022, 0.048);
    let b = a * draw.uniform(0.55, 1.0);
    let height = draw.uniform(4.0 * a, 0.27f32.min(9.0 * a));
    let shoulder = height * draw.uniform(0.5, 0.82);
    let neck_start = shoulder + (height - shoulder) * draw.uniform(0.3, 0.7);
    let neck = b * draw.uniform(0.3, 0.6);
    let waist = draw.uniform(0.8, 1.05);
    let exponent = draw.uniform(2.0, 5.0);
    let solid = Solid::from(&loft(&[
        [0.0, 0.94 * a, 0.94 * b, exponent],
        [0.05 * height, a, b, exponent],
        [0.5 * shoulder, waist * a, waist * b, exponent],
        [shoulder, a, b, exponent],
        [neck_start, neck, neck, 2.0],
        [height, neck, neck, 2.0],
    ]));
    let stance = if b < 0.75 * a && draw.chance(0.4) { Stance::AnyStable } else { Stance::AsDrawn };
    Draft { solid, density: draw.uniform(100.0, 1050.0), stance }
}

/// Thin disc or slab, lying.
pub(super) fn plate(draw: &mut Draw) -> Draft {
    let a = draw.scale(0.02, 0.085);
    let b = a * draw.uniform(0.5, 1.0);
    let exponent = if draw.chance(0.4) { 2.0 } else { draw.uniform(4.0, 12.0) };
    let b = if exponent == 2.0 { a } else { b };
    let solid = cuboid(a, b, draw.scale(0.012, 0.035), exponent);
    Draft { solid, density: draw.uniform(250.0, 1500.0), stance: Stance::AsDrawn }
}
