//! Project commands: `cargo xtask demo | check | test | stress | bench`.
//!
//! They install missing tools, build in dependency order, and skip unchanged steps.

mod api_checks;
mod bench;
mod build_cache;
mod checks;
mod chromium;
mod debian;
mod demo;
mod engines;
mod fast_check;
mod python;
mod stages;
mod test_count;
mod tools;
mod web_build;
mod workspace;

use clap::{Parser, Subcommand};
use std::path::PathBuf;
use std::process::ExitCode;
use workspace::Workspace;

/// Build, test and benchmark this project.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Build everything and serve the web page.
    Demo(demo::Options),
    /// Build the page into web/dist, which can be hosted as static files.
    Page,
    /// Check format, spelling, licences, lints, native tests and types; run before every commit.
    Check {
        /// Check format, lints and unit tests of changed packages only.
        #[arg(long)]
        fast: bool,
        /// With --fast: files that differ from this revision are changed.
        #[arg(long, value_name = "REVISION", default_value = "HEAD", requires = "fast")]
        since: String,
    },
    /// Run all CI checks, including browser tests, and print the number of test cases.
    Test,
    /// Run long checks: browser parity, job crashes and load, API fuzzing, file fuzzing. Default: all.
    Stress {
        #[arg(value_name = "CHECK")]
        checks: Vec<checks::LongCheck>,
    },
    /// Run benchmarks; fails if the page exceeds its budgets.
    Bench {
        /// Also write the results to this JSON file.
        #[arg(long, value_name = "FILE")]
        json: Option<PathBuf>,
        /// Also measure the baselines MuJoCo and PyTorch (installed from PyPI).
        #[arg(long)]
        baselines: bool,
    },
}

fn main() -> ExitCode {
    let result = Workspace::find().and_then(|workspace| match Cli::parse().command {
        Command::Demo(options) => demo::run(&workspace, &options).map(|()| true),
        Command::Page => web_build::build(&workspace).map(|()| true),
        Command::Check { fast: true, since } => fast_check::run_checks(&workspace, &since),
        Command::Check { .. } => checks::check(&workspace),
        Command::Test => checks::test(&workspace),
        Command::Stress { checks } => checks::stress(&workspace, &checks),
        Command::Bench { json, baselines } => bench::run(&workspace, json.as_deref(), baselines),
    });
    match result {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}
