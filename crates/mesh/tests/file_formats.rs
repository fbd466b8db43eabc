//! Mesh files as programs write them: each is read with the right size, or refused by name.

mod common;

use common::{
    box_triangles, check, check_import, corners, cuboid, glb, gltf_box, import, import_with, obj,
    stl,
};
use mesh::MeshError;

/// Extents (mm) and volume (cm³) of the box in most files.
const BOX_MM: [f32; 3] = [60.0, 40.0, 100.0];
const BOX_CM3: f64 = 240.0;

fn box_corners() -> Vec<[f64; 3]> {
    corners([0.0; 3], [60.0, 40.0, 100.0])
}

fn box_faces() -> Vec<Vec<usize>> {
    box_triangles().into_iter().map(Vec::from).collect()
}

#[test]
fn gltf_with_a_separate_buffer_is_read() {
    for (uri, name) in [
        ("scene.bin", "scene.bin"),
        ("my%20mesh%20data.bin", "my mesh data.bin"),
        ("./data/scene.bin", "data/scene.bin"),
        ("50%.bin", "50%.bin"),
    ] {
        let (json, buffer) = gltf_box(Some(uri), "", "");
        let files = |path: &str| (path == name).then(|| buffer.clone());
        check_import(uri, import_with(json.as_bytes(), &files), BOX_MM, BOX_CM3);
        let error = import(json.as_bytes()).unwrap_err();
        assert!(matches!(error, MeshError::ExternalBuffer { .. }), "{error}");
        assert!(error.to_string().contains(uri), "{error}");
    }
}

#[test]
fn concave_polygons_keep_their_opening() {
    // C of 80 x 80 x 40 mm. Its ends are one polygon each, which begins at a corner of the opening.
    let outline = [[80, 0], [80, 15], [15, 15], [15, 65], [80, 65], [80, 80], [0, 80], [0, 0]];
    let at = |z: f64| outline.iter().map(move |&[x, y]| [f64::from(x), f64::from(y), z]);
    let vertices: Vec<[f64; 3]> = at(0.0).chain(at(40.0)).collect();
    let mut faces = vec![vec![0, 7, 6, 5, 4, 3, 2, 1], (8..16).collect()];
    faces.extend((0..8).map(|i| vec![i, (i + 1) % 8, 8 + (i + 1) % 8, 8 + i]));
    let rows = |separator: &str| -> String {
        let points = vertices.iter().map(|[x, y, z]| format!("{x} {y} {z}\n"));
        let faces = faces.iter().map(|face| {
            let indices: Vec<String> = face.iter().map(usize::to_string).collect();
            format!("{} {}\n", face.len(), indices.join(separator))
        });
        points.chain(faces).collect()
    };
    let ply = format!(
        "ply\nformat ascii 1.0\nelement vertex 16\nproperty float x\nproperty float y\n\
         property float z\nelement face 10\nproperty list uchar int vertex_indices\nend_header\n{}",
        rows(" ")
    );
    for (name, text) in [
        ("OBJ", obj(&vertices, &faces)),
        ("OFF", format!("OFF\n16 10 0\n{}", rows(" "))),
        ("PLY", ply),
    ] {
        let import = check(name, text.as_bytes(), [80.0, 80.0, 40.0], 126.0);
        assert!(import.repair.watertight, "{name}");
        let parts = mesh::decompose(&import.mesh).hulls;
        let is_open = |point: &[f32; 3]| {
            !parts.iter().any(|hull| {
                let hull = mesh::convex_hull(hull, 64).unwrap();
                let point = glamx::Vec3::from_array(*point);
                hull.triangles.iter().all(|t| {
                    let [a, b, c] = t.map(|i| hull.vertices[i as usize]);
                    (b - a).cross(c - a).dot(point - a) < 0.0
                })
            })
        };
        for point in [[0.05, 0.04, 0.001], [0.05, 0.04, 0.039], [0.02, 0.02, 0.02]] {
            assert!(is_open(&point), "{name}: {point:?} is filled");
        }
    }
}

