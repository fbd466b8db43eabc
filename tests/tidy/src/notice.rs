//! Attribution of bundled packages.

use crate::root;
use std::fs::read_to_string;

/// The licences of bundled packages require attribution.
#[test]
fn notice_names_all_page_dependencies() {
    let package = read_to_string(root().join("web/package.json")).unwrap();
    let package: serde_json::Value = serde_json::from_str(&package).unwrap();
    let notice = read_to_string(root().join("NOTICE")).unwrap().to_lowercase();
    let names: Vec<&String> = package["dependencies"].as_object().unwrap().keys().collect();
    assert!(!names.is_empty());
    for name in names {
        let name = name.trim_start_matches("@fontsource-variable/");
        assert!(notice.contains(name), "NOTICE does not name {name}");
    }
}
