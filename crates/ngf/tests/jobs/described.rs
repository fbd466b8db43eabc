//! Whether answers in JSON to GET and POST are what `GET /openapi.json` says of them.

use crate::proofs;
use crate::server::Server;
use jsonschema::Validator;
use serde_json::{Map, Value, json};
use std::sync::LazyLock;

/// The description of what a request is answered with, if that is JSON and nothing went wrong.
struct Described {
    method: &'static str,
    /// As `/jobs/{id}`.
    path: String,
    schema: Validator,
}

/// Those of all requests, first those whose path leaves the least open.
static DESCRIBED: LazyLock<Vec<Described>> = LazyLock::new(|| {
    let api = serde_json::to_value(server::openapi()).unwrap();
    let mut all = Vec::new();
    for (path, item) in api["paths"].as_object().unwrap() {
        for method in ["get", "post"] {
            let answers = item[method]["responses"].as_object().into_iter().flatten();
            let good = answers.filter(|(status, _)| status.starts_with('2'));
            let schema = |(_, answer): (_, &Value)| {
                answer.pointer("/content/application~1json/schema").cloned()
            };
            // Several of one request are the same.
            if let Some(schema) = good.filter_map(schema).next() {
                let options = jsonschema::options().should_validate_formats(true);
                let schema = options.build(&closed(&schema, &api)).unwrap();
                all.push(Described { method, path: path.clone(), schema });
            }
        }
    }
    all.sort_by_key(|one| one.path.matches('{').count());
    all
});

/// The schema without references, in which nothing is left out: an object has no other properties than those it names.
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

/// Checks what a request was answered with.
pub(crate) fn assert_is_described(method: &str, path: &str, answer: &Value) {
    let asked = path.split('?').next().unwrap();
    let is_at = |described: &&Described| {
        let [named, asked] = [described.path.as_str(), asked].map(|path| path.split('/'));
        described.method == method
            && named.clone().count() == asked.clone().count()
            && named.zip(asked).all(|(name, part)| name.starts_with('{') || name == part)
    };
    let described = DESCRIBED.iter().find(is_at).unwrap_or_else(|| panic!("{method} {path}"));
    let wrong: Vec<String> = described
        .schema
        .iter_errors(answer)
        .map(|error| format!("{}: {error}", error.instance_path()))
        .collect();
    assert!(wrong.is_empty(), "{method} {path}: {wrong:#?}");
}

/// Asks for everything that is answered in JSON, of each job, dataset, model and mesh.
pub(crate) fn assert_all_is_described(server: &Server) {
    // Beside what there is: checkpoints, and an evaluation of a mesh that falls over as it stands.
    let mesh = server.upload(&proofs::tetrahedron(-0.1));
    let models = server.get("/models")["data"].take();
    let of_kind = |kind: &str| {
        let mut models = models.as_array().unwrap().iter();
        models.find(|model| model["kind"] == kind).unwrap()["id"].clone()
    };
    let trained = server.ask(
        "policy.train",
        json!({
            "dataset_id": server.get("/datasets")["data"][0]["id"], "encoder_id": of_kind("encoder"),
            "preset": "smoke", "steps": 4, "batch": 4, "checkpoint": 2,
        }),
    );
    let evaluated = server.ask(
        "policy.evaluate",
        json!({ "model_id": of_kind("policy"), "mesh_id": mesh, "mass_kg": 0.1, "attempts": 1 }),
    );
    for id in [&trained, &evaluated] {
        server.wait_for(id, "succeeded");
    }
    server.post("/jobs?dry_run=true", &json!({ "kind": "dataset.generate" }));
    // An encoder has no file of its configuration.
    let is_asked = |one: &&Described| one.method == "get" && !one.path.ends_with("/{file}");
    for Described { path, .. } in DESCRIBED.iter().filter(is_asked) {
        let Some((list, of_each)) = path.split_once("/{id}") else {
            server.get_whole(path);
            continue;
        };
        let all = server.get_whole(list)["data"].take();
        let ids = all.as_array().unwrap().iter().filter_map(|one| one["id"].as_str());
        let of_id = |id| format!("{list}/{id}{}", of_each.replace("{index}", "0"));
        let answers: Vec<Value> = ids.map(|id| server.get_whole(&of_id(id))).collect();
        // What is a list is not empty everywhere.
        let is_empty = |answer: &Value| answer["data"].as_array().is_some_and(Vec::is_empty);
        assert!(!answers.iter().all(is_empty), "{path}");
    }
    let told = server.get(&format!("/models/{}", of_kind("policy").as_str().unwrap()));
    assert!(told.to_string().contains("\"stands\":{\"on\":"), "{told}");
    assert_eq!(server.delete(&format!("/meshes/{}", mesh.as_str().unwrap())), 204);
}
