//! Uploaded meshes.

use crate::{assert_problem, json_of, send, send_with, test_app};
use axum::body::Bytes;
use axum::http::StatusCode;
use http_body_util::BodyExt;
use serde_json::json;

/// Corner of a cube with an edge length of 0.1 m.
const TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n\
                           f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

const FORM: (&str, &str) = ("content-type", "multipart/form-data; boundary=cut");

/// Multipart form with a text field and a file.
fn form(file: &str) -> String {
    format!(
        "--cut\r\nContent-Disposition: form-data; name=\"note\"\r\n\r\nmine\r\n--cut\r\n\
         Content-Disposition: form-data; name=\"file\"; filename=\"tetra.obj\"\r\n\r\n\
         {file}\r\n--cut--\r\n"
    )
}

/// Body of a response.
async fn bytes(response: axum::response::Response) -> Bytes {
    response.into_body().collect().await.unwrap().to_bytes()
}

#[tokio::test]
async fn mesh_with_the_name_of_a_drawing_is_not_displayed_by_browsers() {
    let (app, _folder) = test_app().await;
    let mesh = json_of(send(&app, "POST", "/meshes?name=x.svg", TETRAHEDRON).await).await;
    let file = format!("/meshes/{}/file", mesh["id"].as_str().unwrap());
    let file = send(&app, "GET", &file, "").await;
    assert_eq!(file.headers()["content-type"], "application/octet-stream");
    let disposition = file.headers()["content-disposition"].to_str().unwrap();
    assert_eq!(disposition, "attachment; filename*=UTF-8''x.svg");
    let artifact = format!("/artifacts/{}", mesh["hash"].as_str().unwrap());
    let artifact = send(&app, "GET", &artifact, "").await;
    assert!(artifact.headers()["content-disposition"].to_str().unwrap().starts_with("attachment"));
}

#[tokio::test]
async fn equal_bytes_are_stored_as_one_mesh() {
    let (app, _folder) = test_app().await;
    let path = "/meshes?name=../../tetra.obj";
    let response = send(&app, "POST", path, TETRAHEDRON).await;
    assert_eq!(response.status(), StatusCode::CREATED);
    let mesh = json_of(response).await;
    let id = mesh["id"].as_str().unwrap();
    assert_eq!(mesh["name"], "tetra.obj");
    assert_eq!(mesh["bytes"], TETRAHEDRON.len());
    assert_eq!(mesh["summary"]["triangles"], 4, "{mesh}");

    let again = send_with(&app, "POST", "/meshes", form(TETRAHEDRON), &[FORM]).await;
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(json_of(again).await, mesh);
    let list = json_of(send(&app, "GET", "/meshes", "").await).await;
    assert_eq!(list["data"], json!([mesh]));

    // A file in a form has the same size limit as a raw body.
    let long = format!("{TETRAHEDRON}{}", "# 3 MB of comment\n".repeat(160_000));
    let long = send_with(&app, "POST", "/meshes", form(&long), &[FORM]).await;
    assert_eq!(long.status(), StatusCode::CREATED);
    let long = json_of(long).await;
    assert_eq!(long["summary"]["triangles"], 4);
    let long_mesh = format!("/meshes/{}", long["id"].as_str().unwrap());
    let deleted = send(&app, "DELETE", &long_mesh, "").await;
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);

    let file = format!("/meshes/{id}/file");
    assert_eq!(bytes(send(&app, "GET", &file, "").await).await, TETRAHEDRON);
    let part = send_with(&app, "GET", &file, "", &[("range", "bytes=2-6")]).await;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(bytes(part).await, "0 0 0");
    let outside = send_with(&app, "GET", &file, "", &[("range", "bytes=9999-")]).await;
    assert_problem(outside, 416, "range_not_satisfiable").await;
}

#[tokio::test]
async fn deleted_mesh_is_rejected_as_input() {
    let (app, _folder) = test_app().await;
    let mesh = json_of(send(&app, "POST", "/meshes", TETRAHEDRON).await).await;
    let id = mesh["id"].as_str().unwrap();
    let job = json!({ "kind": "mesh.prepare", "params": { "mesh_id": id } }).to_string();
    let created = json_of(send(&app, "POST", "/jobs", job.clone()).await).await;
    assert_eq!(created["params"]["mesh_id"], id, "{created}");
    let deleted = send(&app, "DELETE", &format!("/meshes/{id}"), "").await;
    assert_eq!(deleted.status(), StatusCode::NO_CONTENT);
    let late = send(&app, "POST", "/jobs", job).await;
    let problem = assert_problem(late, 422, "input_not_found").await;
    assert_eq!(problem["errors"][0]["param"], "params.mesh_id");
    let again = send(&app, "DELETE", &format!("/meshes/{id}"), "").await;
    assert_problem(again, 404, "record_not_found").await;
    let file = format!("/artifacts/{}", mesh["hash"].as_str().unwrap());
    assert_problem(send(&app, "GET", &file, "").await, 404, "record_not_found").await;
}

