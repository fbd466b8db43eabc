//! Meshes that are uploaded.

use crate::{assert_problem, idle, json_of, send, send_with};
use axum::body::Bytes;
use axum::http::StatusCode;
use http_body_util::BodyExt;
use serde_json::json;

/// A corner of a cube, 10 cm wide.
const TETRAHEDRON: &str = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\n\
                           f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

const FORM: (&str, &str) = ("content-type", "multipart/form-data; boundary=cut");

fn form(file: &str) -> String {
    format!(
        "--cut\r\nContent-Disposition: form-data; name=\"note\"\r\n\r\nmine\r\n--cut\r\n\
         Content-Disposition: form-data; name=\"file\"; filename=\"tetra.obj\"\r\n\r\n\
         {file}\r\n--cut--\r\n"
    )
}

async fn bytes(response: axum::response::Response) -> Bytes {
    response.into_body().collect().await.unwrap().to_bytes()
}

#[tokio::test]
async fn the_same_bytes_are_the_same_mesh() {
    let (app, _folder) = idle().await;
    let path = "/meshes?name=../../tetra.obj";
    let answer = send(&app, "POST", path, TETRAHEDRON).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    let mesh = json_of(answer).await;
    let id = mesh["id"].as_str().unwrap();
    assert_eq!(mesh["name"], "tetra.obj");
    assert_eq!(mesh["bytes"], TETRAHEDRON.len());
    assert_eq!(mesh["report"]["triangles"], 4, "{mesh}");

    let again = send_with(&app, "POST", "/meshes", form(TETRAHEDRON), &[FORM]).await;
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(json_of(again).await, mesh);
    let list = json_of(send(&app, "GET", "/meshes", "").await).await;
    assert_eq!(list["data"], json!([mesh]));

    // A form may be as long as a body without one.
    let long = format!("{TETRAHEDRON}{}", "# 3 MB of a remark\n".repeat(160_000));
    let long = send_with(&app, "POST", "/meshes", form(&long), &[FORM]).await;
    assert_eq!(long.status(), StatusCode::CREATED);
    let long = json_of(long).await;
    assert_eq!(long["report"]["triangles"], 4);
    let gone = send(&app, "DELETE", &format!("/meshes/{}", long["id"].as_str().unwrap()), "").await;
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);

    let file = format!("/meshes/{id}/file");
    assert_eq!(bytes(send(&app, "GET", &file, "").await).await, TETRAHEDRON);
    let part = send_with(&app, "GET", &file, "", &[("range", "bytes=2-6")]).await;
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(bytes(part).await, "0 0 0");
    let beyond = send_with(&app, "GET", &file, "", &[("range", "bytes=9999-")]).await;
    assert_problem(beyond, 416, "range_not_satisfiable").await;
}

#[tokio::test]
async fn a_mesh_that_is_gone_is_no_input() {
    let (app, _folder) = idle().await;
    let mesh = json_of(send(&app, "POST", "/meshes", TETRAHEDRON).await).await;
    let id = mesh["id"].as_str().unwrap();
    let job = json!({ "kind": "mesh.prepare", "params": { "mesh_id": id } }).to_string();
    let made = json_of(send(&app, "POST", "/jobs", job.clone()).await).await;
    assert_eq!(made["params"]["mesh_id"], id, "{made}");
    let gone = send(&app, "DELETE", &format!("/meshes/{id}"), "").await;
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    let late = send(&app, "POST", "/jobs", job).await;
    let problem = assert_problem(late, 422, "input_not_found").await;
    assert_eq!(problem["errors"][0]["param"], "params.mesh_id");
    let again = send(&app, "DELETE", &format!("/meshes/{id}"), "").await;
    assert_problem(again, 404, "record_not_found").await;
    let file = format!("/artifacts/{}", mesh["hash"].as_str().unwrap());
    assert_problem(send(&app, "GET", &file, "").await, 404, "record_not_found").await;
}

#[tokio::test]
async fn what_is_no_mesh_is_refused() {
    let (app, _folder) = idle().await;
    for bytes in ["", "solid", "v 0 0", "glTF", "\0\0\0\0"] {
        let answer = send(&app, "POST", "/meshes", bytes).await;
        assert_problem(answer, 422, "mesh_unusable").await;
    }
    let cut = send_with(&app, "POST", "/meshes", "--cut\r\nContent", &[FORM]).await;
    assert_problem(cut, 400, "malformed_form").await;
    let no_file = "--cut\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\nb\r\n--cut--\r\n";
    let no_file = send_with(&app, "POST", "/meshes", no_file, &[FORM]).await;
    assert_problem(no_file, 400, "malformed_form").await;
    let fields = "--cut\r\nContent-Disposition: form-data; name=\"a\"\r\n\r\nb\r\n".repeat(100);
    let fields = send_with(&app, "POST", "/meshes", fields + "--cut--\r\n", &[FORM]).await;
    assert_problem(fields, 400, "malformed_form").await;
    let list = json_of(send(&app, "GET", "/meshes", "").await).await;
    assert_eq!(list["data"], json!([]));
}

#[tokio::test]
async fn what_is_packed_is_not_unpacked() {
    let (app, folder) = idle().await;
    // 10 MB of zeros as gzip: what a zip bomb is made of.
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
        let answer = send_with(&app, "POST", "/meshes", body, headers).await;
        assert_problem(answer, 422, "mesh_unusable").await;
    }
    // Nothing of what was sent is left.
    assert_eq!(std::fs::read_dir(folder.path().join("data/incoming")).unwrap().count(), 0);
}

#[tokio::test]
async fn a_page_begins_where_something_is() {
    let (app, _folder) = idle().await;
    for list in ["/meshes", "/datasets", "/models"] {
        let answer = send(&app, "GET", &format!("{list}?after=msh_0"), "").await;
        let problem = assert_problem(answer, 422, "invalid_parameter").await;
        assert_eq!(problem["errors"][0]["param"], "after");
    }
}

#[tokio::test]
async fn what_is_too_long_is_refused_before_it_is_read() {
    let (app, _folder) = idle().await;
    let length = [("content-length", "60000000")];
    let answer = send_with(&app, "POST", "/meshes", "v 0 0 0", &length).await;
    assert_problem(answer, 413, "body_too_large").await;
    // A body that does not say how long it is.
    let answer = send(&app, "POST", "/meshes", vec![b'v'; 50_000_001]).await;
    assert_problem(answer, 413, "body_too_large").await;
    let answer = send_with(&app, "POST", "/meshes", form(&"v".repeat(50_010_000)), &[FORM]).await;
    assert_problem(answer, 413, "body_too_large").await;
    let answer = send(&app, "POST", "/jobs", vec![b' '; 5 << 20]).await;
    assert_problem(answer, 413, "body_too_large").await;
}
