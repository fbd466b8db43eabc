//! The command line of ngf-grasp.

mod bar;
mod bench;
mod card;
mod dataset;
mod engine;
mod environment;
mod evaluate;
mod examine;
mod grasps;
mod journal;
mod link;
mod mesh;
mod objects;
mod replay;
mod report;
mod serve;
mod suite;
mod train;

use clap::{Parser, Subcommand};

/// Grasping with Neural Geometric Fabrics.
#[derive(Parser)]
#[command(name = "ngf", version)]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Serve the page and the models.
    Serve(serve::Options),
    /// List the built-in objects, or draw them on a contact sheet.
    Objects(objects::SheetOptions),
    /// Say what a mesh file is, and split it into convex parts.
    Mesh(mesh::Options),
    /// Search grasps of an object in physics.
    Grasps(grasps::Options),
    /// Make demonstrations and clouds, or look into a dataset.
    Dataset(dataset::Options),
    /// Train an encoder, a policy or a start network.
    #[command(subcommand)]
    Train(train::Options),
    /// Run attempts by the protocol and count them.
    Evaluate(evaluate::Options),
    /// Roll a policy out on the poses of a dataset: how far off it ends, object by object.
    Examine(examine::Options),
    /// Compare the paper's policies on the same attempts, with controls, as table and figure.
    Suite(suite::Options),
    /// Measure what runs in an attempt.
    Bench(bench::Options),
    /// Replay a recorded episode and print its verdict and final state hash.
    Replay(replay::Options),
}

fn main() -> std::process::ExitCode {
    let command = Cli::parse().command;
    // Whoever reads no further, as `head`, ends a program that prints; a server outlives its readers, and a job the server.
    if !matches!(command, Command::Serve(_)) && !report::is_asked() {
        sigpipe::reset();
    }
    // A report tells of one process from its beginning.
    let ready = if trains(&command) { environment::begin_anew() } else { Ok(()) };
    let result = ready.and_then(|()| report::begin()).and_then(|()| caught(|| run(&command)));
    report::end(&result);
    match result {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            std::process::ExitCode::from(2)
        }
    }
}

/// Makes an error of a panic: a server that waits for its job would take the process for lost and begin it again, which
/// would panic again.
fn caught(work: impl FnOnce() -> anyhow::Result<()>) -> anyhow::Result<()> {
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    done.unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        Err(anyhow::anyhow!("a bug in this program: {}", text.unwrap_or("it says nothing")))
    })
}

/// Whether it needs the environment of training.
fn trains(command: &Command) -> bool {
    matches!(command, Command::Train(_) | Command::Bench(bench::Options { learning: true, .. }))
}

fn run(command: &Command) -> anyhow::Result<()> {
    match command {
        Command::Serve(options) => serve::run(options),
        Command::Objects(options) => objects::run(options),
        Command::Mesh(options) => mesh::run(options),
        Command::Grasps(options) => grasps::run(options),
        Command::Dataset(options) => dataset::run(options),
        Command::Train(options) => train::run(options),
        Command::Evaluate(options) => evaluate::run(options),
        Command::Examine(options) => examine::run(options),
        Command::Suite(options) => suite::run(options),
        Command::Bench(options) => bench::run(options),
        Command::Replay(options) => replay::run(options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_an_error_that_says_what_panicked() {
        let error = caught(|| panic!("row {}", 7)).unwrap_err();
        assert_eq!(error.to_string(), "a bug in this program: row 7");
        assert!(caught(|| panic!("no more")).unwrap_err().to_string().ends_with("no more"));
        assert!(caught(|| Ok(())).is_ok());
    }
}
