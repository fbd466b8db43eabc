//! glTF 2, as GLB or as JSON with its buffers in it; the JSON is parsed by `gltf`, the buffers are read here.
//!
//! glTF is y up: its (x, y, z) becomes our (x, -z, y). Of `gltf` only the JSON types are used: its own way to
//! the container subtracts from a length that may be too small, and its accessors trust strides and types.

use super::accessor::Column;
use super::read::{Draft, check_count, excerpt};
use super::{Mesh, MeshError, Place, data_uri};
use glamx::{DMat4, DQuat, DVec3};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Node, Root};
use std::borrow::Cow;

pub(super) const FORMAT: &str = "glTF";
/// Most bytes of JSON, without the buffers in it: each may become 200 times as many in memory.
const MAX_JSON: usize = 1_000_000;
/// What every glTF file has.
const ASSET: &[u8] = b"\"asset\"";
/// Most primitives over all nodes: nodes may share a mesh.
const MAX_PRIMITIVES: usize = 100_000;

/// Whether this begins like GLB, or is JSON with what every glTF file has.
pub(super) fn is_gltf(bytes: &[u8]) -> bool {
    let is_json = || bytes.trim_ascii_start().starts_with(b"{");
    is_glb(bytes) || is_json() && bytes.windows(ASSET.len()).any(|window| window == ASSET)
}

fn is_glb(bytes: &[u8]) -> bool {
    bytes.starts_with(b"glTF")
}

/// Reads all triangles of the scene, each node's transform applied.
pub(super) fn read(bytes: &[u8]) -> Result<Mesh, MeshError> {
    let (at, json, chunk) = if is_glb(bytes) { chunks(bytes)? } else { (0, bytes, &[][..]) };
    let (json, held) = data_uri::taken_out(json);
    check_count("bytes of JSON", json.len() as u64, MAX_JSON)?;
    let root = Root::from_slice(&json).map_err(|e| {
        malformed(Place::Byte(at), "glTF 2 in JSON", excerpt(e.to_string().as_bytes()))
    })?;
    let packed = ["KHR_draco_mesh_compression", "EXT_meshopt_compression"];
    if let Some(name) = root.extensions_required.iter().find(|name| packed.contains(&&name[..])) {
        return Err(unsupported(format!("compression ({name})")));
    }
    let buffers = buffers(&root, chunk, &held)?;
    let draft = Draft::new(FORMAT, 0);
    let mut reader = Reader { root: &root, buffers: &buffers, draft, num_primitives: 0 };
    reader.scene()?;
    reader.draft.finish()
}

pub(super) fn malformed(place: Place, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, place, expected, found }
}

pub(super) fn unsupported(feature: String) -> MeshError {
    MeshError::Unsupported { format: FORMAT, feature }
}

/// The buffers in the order of the JSON: what a data URI holds, or, of the first one, the binary chunk; `None` is in
/// another file.
fn buffers<'a>(
    root: &Root,
    chunk: &'a [u8],
    held: &[&[u8]],
) -> Result<Vec<Option<Cow<'a, [u8]>>>, MeshError> {
    let buffer = |(index, buffer): (usize, &gltf::json::Buffer)| {
        let Some(uri) = &buffer.uri else {
            return Ok(Some(Cow::Borrowed(if index == 0 { chunk } else { &[] })));
        };
        let Some(held) =
            uri.strip_prefix("data:").and_then(|at| held.get(at.parse::<usize>().ok()?))
        else {
            return Ok(None);
        };
        let place = Place::Entry("buffer", index);
        let bytes = data_uri::bytes(held);
        let bytes = bytes.ok_or_else(|| malformed(place, "bytes in base 64", excerpt(held)))?;
        Ok(Some(Cow::Owned(bytes)))
    };
    root.buffers.iter().enumerate().map(buffer).collect()
}

