//! Test meshes, and writers for every format.

use crate::Mesh;
use base64::Engine;
use glamx::Vec3;

/// Cube from 0 to 1 along each axis.
pub(super) fn cube() -> Mesh {
    cuboid(Vec3::ZERO, Vec3::ONE)
}

pub(super) fn cuboid(low: Vec3, high: Vec3) -> Mesh {
    let vertex = |i: u32| {
        let pick = |bit: u32, axis: usize| if i >> bit & 1 == 1 { high[axis] } else { low[axis] };
        Vec3::new(pick(0, 0), pick(1, 1), pick(2, 2))
    };
    let quads =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    Mesh { vertices: (0..8).map(vertex).collect(), triangles }
}

/// Concatenates meshes.
pub(super) fn union(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh::default();
    for mesh in meshes {
        let first = all.vertices.len() as u32;
        all.vertices.extend(&mesh.vertices);
        all.triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| i + first)));
    }
    all
}

/// Prism of a counter-clockwise outline from z = 0 to `height`; `caps` triangulates the outline.
pub(super) fn prism(outline: &[[f32; 2]], caps: &[[u32; 3]], height: f32) -> Mesh {
    let n = outline.len() as u32;
    let ring = |z: f32| outline.iter().map(move |&[x, y]| Vec3::new(x, y, z));
    let vertices = ring(0.0).chain(ring(height)).collect();
    let ends = caps.iter().flat_map(|&[a, b, c]| [[a, c, b], [a + n, b + n, c + n]]);
    let walls = (0..n).flat_map(|i| {
        let j = (i + 1) % n;
        [[i, j, j + n], [i, j + n, i + n]]
    });
    Mesh { vertices, triangles: ends.chain(walls).collect() }
}

/// L of two bars, 0.1 m long and 0.03 m thick.
pub(super) fn l_shape() -> Mesh {
    let outline = [[0.0, 0.0], [0.1, 0.0], [0.1, 0.03], [0.03, 0.03], [0.03, 0.1], [0.0, 0.1]];
    prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 0.03)
}

/// Signed volume by the divergence theorem.
pub(super) fn volume(mesh: &Mesh) -> f32 {
    let corner = |i: u32| mesh.vertices[i as usize];
    let six = |t: &[u32; 3]| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])));
    mesh.triangles.iter().map(six).sum::<f32>() / 6.0
}

/// The mesh in every format, z up, with the format's name.
pub(super) fn all(mesh: &Mesh) -> Vec<(&'static str, Vec<u8>)> {
    vec![
        ("obj", obj(mesh)),
        ("text stl", stl_text(mesh)),
        ("binary stl", stl_binary(mesh)),
        ("text ply", ply_text(mesh)),
        ("little-endian ply", ply_binary(mesh, false)),
        ("big-endian ply", ply_binary(mesh, true)),
        ("off", off(mesh)),
        ("glb", glb(mesh)),
        ("gltf", gltf(mesh)),
    ]
}

pub(super) fn obj(mesh: &Mesh) -> Vec<u8> {
    let mut text = "# a comment\nmtllib none.mtl\no thing\n".to_owned();
    for v in &mesh.vertices {
        text += &format!("v {} {} {}\n", v.x, v.y, v.z);
    }
    for [a, b, c] in mesh.triangles.iter().map(|t| t.map(|i| i + 1)) {
        text += &format!("f {a} {b} {c}\n");
    }
    text.into_bytes()
}

fn off(mesh: &Mesh) -> Vec<u8> {
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertices.len(), mesh.triangles.len());
    for v in &mesh.vertices {
        text += &format!("{} {} {}\n", v.x, v.y, v.z);
    }
    for [a, b, c] in &mesh.triangles {
        text += &format!("3 {a} {b} {c}\n");
    }
    text.into_bytes()
}

fn corners(mesh: &Mesh) -> impl Iterator<Item = [Vec3; 3]> {
    mesh.triangles.iter().map(|t| t.map(|i| mesh.vertices[i as usize]))
}

pub(super) fn stl_text(mesh: &Mesh) -> Vec<u8> {
    let mut text = "solid thing\n".to_owned();
    for triangle in corners(mesh) {
        text += "facet normal 0 0 0\n  outer loop\n";
        for v in triangle {
            text += &format!("    vertex {} {} {}\n", v.x, v.y, v.z);
        }
        text += "  endloop\nendfacet\n";
    }
    (text + "endsolid thing\n").into_bytes()
}

