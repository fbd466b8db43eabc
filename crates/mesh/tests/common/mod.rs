//! Writers of mesh files, and checks of their import.

#![allow(dead_code, reason = "each test file uses some of the writers")]

use mesh::{
    ExternalFiles, ImportedMesh, MassProperties, MeshError, MeshOptions, NO_EXTERNAL_FILES,
};

pub(crate) type Triangle = [[f64; 3]; 3];

/// Corners of a box; the quadrilaterals of [`QUADS`] face outward.
pub(crate) fn corners(low: [f64; 3], high: [f64; 3]) -> Vec<[f64; 3]> {
    let pick = |i: usize, bit: usize, axis: usize| {
        if i >> bit & 1 == 0 { low[axis] } else { high[axis] }
    };
    (0..8).map(|i| [pick(i, 2, 0), pick(i, 1, 1), pick(i, 0, 2)]).collect()
}

pub(crate) const QUADS: [[usize; 4]; 6] =
    [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];

/// Triangles of a box as indices into its corners.
pub(crate) fn box_triangles() -> Vec<[usize; 3]> {
    QUADS.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Vec<Triangle> {
    let points = corners(low, high);
    box_triangles().into_iter().map(|t| t.map(|i| points[i])).collect()
}

/// Surface of revolution of a closed profile of (radius, height) about z, in `count` segments.
pub(crate) fn lathe(profile: &[[f64; 2]], count: usize) -> Vec<Triangle> {
    let at = |[radius, height]: [f64; 2], k: usize| {
        let (sin, cos) = libm::sincos(std::f64::consts::TAU * (k % count) as f64 / count as f64);
        [radius * cos, radius * sin, height]
    };
    let mut triangles = Vec::new();
    for k in 0..count {
        for (i, &p) in profile.iter().enumerate() {
            let q = profile[(i + 1) % profile.len()];
            if p[0] > 0.0 {
                triangles.push([at(p, k), at(p, k + 1), at(q, k + 1)]);
            }
            if q[0] > 0.0 {
                triangles.push([at(p, k), at(q, k + 1), at(q, k)]);
            }
        }
    }
    triangles
}

pub(crate) fn stl(triangles: &[Triangle]) -> Vec<u8> {
    let mut bytes = vec![0; 80];
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for triangle in triangles {
        bytes.extend([0; 12]);
        let numbers = triangle.iter().flatten().map(|x| *x as f32);
        bytes.extend(numbers.flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

/// OBJ of polygons; indices count from 0.
pub(crate) fn obj(vertices: &[[f64; 3]], faces: &[Vec<usize>]) -> String {
    let mut text = String::new();
    for [x, y, z] in vertices {
        text += &format!("v {x:.6} {y:.6} {z:.6}\n");
    }
    for face in faces {
        text += "f";
        for i in face {
            text += &format!(" {}", i + 1);
        }
        text += "\n";
    }
    text
}

/// JSON of a glTF box of 60 x 40 x 100 mm, z up, and its buffer. `extra` are further members of the JSON,
/// `node` those of its node.
pub(crate) fn gltf_box(uri: Option<&str>, extra: &str, node: &str) -> (String, Vec<u8>) {
    let points = corners([-0.03, 0.0, -0.02], [0.03, 0.1, 0.02]);
    let mut data: Vec<u8> =
        points.iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    data.extend(box_triangles().iter().flatten().flat_map(|i| (*i as u16).to_le_bytes()));
    // Places of three instances.
    data.extend(
        [0.0_f32, 0.1, 0.2].into_iter().flat_map(|x| [x, 0.0, 0.0]).flat_map(f32::to_le_bytes),
    );
    let uri = uri.map_or(String::new(), |uri| format!(r#","uri":"{uri}""#));
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"mesh":0{node}}}]{extra},
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5123,"count":36,"type":"SCALAR"}},
        {{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":96}},{{"buffer":0,"byteOffset":96,"byteLength":72}},
        {{"buffer":0,"byteOffset":168,"byteLength":36}}],
        "buffers":[{{"byteLength":{}{uri}}}]}}"#,
        data.len()
    );
    (json, data)
}

pub(crate) fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let json = format!("{json}{}", " ".repeat(json.len().next_multiple_of(4) - json.len()));
    let length = 12 + 8 + json.len() + 8 + buffer.len();
    let mut bytes = b"glTF".to_vec();
    for word in [2, length, json.len()] {
        bytes.extend((word as u32).to_le_bytes());
    }
    bytes.extend(b"JSON");
    bytes.extend(json.as_bytes());
    bytes.extend((buffer.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(buffer);
    bytes
}

pub(crate) fn import(bytes: &[u8]) -> Result<(ImportedMesh, MassProperties), MeshError> {
    import_with(bytes, NO_EXTERNAL_FILES)
}

pub(crate) fn import_with(
    bytes: &[u8],
    files: &ExternalFiles,
) -> Result<(ImportedMesh, MassProperties), MeshError> {
    let import = mesh::import_with_files(bytes, &MeshOptions::default(), files)?;
    let properties = mesh::solid_properties(&import.mesh, import.repair.watertight)?;
    Ok((import, properties))
}

/// Checks extents (within 0.5 mm) and volume (within 2 %).
pub(crate) fn check(
    name: &str,
    bytes: &[u8],
    extent_mm: [f32; 3],
    volume_cm3: f64,
) -> ImportedMesh {
    check_import(name, import(bytes), extent_mm, volume_cm3)
}

pub(crate) fn check_import(
    name: &str,
    import: Result<(ImportedMesh, MassProperties), MeshError>,
    extent_mm: [f32; 3],
    volume_cm3: f64,
) -> ImportedMesh {
    let (import, properties) = import.unwrap_or_else(|error| panic!("{name}: {error}"));
    let extent = import.mesh.extent().to_array().map(|side| 1000.0 * side);
    let is_near = extent.iter().zip(extent_mm).all(|(got, wanted)| (got - wanted).abs() < 0.5);
    assert!(is_near, "{name}: wanted {extent_mm:?} mm, got {extent:?}");
    let volume = 1e6 * properties.volume;
    let is_near = (volume / volume_cm3 - 1.0).abs() < 0.02;
    assert!(is_near, "{name}: wanted {volume_cm3} cm³, got {volume} ({:?})", properties.source);
    import
}