#[test]
fn binary_stl_with_other_bytes_is_read() {
    let bytes = stl(&cuboid([0.0; 3], [60.0, 40.0, 100.0]));
    let with = |header: &[u8], tail: &[u8]| {
        let mut bytes = [&bytes[..], tail].concat();
        bytes[..header.len()].copy_from_slice(header);
        bytes
    };
    for (name, bytes) in [
        ("two zeros", with(b"", &[0; 2])),
        ("metadata", with(b"", b"<metadata>made by a scanner</metadata>")),
        ("padding", with(b"", &[0; 340])),
        ("[", with(b"[mm] part 42", b"")),
        ("{", with(b"{\"units\":\"mm\",\"asset\":1}", b"")),
        ("<", with(b"<exported by a tool>", b"")),
    ] {
        check(name, &bytes, BOX_MM, BOX_CM3);
    }
}

#[test]
fn instances_are_placed() {
    let instancing =
        r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":2}}}"#;
    let required = r#","extensionsUsed":["EXT_mesh_gpu_instancing"],
        "extensionsRequired":["EXT_mesh_gpu_instancing"]"#;
    let (json, buffer) = gltf_box(None, required, instancing);
    let import = check("instances", &glb(&json, &buffer), [260.0, 40.0, 100.0], 720.0);
    assert_eq!(import.repair.components, 3);
}

