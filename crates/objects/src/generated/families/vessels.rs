//! Vessels with a cavity: bowls, cups, pitchers, rings, trays, baskets, vases.

use super::{loft, steps};
use crate::generated::draw::Draw;
use crate::generated::{Draft, Stance};
use crate::loft::Loft;
use crate::solid::{Solid, Sweep, SweepPoint, Vessel};
use geometry::Vec3;

/// Density (kg/m³) of the wall: plastic, glass, ceramics.
fn wall_density(draw: &mut Draw) -> f32 {
    draw.uniform(900.0, 2400.0)
}

fn vessel(outer: Loft, wall: f32, floor: Option<f32>) -> Solid {
    Vessel { outer, wall, floor }.solid()
}

/// Half a ring from `low` to `high` (heights, m) on a wall. The wall has its surface at x = `wall_at(height)`;
/// `reach` is the distance (m) from it to the middle of the handle.
fn handle(
    [low, high]: [f32; 2],
    wall_at: impl Fn(f32) -> f32,
    reach: f32,
    radii: [f32; 2],
) -> Solid {
    let path = steps(7).map(|t| {
        let (sin, cos) = libm::sincosf(std::f32::consts::PI * t);
        let height = 0.5 * (low + high) - 0.5 * (high - low) * cos;
        // The ends are inside the wall.
        let x = wall_at(height) - 0.001 + reach * sin;
        SweepPoint { center: Vec3::new(x, 0.0, height), radii }
    });
    Sweep { path: path.collect(), is_closed: false, up: Vec3::Y }.solid()
}

/// Round open bowl.
pub(super) fn bowl(draw: &mut Draw) -> Draft {
    let radius = draw.uniform(0.04, 0.09);
    let height = draw.uniform(0.03, 0.09f32.min(1.2 * radius));
    let (base, wall) = (draw.uniform(0.4, 0.7), draw.uniform(0.003, 0.006));
    let curve = draw.uniform(0.45, 0.9);
    let rows: Vec<[f32; 4]> = steps(4)
        .map(|t| {
            let r = radius * (base + (1.0 - base) * libm::powf(t, curve));
            [height * t, r, r, 2.0]
        })
        .collect();
    let solid = vessel(loft(&rows), wall, Some(1.2 * wall));
    Draft { solid, density: wall_density(draw), stance: Stance::AsDrawn }
}

/// Cup, mug or glass, often with a handle.
pub(super) fn cup(draw: &mut Draw) -> Draft {
    let top = draw.uniform(0.028, 0.05);
    let bottom = top * draw.uniform(0.7, 1.05);
    let height = draw.uniform(0.055, 0.14f32.min(4.0 * bottom));
    let wall = draw.uniform(0.0025, 0.005);
    let rows = [[0.0, bottom, bottom, 2.0], [height, top, top, 2.0]];
    let mut solid = vessel(loft(&rows), wall, Some(1.3 * wall));
    if draw.chance(0.6) {
        let at = |z: f32| bottom + (top - bottom) * z / height;
        let ends = [height * draw.uniform(0.15, 0.3), height * draw.uniform(0.7, 0.88)];
        let radii = [draw.uniform(0.0035, 0.006), draw.uniform(0.005, 0.009)];
        solid = solid.union(handle(ends, at, draw.uniform(0.022, 0.034), radii));
    }
    Draft { solid, density: wall_density(draw), stance: Stance::AsDrawn }
}

/// Tall jug with a large handle.
pub(super) fn pitcher(draw: &mut Draw) -> Draft {
    let bottom = draw.uniform(0.038, 0.065);
    let top = bottom * draw.uniform(0.75, 1.05);
    let belly = bottom * draw.uniform(1.0, 1.12);
    let height = draw.uniform(0.13, 0.24);
    let wall = draw.uniform(0.0025, 0.004);
    let rows =
        [[0.0, bottom, bottom, 2.0], [0.4 * height, belly, belly, 2.0], [height, top, top, 2.0]];
    let outer = loft(&rows);
    let profile = outer.clone();
    let at = move |z: f32| profile.section_at(z).half[0];
    let ends = [height * draw.uniform(0.15, 0.3), height * draw.uniform(0.75, 0.92)];
    let radii = [draw.uniform(0.005, 0.008), draw.uniform(0.007, 0.012)];
    let solid = vessel(outer, wall, Some(1.5 * wall)).union(handle(
        ends,
        at,
        draw.uniform(0.03, 0.05),
        radii,
    ));
    Draft { solid, density: draw.uniform(700.0, 1600.0), stance: Stance::AsDrawn }
}

