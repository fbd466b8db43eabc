//! Chromium and its driver, for the tests in the browser.

use crate::place::{Place, read, run};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;
use std::process::Command;

/// Browser and driver, of one major version.
pub(crate) struct Chromium {
    pub(crate) browser: PathBuf,
    pub(crate) driver: PathBuf,
}

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "chrome"];
const DRIVERS: [&str; 1] = ["chromedriver"];

/// Finds both, installing Debian's where they are missing and we may.
pub(crate) fn find(place: &Place) -> Result<Chromium> {
    if on_path(&BROWSERS).is_none() || on_path(&DRIVERS).is_none() {
        install(place)?;
    }
    let browser = on_path(&BROWSERS).context("Chromium is not on PATH")?;
    let driver = on_path(&DRIVERS).context("chromedriver is not on PATH")?;
    let browser_version = read(Command::new(&browser).arg("--version"))?;
    let driver_version = read(Command::new(&driver).arg("--version"))?;
    match (major(&browser_version), major(&driver_version)) {
        (Some(ours), Some(theirs)) if ours == theirs => Ok(Chromium { browser, driver }),
        _ => bail!("browser and driver differ: \"{browser_version}\" and \"{driver_version}\""),
    }
}

fn install(place: &Place) -> Result<()> {
    const CURE: &str = "install Chromium and its driver: apt-get install chromium chromium-driver";
    if on_path(&["apt-get"]).is_none() || read(&mut place.command("id", &["-u"]))? != "0" {
        bail!(CURE);
    }
    let packages = ["install", "-y", "--no-install-recommends", "chromium", "chromium-driver"];
    run(&mut place.command("apt-get", &["update", "-q"])).context(CURE)?;
    run(place.command("apt-get", &packages).env("DEBIAN_FRONTEND", "noninteractive")).context(CURE)
}

fn on_path(names: &[&str]) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let mut places = names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    places.find(|place| place.is_file())
}

/// 156 of "Chromium 156.0.7100.0 built on Debian".
fn major(version: &str) -> Option<u32> {
    let number =
        version.split_whitespace().find(|w| w.starts_with(|c: char| c.is_ascii_digit()))?;
    number.split('.').next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_major_version_is_read_from_browser_and_driver() {
        assert_eq!(major("Chromium 156.0.7100.3 built on Debian GNU/Linux 12"), Some(156));
        assert_eq!(major("ChromeDriver 156.0.7100.3 (abc-refs/heads@{#1})"), Some(156));
        assert_eq!(major("chromium"), None);
    }
}
