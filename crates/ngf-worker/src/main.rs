//! `ngf-worker`: all commands of `ngf` except `serve`. Runs jobs, and the commands that `ngf` passes on.

mod adapt;
mod bench;
mod compare;
mod datagen_bench;
mod dataset;
mod evaluate;
mod grasps;
mod job_client;
mod mesh;
mod mesh_archive;
mod mesh_file;
mod model_card;
mod object_selection;
mod physics;
mod physics_bench;
mod planner_grasps;
mod progress_bar;
mod record;
mod replay;
mod result_cache;
mod share_link;
mod stage_progress;
mod train;
mod training_env;
mod validate;

use clap::{Parser, Subcommand};
use std::ffi::{OsStr, OsString};

/// Grasping with Neural Geometric Fabrics
#[derive(Parser)]
#[command(name = "ngf", version)]
struct Cli {
    #[command(subcommand)]
    command: CliCommand,
}

#[derive(Subcommand)]
enum CliCommand {
    /// Serve the page, the models and the job API
    #[command(disable_help_flag = true)]
    Serve {
        /// Options of the executable `ngf`
        #[arg(hide = true, trailing_var_arg = true, allow_hyphen_values = true)]
        args: Vec<OsString>,
    },
    /// List the built-in objects, or draw them on a contact sheet
    Objects(object_selection::ListOptions),
    /// Inspect mesh files
    #[command(subcommand)]
    Mesh(mesh::MeshCommand),
    /// Search for grasps of an object in simulation
    Grasps(grasps::Options),
    /// Generate and inspect datasets of demonstrations and point clouds
    #[command(subcommand)]
    Dataset(dataset::DatasetCommand),
    /// Train an encoder, a policy or a start network
    #[command(subcommand)]
    Train(train::Options),
    /// Run grasp attempts and report success rates
    Evaluate(evaluate::Options),
    /// Roll out a policy on the poses of a dataset and print fingertip errors by object
    Validate(validate::Options),
    /// Compare policies and controls on the same attempts, as a table and a chart
    Compare(compare::Options),
    /// Benchmark the components of an attempt
    Bench(bench::Options),
    /// Compare settings of the physics with a fine reference
    Physics(physics::Options),
    /// Replay a recording or a share link; print the outcome and the final state hash
    Replay(replay::Options),
    /// Record an attempt of the planner and check that its recording replays
    Record(record::Options),
}

fn main() -> std::process::ExitCode {
    let command = Cli::parse().command;
    // A closed pipe, as with `head`, ends a command that prints. A job outlives the server.
    if !job_client::is_job() {
        sigpipe::reset();
    }
    // Re-execution must precede the first report, because the server tracks the process that reports.
    let ready = if needs_training_env(&command) { training_env::reexec() } else { Ok(()) };
    let result =
        ready.and_then(|()| job_client::start()).and_then(|()| catch_panic(|| run(&command)));
    job_client::finish(&result);
    match result {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            std::process::ExitCode::from(2)
        }
    }
}

/// Converts a panic into an error. The server would treat a panicked worker as lost and restart it, and it
/// would panic again.
fn catch_panic(work: impl FnOnce() -> anyhow::Result<()>) -> anyhow::Result<()> {
    let done = std::panic::catch_unwind(std::panic::AssertUnwindSafe(work));
    done.unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        Err(anyhow::anyhow!("internal error (bug): {}", text.unwrap_or("no message")))
    })
}

/// Whether a command needs the environment variables of training.
fn needs_training_env(command: &CliCommand) -> bool {
    matches!(
        command,
        CliCommand::Train(_) | CliCommand::Bench(bench::Options { training: true, .. })
    )
}

fn run(command: &CliCommand) -> anyhow::Result<()> {
    match command {
        CliCommand::Serve { args } => {
            let args = args.join(OsStr::new(" "));
            anyhow::bail!("`ngf-worker` cannot serve; run `ngf serve {}`", args.display())
        }
        CliCommand::Objects(options) => object_selection::run(options),
        CliCommand::Mesh(command) => mesh::run(command),
        CliCommand::Grasps(options) => grasps::run(options),
        CliCommand::Dataset(command) => dataset::run(command),
        CliCommand::Train(options) => train::run(options),
        CliCommand::Evaluate(options) => evaluate::run(options),
        CliCommand::Validate(options) => validate::run(options),
        CliCommand::Compare(options) => compare::run(options),
        CliCommand::Bench(options) => bench::run(options),
        CliCommand::Physics(options) => physics::run(options),
        CliCommand::Replay(options) => replay::run(options),
        CliCommand::Record(options) => record::run(options),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panic_becomes_error_with_its_message() {
        let error = catch_panic(|| panic!("row {}", 7)).unwrap_err();
        assert_eq!(error.to_string(), "internal error (bug): row 7");
        assert!(catch_panic(|| panic!("last row")).unwrap_err().to_string().ends_with("last row"));
        assert!(catch_panic(|| Ok(())).is_ok());
    }
}
