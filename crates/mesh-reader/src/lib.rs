//! Browser module that reads mesh files.
//!
//! In: the bytes of a file, and the user's options. Out: the repaired mesh as bytes for `sim`, the module of the
//! simulation. The page loads this module with the first upload, so that the first attempt waits for less code.

use mesh::{MeshError, MeshOptions, Unit, UpAxis};
use serde::{Deserialize, Serialize};
use wasm_bindgen::JsValue;
use wasm_bindgen::prelude::wasm_bindgen;

/// User's options; `None` selects the default. See [`MeshOptions`].
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct ReadOptions {
    unit: Option<Unit>,
    /// Length (m) of the longest side.
    size_m: Option<f32>,
    scale: Option<f32>,
    up: Option<UpAxis>,
}

/// Why a file was rejected, in the form of the page's failure events.
#[derive(Serialize)]
struct Failure {
    code: &'static str,
    message: String,
    hint: String,
}

/// Reads a mesh file: [`mesh::import`] with `options`, which is a `ReadOptions` of the page. The result is
/// [`mesh::ImportedMesh::to_bytes`].
///
/// # Errors
/// An object with `code`, `message` and `hint`.
#[wasm_bindgen(js_name = readMesh)]
pub fn read_mesh(file_name: &str, bytes: &[u8], options: JsValue) -> Result<Vec<u8>, JsValue> {
    let ReadOptions { unit, size_m, scale, up } = serde_wasm_bindgen::from_value(options)?;
    let options = MeshOptions { unit, size: size_m, scale, up };
    let imported = mesh::import(bytes, &options).map_err(|error| failure(file_name, &error));
    imported.map(|imported| imported.to_bytes())
}

fn failure(file_name: &str, error: &MeshError) -> JsValue {
    let (cause, hint) = error.cause_and_hint();
    let failure = Failure {
        code: error.code(),
        message: format!("{file_name}: {cause}."),
        hint: format!("{hint}."),
    };
    // A struct of texts cannot fail.
    serde_wasm_bindgen::to_value(&failure).unwrap_or(JsValue::NULL)
}

#[cfg(test)]
wasm_bindgen_test::wasm_bindgen_test_configure!(run_in_dedicated_worker);

#[cfg(all(test, target_arch = "wasm32"))]
mod tests {
    use super::*;
    use mesh::ImportedMesh;
    use wasm_bindgen_test::wasm_bindgen_test;

    /// Tetrahedron of 60 x 40 x 120 units as an OBJ file.
    const OBJ: &[u8] =
        b"v 0 0 0\nv 60 0 0\nv 0 40 0\nv 0 0 120\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";

    /// Options as the page sends them, next to other fields.
    fn options(text: &str) -> JsValue {
        js_sys::JSON::parse(text).unwrap()
    }

    #[wasm_bindgen_test]
    fn mesh_is_that_of_the_native_import_with_the_options() {
        let page = r#"{"kind":"upload","unit":null,"sizeM":0.24,"scale":null,"up":"y","massKg":1}"#;
        let bytes = read_mesh("wedge.obj", OBJ, options(page)).unwrap();
        let native =
            MeshOptions { size: Some(0.24), up: Some(UpAxis::Y), ..MeshOptions::default() };
        assert_eq!(ImportedMesh::from_bytes(&bytes).unwrap(), mesh::import(OBJ, &native).unwrap());
    }

    #[wasm_bindgen_test]
    fn error_names_the_file_the_cause_and_the_cure() {
        let none = r#"{"unit":null,"sizeM":null,"scale":null,"up":null}"#;
        let error = |bytes: &[u8]| {
            let thrown = read_mesh("a.obj", bytes, options(none)).unwrap_err();
            let field = |name| js_sys::Reflect::get(&thrown, &JsValue::from_str(name)).unwrap();
            ["code", "message", "hint"].map(|name| field(name).as_string().unwrap())
        };
        let [code, message, hint] = error(b"Dear reader,\nthis is a letter.\n");
        assert_eq!(code, "invalid_mesh");
        assert!(message.starts_with("a.obj: ") && message.contains("plain text"), "{message}");
        assert!(hint.len() > 10, "{hint}");
        let [code, message, hint] = error(b"");
        assert_eq!((code.as_str(), hint.as_str()), ("invalid_mesh", "Export it again."));
        assert!(message.starts_with("a.obj: the file is empty"), "{message}");
        let unit_size = String::from_utf8_lossy(OBJ).replace("120", "1");
        let unit_size = unit_size.replace("60", "0.5").replace("40", "0.3");
        assert_eq!(error(unit_size.as_bytes())[0], "size_required");
    }
}
