//! `cargo xtask <task>`.

use clap::{Parser, Subcommand};
use std::process::ExitCode;
use xtask::figures::Ending;

/// The project's tasks.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
struct Cli {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Regenerate figures and tables as CSV, JSON and SVG, with a gallery, and check their claims.
    Figures(xtask::figures::Options),
    /// Run the benchmarks and print each as a multiple of its unit.
    Bench(xtask::bench::Options),
    /// Build every crate as a user would depend on it, outside the workspace, and run its examples.
    Alone(xtask::alone::Options),
    /// List every public item of the library crates in `docs/api`, or compare with what is there.
    Api(xtask::api::Options),
    /// Count lines and public items of every crate.
    Size(xtask::size::Options),
    /// Check the house rules.
    Tidy,
}

fn main() -> ExitCode {
    if let Some(good) = xtask::api::as_rustdoc() {
        return if good { ExitCode::SUCCESS } else { ExitCode::FAILURE };
    }
    let ended = |good: bool| if good { Ending::Good } else { Ending::Failed };
    let done = match Cli::parse().task {
        Task::Figures(options) => xtask::figures::run(&options),
        Task::Bench(options) => xtask::bench::run(&options).map(ended),
        Task::Alone(options) => xtask::alone::run(&options).map(ended),
        Task::Api(options) => xtask::api::run(&options).map(ended),
        Task::Size(options) => xtask::size::run(&options).map(ended),
        Task::Tidy => xtask::tidy::run().map(ended),
    };
    match done {
        Ok(Ending::Good) => ExitCode::SUCCESS,
        Ok(Ending::Failed) => ExitCode::FAILURE,
        Ok(Ending::Interrupted) => ExitCode::from(130),
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}
