//! Host names, the token for read requests, and rate limits behind proxies.

use crate::{assert_problem, create_job, send, send_with, test_app, test_state};
use axum::Router;
use axum::body::Body;
use axum::extract::ConnectInfo;
use axum::http::{Request, StatusCode};
use axum::response::Response;
use server::{Quotas, app};
use std::net::SocketAddr;
use std::num::NonZeroU32;
use tempfile::TempDir;
use tower::ServiceExt;

const TOKEN: &str = "0123456789abcdef";
const BEARER: (&str, &str) = ("authorization", "Bearer 0123456789abcdef");

/// Sends a GET request to a path of the server.
async fn get(app: &Router, path: &str, headers: &[(&str, &str)]) -> Response {
    let request =
        headers.iter().fold(Request::get(path), |r, (name, value)| r.header(*name, *value));
    app.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
}

#[tokio::test]
async fn read_requests_for_foreign_hosts_are_rejected_without_a_token() {
    let (app, _folder) = test_app().await;
    let id = create_job(&app, "x").await;
    for path in ["/jobs".to_owned(), format!("/jobs/{id}/logs"), format!("/jobs/{id}/stream")] {
        for host in ["attacker.example", "attacker.example:8787", "127.0.0.1.attacker.example"] {
            let response = send_with(&app, "GET", &path, "", &[("host", host)]).await;
            assert_problem(response, 403, "host_not_allowed").await;
        }
    }
    let own = send_with(&app, "GET", "/jobs", "", &[("host", "LocalHost:8787")]).await;
    assert_eq!(own.status(), StatusCode::OK);
    for path in ["/metrics", "/openapi.json", "/"] {
        let response = get(&app, path, &[("host", "attacker.example")]).await;
        assert_problem(response, 403, "host_not_allowed").await;
    }
    assert_eq!(get(&app, "/healthz", &[("host", "pod-7")]).await.status(), StatusCode::OK);
}

#[tokio::test]
async fn host_names_are_enforced_with_a_token() {
    let folder = tempfile::tempdir().unwrap();
    let state = test_state(folder.path()).await.with_token(TOKEN);
    let app = app(state.with_host_names(vec!["lab.example".into()]));
    for (host, status) in [("lab.example", 200), ("10.0.0.1:80", 200), ("attacker.example", 403)] {
        let response = send_with(&app, "GET", "/jobs", "", &[("host", host)]).await;
        assert_eq!(response.status(), status, "{host}");
    }
}

#[tokio::test]
async fn scheme_of_the_token_has_no_case() {
    let folder = tempfile::tempdir().unwrap();
    let app = app(test_state(folder.path()).await.with_token(TOKEN));
    let headers = [("authorization", "bearer 0123456789abcdef")];
    let response = send_with(&app, "POST", "/jobs/x/cancel", "", &headers).await;
    assert_problem(response, 404, "job_not_found").await;
}

/// A server that requires the token for read requests, with a page.
async fn private_app() -> (Router, TempDir) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("web/assets")).unwrap();
    for name in ["index.html", "assets/page-a1b2.js"] {
        std::fs::write(folder.path().join("web").join(name), "content").unwrap();
    }
    let state = test_state(folder.path()).await.with_token(TOKEN).with_token_for_reads();
    (app(state), folder)
}

