//! Crates that run in the browser call no system mathematics and no native-only modules.

use crate::dependencies::ALLOWED_DEPENDENCIES;
use crate::{files, root};
use std::fs::read_to_string;
use std::path::PathBuf;

/// Source folders of the crates that run in the browser.
fn browser_sources() -> impl Iterator<Item = PathBuf> {
    let (_, dependencies) = ALLOWED_DEPENDENCIES.iter().find(|(name, _)| *name == "wasm").unwrap();
    let crates = dependencies.iter().map(|name| root().join("crates").join(name).join("src"));
    crates.chain([root().join("wasm/src")])
}

/// Mathematical functions of the system, whose results differ between platforms; `libm` replaces them.
const SYSTEM_MATH: [&str; 20] = [
    "sin()",
    "cos()",
    "tan()",
    "sin_cos()",
    "asin()",
    "acos()",
    "atan()",
    "atan2(",
    "sinh()",
    "cosh()",
    "tanh()",
    "exp()",
    "exp2()",
    "ln()",
    "log2()",
    "log10()",
    "cbrt()",
    "powf(",
    "hypot(",
    "mul_add(",
];

/// Standard modules that are unavailable in a browser worker, or behave differently there.
const NATIVE_ONLY: [&str; 4] = ["std::fs", "std::thread", "std::time", "std::env::"];

#[test]
fn browser_crates_use_no_system_math_or_native_modules() {
    let mut num_files = 0;
    for file in browser_sources().flat_map(|folder| files(&folder, "rs")) {
        let text = read_to_string(&file).unwrap();
        // Unit tests and examples in doc comments are exempt.
        let code = text.split("cfg(test)").next().unwrap_or_default();
        let is_doc = |line: &&str| line.trim_start().starts_with("//");
        let shipped: Vec<&str> = code.lines().filter(|line| !is_doc(line)).collect();
        let shipped = shipped.join("\n");
        num_files += 1;
        for name in SYSTEM_MATH {
            assert!(!shipped.contains(&format!(".{name}")), "{file:?} calls .{name}");
        }
        for name in NATIVE_ONLY {
            assert!(!shipped.contains(name), "{file:?} uses {name}");
        }
    }
    assert!(num_files > 100, "{num_files} files");
}
