//! glTF 2, as GLB or as JSON with embedded or external buffers.
//!
//! The crate `gltf` parses the JSON; this module reads the buffers.
//!
//! glTF is y up: (x, y, z) is converted to (x, -z, y). Only the JSON types of `gltf` are used: its GLB reader
//! subtracts from an unchecked length, and its accessors do not check strides and types.

use super::accessor::AccessorView;
use super::builder::MeshBuilder;
use super::glb::{glb_chunks, is_glb};
use super::gltf_extensions::{check_required, instance_transforms};
use super::gltf_skin::{VertexJoints, joint_transforms};
use super::parse::{check_limit, excerpt};
use super::{ExternalFiles, data_uri};
use crate::{Location, Mesh, MeshError};
use glamx::{DMat4, DQuat, DVec3};
use gltf::json::accessor::Type;
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::Checked;
use gltf::json::{Index, Node, Root};
use std::borrow::Cow;

pub(super) const FORMAT: &str = "glTF";
/// Max size of the JSON without embedded buffers (bytes).
const MAX_JSON_BYTES: usize = 16_000_000;
/// Max number of objects in the JSON; parsed, one may take 600 bytes. A body of a CAD assembly takes six.
const MAX_JSON_OBJECTS: usize = 500_000;
/// Property that every glTF file has.
const ASSET_KEY: &[u8] = b"\"asset\"";
/// Max number of primitives over all nodes; nodes may share a mesh.
const MAX_PRIMITIVES: usize = 100_000;

/// Whether the bytes begin as GLB, or are JSON with an `asset` property.
pub(super) fn is_gltf(bytes: &[u8]) -> bool {
    let is_json = || bytes.trim_ascii_start().starts_with(b"{");
    is_glb(bytes) || is_json() && bytes.windows(ASSET_KEY.len()).any(|window| window == ASSET_KEY)
}

/// Parses all triangles of the scene, with the node transforms applied.
pub(super) fn read(bytes: &[u8], files: &ExternalFiles) -> Result<Mesh, MeshError> {
    let (offset, json, chunk) =
        if is_glb(bytes) { glb_chunks(bytes)? } else { (0, bytes, &[][..]) };
    let (json, data_uris) = data_uri::extract_data_uris(json);
    check_limit("bytes of JSON", json.len() as u64, MAX_JSON_BYTES)?;
    let num_objects = json.iter().filter(|byte| **byte == b'{').count();
    check_limit("objects in JSON", num_objects as u64, MAX_JSON_OBJECTS)?;
    let root = Root::from_slice(&json).map_err(|e| {
        malformed(Location::Byte(offset), "glTF 2 in JSON", excerpt(e.to_string().as_bytes()))
    })?;
    check_required(&root)?;
    let buffers = load_buffers(&root, chunk, &data_uris, files)?;
    let builder = MeshBuilder::new(FORMAT, 0);
    let mut reader = SceneReader { root: &root, buffers: &buffers, builder, num_primitives: 0 };
    reader.add_scene()?;
    reader.builder.finish()
}

pub(super) fn malformed(location: Location, expected: &'static str, found: String) -> MeshError {
    MeshError::Malformed { format: FORMAT, location, expected, found }
}

pub(super) fn unsupported(feature: String) -> MeshError {
    MeshError::Unsupported { format: FORMAT, feature }
}

/// Buffers in the order of the JSON: decoded data URIs, external files, or the binary chunk for the first
/// buffer.
///
/// `None` marks a missing external file.
fn load_buffers<'a>(
    root: &Root,
    chunk: &'a [u8],
    data_uris: &[&[u8]],
    files: &ExternalFiles,
) -> Result<Vec<Option<Cow<'a, [u8]>>>, MeshError> {
    let buffer = |(index, buffer): (usize, &gltf::json::Buffer)| {
        let Some(uri) = &buffer.uri else {
            return Ok(Some(Cow::Borrowed(if index == 0 { chunk } else { &[] })));
        };
        let index_in_uri = uri.strip_prefix("data:").and_then(|text| text.parse::<usize>().ok());
        let Some(content) = index_in_uri.and_then(|index| data_uris.get(index)) else {
            return Ok(external_file(uri, files).map(Cow::Owned));
        };
        let location = Location::Entry("buffer", index);
        let bytes = data_uri::decode(content);
        let bytes =
            bytes.ok_or_else(|| malformed(location, "bytes in base64", excerpt(content)))?;
        Ok(Some(Cow::Owned(bytes)))
    };
    root.buffers.iter().enumerate().map(buffer).collect()
}