#[tokio::test]
async fn read_requests_need_the_token_when_the_operator_requires_it() {
    let (app, _folder) = private_app().await;
    for path in ["/api/v1", "/api/v1/jobs", "/api/v1/models", "/metrics"] {
        let response = get(&app, path, &[]).await;
        assert_eq!(response.headers()["www-authenticate"], "Bearer", "{path}");
        assert_problem(response, 401, "unauthorized").await;
        assert_eq!(get(&app, path, &[BEARER]).await.status(), StatusCode::OK, "{path}");
    }
    for path in ["/healthz", "/readyz", "/version", "/assets/page-a1b2.js"] {
        assert_eq!(get(&app, path, &[]).await.status(), StatusCode::OK, "{path}");
    }
    // The browser asks for the password of a page, and receives the cookie for its other requests.
    let page = get(&app, "/", &[]).await;
    assert_eq!(page.status(), StatusCode::UNAUTHORIZED);
    assert!(page.headers()["www-authenticate"].to_str().unwrap().starts_with("Basic "));
    // "ngf:0123456789abcdef" in base64.
    let basic = ("authorization", "Basic bmdmOjAxMjM0NTY3ODlhYmNkZWY=");
    let page = get(&app, "/", &[basic]).await;
    assert_eq!(page.status(), StatusCode::OK);
    let cookie = page.headers()["set-cookie"].to_str().unwrap().split(';').next().unwrap();
    let known = get(&app, "/api/v1/jobs", &[("cookie", cookie)]).await;
    assert_eq!(known.status(), StatusCode::OK);
    assert!(known.headers().get("set-cookie").is_none());
    // The cookie does not permit changes: other origins could use it.
    let response = send_with(&app, "POST", "/jobs", "{}", &[("cookie", cookie)]).await;
    assert_problem(response, 401, "unauthorized").await;
}

#[tokio::test]
async fn shared_caches_keep_nothing_that_needs_the_token() {
    let (app, _folder) = private_app().await;
    let mesh = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
    let mesh = crate::json_of(send_with(&app, "POST", "/meshes", mesh, &[BEARER]).await).await;
    let file = format!("/meshes/{}/file", mesh["id"].as_str().unwrap());
    let file = send_with(&app, "GET", &file, "", &[BEARER]).await;
    assert_eq!(file.headers()["cache-control"], "private, max-age=31536000, immutable");
    assert_problem(send(&app, "GET", "/meshes", "").await, 401, "unauthorized").await;
}

/// Cancels an unknown job, through a proxy at 10.0.0.1.
async fn cancel(app: &Router, client: &str, headers: &[(&str, &str)]) -> Response {
    let proxy = ConnectInfo(SocketAddr::from(([10, 0, 0, 1], 1)));
    let request = Request::post("/api/v1/jobs/job_1/cancel").extension(proxy);
    let request = headers.iter().fold(request, |r, (name, value)| r.header(*name, *value));
    let request = request.header("x-forwarded-for", client);
    app.clone().oneshot(request.body(Body::empty()).unwrap()).await.unwrap()
}

#[tokio::test]
async fn clients_without_the_token_do_not_use_up_the_rate_of_others() {
    let folder = tempfile::tempdir().unwrap();
    let max_writes_per_second = NonZeroU32::new(3).unwrap();
    let limits = Quotas { max_writes_per_second, ..Quotas::default() };
    let state = test_state(folder.path()).await.with_quotas(limits).with_token(TOKEN);
    let app = app(state);
    for expected in [401, 401, 401, 429, 429] {
        assert_eq!(cancel(&app, "198.51.100.1", &[]).await.status(), expected);
    }
    for expected in [404, 404, 404, 429] {
        assert_eq!(cancel(&app, "198.51.100.1", &[BEARER]).await.status(), expected);
    }
}

#[tokio::test]
async fn clients_of_a_trusted_proxy_have_their_own_rates() {
    let folder = tempfile::tempdir().unwrap();
    let max_writes_per_second = NonZeroU32::new(1).unwrap();
    let limits = Quotas { max_writes_per_second, ..Quotas::default() };
    let state = test_state(folder.path()).await.with_quotas(limits);
    let app = app(state.with_trusted_proxies(vec!["10.0.0.1".parse().unwrap()]));
    for (client, expected) in [("198.51.100.1", 404), ("198.51.100.1", 429), ("198.51.100.2", 404)]
    {
        assert_eq!(cancel(&app, client, &[]).await.status(), expected, "{client}");
    }
}
