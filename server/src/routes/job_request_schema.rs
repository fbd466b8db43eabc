//! OpenAPI schema of a creation request: one complete object schema per job kind.
//!
//! Clients are generated from it. They support `oneOf` with a discriminator, but not `allOf` around `oneOf`.

use crate::jobs::kinds::{JobTask, Kind, REQUEST_NAMES};
use serde_json::{Map, Value};
use std::borrow::Cow;
use utoipa::openapi::schema::{AdditionalProperties, Discriminator, Object, OneOfBuilder, Schema};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};

/// Creation request of a job of any kind; a name for its schema, without values.
pub(super) enum JobRequest {}

/// Members that the requests of all kinds share.
#[derive(ToSchema)]
#[expect(dead_code, reason = "OpenAPI schema")]
struct JobOptions {
    /// Display name.
    #[schema(max_length = 200)]
    name: Option<String>,
    /// Up to 16 text entries.
    #[schema(value_type = Option<std::collections::HashMap<String, String>>)]
    metadata: Option<Map<String, Value>>,
    /// Jobs with a higher priority start first.
    priority: Option<i64>,
}

impl PartialSchema for JobRequest {
    fn schema() -> RefOr<Schema> {
        let targets = REQUEST_NAMES.iter().map(|name| Ref::from_schema_name(*name));
        let kinds = Kind::ALL.iter().map(|kind| kind.name());
        let mapping = kinds.zip(targets.clone().map(|target| target.ref_location));
        let any = targets.fold(OneOfBuilder::new(), OneOfBuilder::item);
        any.discriminator(Some(Discriminator::with_mapping("kind", mapping)))
            .description(Some("Request that creates a job; `kind` selects the parameters."))
            .into()
    }
}

impl ToSchema for JobRequest {
    fn name() -> Cow<'static, str> {
        "JobRequest".into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        JobTask::schemas(schemas);
        let RefOr::T(Schema::OneOf(tasks)) = JobTask::schema() else { return };
        let RefOr::T(Schema::Object(options)) = JobOptions::schema() else { return };
        for (name, task) in REQUEST_NAMES.iter().zip(tasks.items) {
            if let RefOr::T(Schema::Object(task)) = task {
                schemas.push(((*name).to_owned(), Schema::Object(request(task, &options)).into()));
            }
        }
    }
}

/// Adds the shared members to the schema of kind and parameters.
fn request(mut task: Object, options: &Object) -> Object {
    task.properties.extend(options.properties.clone());
    // As in `CreateJobRequest`, which rejects unknown members.
    task.additional_properties = Some(Box::new(AdditionalProperties::FreeForm(false)));
    task
}