/// Content of the file at a relative URI, whose special characters may be escaped as `%20`.
fn external_file(uri: &str, files: &ExternalFiles) -> Option<Vec<u8>> {
    let normalized = |path: &str| {
        let path = path.replace('\\', "/");
        path.strip_prefix("./").map(str::to_owned).unwrap_or(path)
    };
    let decoded = percent_encoding::percent_decode_str(uri).decode_utf8_lossy();
    files(&normalized(&decoded)).or_else(|| files(&normalized(uri)))
}

struct SceneReader<'a> {
    root: &'a Root,
    buffers: &'a [Option<Cow<'a, [u8]>>],
    builder: MeshBuilder,
    num_primitives: u64,
}

impl SceneReader<'_> {
    /// Adds the nodes of the scene, or all nodes if the file has no scene.
    fn add_scene(&mut self) -> Result<(), MeshError> {
        let root = self.root;
        let scene = root.scenes.get(root.scene.map_or(0, |index| index.value()));
        let mut stack: Vec<(usize, DMat4)> = match scene {
            Some(scene) => scene.nodes.iter().map(|n| (n.value(), DMat4::IDENTITY)).collect(),
            None => {
                let mut is_root = vec![true; root.nodes.len()];
                for child in root.nodes.iter().flat_map(children) {
                    if let Some(is_root) = is_root.get_mut(child.value()) {
                        *is_root = false;
                    }
                }
                let roots = (0..root.nodes.len()).filter(|&i| is_root[i]);
                roots.map(|i| (i, DMat4::IDENTITY)).collect()
            }
        };
        stack.reverse();
        let mut world_from_nodes = vec![None; root.nodes.len()];
        let mut order = Vec::new();
        while let Some((index, world_from_parent)) = stack.pop() {
            let location = Location::Entry("node", index);
            let Some(node) = root.nodes.get(index) else {
                return Err(malformed(location, "an existing node", root.nodes.len().to_string()));
            };
            let world_from_node = world_from_parent * parent_from_node(node);
            if world_from_nodes[index].replace(world_from_node).is_some() {
                return Err(malformed(
                    location,
                    "one parent",
                    "several parents, or a cycle".to_owned(),
                ));
            }
            order.push((node, world_from_node));
            stack.extend(children(node).rev().map(|child| (child.value(), world_from_node)));
        }
        // Joints of a skin may follow the node that uses it.
        order.into_iter().try_for_each(|(node, world_from_node)| {
            self.add_node(node, world_from_node, &world_from_nodes)
        })
    }

    fn add_node(
        &mut self,
        node: &Node,
        world_from_node: DMat4,
        world_from_nodes: &[Option<DMat4>],
    ) -> Result<(), MeshError> {
        let Some(mesh) = node.mesh.map(|mesh| mesh.value()) else { return Ok(()) };
        if let Some(skin) = node.skin {
            // The joints replace the transform of the node.
            let joints = joint_transforms(self.root, self.buffers, skin, world_from_nodes)?;
            return self.add_mesh(mesh, DMat4::IDENTITY, Some(&joints));
        }
        match instance_transforms(self.root, self.buffers, node)? {
            Some(instances) => instances.into_iter().try_for_each(|node_from_instance| {
                self.add_mesh(mesh, world_from_node * node_from_instance, None)
            }),
            None => self.add_mesh(mesh, world_from_node, None),
        }
    }

    /// Adds a mesh whose vertices follow the joints, if it has some.
    fn add_mesh(
        &mut self,
        index: usize,
        world_from_mesh: DMat4,
        joints: Option<&[DMat4]>,
    ) -> Result<(), MeshError> {
        let root = self.root;
        let Some(mesh) = root.meshes.get(index) else {
            let (location, found) = (Location::Entry("mesh", index), root.meshes.len().to_string());
            return Err(malformed(location, "an existing mesh", found));
        };
        for primitive in &mesh.primitives {
            self.num_primitives += 1;
            check_limit("primitives", self.num_primitives, MAX_PRIMITIVES)?;
            self.add_primitive(primitive, world_from_mesh, joints)?;
        }
        Ok(())
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive,
        world_from_mesh: DMat4,
        joints: Option<&[DMat4]>,
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
        let first = self.builder.num_vertices() as u32;
        let location = Location::Entry("accessor", positions.value());
        let points = AccessorView::new(root, self.buffers, positions, Type::Vec3)?;
        let joints = match joints {
            Some(joints) => VertexJoints::new(root, self.buffers, primitive, joints, points.count)?,
            None => None,
        };
        let mut is_mirrored = world_from_mesh.determinant() < 0.0;
        let mut magnitudes = Vec::new();
        for row in 0..points.count {
            let point = DVec3::from_array([0, 1, 2].map(|axis| points.value(row, axis)));
            let mut transform = world_from_mesh;
            if let Some(joints) = &joints {
                transform = joints.world_from_bind(row)?;
                is_mirrored = transform.determinant() < 0.0;
            }
            let p = transform.transform_point3(point);
            self.builder.add_vertex([p.x, -p.z, p.y], location)?;
            magnitudes.push(max_scale(&transform) * point.abs().max_element());
        }
        let (corners, location) = match primitive.indices {
            Some(index) => (
                Some(AccessorView::new(root, self.buffers, index, Type::Scalar)?),
                Location::Entry("accessor", index.value()),
            ),
            None => (None, location),
        };
        let count = corners.as_ref().map_or(points.count, |column| column.count);
        let num_triangles =
            if mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
        let mut magnitude = 0.0_f64;
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
            let index = |i: usize| corners.as_ref().map_or(i as u32, |c| c.value(i, 0) as u32);
            let triangle = triangle.map(index);
            if let Some(&bad) = triangle.iter().find(|&&corner| corner as usize >= points.count) {
                let limits = format!("there are {}, counted from 0", points.count);
                return Err(MeshError::BadIndex { location, index: i64::from(bad), limits });
            }
            magnitude = triangle.iter().fold(magnitude, |m, &i| m.max(magnitudes[i as usize]));
            self.builder.add_polygon(&triangle.map(|corner| first + corner), location)?;
        }
        self.builder.add_single_precision(magnitude);
        Ok(())
    }
}

