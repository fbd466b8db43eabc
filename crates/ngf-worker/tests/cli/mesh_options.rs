//! Size, unit, up axis, containers and convex parts of a mesh file on the command line.

use serde_json::Value;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output};
use zip::write::SimpleFileOptions;

/// A box of 1 x 2 x 0.5 units, centred at the origin, y up.
fn unit_sized_box() -> String {
    let corners = (0..8).map(|i| [i & 1, i >> 1 & 1, i >> 2 & 1].map(|bit| bit as f32 - 0.5));
    let corners = corners.map(|[x, y, z]| format!("v {x} {} {}\n", 2.0 * y, 0.5 * z));
    let faces = ["1 3 4 2", "5 6 8 7", "1 2 6 5", "3 7 8 4", "1 5 7 3", "2 4 8 6"];
    corners.chain(faces.map(|face| format!("f {face}\n"))).collect()
}

/// glTF of a tetrahedron of 6 x 4 x 12 cm, and its buffer.
fn gltf() -> (&'static str, Vec<u8>) {
    let json = r#"{"asset":{"version":"2.0"},"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1}]}],
        "buffers":[{"byteLength":60,"uri":"scene.bin"}],
        "bufferViews":[{"buffer":0,"byteLength":48},{"buffer":0,"byteOffset":48,"byteLength":12}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"},
        {"bufferView":1,"componentType":5121,"count":12,"type":"SCALAR"}]}"#;
    let corners = [[0.0_f32, 0.0, 0.0], [0.06, 0.0, 0.0], [0.0, 0.0, -0.04], [0.0, 0.12, 0.0]];
    let mut buffer: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
    buffer.extend([0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]);
    (json, buffer)
}

/// OBJ of a comb on a base. The tines and the gaps are half a pitch (mm) wide.
fn comb(tines: u32, pitch: f64) -> String {
    let base = [0.0, (f64::from(tines) - 0.5) * pitch, 0.0, 4.0];
    let tine = |i: u32| [f64::from(i) * pitch, (f64::from(i) + 0.5) * pitch, 3.0, 24.0];
    let mut text = String::new();
    for (first, [left, right, bottom, top]) in
        (1..).step_by(8).zip(std::iter::once(base).chain((0..tines).map(tine)))
    {
        for z in [bottom, top] {
            for [x, y] in [[left, 0.0], [right, 0.0], [right, 8.0], [left, 8.0]] {
                text += &format!("v {x} {y} {z}\n");
            }
        }
        for face in
            [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]
        {
            let [a, b, c, d] = face.map(|i: u32| first + i);
            text += &format!("f {a} {b} {c} {d}\n");
        }
    }
    text
}

fn inspect(path: &Path, options: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
    command.args(["mesh", "inspect", "--json"]).arg(path).args(options).output().unwrap()
}

/// Extents (cm, rounded to 0.1) in the JSON report.
fn extents(path: &Path, options: &[&str]) -> [f64; 3] {
    let output = inspect(path, options);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["convex_parts"]["count"].as_u64() > Some(0), "{report}");
    [0, 1, 2].map(|i| (1000.0 * report["extent_m"][i].as_f64().unwrap()).round() / 10.0)
}

#[test]
fn size_unit_scale_and_up_axis_are_applied() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("unit.obj");
    std::fs::write(&file, unit_sized_box()).unwrap();
    let refused = inspect(&file, &[]);
    let text = String::from_utf8(refused.stderr).unwrap();
    assert_eq!(refused.status.code(), Some(2), "{text}");
    assert!(text.contains("size_required") && text.contains("--size"), "{text}");
    assert_eq!(extents(&file, &["--size", "12cm"]), [6.0, 12.0, 3.0]);
    assert_eq!(extents(&file, &["--size", "0.12", "--up", "y"]), [6.0, 3.0, 12.0]);
    assert_eq!(extents(&file, &["--unit", "in"]), [2.5, 5.1, 1.3]);
    assert_eq!(extents(&file, &["--unit", "cm", "--scale", "5"]), [5.0, 10.0, 2.5]);
    let shown = Command::new(env!("CARGO_BIN_EXE_ngf-worker"))
        .args(["mesh", "inspect", "--size", "12cm"])
        .arg(&file)
        .output()
        .unwrap();
    let shown = String::from_utf8(shown.stdout).unwrap();
    assert!(shown.contains("scaled to 12.0 cm, as specified"), "{shown}");
    assert!(shown.contains("the file appears to be y-up"), "{shown}");
}

#[test]
fn gltf_with_its_buffer_is_read_from_a_file_a_folder_and_an_archive() {
    let folder = tempfile::tempdir().unwrap();
    let (json, buffer) = gltf();
    let scene = folder.path().join("scene.gltf");
    std::fs::write(&scene, json).unwrap();
    let alone = String::from_utf8(inspect(&scene, &[]).stderr).unwrap();
    assert!(
        alone.contains("scene.bin, which is missing") || alone.contains("\"scene.bin\""),
        "{alone}"
    );
    std::fs::write(folder.path().join("scene.bin"), &buffer).unwrap();
    let archive = tempfile::NamedTempFile::new().unwrap();
    let mut writer = zip::ZipWriter::new(archive.reopen().unwrap());
    for (name, content) in [("a/scene.gltf", json.as_bytes()), ("a/scene.bin", &buffer)] {
        writer.start_file(name, SimpleFileOptions::default()).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap();
    for path in [&scene, folder.path(), archive.path()] {
        assert_eq!(extents(path, &[]), [6.0, 4.0, 12.0], "{}", path.display());
    }
}

#[test]
fn report_states_the_share_of_the_hollows_that_the_parts_fill() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("comb.obj");
    let filled = |mesh: String| {
        std::fs::write(&file, mesh).unwrap();
        let output = inspect(&file, &["--unit", "mm"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        let parts = &report["convex_parts"];
        assert_eq!(parts["method"], "planes", "{report}");
        parts["filled_fraction"].as_f64().unwrap()
    };
    // Three parts leave the gap of a bracket free.
    let bracket = filled(comb(2, 60.0));
    assert!((0.0..0.05).contains(&bracket), "{bracket}");
    // 24 parts leave up to 23 of the 40 gaps free.
    let many_gaps = filled(comb(41, 4.0));
    assert!((0.35..=1.0).contains(&many_gaps), "{many_gaps}");
    let shown = Command::new(env!("CARGO_BIN_EXE_ngf-worker"))
        .args(["mesh", "inspect", "--unit", "mm"])
        .arg(&file)
        .output()
        .unwrap();
    let shown = String::from_utf8(shown.stdout).unwrap();
    let share = format!("convex parts, which fill {:.1} % of the hollows", 100.0 * many_gaps);
    assert!(shown.contains(&share), "wanted {share}, got {shown}");
}
