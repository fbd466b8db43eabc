//! Tools: rods, hammers, brushes, drills, clamps, wrenches, dumbbells.

use super::{cuboid, grounded, loft, lying, rotation, steps};
use crate::generated::draw::Draw;
use crate::generated::{Draft, Stance};
use crate::solid::{Solid, Sweep, SweepPoint, Vessel};
use geometry::{Pose, Vec3};
use std::f32::consts::{FRAC_PI_2, PI};

/// Bar along x from x = 0 to `length`, on z = 0, with half-width `a` at its start and `b` at its end.
fn bar(length: f32, [a, b]: [f32; 2], height: f32, exponent: f32) -> Solid {
    let half = 0.5 * height;
    let rows = [
        [0.0, 0.85 * half, 0.85 * a, exponent],
        [0.04 * length, half, a, exponent],
        [0.96 * length, half, b, exponent],
        [length, 0.85 * half, 0.85 * b, exponent],
    ];
    grounded(lying(Solid::from(&loft(&rows))))
}

/// Marker, screwdriver, torch or stick, lying: up to three pieces in a line.
pub(super) fn rod(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.08, 0.26);
    let radius = draw.scale(0.006, 0.021);
    let exponent = if draw.chance(0.4) { 2.0 } else { draw.uniform(2.5, 6.0) };
    let first = length * draw.uniform(0.4, 0.7);
    let ratio = draw.uniform(0.45, 1.0);
    let rows = [
        [0.0, 0.8 * radius, 0.8 * radius, exponent],
        [0.05 * length, radius, radius, exponent],
        [first, radius, radius, exponent],
        [first + 0.06 * length, ratio * radius, ratio * radius, exponent],
        [length, ratio * radius, ratio * radius, exponent],
    ];
    let solid = grounded(lying(Solid::from(&loft(&rows))));
    Draft { solid, density: draw.uniform(400.0, 2000.0), stance: Stance::AsDrawn }
}

/// Hammer, mallet or axe, lying: a head across the end of a handle.
pub(super) fn striker(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.14, 0.3);
    let thickness = draw.uniform(0.018, 0.034);
    let handle = bar(length, [0.5 * thickness; 2], thickness, draw.uniform(2.5, 6.0));
    let head_length = draw.uniform(0.05, 0.13);
    let head = 0.5 * draw.uniform(0.018, 0.045);
    let offset = draw.uniform(-0.2, 0.2) * head_length;
    let head =
        bar(head_length, [head, head * draw.uniform(0.6, 1.0)], 2.0 * head, draw.uniform(2.0, 7.0));
    let turn = Pose::from_parts(
        Vec3::new(length - 0.4 * thickness, offset - 0.5 * head_length, 0.0),
        rotation(Vec3::Z, FRAC_PI_2),
    );
    let solid = handle.union(head.placed(&turn));
    Draft { solid, density: draw.uniform(500.0, 2200.0), stance: Stance::AsDrawn }
}

/// Brush, spatula or racket, lying: a wide flat end on a handle.
pub(super) fn paddle(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.09, 0.2);
    let thickness = draw.uniform(0.014, 0.028);
    let handle = bar(length, [0.5 * thickness; 2], thickness, draw.uniform(2.0, 5.0));
    let [a, b] = [draw.uniform(0.02, 0.055), draw.uniform(0.015, 0.045)];
    let blade = cuboid(a, b, draw.uniform(0.01, 0.04), draw.uniform(2.0, 8.0));
    let solid = handle.union(blade.moved(Vec3::new(length + 0.85 * a, 0.0, 0.0)));
    Draft { solid, density: draw.uniform(300.0, 1200.0), stance: Stance::AsDrawn }
}

