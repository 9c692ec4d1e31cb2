//! The command `fewbits`: recordings and telemetry within guaranteed errors.
//!
//! Each task is a module with a function `run`. Results go to `--output` or standard output, everything else to standard error.
//! Exit codes: 0 done, 1 an error bound is violated or a part is damaged, 2 refused.

mod arguments;
mod bench;
mod bounds;
mod centre;
mod clock;
mod design;
mod design_options;
mod error;
mod fleet_options;
mod generate;
mod info;
mod input;
mod link;
mod node;
mod notes;
mod numbers;
mod output;
mod pack;
#[cfg(feature = "parquet")]
mod parquet;
mod place;
mod plan;
mod plot;
mod private;
mod report;
mod sensor;
mod serial;
mod track;
mod unpack;
mod verify;

use arguments::{Cli, Task};
use clap::Parser;
use std::error::Error as _;
use std::process::ExitCode;

/// The end of a task that was not refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Ending {
    Good,
    /// An error bound is violated, or a part could not be read.
    Failed,
}

impl Ending {
    /// The end of a task that received no complete frame.
    pub(crate) fn no_frame(name: &str) -> Self {
        eprintln!("error: {name}: no whole frame came: use the sender's link, options and baud rate, and wait longer");
        Self::Failed
    }
}

fn main() -> ExitCode {
    let done = match Cli::parse().task {
        Task::Plan(options) => plan::run(&options),
        Task::Pack(options) => pack::run(&options),
        Task::Unpack(options) => unpack::run(&options.whole()),
        Task::Cat(options) => unpack::run(&options),
        Task::Info(options) => info::run(&options),
        Task::Verify(options) => verify::run(&options),
        Task::Bench(options) => bench::run(&options),
        Task::Track(options) => track::run(&options),
        Task::Design(options) => design::run(&options),
        Task::Send(options) => link::send::run(&options),
        Task::Receive(options) => link::receive::run(&options),
        Task::Generate(options) => generate::run(&options),
        Task::Centre(options) => centre::run(&options),
        Task::Check(options) => centre::check(&options.configuration),
        Task::Sensor(options) => sensor::run(&options),
    };
    match done {
        Ok(Ending::Good) => ExitCode::SUCCESS,
        Ok(Ending::Failed) => ExitCode::FAILURE,
        // The reader of the output has closed the pipe: not an error.
        Err(error) if error.is_closed_pipe() => ExitCode::SUCCESS,
        Err(error) => {
            eprint!("error: {error}");
            let mut source = error.source();
            while let Some(cause) = source {
                eprint!(": {cause}");
                source = cause.source();
            }
            eprintln!();
            ExitCode::from(2)
        }
    }
}