pub(super) fn stl_binary(mesh: &Mesh) -> Vec<u8> {
    let mut bytes = vec![b' '; 80];
    bytes.extend((mesh.triangles.len() as u32).to_le_bytes());
    for triangle in corners(mesh) {
        bytes.extend([0; 12]);
        bytes.extend(triangle.iter().flat_map(|v| v.to_array()).flat_map(f32::to_le_bytes));
        bytes.extend([0; 2]);
    }
    bytes
}

fn ply_header(mesh: &Mesh, encoding: &str) -> String {
    format!(
        "ply\nformat {encoding} 1.0\nelement vertex {}\nproperty float x\nproperty float y\n\
        property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        mesh.vertices.len(),
        mesh.triangles.len()
    )
}

pub(super) fn ply_text(mesh: &Mesh) -> Vec<u8> {
    let mut text = ply_header(mesh, "ascii");
    for v in &mesh.vertices {
        text += &format!("{} {} {}\n", v.x, v.y, v.z);
    }
    for [a, b, c] in &mesh.triangles {
        text += &format!("3 {a} {b} {c}\n");
    }
    text.into_bytes()
}

pub(super) fn ply_binary(mesh: &Mesh, is_big: bool) -> Vec<u8> {
    let order =
        |bytes: [u8; 4]| if is_big { [bytes[3], bytes[2], bytes[1], bytes[0]] } else { bytes };
    let name = if is_big { "binary_big_endian" } else { "binary_little_endian" };
    let mut bytes = ply_header(mesh, name).into_bytes();
    let floats = mesh.vertices.iter().flat_map(|v| v.to_array());
    bytes.extend(floats.flat_map(|x| order(x.to_le_bytes())));
    for triangle in &mesh.triangles {
        bytes.push(3);
        bytes.extend(triangle.iter().flat_map(|i| order(i.to_le_bytes())));
    }
    bytes
}

/// GLB file with positions (12 bytes each) and 32-bit indices; `node` is the JSON of the scene's single node.
pub(super) fn glb_with_node(mesh: &Mesh, node: &str) -> Vec<u8> {
    let (json, buffer) = gltf_parts(mesh, node);
    glb_file(&json, buffer)
}

/// glTF file in JSON, with the buffer as a data URI.
pub(super) fn gltf(mesh: &Mesh) -> Vec<u8> {
    let (json, buffer) = gltf_parts(mesh, r#"{"mesh":0}"#);
    let text = base64::engine::general_purpose::STANDARD.encode(buffer);
    let uri = format!(r#""buffers":[{{"uri":"data:application/octet-stream;base64,{text}","#);
    json.replace(r#""buffers":[{"#, &uri).into_bytes()
}

fn gltf_parts(mesh: &Mesh, node: &str) -> (String, Vec<u8>) {
    let (points, indices) = (mesh.vertices.len(), 3 * mesh.triangles.len());
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],"nodes":[{node}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"indices":1}}]}}],
        "buffers":[{{"byteLength":{0}}}],"bufferViews":[{{"buffer":0,"byteLength":{1}}},
        {{"buffer":0,"byteOffset":{1},"byteLength":{2}}}],"accessors":[{{"bufferView":0,
        "componentType":5126,"count":{points},"type":"VEC3"}},{{"bufferView":1,
        "componentType":5125,"count":{indices},"type":"SCALAR"}}]}}"#,
        12 * points + 4 * indices,
        12 * points,
        4 * indices
    );
    // glTF is y up.
    let floats = mesh.vertices.iter().flat_map(|v| [v.x, v.z, -v.y]).flat_map(f32::to_le_bytes);
    let indices = mesh.triangles.iter().flatten().flat_map(|i| i.to_le_bytes());
    (json, floats.chain(indices).collect())
}

pub(super) fn glb(mesh: &Mesh) -> Vec<u8> {
    glb_with_node(mesh, r#"{"mesh":0}"#)
}

pub(super) fn glb_file(json: &str, buffer: Vec<u8>) -> Vec<u8> {
    let json = format!("{json:<width$}", width = json.len().next_multiple_of(4));
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