/// Roll of tape or ring, lying.
pub(super) fn ring(draw: &mut Draw) -> Draft {
    let radius = draw.uniform(0.03, 0.07);
    let thickness = draw.uniform(0.006, 0.4 * radius);
    let height = draw.scale(0.014, 0.065);
    let solid = match draw.chance(0.4) {
        true => {
            let minor = 0.5 * height.min(0.035);
            let path = (0..16).map(|i| {
                let (sin, cos) = libm::sincosf(i as f32 * (std::f32::consts::TAU / 16.0));
                let center = Vec3::new(cos, sin, 0.0) * (radius - minor);
                SweepPoint { center, radii: [minor; 2] }
            });
            Sweep { path: path.collect(), is_closed: true, up: Vec3::Z }.solid()
        }
        false => {
            let rows = [[0.0, radius, radius, 2.0], [height, radius, radius, 2.0]];
            vessel(loft(&rows), thickness, None)
        }
    };
    Draft { solid, density: draw.uniform(300.0, 1300.0), stance: Stance::AsDrawn }
}

/// Low open tray or dish with straight sides.
pub(super) fn tray(draw: &mut Draw) -> Draft {
    let a = draw.uniform(0.045, 0.1);
    let b = a * draw.uniform(0.55, 1.0);
    let height = draw.uniform(0.02, 0.05);
    let exponent = draw.uniform(3.0, 9.0);
    let base = draw.uniform(0.8, 0.95);
    let wall = draw.uniform(0.003, 0.006);
    let rows = [[0.0, base * a, base * b, exponent], [height, a, b, exponent]];
    let solid = vessel(loft(&rows), wall, Some(wall));
    Draft { solid, density: wall_density(draw), stance: Stance::AsDrawn }
}

/// Pot or basket with a handle over its opening.
pub(super) fn basket(draw: &mut Draw) -> Draft {
    let top = draw.uniform(0.04, 0.075);
    let bottom = top * draw.uniform(0.7, 1.0);
    let height = draw.uniform(0.05, 0.11);
    let wall = draw.uniform(0.003, 0.005);
    let rows = [[0.0, bottom, bottom, 2.0], [height, top, top, 2.0]];
    let mut solid = vessel(loft(&rows), wall, Some(1.3 * wall));
    let rise = draw.uniform(0.05, 0.09);
    let radii = [draw.uniform(0.004, 0.006), draw.uniform(0.004, 0.009)];
    let path = steps(9).map(|t| {
        let (sin, cos) = libm::sincosf(std::f32::consts::PI * t);
        let center = Vec3::new(-(top - 0.5 * wall) * cos, 0.0, 0.9 * height + rise * sin);
        SweepPoint { center, radii }
    });
    solid = solid.union(Sweep { path: path.collect(), is_closed: false, up: Vec3::Y }.solid());
    Draft { solid, density: draw.uniform(700.0, 1500.0), stance: Stance::AsDrawn }
}

/// Vase, tumbler or open jar with a curved profile.
pub(super) fn vase(draw: &mut Draw) -> Draft {
    let belly = draw.uniform(0.03, 0.05);
    let [bottom, neck, rim] =
        [draw.uniform(0.7, 1.0), draw.uniform(0.55, 0.95), draw.uniform(0.7, 1.1)]
            .map(|ratio| ratio * belly);
    let height = draw.uniform(0.09, 0.22f32.min(5.0 * bottom));
    let wall = draw.uniform(0.003, 0.005);
    let rows = [
        [0.0, bottom, bottom, 2.0],
        [0.4 * height, belly, belly, 2.0],
        [0.8 * height, neck, neck, 2.0],
        [height, rim, rim, 2.0],
    ];
    let solid = vessel(loft(&rows), wall, Some(1.5 * wall));
    Draft { solid, density: wall_density(draw), stance: Stance::AsDrawn }
}
