//! Programs on PATH, and packages of Debian.

use crate::workspace::{Workspace, output_of, run};
use anyhow::{Context, Result, bail};
use std::path::PathBuf;

/// Path of the first of these programs that is on PATH.
pub(crate) fn on_path(names: &[&str]) -> Option<PathBuf> {
    let path = std::env::var_os("PATH")?;
    let folders: Vec<PathBuf> = std::env::split_paths(&path).collect();
    let mut candidates = names.iter().flat_map(|name| folders.iter().map(move |f| f.join(name)));
    candidates.find(|path| path.is_file())
}

/// Installs Debian's packages, which requires root. Fails with `hint`.
pub(crate) fn install(workspace: &Workspace, packages: &[&str], hint: &'static str) -> Result<()> {
    if on_path(&["apt-get"]).is_none() || output_of(&mut workspace.command("id", &["-u"]))? != "0" {
        bail!(hint);
    }
    let install = ["install", "-y", "--no-install-recommends"];
    run(&mut workspace.command("apt-get", &["update", "-q"])).context(hint)?;
    let mut apt = workspace.command("apt-get", &install);
    run(apt.args(packages).env("DEBIAN_FRONTEND", "noninteractive")).context(hint)
}