/// Where the JSON chunk begins, that chunk and the binary one.
fn chunks(bytes: &[u8]) -> Result<(usize, &[u8], &[u8]), MeshError> {
    let word = |at: usize| {
        let word = bytes.get(at..at + 4).and_then(|w| w.try_into().ok()).map(u32::from_le_bytes);
        word.ok_or_else(|| truncated(at as u64 + 4, bytes.len()))
    };
    let (version, length) = (word(4)?, word(8)?);
    if version != 2 {
        return Err(unsupported(format!("glTF version {version}")));
    }
    if length as usize > bytes.len() {
        return Err(truncated(u64::from(length), bytes.len()));
    }
    let mut chunks: [&[u8]; 2] = [&[]; 2];
    let mut at = 12;
    while at + 8 <= bytes.len() {
        let (length, kind) = (u64::from(word(at)?), &bytes[at + 4..at + 8]);
        let end = at as u64 + 8 + length;
        let data = bytes.get(at + 8..usize::try_from(end).unwrap_or(usize::MAX));
        let data = data.ok_or_else(|| truncated(end, bytes.len()))?;
        match kind {
            b"JSON" => chunks[0] = data,
            b"BIN\0" => chunks[1] = data,
            _ if at == 12 => {
                return Err(malformed(Place::Byte(16), "a JSON chunk first", excerpt(kind)));
            }
            _ => {}
        }
        at += 8 + data.len();
    }
    Ok((20, chunks[0], chunks[1]))
}

fn truncated(expected: u64, found: usize) -> MeshError {
    let (expected, found) = (format!("{expected} bytes"), found.to_string());
    MeshError::Truncated { format: FORMAT, expected, found }
}

struct Reader<'a> {
    root: &'a Root,
    buffers: &'a [Option<Cow<'a, [u8]>>],
    draft: Draft,
    num_primitives: u64,
}

impl Reader<'_> {
    /// Visits the nodes of the scene, or all of them if there is none.
    fn scene(&mut self) -> Result<(), MeshError> {
        let root = self.root;
        let scene = root.scenes.get(root.scene.map_or(0, |index| index.value()));
        let mut stack: Vec<(usize, DMat4)> = match scene {
            Some(scene) => scene.nodes.iter().map(|n| (n.value(), DMat4::IDENTITY)).collect(),
            None => {
                let mut is_top = vec![true; root.nodes.len()];
                for child in root.nodes.iter().flat_map(children) {
                    if let Some(is_top) = is_top.get_mut(child.value()) {
                        *is_top = false;
                    }
                }
                let tops = (0..root.nodes.len()).filter(|&i| is_top[i]);
                tops.map(|i| (i, DMat4::IDENTITY)).collect()
            }
        };
        stack.reverse();
        let mut is_seen = vec![false; root.nodes.len()];
        while let Some((index, world_from_parent)) = stack.pop() {
            let place = Place::Entry("node", index);
            let Some(node) = root.nodes.get(index) else {
                return Err(malformed(place, "an existing node", root.nodes.len().to_string()));
            };
            if std::mem::replace(&mut is_seen[index], true) {
                return Err(malformed(place, "one parent", "several, or a circle".to_owned()));
            }
            let world_from_node = world_from_parent * local(node);
            if let Some(mesh) = node.mesh {
                self.mesh(mesh.value(), world_from_node)?;
            }
            stack.extend(children(node).rev().map(|child| (child.value(), world_from_node)));
        }
        Ok(())
    }

    fn mesh(&mut self, index: usize, world_from_mesh: DMat4) -> Result<(), MeshError> {
        let root = self.root;
        let Some(mesh) = root.meshes.get(index) else {
            let (place, found) = (Place::Entry("mesh", index), root.meshes.len().to_string());
            return Err(malformed(place, "an existing mesh", found));
        };
        for primitive in &mesh.primitives {
            self.num_primitives += 1;
            check_count("parts", self.num_primitives, MAX_PRIMITIVES)?;
            self.primitive(primitive, world_from_mesh)?;
        }
        Ok(())
    }

    fn primitive(
        &mut self,
        primitive: &Primitive,
        world_from_mesh: DMat4,
    ) -> Result<(), MeshError> {
        let root = self.root;
        let mode = match primitive.mode {
            Checked::Valid(mode @ (Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan)) => {
                mode
            }
            // Points and lines have no surface.
            _ => return Ok(()),
        };
        let Some(&positions) = primitive.attributes.get(&Checked::Valid(Semantic::Positions))
        else {
            return Ok(());
        };
        let first = self.draft.num_vertices() as u32;
        let place = Place::Entry("accessor", positions.value());
        let points = Column::new(root, self.buffers, positions, Type::Vec3)?;
        for row in 0..points.count {
            let [x, y, z] = [0, 1, 2].map(|axis| points.value(row, axis));
            let p = world_from_mesh.transform_point3(DVec3::new(x, y, z));
            self.draft.vertex([p.x, -p.z, p.y], place)?;
        }
        let (corners, place) = match primitive.indices {
            Some(index) => (
                Some(Column::new(root, self.buffers, index, Type::Scalar)?),
                Place::Entry("accessor", index.value()),
            ),
            None => (None, place),
        };
        let count = corners.as_ref().map_or(points.count, |column| column.count);
        let num_triangles =
            if mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
        let is_mirrored = world_from_mesh.determinant() < 0.0;
        for i in 0..num_triangles {
            let mut triangle = match mode {
                Mode::Triangles => [3 * i, 3 * i + 1, 3 * i + 2],
                Mode::TriangleStrip if i % 2 == 1 => [i + 1, i, i + 2],
                Mode::TriangleStrip => [i, i + 1, i + 2],
                _ => [0, i + 1, i + 2],
            };
            if is_mirrored {
                triangle.swap(1, 2);
            }
            let index = |at: usize| corners.as_ref().map_or(at as u32, |c| c.value(at, 0) as u32);
            let triangle = triangle.map(index);
            if let Some(&bad) = triangle.iter().find(|&&corner| corner as usize >= points.count) {
                let limits = format!("there are {}, counted from 0", points.count);
                return Err(MeshError::BadIndex { place, index: i64::from(bad), limits });
            }
            self.draft.polygon(&triangle.map(|corner| first + corner), place)?;
        }
        Ok(())
    }
}

