//! Static files of the built page, precompressed.

use super::http_content::{IMMUTABLE, REVALIDATE};
use crate::{AppState, Problem, ProblemCode};
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Redirect, Response};
use tower::ServiceExt;
use tower_http::services::ServeDir;

/// Serves one file. Names under `/assets/` contain a content hash, so these files are immutable. All others
/// are revalidated by ETag each time.
pub(crate) async fn file(State(state): State<AppState>, request: Request) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    if let Some(link) = restored_share_link(&path) {
        return Redirect::temporary(&link).into_response();
    }
    let files = ServeDir::new(&*state.web_dir).precompressed_br().precompressed_gzip();
    let mut response = match files.oneshot(request).await {
        Ok(response) => response.map(axum::body::Body::new),
        Err(never) => match never {},
    };
    match response.status() {
        StatusCode::NOT_FOUND if path == "/" => web_not_built().into_response(),
        StatusCode::NOT_FOUND => Problem::not_found(&path).into_response(),
        StatusCode::METHOD_NOT_ALLOWED => {
            let problem = Problem::method_not_allowed(method.as_str(), &path);
            ([(header::ALLOW, "GET,HEAD")], problem).into_response()
        }
        status if status.is_client_error() || status.is_server_error() => Problem {
            status,
            code: ProblemCode::FileNotServed,
            detail: format!("{path} cannot be served with these request headers"),
            hint: "request the complete file, without conditions and ranges".into(),
            param: None,
        }
        .into_response(),
        _ => {
            let is_hashed = path.starts_with("/assets/");
            let cache = if is_hashed { IMMUTABLE } else { REVALIDATE };
            response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(cache));
            response
        }
    }
}

/// Share link whose `#` was escaped on its way, so that the browser sent its fragment as part of the path.
fn restored_share_link(path: &str) -> Option<String> {
    let (page, fragment) = path.split_once("%23")?;
    // Other prefixes could name another host.
    let is_page = ["/", "/index.html"].contains(&page);
    let is_link = fragment.contains("v=") || fragment.contains("v%3D");
    (is_page && is_link).then(|| format!("{page}#{fragment}"))
}

fn web_not_built() -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: ProblemCode::WebNotBuilt,
        detail: "the web page has not been built".into(),
        hint: "run `cargo xtask demo`, or give the folder of the built page with --web-dir".into(),
        param: None,
    }
}
