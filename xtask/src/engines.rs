//! Firefox and WebKitGTK with their drivers, for attempts in other engines than Chromium.

use crate::debian::{self, on_path};
use crate::tools;
use crate::workspace::Workspace;
use anyhow::{Context, Result};
use std::process::Command;

const FIREFOX: [&str; 2] = ["firefox-esr", "firefox"];

/// Programs of the packages below that are not Firefox.
const PROGRAMS: [&str; 2] = ["WebKitWebDriver", "xvfb-run"];

/// The npm script that runs the attempts. WebKitGTK requires a display.
pub(crate) fn command(workspace: &Workspace) -> Result<Command> {
    let is_missing = |names: &[&str]| on_path(names).is_none();
    if is_missing(&FIREFOX) || PROGRAMS.iter().any(|name| is_missing(&[name])) {
        let packages = ["firefox-esr", "webkit2gtk-driver", "xvfb", "xauth"];
        let hint = "install the browsers: apt-get install firefox-esr webkit2gtk-driver xvfb xauth";
        debian::install(workspace, &packages, hint)?;
    }
    let firefox = on_path(&FIREFOX).context("Firefox is not on PATH")?;
    let geckodriver = tools::geckodriver(workspace)?;
    let script = tools::browser(workspace, "engines")?;
    let mut display = workspace.command("xvfb-run", &["--auto-servernum"]);
    display.arg(script.get_program()).args(script.get_args());
    display.envs(script.get_envs().filter_map(|(name, value)| Some((name, value?))));
    if let Some(folder) = script.get_current_dir() {
        display.current_dir(folder);
    }
    display.env("FIREFOX", firefox).env("GECKODRIVER", geckodriver);
    Ok(display)
}
