//! The built page: files of one folder, compressed beforehand.

use super::content::{CHECKED, KEPT};
use crate::{AppState, Code, Problem};
use axum::extract::{Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tower::ServiceExt;
use tower_http::services::ServeDir;

/// One file. Those under `/assets/` carry a hash of their content in the name and never change;
/// all others are checked by ETag each time.
pub(crate) async fn file(State(state): State<AppState>, request: Request) -> Response {
    let (method, path) = (request.method().clone(), request.uri().path().to_owned());
    let files = ServeDir::new(&*state.web).precompressed_br().precompressed_gzip();
    let mut response = match files.oneshot(request).await {
        Ok(response) => response.map(axum::body::Body::new),
        Err(never) => match never {},
    };
    match response.status() {
        StatusCode::NOT_FOUND if path == "/" => not_built().into_response(),
        StatusCode::NOT_FOUND => Problem::not_found(&path).into_response(),
        StatusCode::METHOD_NOT_ALLOWED => {
            let problem = Problem::method_not_allowed(method.as_str(), &path);
            ([(header::ALLOW, "GET,HEAD")], problem).into_response()
        }
        status if status.is_client_error() || status.is_server_error() => Problem {
            status,
            code: Code::FileRefused,
            detail: format!("{path} could not be served as asked"),
            hint: "ask for the whole file, without conditions".into(),
            param: None,
        }
        .into_response(),
        _ => {
            let is_hashed = path.starts_with("/assets/");
            let cache = if is_hashed { KEPT } else { CHECKED };
            response.headers_mut().insert(header::CACHE_CONTROL, HeaderValue::from_static(cache));
            response
        }
    }
}

fn not_built() -> Problem {
    Problem {
        status: StatusCode::NOT_FOUND,
        code: Code::PageNotBuilt,
        detail: "the page has not been built yet".into(),
        hint: "`cargo xtask demo` builds and serves it; or give its folder with --web".into(),
        param: None,
    }
}