fn children(node: &Node) -> impl DoubleEndedIterator<Item = Index<Node>> {
    node.children.iter().flatten().copied()
}

/// The transform from a node to its parent.
fn local(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let vector = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
    let rotation = DQuat::from_array(node.rotation.unwrap_or_default().0.map(f64::from));
    DMat4::from_scale_rotation_translation(
        node.scale.map_or(DVec3::ONE, vector),
        rotation.normalize(),
        node.translation.map_or(DVec3::ZERO, vector),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Vec3;
    use crate::mesh::{read, samples};

    #[test]
    fn y_up_becomes_z_up() {
        let tall = samples::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(read(&samples::glb(&tall)), Ok(tall));
    }

    #[test]
    fn node_transforms_are_applied() {
        // Turned by 90 degrees about z, doubled, moved: glTF (1, 0, 0) goes to (5, 2, 0), which is our (5, 0, 2).
        let node = r#"{"mesh":0,"translation":[5,0,0],"scale":[2,2,2],
            "rotation":[0,0,0.70710678118,0.70710678118]}"#;
        let mesh = read(&samples::glb_with_node(&samples::cube(), node)).unwrap();
        let got = mesh.vertices[1];
        assert!(got.distance(Vec3::new(5.0, 0.0, 2.0)) < 1e-6, "got {got}");
        let mirror = r#"{"mesh":0,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}"#;
        let mesh = read(&samples::glb_with_node(&samples::cube(), mirror)).unwrap();
        assert_eq!(samples::volume(&mesh), 1.0);
    }

    #[test]
    fn nodes_form_a_tree() {
        let nested = r#"{"children":[1],"scale":[2,2,2]},{"mesh":0}"#;
        let mesh = read(&samples::glb_with_node(&samples::cube(), nested)).unwrap();
        assert_eq!(samples::volume(&mesh), 8.0);
        let circle = r#"{"children":[1]},{"children":[0],"mesh":0}"#;
        let error = read(&samples::glb_with_node(&samples::cube(), circle)).unwrap_err();
        assert!(error.to_string().contains("node 0: expected one parent"), "{error}");
    }

    #[test]
    fn strips_fans_and_library_files_are_read() {
        let glb = String::from_utf8_lossy(&samples::glb(&samples::cube())).into_owned();
        assert!(glb.contains(r#""indices":1}"#));
        let change = |from: &str, to: &str| {
            let bytes = samples::glb(&samples::cube());
            let json_length =
                u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
            let json = std::str::from_utf8(&bytes[20..20 + json_length]).unwrap();
            assert!(json.contains(from), "{from}");
            read(&samples::glb_file(&json.replace(from, to), bytes[28 + json_length..].to_vec()))
        };
        for mode in [5, 6] {
            let mesh =
                change(r#""indices":1}"#, &format!(r#""indices":1,"mode":{mode}}}"#)).unwrap();
            assert_eq!(mesh.triangles.len(), 34);
        }
        assert_eq!(change(r#""scene":0,"scenes":[{"nodes":[0]}],"#, ""), Ok(samples::cube()));
        let cloud = change(r#""indices":1}"#, r#""mode":0}"#);
        assert_eq!(cloud, Err(MeshError::NoFaces { vertices: 0 }));
        for (from, to, wanted) in [
            (r#""count":36"#, r#""count":4000000000"#, "expected values within the buffer"),
            (
                r#""count":8"#,
                r#""count":18446744073709551615"#,
                "expected values within the buffer",
            ),
            (r#""count":8"#, r#""count":7"#, "a face uses vertex 7"),
            (r#""VEC3""#, r#""VEC2""#, "accessor 0: expected VEC3"),
            ("5125", "5126", "accessor 1: expected SCALAR of unsigned"),
            (
                r#"{"byteLength""#,
                r#"{"uri":"cube.bin","byteLength""#,
                "in another file (\"cube.bin\")",
            ),
            (
                r#"{"byteLength":240}],"bufferViews":[{"buffer":0"#,
                r#"{"byteLength":240},{"byteLength":240}],"bufferViews":[{"buffer":1"#,
                "expected values within the buffer",
            ),
            (r#""nodes":[0]"#, r#""nodes":[9]"#, "node 9: expected an existing node"),
            (r#""mesh":0"#, r#""mesh":9"#, "mesh 9: expected an existing mesh"),
            (
                r#""scene":0"#,
                r#""extensionsRequired":["KHR_draco_mesh_compression"]"#,
                "(KHR_draco",
            ),
            (r#""scene":0"#, r#""scene":}"#, "expected glTF 2 in JSON"),
        ] {
            let error = change(from, to).unwrap_err().to_string();
            assert!(error.contains(wanted), "wanted {wanted}, got {error}");
        }
    }

    #[test]
    fn json_holds_its_buffers_itself() {
        let text = String::from_utf8(samples::gltf(&samples::cube())).unwrap();
        assert_eq!(read(text.as_bytes()), Ok(samples::cube()));
        assert_eq!(read(text.replace('/', "\\/").as_bytes()), Ok(samples::cube()));
        // A picture is not decoded, however large.
        let picture =
            format!(r#"{{"images":[{{"uri":"data:image/png;base64,{}"}}],"#, "A".repeat(MAX_JSON));
        assert_eq!(read(text.replacen('{', &picture, 1).as_bytes()), Ok(samples::cube()));
        for (from, to, wanted) in [
            (";base64,", ";base64,#", "buffer 0: expected bytes in base 64"),
            ("data:application/octet-stream;base64,", "cube.bin?", "in another file"),
            (r#""buffer":0"#, r#""buffer":1"#, "expected values within the buffer"),
            (r#""2.0""#, r#"2.0"#, "expected glTF 2 in JSON"),
        ] {
            assert!(text.contains(from), "{from}");
            let error = read(text.replace(from, to).as_bytes()).unwrap_err().to_string();
            assert!(error.contains(wanted), "wanted {wanted}, got {error}");
        }
    }

    #[test]
    fn a_cut_file_is_named() {
        let bytes = samples::glb(&samples::cube());
        for cut in [6, 12, 100, bytes.len() - 1] {
            let error = read(&bytes[..cut]).unwrap_err();
            assert!(matches!(error, MeshError::Truncated { .. }), "{cut}: {error}");
        }
        let old = [&bytes[..4], &[1, 0, 0, 0], &bytes[8..]].concat();
        assert!(matches!(read(&old), Err(MeshError::Unsupported { .. })));
    }
}
