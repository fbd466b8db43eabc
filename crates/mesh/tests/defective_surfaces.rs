//! Surfaces with holes, loose pieces, touching or overlapping solids: their volume is that of the object.

mod common;

use common::{Triangle, check, cuboid, import, lathe, stl};
use mesh::VolumeSource;

/// Cup of 80 x 80 x 95 mm with a wall of 3 mm: 86.0 cm³, centre of mass 38.4 mm above its foot.
fn cup() -> Vec<Triangle> {
    let profile = [[0.0, 0.0], [40.0, 0.0], [40.0, 95.0], [37.0, 95.0], [37.0, 4.0], [0.0, 4.0]];
    lathe(&profile, 64)
}

#[test]
fn missing_triangle_does_not_change_the_volume() {
    let cup = cup();
    for missing in [0, 70, 200] {
        let mut open = cup.clone();
        open.remove(missing);
        let found = check("cup", &stl(&open), [80.0, 80.0, 95.0], 86.0);
        assert_eq!((found.repair.filled_holes, found.repair.watertight), (1, true), "{missing}");
        let properties = import(&stl(&open)).unwrap().1;
        let height = 1000.0 * properties.center_of_mass.z;
        assert!((height - 38.4).abs() < 0.3, "{missing}: {height} mm");
    }
}

#[test]
fn cup_of_a_single_surface_is_not_closed_at_its_rim() {
    // Without the inner wall: the opening is not a hole, and the hull is far too heavy.
    let outer: Vec<Triangle> = cup()
        .into_iter()
        .filter(|t| t.iter().all(|[x, y, z]| *z == 0.0 || (x.hypot(*y) - 40.0).abs() < 1e-6))
        .collect();
    let (found, properties) = import(&stl(&outer)).unwrap();
    assert_eq!((found.repair.filled_holes, found.repair.boundary_edges), (0, 64));
    assert_eq!(properties.source, VolumeSource::ConvexParts);
    assert!(properties.volume < 0.5 * 477e-6, "{} m³", properties.volume);
}

#[test]
fn blocks_that_share_faces_or_an_edge_are_closed() {
    let block = |[i, k]: [i32; 2]| {
        let [x, z] = [i, k].map(|n| 30.0 * f64::from(n));
        cuboid([x, 0.0, z], [x + 30.0, 30.0, z + 30.0])
    };
    for (name, cells, extent) in [
        ("L", vec![[0, 0], [1, 0], [0, 1]], [60.0, 30.0, 60.0]),
        ("U", vec![[0, 0], [1, 0], [2, 0], [0, 1], [2, 1]], [90.0, 30.0, 60.0]),
        ("edge", vec![[0, 0], [1, 1]], [60.0, 30.0, 60.0]),
    ] {
        let volume = 27.0 * cells.len() as f64;
        let mut triangles: Vec<Triangle> = cells.iter().flat_map(|&cell| block(cell)).collect();
        let found = check(name, &stl(&triangles), extent, volume);
        assert!(found.repair.watertight, "{name}: {:?}", found.repair);
        // The second block faces inward.
        triangles[12..24].iter_mut().for_each(|triangle| triangle.swap(0, 1));
        check(name, &stl(&triangles), extent, volume);
    }
}

#[test]
fn touching_faces_may_be_cut_along_different_diagonals() {
    let mut second = cuboid([30.0, 0.0, 0.0], [60.0, 30.0, 30.0]);
    let [a, b, c] = second[0];
    let d = second[1][2];
    (second[0], second[1]) = ([a, b, d], [b, c, d]);
    let first = cuboid([0.0; 3], [30.0; 3]);
    let found = check("diagonals", &stl(&[first, second].concat()), [60.0, 30.0, 30.0], 54.0);
    assert!(found.repair.watertight, "{:?}", found.repair);
}

#[test]
fn debris_is_left_out_and_counted() {
    let object = || cuboid([0.0; 3], [60.0, 40.0, 100.0]);
    let mut specks = object();
    let mut state = 1_u64;
    for _ in 0..3000 {
        let mut uniform = |low: f64, high: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            low + (high - low) * (state >> 11) as f64 / (1_u64 << 53) as f64
        };
        let low = [uniform(-10.0, 70.0), uniform(-10.0, 50.0), uniform(-10.0, 110.0)];
        specks.extend(cuboid(low, low.map(|x| x + 0.4)));
    }
    let found = check("specks", &stl(&specks), [60.0, 40.0, 100.0], 240.0);
    // Specks that share an edge would be one component.
    assert!(found.repair.debris > 2900, "{} pieces", found.repair.debris);
    let stray = [[5000.0, 0.0, 0.0], [5000.1, 0.0, 0.0], [5000.0, 0.1, 0.0]];
    let stray = [object(), vec![stray]].concat();
    let found = check("stray", &stl(&stray), [60.0, 40.0, 100.0], 240.0);
    assert_eq!(found.repair.debris, 1);
}

#[test]
fn small_parts_of_an_object_are_no_debris() {
    // A frame of 40 bars, each as long as a ninth of it, and a box on four feet of 12 mm.
    let bars: Vec<Triangle> = (0..40)
        .flat_map(|i| {
            let x = 4.0 * f64::from(i);
            cuboid([x, 0.0, 0.0], [x + 3.0, 20.0, 20.0])
        })
        .collect();
    let found = check("bars", &stl(&bars), [159.0, 20.0, 20.0], 40.0 * 1.2);
    assert_eq!(found.repair.debris, 0);
    let mut table = cuboid([0.0, 0.0, 12.5], [80.0, 50.0, 60.0]);
    for [x, y] in [[0.0, 0.0], [68.0, 0.0], [0.0, 38.0], [68.0, 38.0]] {
        table.extend(cuboid([x, y, 0.0], [x + 12.0, y + 12.0, 12.0]));
    }
    let found = check("feet", &stl(&table), [80.0, 50.0, 60.0], 190.0 + 4.0 * 1.728);
    assert_eq!(found.repair.debris, 0);
}

#[test]
fn overlapping_bars_have_the_volume_of_their_union() {
    let jack = [[50.0, 10.0, 10.0], [10.0, 50.0, 10.0], [10.0, 10.0, 50.0]];
    let jack: Vec<Triangle> =
        jack.iter().flat_map(|half| cuboid(half.map(|x: f64| -x), *half)).collect();
    check("jack", &stl(&jack), [100.0; 3], 104.0);
    assert_eq!(import(&stl(&jack)).unwrap().1.source, VolumeSource::Union);
}
