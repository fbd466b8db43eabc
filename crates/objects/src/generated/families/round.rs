//! Round bodies: ellipsoids, bent fruit, cones, pieces of soap.

use super::{grounded, loft, lying, steps};
use crate::generated::draw::Draw;
use crate::generated::{Draft, Stance};
use crate::solid::{Solid, Sweep, SweepPoint};
use geometry::Vec3;

/// Superellipsoid with half-axes `a`, `b`, `c`, on its lowest point. Exponent 2 gives an ellipsoid, a larger one
/// flatter sides.
fn superellipsoid([a, b, c]: [f32; 3], exponent: f32, taper: f32) -> Solid {
    let rows: Vec<[f32; 4]> = steps(11)
        .map(|t| {
            // Equal angles give sections close to each other near the poles, where the profile curves.
            let z = -libm::cosf(std::f32::consts::PI * (0.06 + 0.88 * t));
            let profile = libm::powf(1.0 - libm::powf(z.abs(), exponent), 1.0 / exponent);
            let profile = profile * (1.0 + taper * z);
            [c * z, a * profile, b * profile, exponent]
        })
        .collect();
    grounded(Solid::from(&loft(&rows)))
}

/// Ball, egg or lens.
pub(super) fn ellipsoid(draw: &mut Draw) -> Draft {
    let a = draw.scale(0.018, 0.055);
    let axes = [a, a * draw.uniform(0.65, 1.0), a * draw.uniform(0.5, 1.0)];
    let axes = if draw.chance(0.3) { [a; 3] } else { axes };
    let solid = superellipsoid(axes, 2.0, draw.uniform(-0.2, 0.2));
    Draft { solid, density: draw.uniform(150.0, 1000.0), stance: Stance::AsDrawn }
}

/// Curved body, thicker in the middle, lying on its side.
pub(super) fn bent(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.09, 0.22);
    let thickness = draw.uniform(0.012, 0.022);
    let angle = draw.uniform(0.4, 2.2);
    let end = draw.uniform(0.35, 0.9);
    let height = thickness * draw.uniform(0.85, 1.1);
    let path = steps(9).map(|t| {
        let (sin, cos) = libm::sincosf(angle * (t - 0.5));
        let radius = length / angle;
        let profile = end + (1.0 - end) * (1.0 - (2.0 * t - 1.0) * (2.0 * t - 1.0));
        SweepPoint {
            center: Vec3::new(radius * sin, radius * (1.0 - cos), 0.0),
            radii: [thickness * profile, height * profile],
        }
    });
    let solid = Sweep { path: path.collect(), is_closed: false, up: Vec3::Z }.solid();
    Draft { solid: grounded(solid), density: draw.uniform(300.0, 1000.0), stance: Stance::AsDrawn }
}

/// Frustum with a round or angular base, upright.
pub(super) fn cone(draw: &mut Draw) -> Draft {
    let a = draw.scale(0.02, 0.06);
    let b = a * draw.uniform(0.6, 1.0);
    let height = draw.scale(0.025, 0.2f32.min(5.0 * b));
    let top = draw.uniform(0.3, 0.9);
    let exponent = if draw.chance(0.5) { 2.0 } else { draw.uniform(2.5, 8.0) };
    let b = if exponent == 2.0 { a } else { b };
    let solid = Solid::from(&loft(&[[0.0, a, b, exponent], [height, top * a, top * b, exponent]]));
    Draft { solid, density: draw.uniform(150.0, 1000.0), stance: Stance::AsDrawn }
}

/// Rounded bar of soap, sponge or cushion, lying.
pub(super) fn soap(draw: &mut Draw) -> Draft {
    let a = draw.uniform(0.028, 0.085);
    let axes = [a, a * draw.uniform(0.45, 0.9), draw.uniform(0.009, 0.022)];
    let solid = superellipsoid(axes, draw.uniform(2.2, 4.0), 0.0);
    let solid = if draw.chance(0.2) { grounded(lying(solid)) } else { solid };
    Draft { solid, density: draw.uniform(100.0, 1100.0), stance: Stance::AsDrawn }
}