#[tokio::test]
async fn mesh_of_unit_size_requires_its_size() {
    let (app, _folder) = test_app().await;
    let unit_sized = TETRAHEDRON.replace("0.1", "1");
    let response = send(&app, "POST", "/meshes", unit_sized.clone()).await;
    let problem = assert_problem(response, 422, "size_required").await;
    assert_eq!(problem["errors"][0]["param"], "size_m", "{problem}");
    let mesh = send(&app, "POST", "/meshes?size_m=0.12&up=y", unit_sized.clone()).await;
    assert_eq!(mesh.status(), StatusCode::CREATED);
    let mesh = json_of(mesh).await;
    let height = mesh["summary"]["extent_m"][2].as_f64().unwrap();
    assert!((height - 0.12).abs() < 1e-6, "{mesh}");
    let job = |size: serde_json::Value| {
        let params = json!({ "mesh_id": mesh["id"], "size_m": size });
        json!({ "kind": "mesh.prepare", "params": params }).to_string()
    };
    let problem = send(&app, "POST", "/jobs", job(json!(null))).await;
    let problem = assert_problem(problem, 422, "size_required").await;
    assert_eq!(problem["errors"][0]["param"], "params.size_m", "{problem}");
    let created = send(&app, "POST", "/jobs", job(json!(0.12))).await;
    assert_eq!(created.status(), StatusCode::CREATED);
    // The same file with another size is the same mesh, with the summary of the new size.
    let larger = json_of(send(&app, "POST", "/meshes?size_m=0.24&up=y", unit_sized).await).await;
    let height = larger["summary"]["extent_m"][2].as_f64().unwrap();
    assert!((height - 0.24).abs() < 1e-6, "{larger}");
    assert_eq!((&larger["id"], &larger["created_at"]), (&mesh["id"], &mesh["created_at"]));
    let path = format!("/meshes/{}", mesh["id"].as_str().unwrap());
    assert_eq!(json_of(send(&app, "GET", &path, "").await).await, larger);
    // A mesh whose file tells the size needs none.
    let known = json_of(send(&app, "POST", "/meshes?unit=m", TETRAHEDRON).await).await;
    assert_eq!(known["size_required"], false, "{known}");
    for query in ["unit=ell", "size_m=-1", "size_m=big", "scale=0", "up=w", "unit=m&size_m=1"] {
        let response = send(&app, "POST", &format!("/meshes?{query}"), TETRAHEDRON).await;
        assert_problem(response, 422, "invalid_parameter").await;
    }
}

#[tokio::test]
async fn invalid_mesh_files_and_forms_are_rejected() {
    let (app, _folder) = test_app().await;
    for bytes in ["", "solid", "v 0 0", "glTF", "\0\0\0\0"] {
        let response = send(&app, "POST", "/meshes", bytes).await;
        assert_problem(response, 422, "invalid_mesh").await;
    }
    let cut = send_with(&app, "POST", "/meshes", "--cut\r\nContent", &[FORM]).await;
    assert_problem(cut, 400, "malformed_form").await;
    let no_file = "--cut\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\nb\r\n--cut--\r\n";
    let no_file = send_with(&app, "POST", "/meshes", no_file, &[FORM]).await;
    assert_problem(no_file, 400, "malformed_form").await;
    let fields = "--cut\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\nb\r\n".repeat(100);
    let fields = send_with(&app, "POST", "/meshes", fields + "--cut--\r\n", &[FORM]).await;
    assert_problem(fields, 400, "malformed_form").await;
    // glTF and its buffer: one of them alone is not the mesh that the client means.
    let file = |name: &str| {
        format!(
            "--cut\r\nContent-Disposition: form-data; name=\"file\"; filename=\"{name}\"\r\n\r\n{TETRAHEDRON}\r\n"
        )
    };
    let two = format!("{}{}--cut--\r\n", file("a.obj"), file("b.obj"));
    let problem = send_with(&app, "POST", "/meshes", two, &[FORM]).await;
    let problem = assert_problem(problem, 400, "malformed_form").await;
    assert!(problem["detail"].as_str().unwrap().contains("several files"), "{problem}");
    let list = json_of(send(&app, "GET", "/meshes", "").await).await;
    assert_eq!(list["data"], json!([]));
}

#[tokio::test]
async fn compressed_upload_is_not_decompressed() {
    let (app, folder) = test_app().await;
    // 10 MB of zeros as gzip, as in a decompression bomb.
    let packed = {
        use std::io::Write;
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
        gzip.write_all(&vec![0; 10_000_000]).unwrap();
        gzip.finish().unwrap()
    };
    assert!(packed.len() < 20_000);
    let zip = [b"PK\x03\x04".as_slice(), &packed].concat();
    for (body, headers) in [
        (packed.clone(), &[][..]),
        (packed, &[("content-encoding", "gzip")][..]),
        (zip, &[("content-type", "application/zip")][..]),
    ] {
        let response = send_with(&app, "POST", "/meshes", body, headers).await;
        assert_problem(response, 422, "invalid_mesh").await;
    }
    // No file of a rejected upload remains.
    assert_eq!(std::fs::read_dir(folder.path().join("data/uploads")).unwrap().count(), 0);
}

#[tokio::test]
async fn list_rejects_an_unknown_cursor() {
    let (app, _folder) = test_app().await;
    for list in ["/meshes", "/datasets", "/models"] {
        let response = send(&app, "GET", &format!("{list}?after=msh_0"), "").await;
        let problem = assert_problem(response, 422, "invalid_parameter").await;
        assert_eq!(problem["errors"][0]["param"], "after");
    }
}

#[tokio::test]
async fn oversized_body_is_rejected() {
    let (app, _folder) = test_app().await;
    let length = [("content-length", "60000000")];
    let response = send_with(&app, "POST", "/meshes", "v 0 0 0", &length).await;
    assert_problem(response, 413, "body_too_large").await;
    // A body without Content-Length.
    let response = send(&app, "POST", "/meshes", vec![b'v'; 50_000_001]).await;
    assert_problem(response, 413, "body_too_large").await;
    let response = send_with(&app, "POST", "/meshes", form(&"v".repeat(50_010_000)), &[FORM]).await;
    assert_problem(response, 413, "body_too_large").await;
    let response = send(&app, "POST", "/jobs", vec![b' '; 5 << 20]).await;
    assert_problem(response, 413, "body_too_large").await;
}