#[test]
fn required_extension_is_refused_by_name_unless_it_only_changes_the_appearance() {
    let read = |extra: &str| {
        let (json, buffer) = gltf_box(None, extra, "");
        import(&glb(&json, &buffer))
    };
    for name in ["EXT_shape_of_the_future", "KHR_draco_mesh_compression", "EXT_meshopt_compression"]
    {
        let error = read(&format!(r#","extensionsRequired":["{name}"]"#)).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("Export the mesh without it"), "{error}");
    }
    assert!(
        read(r#","extensionsRequired":["KHR_materials_unlit","KHR_texture_transform"]"#).is_ok()
    );
    assert!(read(r#","extensionsUsed":["EXT_shape_of_the_future"]"#).is_ok());
}

#[test]
fn compression_is_named_if_the_geometry_is_missing() {
    let (json, buffer) = gltf_box(None, r#","extensionsUsed":["KHR_draco_mesh_compression"]"#, "");
    let json = json.replace(r#"{"bufferView":0,"#, "{").replace(r#"{"bufferView":1,"#, "{");
    let error = import(&glb(&json, &buffer)).unwrap_err().to_string();
    assert!(error.contains("compression (KHR_draco_mesh_compression)"), "{error}");
    let (json, _) = gltf_box(None, r#","extensionsUsed":["KHR_meshopt_compression"]"#, "");
    let error = import(&glb(&json, &[0; 32])).unwrap_err().to_string();
    assert!(error.contains("compression (KHR_meshopt_compression)"), "{error}");
}

#[test]
fn assembly_of_many_bodies_is_read() {
    let (json, buffer) = gltf_box(None, "", "");
    let list = |item: &dyn Fn(usize) -> String| (0..3000).map(item).collect::<Vec<_>>().join(",");
    let node = |i: usize| {
        let at = [i % 15, i / 15 % 15, i / 225].map(|k| 0.15 * k as f64);
        format!(
            r#"{{"mesh":{i},"name":"Part {i}","scale":[0.1,0.1,0.1],"translation":{:?}}}"#,
            at.map(|x| x * 0.1)
        )
    };
    let mesh = |i: usize| {
        format!(
            r#"{{"name":"A body of the assembly with the number {i}, as CAD programs write it when they export","primitives":[
            {{"attributes":{{"POSITION":0}},"indices":1,"material":0}}],"extras":{{"id":{i},"material":"aluminium"}},"extensions":{{}}}}"#
        )
    };
    let json = json
        .replace(r#""nodes":[{"mesh":0}]"#, &format!(r#""nodes":[{}]"#, list(&node)))
        .replace(
            r#""scenes":[{"nodes":[0]}]"#,
            &format!(r#""scenes":[{{"nodes":[{}]}}]"#, list(&|i| i.to_string())),
        )
        .replace(
            r#""meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}]"#,
            &format!(r#""meshes":[{}]"#, list(&mesh)),
        );
    assert!(json.len() > 1_000_000, "{} bytes", json.len());
    // 15 x 15 x 14 bodies of 6 x 10 x 4 mm, every 15 mm; y up becomes z up.
    let extent = [6.0 + 14.0 * 15.0, 4.0 + 13.0 * 15.0, 10.0 + 14.0 * 15.0];
    let import = check("assembly", &glb(&json, &buffer), extent, 3000.0 * 0.24);
    assert_eq!(import.repair.components, 3000);
}

#[test]
fn excess_of_json_asks_to_join_the_parts() {
    let objects = "{},".repeat(500_000);
    let json = format!(r#"{{"asset":{{"version":"2.0"}},"nodes":[{objects}{{}}]}}"#);
    let error = import(json.as_bytes()).unwrap_err().to_string();
    assert!(error.contains("objects in JSON") && error.contains("Join the parts"), "{error}");
}

#[test]
fn invalid_vertex_without_a_face_is_ignored() {
    let mut vertices = box_corners();
    vertices.push([f64::NAN; 3]);
    let mut faces = box_faces();
    check("NaN", obj(&vertices, &faces).as_bytes(), BOX_MM, BOX_CM3);
    for sentinel in [1e11, 1e38] {
        vertices[8] = [sentinel; 3];
        check("sentinel", obj(&vertices, &faces).as_bytes(), BOX_MM, BOX_CM3);
    }
    // An unused origin, 5,000 km from a mesh in millimetres.
    let mut distant = box_corners();
    distant.iter_mut().for_each(|v| v[1] += 4.65e9);
    distant.push([0.0; 3]);
    check("origin", obj(&distant, &faces).as_bytes(), BOX_MM, BOX_CM3);
    faces.push(vec![0, 1, 8]);
    for used in [vertices, distant] {
        let error = import(obj(&used, &faces).as_bytes()).unwrap_err();
        assert!(matches!(error, MeshError::NotFinite { .. }), "{error}");
    }
}

#[test]
fn gltf_with_distant_positions_in_single_precision_is_refused() {
    // The transform of a node is in double precision.
    let translation = r#","translation":[10000,0,0]"#;
    let (json, buffer) = gltf_box(None, "", translation);
    check("distant node", &glb(&json, &buffer), BOX_MM, BOX_CM3);
    // At 10 km, single-precision numbers have a spacing of 1 mm.
    let (json, mut buffer) = gltf_box(None, "", r#","translation":[-10000,0,0]"#);
    for corner in 0..8 {
        let bytes = &mut buffer[12 * corner..12 * corner + 4];
        let x = f32::from_le_bytes(bytes.try_into().unwrap());
        bytes.copy_from_slice(&(x + 10_000.0).to_le_bytes());
    }
    let error = import(&glb(&json, &buffer)).unwrap_err();
    assert!(matches!(error, MeshError::Imprecise { .. }), "{error}");
}

#[test]
fn skinned_vertices_follow_their_joints() {
    let skinned = |upper_joint: u8, node: &str, num_matrices: usize| {
        let skin = r#","skins":[{"joints":[1,2],"inverseBindMatrices":5}]"#;
        let (json, mut buffer) = gltf_box(None, skin, &format!(r#","skin":0{node}"#));
        let is_upper = |corner: usize| corners([0.0; 3], [1.0; 3])[corner][1] > 0.5;
        let joints =
            (0..8).map(|i| if is_upper(i) { [upper_joint, 0, 0, 0] } else { [0, 0, 0, 0] });
        buffer.extend(joints.flatten());
        let weights = (0..8).map(|i| if is_upper(i) { [1.0, 0.0] } else { [0.75, 0.25] });
        let weights = weights.flat_map(|[a, b]| [a, b, 0.0, 0.0_f32]);
        buffer.extend(weights.flat_map(f32::to_le_bytes));
        for y in [0.0, -0.1_f32] {
            let matrix = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., y, 0., 1.];
            buffer.extend(matrix.into_iter().flat_map(f32::to_le_bytes));
        }
        let nodes = r#"},{},{"translation":[0,0.15,0]}],"skins""#;
        let views = r#"{"buffer":0,"byteOffset":168,"byteLength":36},
            {"buffer":0,"byteOffset":204,"byteLength":32},
            {"buffer":0,"byteOffset":236,"byteLength":128},
            {"buffer":0,"byteOffset":364,"byteLength":128}"#;
        let accessors = format!(
            r#"{{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"}},
            {{"bufferView":3,"componentType":5121,"count":8,"type":"VEC4"}},
            {{"bufferView":4,"componentType":5126,"count":8,"type":"VEC4"}},
            {{"bufferView":5,"componentType":5126,"count":{num_matrices},"type":"MAT4"}}"#
        );
        let json = json
            .replace(r#"[{"nodes":[0]}]"#, r#"[{"nodes":[0,1,2]}]"#)
            .replace(r#"}],"skins""#, nodes)
            .replace(r#""POSITION":0"#, r#""POSITION":0,"JOINTS_0":3,"WEIGHTS_0":4"#)
            .replace(r#"{"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"}"#, &accessors)
            .replace(r#"{"buffer":0,"byteOffset":168,"byteLength":36}"#, views)
            .replace(r#""byteLength":204"#, r#""byteLength":492"#);
        glb(&json, &buffer)
    };
    check("bind pose", &skinned(0, "", 2), BOX_MM, BOX_CM3);
    // The second joint is 5 cm above its place in the bind pose, and the node itself does not count.
    check("moved joint", &skinned(1, "", 2), [60.0, 40.0, 150.0], 360.0);
    check("moved node", &skinned(1, r#","scale":[9,9,9]"#, 2), [60.0, 40.0, 150.0], 360.0);
    for (bytes, wanted) in [
        (skinned(7, "", 2), "expected a joint of the skin, found 7"),
        (skinned(1, "", 1), "expected an inverse bind matrix per joint, found 1 for 2 joints"),
    ] {
        let error = import(&bytes).unwrap_err().to_string();
        assert!(error.contains(wanted), "{error}");
    }
}

#[test]
fn distant_mesh_keeps_its_size() {
    for (name, at) in [
        ("near", [0.0; 3]),
        ("10 km", [1e4, 0.0, 0.0]),
        ("100 km", [1e5, 0.0, 0.0]),
        ("UTM", [500_123.25, 4_649_776.5, 312.75]),
    ] {
        let mut vertices = corners([0.0; 3], [0.06, 0.04, 0.1]);
        vertices.iter_mut().for_each(|v| (0..3).for_each(|axis| v[axis] += at[axis]));
        check(name, obj(&vertices, &box_faces()).as_bytes(), BOX_MM, BOX_CM3);
        let mut ply =
            b"ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty double x\n\
            property double y\nproperty double z\nelement face 12\n\
            property list uchar int vertex_indices\nend_header\n"
                .to_vec();
        ply.extend(vertices.iter().flatten().flat_map(|x| x.to_le_bytes()));
        for triangle in box_triangles() {
            ply.push(3);
            ply.extend(triangle.iter().flat_map(|i| (*i as i32).to_le_bytes()));
        }
        check(name, &ply, BOX_MM, BOX_CM3);
        // In millimetres, the coordinates of a map projection exceed 1e9.
        vertices.iter_mut().flatten().for_each(|x| *x *= 1000.0);
        check(name, obj(&vertices, &box_faces()).as_bytes(), BOX_MM, BOX_CM3);
    }
}

#[test]
fn positions_in_a_sparse_accessor_are_read() {
    let (json, mut buffer) = gltf_box(None, "", "");
    buffer.truncate(168);
    buffer.extend((0..8_u16).flat_map(u16::to_le_bytes));
    let sparse = r#"{"componentType":5126,"count":8,"type":"VEC3","sparse":{"count":8,
        "indices":{"bufferView":2,"componentType":5123},"values":{"bufferView":0}}}"#;
    let base = r#"{"bufferView":0,"componentType":5126,"count":8,"type":"VEC3"}"#;
    let json = json.replacen(base, sparse, 1).replace(r#""byteLength":36"#, r#""byteLength":16"#);
    check("sparse", &glb(&json, &buffer), BOX_MM, BOX_CM3);
}

#[test]
fn triangle_strips_of_ply_are_read() {
    let mut ply = b"ply\nformat binary_little_endian 1.0\nelement vertex 8\nproperty float x\n\
        property float y\nproperty float z\nelement tristrips 1\n\
        property list int int vertex_indices\nend_header\n"
        .to_vec();
    ply.extend(box_corners().iter().flatten().flat_map(|x| (*x as f32).to_le_bytes()));
    let strips: Vec<i32> = common::QUADS
        .iter()
        .flat_map(|&[a, b, c, d]| [a as i32, b as i32, d as i32, c as i32, -1])
        .collect();
    ply.extend((strips.len() as i32).to_le_bytes());
    ply.extend(strips.iter().flat_map(|i| i.to_le_bytes()));
    let import = check("strips", &ply, BOX_MM, BOX_CM3);
    assert!(import.repair.watertight);
}
