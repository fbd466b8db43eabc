//! `demo`: build, then hand over to the `ngf` program.

use crate::page;
use crate::place::{self, Place};
use crate::stamp::timed;
use crate::tools;
use anyhow::{Context, Result, bail};
use std::process::Command;

/// How the page is served.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Port on 127.0.0.1.
    #[arg(long, default_value_t = 8787)]
    port: u16,
    /// Do not open a browser.
    #[arg(long)]
    no_open: bool,
}

/// Builds what is not built, then serves until stopped.
pub(crate) fn run(place: &Place, options: &Options) -> Result<()> {
    build(place)?;
    let port = options.port.to_string();
    let data = place.target.join("demo");
    let mut serve = place.command(place.program("ngf"), &["serve", "--port", &port]);
    serve.arg("--data").arg(data);
    if !options.no_open {
        serve.arg("--open");
    }
    become_program(&mut serve)
}

/// Page and server side by side: the page's longest step is one thread of the linker.
pub(crate) fn build(place: &Place) -> Result<()> {
    // What is missing is told before anything that takes minutes.
    tools::node(place)?;
    tools::wasm_target(place)?;
    let mut cargo = place.cargo(&["build", "-p", "ngf"]);
    let mut server = cargo.spawn().context("cannot run cargo")?;
    let page = page::build(place);
    let status = timed("server", || Ok(server.wait()?))?;
    page?;
    if !status.success() {
        bail!("`{}` failed ({status})", place::name(&cargo));
    }
    Ok(())
}

/// Replaces this process, so that signals reach the program itself.
#[cfg(unix)]
fn become_program(command: &mut Command) -> Result<()> {
    use std::os::unix::process::CommandExt;
    let error = command.exec();
    Err(error).with_context(|| format!("cannot run {}", place::name(command)))
}

#[cfg(not(unix))]
fn become_program(command: &mut Command) -> Result<()> {
    place::run(command)
}
