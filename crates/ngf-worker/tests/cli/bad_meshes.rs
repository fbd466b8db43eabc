//! Invalid mesh files: each gets its own message, exit status 2, and no panic.

use std::path::Path;
use std::process::Command;

/// Error of `ngf evaluate` for an invalid mesh file.
fn error_message(folder: &Path, name: &str, bytes: &[u8]) -> String {
    let file = folder.join(name);
    std::fs::write(&file, bytes).unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_ngf-worker"))
        .args(["evaluate", "--model", "planner", "--attempts", "1", "--mass", "0.3"])
        .args(["--grasps", "none.json", "--mesh"])
        .arg(&file)
        .output()
        .unwrap();
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{name}: {stderr}");
    // A note about the unit of the mesh may precede the error.
    assert!(stderr.lines().any(|line| line.starts_with("error: ")), "{name}: {stderr}");
    assert!(!stderr.contains("panicked"), "{name}: {stderr}");
    stderr
}

/// A binary PLY file of `faces` triangles over a grid of vertices.
fn ply(faces: u32) -> Vec<u8> {
    let side = (faces as f32 / 2.0).sqrt().ceil() as u32;
    let vertices = (side + 1) * (side + 1);
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty uchar x\n\
         property uchar y\nproperty uchar z\nelement face {faces}\n\
         property list uchar uint vertex_indices\nend_header\n"
    )
    .into_bytes();
    bytes.extend((0..vertices).flat_map(|v| [(v % 251) as u8, (v / 251 % 251) as u8, 1]));
    for face in 0..faces {
        let corner = face / 2 % side + (face / 2 / side) * (side + 1);
        bytes.push(3);
        for index in [corner, corner + 1, corner + side + 1 + face % 2] {
            bytes.extend(index.to_le_bytes());
        }
    }
    bytes
}

#[test]
fn each_invalid_file_has_its_own_message() {
    let folder = tempfile::tempdir().unwrap();
    let mut short_stl = vec![0u8; 80];
    short_stl.extend(12u32.to_le_bytes());
    short_stl.extend([0; 50]);
    let flat = "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n";
    let cases: [(&str, Vec<u8>, &str); 7] = [
        ("empty.obj", vec![], "the file is empty"),
        ("truncated.stl", short_stl, "ends early"),
        ("nan.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n".to_vec(), "a coordinate is"),
        ("flat.obj", flat.into(), "zero area"),
        ("large.ply", ply(6_000_000), "the limit is 5000000"),
        ("picture.obj", b"\x89PNG\r\n\x1a\n0000000000000000".to_vec(), "this looks like"),
        ("notes.stl", b"Dear diary, today I forgot the mesh.\n".to_vec(), "not a mesh"),
    ];
    let mut messages = Vec::new();
    for (name, bytes, wanted) in cases {
        let message = error_message(folder.path(), name, &bytes);
        println!("{}", message.trim_end().replace(&folder.path().display().to_string(), ""));
        assert!(message.contains(wanted), "{name}: expected \"{wanted}\" in \"{message}\"");
        assert!(message.contains(name), "the message does not contain {name}: {message}");
        messages.push(message.replace(name, ""));
    }
    messages.sort();
    messages.dedup();
    assert_eq!(messages.len(), 7, "two files got the same message: {messages:?}");
}

#[test]
fn file_format_is_detected_independent_of_extension() {
    let folder = tempfile::tempdir().unwrap();
    let cube = "v 0 0 0\nv 40 0 0\nv 40 60 0\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    // The file is parsed by its content. The later error about the grasp file is expected.
    let stderr = error_message(folder.path(), "box.stl", cube.as_bytes());
    assert!(stderr.contains("cannot read none.json"), "{stderr}");
}

#[test]
fn unstable_mesh_is_reoriented_with_note() {
    let folder = tempfile::tempdir().unwrap();
    // A box with one edge of its base raised by 90 mm.
    let tilted = "v 0 0 0\nv 40 0 90\nv 40 60 90\nv 0 60 0\nv 0 0 120\nv 40 0 120\nv 40 60 120\n\
        v 0 60 120\nf 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";
    let file = folder.path().join("tilted.obj");
    std::fs::write(&file, tilted).unwrap();
    let notes = |model: &[&str]| {
        let mut ngf = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
        ngf.args(["evaluate", "--attempts", "1", "--mass", "0.3", "--model"]).args(model);
        String::from_utf8_lossy(&ngf.arg("--mesh").arg(&file).output().unwrap().stderr).into_owned()
    };
    let (most_stable, most_similar) =
        ("the most stable pose is used", "most similar to the training data");
    let stderr = notes(&["planner", "--grasps", "none.json"]);
    assert!(
        stderr.contains("tilted: The orientation in the file is unstable")
            && stderr.contains(most_stable),
        "{stderr}"
    );
    // With a model, the stable pose is the same as on the page.
    let stderr = notes(&[concat!(env!("CARGO_MANIFEST_DIR"), "/../../models/default")]);
    assert!(
        stderr.contains("tilted: The orientation in the file is unstable")
            && stderr.contains(most_similar),
        "{stderr}"
    );
}

#[test]
fn mesh_needs_mass_or_density() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("box.obj");
    std::fs::write(
        &file,
        "v 0 0 0\nv 40 0 0\nv 0 60 0\nv 0 0 90\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n",
    )
    .unwrap();
    let error = |more: &[&str]| {
        let mut ngf = Command::new(env!("CARGO_BIN_EXE_ngf-worker"));
        ngf.args(["evaluate", "--model", "planner", "--grasps", "none.json", "--mesh"]).arg(&file);
        String::from_utf8_lossy(&ngf.args(more).output().unwrap().stderr).into_owned()
    };
    assert!(error(&[]).contains("needs --mass KG or --density"));
    for mass in ["0", "1e30", "1e-30", "-1", "nan"] {
        let text = error(&[&format!("--mass={mass}")]);
        assert!(text.contains("--mass must be between 0.001 and 100 kg"), "{text}");
    }
    let text = error(&["--density", "nan"]);
    assert!(text.contains("--density must be between 1 and 23000 kg/m³"), "{text}");
    // A mesh with a density is accepted. The later error about the grasp file is expected.
    assert!(error(&["--density", "500"]).contains("cannot read none.json"));
}
