//! Chromium and chromedriver for browser tests.

use crate::debian::{self, on_path};
use crate::workspace::{Workspace, output_of};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;
use std::process::Command;

/// Paths of browser and driver, with equal major versions.
pub(crate) struct Chromium {
    pub(crate) browser: PathBuf,
    pub(crate) driver: PathBuf,
}

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];
const DRIVERS: [&str; 1] = ["chromedriver"];

/// Finds browser and driver on PATH. If one is missing, installs Debian's packages, which requires root.
pub(crate) fn find(workspace: &Workspace) -> Result<Chromium> {
    if on_path(&BROWSERS).is_none() || on_path(&DRIVERS).is_none() {
        install(workspace)?;
    }
    let browser = on_path(&BROWSERS).context("Chromium is not on PATH")?;
    let driver = on_path(&DRIVERS).context("chromedriver is not on PATH")?;
    let browser_version = output_of(Command::new(&browser).arg("--version"))?;
    let driver_version = output_of(Command::new(&driver).arg("--version"))?;
    match (major(&browser_version), major(&driver_version)) {
        (Some(ours), Some(theirs)) if ours == theirs => Ok(Chromium { browser, driver }),
        _ => bail!(
            "versions of browser and driver differ: \"{browser_version}\" and \"{driver_version}\"; \
             install matching versions"
        ),
    }
}

fn install(workspace: &Workspace) -> Result<()> {
    let hint = "install Chromium and its driver: apt-get install chromium chromium-driver";
    debian::install(workspace, &["chromium", "chromium-driver"], hint)
}

/// Major version: 156 for "Chromium 156.0.7100.0 built on Debian".
fn major(version: &str) -> Option<u32> {
    let number =
        version.split_whitespace().find(|w| w.starts_with(|c: char| c.is_ascii_digit()))?;
    number.split('.').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn major_version_is_parsed_from_browser_and_driver() {
        assert_eq!(major("Chromium 156.0.7100.3 built on Debian GNU/Linux 12"), Some(156));
        assert_eq!(major("ChromeDriver 156.0.7100.3 (abc-refs/heads@{#1})"), Some(156));
        assert_eq!(major("chromium"), None);
    }
}
