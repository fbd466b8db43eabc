//! Validates JSON responses to GET and POST against the OpenAPI description.

use crate::server::Server;
use crate::stress;
use jsonschema::Validator;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

/// Schema of the successful JSON response of an endpoint.
struct EndpointSchema {
    method: &'static str,
    /// Path template, such as `/jobs/{id}`.
    path: String,
    schema: Validator,
}

/// Schemas of all endpoints, with the fewest path parameters first.
static SCHEMAS: LazyLock<Vec<EndpointSchema>> = LazyLock::new(|| {
    let api = serde_json::to_value(server::openapi()).unwrap();
    let mut all = Vec::new();
    for (path, item) in api["paths"].as_object().unwrap() {
        for method in ["get", "post"] {
            let responses = item[method]["responses"].as_object().into_iter().flatten();
            let successes = responses.filter(|(status, _)| status.starts_with('2'));
            let schema = |(_, response): (_, &Value)| {
                response.pointer("/content/application~1json/schema").cloned()
            };
            // All success responses of one endpoint have the same schema.
            if let Some(schema) = successes.filter_map(schema).next() {
                let options = jsonschema::options().should_validate_formats(true);
                let schema = options.build(&closed(&schema, &api)).unwrap();
                all.push(EndpointSchema { method, path: path.clone(), schema });
            }
        }
    }
    all.sort_by_key(|one| one.path.matches('{').count());
    all
});

/// Resolves references, and forbids additional properties in objects.
fn closed(schema: &Value, api: &Value) -> Value {
    match schema {
        Value::Array(all) => all.iter().map(|one| closed(one, api)).collect(),
        Value::Object(object) => closed_object(object, api),
        plain => plain.clone(),
    }
}

fn closed_object(schema: &Map<String, Value>, api: &Value) -> Value {
    if let Some(Value::String(reference)) = schema.get("$ref") {
        return closed(api.pointer(reference.trim_start_matches('#')).unwrap(), api);
    }
    let each = |(name, part): (&String, &Value)| (name.clone(), closed(part, api));
    let mut schema: Map<String, Value> = schema.iter().map(each).collect();
    if let Some(Value::Array(all)) = schema.remove("allOf") {
        let (mut properties, mut required) = (Map::new(), Vec::new());
        for one in all {
            properties.extend(one["properties"].as_object().unwrap().clone());
            required.extend(one["required"].as_array().cloned().unwrap_or_default());
        }
        return json!({
            "type": "object", "properties": properties, "required": required,
            "additionalProperties": false,
        });
    }
    if schema.get("properties").is_some_and(Value::is_object) {
        schema.entry("additionalProperties").or_insert(false.into());
    }
    schema.into()
}

/// Checks a response.
pub(crate) fn assert_matches_schema(method: &str, path: &str, response: &Value) {
    let requested = path.split('?').next().unwrap();
    let matches_path = |described: &&EndpointSchema| {
        let [template, segments] = [described.path.as_str(), requested].map(|path| path.split('/'));
        described.method == method
            && template.clone().count() == segments.clone().count()
            && template.zip(segments).all(|(name, part)| name.starts_with('{') || name == part)
    };
    let described = SCHEMAS.iter().find(matches_path).unwrap_or_else(|| panic!("{method} {path}"));
    let errors: Vec<String> = described
        .schema
        .iter_errors(response)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(errors.is_empty(), "{method} {path}: {errors:#?}");
}

/// Requests every JSON endpoint for each job, dataset, model and mesh.
pub(crate) fn assert_all_endpoints_match_schema(server: &Server) {
    // Adds checkpoints, and an evaluation of a mesh with an unstable orientation.
    let mesh = server.upload(&stress::tetrahedron(-0.1));
    let models = server.get("/models")["data"].take();
    let of_kind = |kind: &str| {
        let mut models = models.as_array().unwrap().iter();
        models.find(|model| model["kind"] == kind).unwrap()["id"].clone()
    };
    let trained = server.create_job(
        "policy.train",
        json!({
            "dataset_id": server.get("/datasets")["data"][0]["id"], "encoder_id": of_kind("encoder"),
            "preset": "smoke", "steps": 4, "batch": 4, "checkpoint_every": 2,
        }),
    );
    let evaluated = server.create_job(
        "policy.evaluate",
        json!({ "model_id": of_kind("policy"), "mesh_id": mesh, "mass_kg": 0.1, "attempts": 1 }),
    );
    for id in [&trained, &evaluated] {
        server.wait_for(id, "succeeded");
    }
    server.post("/jobs?dry_run=true", &json!({ "kind": "dataset.generate" }));
    // Model files are skipped, because an encoder has no configuration file.
    let is_tested = |endpoint: &&EndpointSchema| {
        endpoint.method == "get" && !endpoint.path.ends_with("/{file}")
    };
    for EndpointSchema { path, .. } in SCHEMAS.iter().filter(is_tested) {
        let Some((list, of_each)) = path.split_once("/{id}") else {
            server.get_path(path);
            continue;
        };
        let all = server.get_path(list)["data"].take();
        let ids = all.as_array().unwrap().iter().filter_map(|one| one["id"].as_str());
        let of_id = |id| format!("{list}/{id}{}", of_each.replace("{index}", "0"));
        let responses: Vec<Value> = ids.map(|id| server.get_path(&of_id(id))).collect();
        // Each list endpoint returns items for at least one resource.
        let is_empty = |response: &Value| response["data"].as_array().is_some_and(Vec::is_empty);
        assert!(!responses.iter().all(is_empty), "{path}");
    }
    let model = server.get(&format!("/models/{}", of_kind("policy").as_str().unwrap()));
    assert!(model.to_string().contains("\"orientation\":{\"stablePose\":"), "{model}");
    assert_eq!(server.delete(&format!("/meshes/{}", mesh.as_str().unwrap())), 204);
}
