//! `demo`: builds page and server, executes `ngf serve`, and builds the worker executable meanwhile.

use crate::build_cache::timed;
use crate::tools;
use crate::web_build;
use crate::workspace::{self, Workspace};
use anyhow::{Context, Result, bail};
use std::process::Command;

/// Options of `cargo xtask demo`.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// TCP port on 127.0.0.1.
    #[arg(long, default_value_t = 8787)]
    port: u16,
    /// Do not open a browser.
    #[arg(long)]
    no_open: bool,
}

/// Builds page and server, then serves until the process is stopped. Jobs wait until their executable is built: it
/// takes longer than all else together.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    build_binaries(workspace, &[web_build::GENERATOR, "ngf"])?;
    // The executable of an earlier build may not fit this server.
    std::fs::remove_file(workspace.program("ngf-worker")).ok();
    let mut worker = workspace.cargo(&["build", "--workspace", "--bin", "ngf-worker"]);
    worker.spawn().context("cannot run cargo")?;
    let port = options.port.to_string();
    let data = workspace.target.join("demo");
    let mut serve = workspace.command(workspace.program("ngf"), &["serve", "--port", &port]);
    serve.arg("--wait-for-worker").arg("--data-dir").arg(data);
    if !options.no_open {
        serve.arg("--open");
    }
    become_program(&mut serve)
}

/// Builds the page and all executables.
pub(crate) fn build(workspace: &Workspace) -> Result<()> {
    build_binaries(workspace, &[web_build::GENERATOR, "ngf", "ngf-worker"])
}

/// Builds the page and executables in parallel: the longest step of the page is the single-threaded linker.
fn build_binaries(workspace: &Workspace, names: &[&str]) -> Result<()> {
    // Missing tools are reported before builds that take minutes.
    tools::node(workspace)?;
    tools::wasm_target(workspace)?;
    let mut cargo = workspace.cargo(&["build", "--workspace"]);
    cargo.args(names.iter().flat_map(|name| ["--bin", name]));
    let mut server = cargo.spawn().context("cannot run cargo")?;
    let page = web_build::build(workspace);
    let status = timed("server", || Ok(server.wait()?))?;
    page?;
    if !status.success() {
        bail!("`{}` failed ({status})", workspace::display(&cargo));
    }
    Ok(())
}

/// Replaces this process, so that signals reach the program directly.
#[cfg(unix)]
fn become_program(command: &mut Command) -> Result<()> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(error).with_context(|| format!("cannot run {}", workspace::display(command)))
}

#[cfg(not(unix))]
fn become_program(command: &mut Command) -> Result<()> {
    workspace::run(command)
}
