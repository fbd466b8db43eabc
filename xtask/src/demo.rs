//! `demo`: serves the page, then the server, then builds the worker executable.

use crate::build_cache::timed;
use crate::tools;
use crate::web_build;
use crate::workspace::{self, Workspace};
use anyhow::{Context, Result, anyhow, bail};
use std::process::{Child, Command};
use std::sync::mpsc;
use std::time::Duration;

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

/// Serves the page as soon as it is built, then the server, until the process is stopped. Jobs wait until their
/// executable is built: it takes longer than all else together.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    // Missing tools are reported before builds that take minutes.
    tools::node(workspace)?;
    tools::wasm_target(workspace)?;
    let (generator, is_generator_built) = mpsc::channel();
    let server = std::thread::scope(|scope| {
        // The page uses both cores when it needs them.
        let server = scope.spawn(|| {
            generator.send(run_in_background(workspace, web_build::GENERATOR)).ok();
            start_in_background(workspace, "ngf")
        });
        let wait =
            || is_generator_built.recv().context("the generator of the bindings is not built")?;
        web_build::build_with(workspace, wait)?;
        server.join().map_err(|_| anyhow!("the build of the server panicked"))?
    });
    let mut server = server?;
    let is_opened = preview_until_built(workspace, options, &mut server)?;
    // The executable of an earlier build may not fit this server.
    std::fs::remove_file(workspace.program("ngf-worker")).ok();
    start_in_background(workspace, "ngf-worker")?;
    let port = options.port.to_string();
    let data = workspace.target.join("demo");
    let mut serve = workspace.command(workspace.program("ngf"), &["serve", "--port", &port]);
    serve.arg("--wait-for-worker").arg("--data-dir").arg(data);
    if !options.no_open && !is_opened {
        serve.arg("--open");
    }
    become_program(&mut serve)
}

/// Starts the build of an executable at low priority.
fn start_in_background(workspace: &Workspace, name: &str) -> Result<Child> {
    let mut cargo = workspace.cargo(&["build", "--workspace", "--bin", name]);
    if cfg!(unix) {
        let mut nice = workspace.command("nice", &["-n", "19"]);
        nice.arg(cargo.get_program()).args(cargo.get_args());
        for (variable, _) in cargo.get_envs().filter(|(_, value)| value.is_none()) {
            nice.env_remove(variable);
        }
        cargo = nice;
    }
    cargo.spawn().with_context(|| format!("cannot run {}", workspace::display(&cargo)))
}

fn run_in_background(workspace: &Workspace, name: &str) -> Result<()> {
    wait_for(&mut start_in_background(workspace, name)?, name)
}

fn wait_for(build: &mut Child, name: &str) -> Result<()> {
    let status = build.wait()?;
    if !status.success() {
        bail!("the build of {name} failed ({status})");
    }
    Ok(())
}

/// Serves the static page while the server is built. Returns whether it has opened a browser.
fn preview_until_built(
    workspace: &Workspace,
    options: &Options,
    server: &mut Child,
) -> Result<bool> {
    std::thread::sleep(MIN_PREVIEW);
    if server.try_wait()?.is_some() {
        wait_for(server, "ngf")?;
        return Ok(false);
    }
    let port = options.port.to_string();
    let address = format!("http://127.0.0.1:{port}");
    // Not by npm, whose children outlive it when it is killed.
    let vite = workspace.web().join("node_modules/vite/bin/vite.js");
    let mut preview = workspace.command("node", &[]);
    preview.current_dir(workspace.web()).arg(vite);
    preview.args(["preview", "--strictPort", "--host", "127.0.0.1", "--port", &port]);
    preview.args(["--logLevel", "warn"]).env("NGF_PENDING_SERVER", "1");
    if !options.no_open {
        preview.arg("--open");
    }
    let mut preview = preview.spawn().context("cannot run vite")?;
    println!("{address} (the page; the Jobs page follows when the server is built)");
    let built = wait_for(server, "ngf");
    preview.kill().ok();
    preview.wait().ok();
    built?;
    Ok(!options.no_open)
}

/// Time that the build of the server may take without a preview of the page.
const MIN_PREVIEW: Duration = Duration::from_secs(3);

/// Builds the page and all executables in parallel: the longest step of the page is the single-threaded linker.
pub(crate) fn build(workspace: &Workspace) -> Result<()> {
    // Missing tools are reported before builds that take minutes.
    tools::node(workspace)?;
    tools::wasm_target(workspace)?;
    let mut cargo = workspace.cargo(&["build", "--workspace"]);
    cargo.args(["--bin", web_build::GENERATOR, "--bin", "ngf", "--bin", "ngf-worker"]);
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