/// Drill, glue gun or spray pistol on any stable side: a body, a grip, a base.
pub(super) fn drill(draw: &mut Draw) -> Draft {
    let body = draw.uniform(0.11, 0.19);
    let radius = draw.uniform(0.02, 0.032);
    let grip = draw.uniform(0.06, 0.12);
    let exponent = draw.uniform(2.0, 5.0);
    let nose = radius * draw.uniform(0.4, 0.9);
    let rows = [
        [0.0, 0.9 * radius, 0.9 * radius, exponent],
        [0.6 * body, radius, radius, exponent],
        [body, nose, nose, exponent],
    ];
    let barrel = lying(Solid::from(&loft(&rows))).moved(Vec3::Z * (grip + 0.8 * radius));
    let x = body * draw.uniform(0.15, 0.35);
    let [a, b] = [draw.uniform(0.016, 0.024), draw.uniform(0.013, 0.02)];
    let lean = draw.uniform(-0.02, 0.005);
    let mut stem = loft(&[[0.0, a, b, 3.0], [grip, a, b, 3.0]]);
    stem.sections[0].center[0] = lean;
    let stem = Solid::from(&stem).moved(Vec3::X * x);
    let mut solid = barrel.union(stem);
    if draw.chance(0.6) {
        let [a, b] = [draw.uniform(0.03, 0.045), draw.uniform(0.02, 0.03)];
        let base = cuboid(a, b, draw.uniform(0.015, 0.04), 5.0);
        solid = solid.union(base.moved(Vec3::X * (x + lean)));
    }
    Draft { solid, density: draw.uniform(350.0, 1100.0), stance: Stance::AnyStable }
}

/// U-shaped frame with a bar through its opening, lying.
pub(super) fn clamp(draw: &mut Draw) -> Draft {
    let width = draw.uniform(0.03, 0.09);
    let arm = draw.uniform(0.03, 0.1);
    let radii = [draw.uniform(0.007, 0.014), draw.uniform(0.007, 0.018)];
    let half = 0.5 * width;
    let arc = steps(7).map(|t| {
        let (sin, cos) = libm::sincosf(PI * (t - 0.5));
        Vec3::new(arm + half * cos, half * sin, 0.0)
    });
    let path: Vec<Vec3> = std::iter::once(Vec3::new(0.0, -half, 0.0))
        .chain(arc)
        .chain([Vec3::new(0.0, half, 0.0)])
        .collect();
    let path = path.into_iter().map(|center| SweepPoint { center, radii }).collect();
    let mut solid = grounded(Sweep { path, is_closed: false, up: Vec3::Z }.solid());
    if draw.chance(0.5) {
        let thickness = 2.0 * radii[1] * draw.uniform(0.6, 1.0);
        let length = width * draw.uniform(1.2, 1.8);
        let bar = bar(length, [0.5 * thickness; 2], thickness, 3.0);
        let x = arm * draw.uniform(0.0, 0.5);
        let at = Pose::from_parts(Vec3::new(x, -0.4 * length, 0.0), rotation(Vec3::Z, FRAC_PI_2));
        solid = solid.union(bar.placed(&at));
    }
    Draft { solid, density: draw.uniform(400.0, 2500.0), stance: Stance::AsDrawn }
}

/// Flat wrench: a shaft with a ring or a fork at each end.
pub(super) fn wrench(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.09, 0.2);
    let height = draw.uniform(0.012, 0.028);
    let half = draw.uniform(0.007, 0.014);
    let mut solid = bar(length, [half; 2], height, 5.0);
    for x in [0.0, length] {
        let radius = half * draw.uniform(1.7, 2.4);
        let wall = radius * draw.uniform(0.35, 0.5);
        let rows = [[0.0, radius, radius, 2.0], [height, radius, radius, 2.0]];
        let eye = Vessel { outer: loft(&rows), wall, floor: None }.solid();
        let outwards = if x > 0.0 { 0.8 * radius } else { -0.8 * radius };
        let end = match draw.chance(0.5) {
            true => eye,
            false => cuboid(radius, 0.7 * radius, height, 4.0),
        };
        solid = solid.union(end.moved(Vec3::X * (x + outwards)));
    }
    Draft { solid, density: draw.uniform(700.0, 3000.0), stance: Stance::AsDrawn }
}

/// Two thick ends joined by a bar, lying.
pub(super) fn dumbbell(draw: &mut Draw) -> Draft {
    let length = draw.uniform(0.1, 0.24);
    let radius = draw.uniform(0.016, 0.04);
    let thin = radius * draw.uniform(0.35, 0.8);
    let end = length * draw.uniform(0.15, 0.3);
    let exponent = draw.uniform(2.0, 6.0);
    let piece = |from: f32, to: f32, radius: f32| {
        Solid::from(&loft(&[[from, radius, radius, exponent], [to, radius, radius, exponent]]))
    };
    let solid = piece(0.0, end, radius).union(piece(end, length - end, thin)).union(piece(
        length - end,
        length,
        radius * draw.uniform(0.75, 1.0),
    ));
    Draft {
        solid: grounded(lying(solid)),
        density: draw.uniform(300.0, 1500.0),
        stance: Stance::AsDrawn,
    }
}
