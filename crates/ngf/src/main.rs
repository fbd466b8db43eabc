//! `ngf`: serves the page and the job API, and passes every other command to the worker executable.
//!
//! Links no physics, training or Parquet.

mod open_files;
mod serve;
mod token;
mod worker;

use clap::{Parser, Subcommand};
use std::ffi::OsString;
use std::process::ExitCode;

/// Returns memory to the system. After four meshes of 20 MB and 800 streams, the idle server needs 29 MB; with the
/// allocator of glibc, 200 MB.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

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
    Serve(serve::Options),
}

fn main() -> ExitCode {
    let args: Vec<OsString> = std::env::args_os().skip(1).collect();
    let result = if is_own_command(&args) {
        let CliCommand::Serve(options) = Cli::parse().command;
        serve::run(&options)
    } else {
        worker::run(&args)
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

/// Whether these arguments are a command of this executable: `serve` or `help serve`.
fn is_own_command(args: &[OsString]) -> bool {
    let command = match args {
        [help, command, ..] if help == "help" => Some(command),
        _ => args.first(),
    };
    command.is_some_and(|command| command == "serve")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_serve_is_a_command_of_this_executable() {
        let is_own = |line: &str| {
            is_own_command(&line.split_whitespace().map(OsString::from).collect::<Vec<_>>())
        };
        for line in ["serve", "serve --port 0", "help serve"] {
            assert!(is_own(line), "{line}");
        }
        for line in ["", "--help", "help", "help evaluate", "evaluate serve"] {
            assert!(!is_own(line), "{line}");
        }
    }
}