fn children(node: &Node) -> impl DoubleEndedIterator<Item = Index<Node>> {
    node.children.iter().flatten().copied()
}

/// Max factor by which a transform stretches an axis.
fn max_scale(transform: &DMat4) -> f64 {
    [transform.x_axis, transform.y_axis, transform.z_axis]
        .iter()
        .fold(0.0, |max, axis| max.max(axis.truncate().length()))
}

/// Transform `parent_from_node`.
fn parent_from_node(node: &Node) -> DMat4 {
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
    use crate::io::read;
    use crate::test_meshes;
    use glamx::Vec3;

    #[test]
    fn y_up_is_converted_to_z_up() {
        let tall = test_meshes::cuboid(Vec3::ZERO, Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(read(&test_meshes::glb(&tall)), Ok(tall));
    }

    #[test]
    fn node_transforms_are_applied() {
        // Scale 2, rotation by 90 degrees about z, translation: glTF (1, 0, 0) maps to (5, 2, 0).
        // In z-up coordinates that is (5, 0, 2).
        let node = r#"{"mesh":0,"translation":[5,0,0],"scale":[2,2,2],
            "rotation":[0,0,0.70710678118,0.70710678118]}"#;
        let mesh = read(&test_meshes::glb_with_node(&test_meshes::cube(), node)).unwrap();
        let got = mesh.vertices[1];
        assert!(got.distance(Vec3::new(5.0, 0.0, 2.0)) < 1e-6, "got {got}");
        let mirror = r#"{"mesh":0,"matrix":[-1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]}"#;
        let mesh = read(&test_meshes::glb_with_node(&test_meshes::cube(), mirror)).unwrap();
        assert_eq!(test_meshes::volume(&mesh), 1.0);
    }

    #[test]
    fn nested_nodes_are_read_and_cycles_rejected() {
        let nested = r#"{"children":[1],"scale":[2,2,2]},{"mesh":0}"#;
        let mesh = read(&test_meshes::glb_with_node(&test_meshes::cube(), nested)).unwrap();
        assert_eq!(test_meshes::volume(&mesh), 8.0);
        let cycle = r#"{"children":[1]},{"children":[0],"mesh":0}"#;
        let error = read(&test_meshes::glb_with_node(&test_meshes::cube(), cycle)).unwrap_err();
        assert!(error.to_string().contains("node 0: expected one parent"), "{error}");
    }

    #[test]
    fn strips_fans_and_missing_scenes_are_read_and_invalid_files_named() {
        let glb = String::from_utf8_lossy(&test_meshes::glb(&test_meshes::cube())).into_owned();
        assert!(glb.contains(r#""indices":1}"#));
        let change = |from: &str, to: &str| {
            let bytes = test_meshes::glb(&test_meshes::cube());
            let json_length =
                u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
            let json = std::str::from_utf8(&bytes[20..20 + json_length]).unwrap();
            assert!(json.contains(from), "{from}");
            read(&test_meshes::glb_file(
                &json.replace(from, to),
                bytes[28 + json_length..].to_vec(),
            ))
        };
        for mode in [5, 6] {
            let mesh =
                change(r#""indices":1}"#, &format!(r#""indices":1,"mode":{mode}}}"#)).unwrap();
            assert_eq!(mesh.triangles.len(), 34);
        }
        assert_eq!(change(r#""scene":0,"scenes":[{"nodes":[0]}],"#, ""), Ok(test_meshes::cube()));
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
                "in another file, \"cube.bin\"",
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
                "KHR_draco_mesh_compression",
            ),
            (r#""scene":0"#, r#""scene":}"#, "expected glTF 2 in JSON"),
        ] {
            let error = change(from, to).unwrap_err().to_string();
            assert!(error.contains(wanted), "wanted {wanted}, got {error}");
        }
    }

    #[test]
    fn embedded_buffers_are_decoded() {
        let text = String::from_utf8(test_meshes::gltf(&test_meshes::cube())).unwrap();
        assert_eq!(read(text.as_bytes()), Ok(test_meshes::cube()));
        assert_eq!(read(text.replace('/', "\\/").as_bytes()), Ok(test_meshes::cube()));
        // Images are not decoded and do not count towards the JSON limit.
        let image = format!(
            r#"{{"images":[{{"uri":"data:image/png;base64,{}"}}],"#,
            "A".repeat(MAX_JSON_BYTES)
        );
        assert_eq!(read(text.replacen('{', &image, 1).as_bytes()), Ok(test_meshes::cube()));
        for (from, to, wanted) in [
            (";base64,", ";base64,#", "buffer 0: expected bytes in base64"),
            ("data:application/octet-stream;base64,", "cube.bin?", "in another file"),
            (r#""buffer":0"#, r#""buffer":1"#, "expected values within the buffer"),
            (r#""2.0""#, r#"2.0"#, "expected glTF 2 in JSON"),
        ] {
            assert!(text.contains(from), "{from}");
            let error = read(text.replace(from, to).as_bytes()).unwrap_err().to_string();
            assert!(error.contains(wanted), "wanted {wanted}, got {error}");
        }
    }
}
