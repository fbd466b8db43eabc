//! The OpenAPI description: the parts that all endpoints share, added to the descriptions of the endpoints.

use crate::ProblemCode;
use axum::Json;
use utoipa::openapi::path::{Operation, Parameter, ParameterIn};
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::{
    Components, ContentBuilder, InfoBuilder, LicenseBuilder, OpenApi, PathItem, Ref, RefOr,
    Response, ResponseBuilder, SecurityRequirement, ServerBuilder,
};
use utoipa::{PartialSchema, ToSchema};

/// Error response (RFC 9457).
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct ProblemDetails {
    /// Problem type: always `about:blank`.
    r#type: String,
    /// Phrase of the HTTP status.
    title: String,
    status: u16,
    /// Cause of the error.
    detail: String,
    /// Stable code of the error.
    code: ProblemCode,
    /// Suggested remedy.
    hint: String,
    /// Invalid parameters.
    errors: Option<Vec<ParameterError>>,
    /// Id of this request in the server log.
    request_id: Option<String>,
}

/// Error of one parameter.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct ParameterError {
    param: String,
    detail: String,
}

/// Completes the description of the endpoints: title, operation ids, security, error responses, shared schemas.
pub(super) fn complete(mut api: OpenApi) -> OpenApi {
    let license = LicenseBuilder::new().name(LICENSE).identifier(Some(LICENSE));
    api.info = InfoBuilder::new()
        .title("ngf-grasp")
        .version(env!("CARGO_PKG_VERSION"))
        .description(Some(
            "Dataset generation, training and evaluation of grasping policies as jobs.",
        ))
        .license(Some(license.build()))
        .build();
    let server = ServerBuilder::new().url("/").description(Some("The server of this description"));
    api.servers = Some(vec![server.build()]);
    let components = api.components.get_or_insert_with(Components::new);
    components.schemas.insert("Problem".into(), ProblemDetails::schema());
    components.schemas.insert("ProblemCode".into(), ProblemCode::schema());
    components.schemas.insert("ParameterError".into(), ParameterError::schema());
    let bearer = HttpBuilder::new().scheme(HttpAuthScheme::Bearer).build();
    components.add_security_scheme("token", SecurityScheme::Http(bearer));
    let paths = std::mem::take(&mut api.paths.paths).into_iter();
    api.paths.paths = paths
        .map(|(path, mut item)| {
            complete_item(&path, &mut item);
            // OpenAPI has no syntax for a parameter with slashes; clients send them as %2F.
            (path.replace("{*", "{"), item)
        })
        .collect();
    api
}

/// SPDX expression.
const LICENSE: &str = "MIT OR Apache-2.0";

fn complete_item(path: &str, item: &mut PathItem) {
    let has_parameter = path.contains('{');
    for operation in [&mut item.get, &mut item.head].into_iter().flatten() {
        complete_operation(operation, has_parameter);
        // Reading requires no token.
        operation.security = Some(Vec::new());
    }
    for operation in
        [&mut item.post, &mut item.patch, &mut item.delete, &mut item.put].into_iter().flatten()
    {
        complete_operation(operation, has_parameter);
        add_problem(operation, "401", "The token is missing or invalid");
        // The token is optional, because not every server requires one.
        let none = SecurityRequirement::default();
        let token = SecurityRequirement::new::<_, [&str; 0], _>("token", []);
        operation.security = Some(vec![none, token]);
    }
}

/// Adds the error responses, and the tag to the operation id: names of handlers are unique in their module only.
fn complete_operation(operation: &mut Operation, has_path_parameter: bool) {
    let tag = operation.tags.iter().flatten().next().cloned().unwrap_or_default();
    let name = operation.operation_id.take().unwrap_or_default();
    operation.operation_id = Some(format!("{tag}_{name}"));
    if has_path_parameter {
        add_problem(operation, "404", "Not found: the hint names the list of valid ids");
    }
    let is_input = |parameter: &RefOr<Parameter>| matches!(parameter, RefOr::T(of) if of.parameter_in != ParameterIn::Path);
    if operation.request_body.is_some() || operation.parameters.iter().flatten().any(is_input) {
        add_problem(operation, "422", "A parameter or the body is invalid");
    }
    add_problem(operation, "default", "Error: cause and suggested remedy");
}

fn add_problem(operation: &mut Operation, status: &str, description: &str) {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name("Problem"))).build();
    let response: Response = ResponseBuilder::new()
        .description(description)
        .content("application/problem+json", content)
        .build();
    operation.responses.responses.insert(status.into(), RefOr::T(response));
}

/// OpenAPI description.
#[utoipa::path(
    get, path = "/openapi.json", tag = "system",
    responses((status = 200, description = "This description", body = Object)),
)]
pub(super) async fn openapi() -> Json<OpenApi> {
    Json(crate::openapi())
}
