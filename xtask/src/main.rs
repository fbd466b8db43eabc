//! The project's own commands: `cargo xtask demo | check | test | prove | bench`.
//!
//! Installs what is missing, builds in the right order, skips what has not changed.

mod bench;
mod chromium;
mod demo;
mod page;
mod place;
mod python;
mod stages;
mod stamp;
mod tally;
mod tools;

use clap::{Parser, Subcommand};
use place::Place;
use std::path::PathBuf;
use std::process::ExitCode;

/// Commands of this project.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Build everything and serve the page.
    Demo(demo::Options),
    /// Format, lints, quick tests, types: before every commit.
    Check,
    /// Everything that CI runs, in the browser too; ends with a count.
    Test,
    /// What takes longer, all of it or what is named: attempts in the browser, bit for bit as natively; violent ends of
    /// jobs and a crowd of readers; requests of every kind; mutated files.
    Prove {
        #[arg(value_name = "PROOF")]
        proofs: Vec<stages::Proof>,
    },
    /// Measure; fails where the page exceeds its budgets.
    Bench {
        /// Also write the rows to this file.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Beside what others need for the same: MuJoCo and PyTorch, from PyPI.
        #[arg(long)]
        peers: bool,
    },
}

fn main() -> ExitCode {
    let done = Place::find().and_then(|place| match Cli::parse().command {
        Command::Demo(options) => demo::run(&place, &options).map(|()| true),
        Command::Check => stages::check(&place),
        Command::Test => stages::test(&place),
        Command::Prove { proofs } => stages::prove(&place, &proofs),
        Command::Bench { json, peers } => bench::run(&place, json.as_deref(), peers),
    });
    match done {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
