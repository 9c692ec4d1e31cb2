//! The command `fewbits`: recordings and telemetry within guaranteed errors.
//!
//! Each task is a module with a function `run`. Results go to `--output` or standard output, everything else to standard error.
//! Exit codes: 0 done, 1 an error bound is violated or a part is damaged or missing, 2 refused, 130 ended by a signal.

mod arguments;
mod bench;
mod bounds;
mod centre;
mod clock;
mod continuing;
mod design;
mod design_options;
mod ending;
mod error;
mod files;
mod fit_options;
mod fleet_options;
mod generate;
mod identity;
mod info;
mod input;
mod interrupt;
mod link;
mod live;
mod look;
mod manifest;
mod many;
mod measured;
mod naming;
mod node;
mod notes;
mod numbers;
mod opening;
mod output;
mod pack;
#[cfg(feature = "parquet")]
mod parquet;
mod patterns;
mod place;
mod plan;
mod plot;
mod private;
mod ranges_options;
mod recording;
mod recording_options;
mod repack;
mod report;
mod rows;
mod say;
mod send;
mod sensor;
mod serial;
mod shard;
mod single_pass;
mod stretches;
mod table_options;
mod target;
mod towards;
mod track;
mod track_options;
mod unpack;
mod verify;
mod waiting;

use arguments::{Cli, Task};
use clap::Parser;
pub(crate) use ending::Ending;
use error::Error;
use say::say;
use std::error::Error as _;
use std::ffi::OsString;
use std::process::ExitCode;

fn run(mut task: Task) -> Result<Ending, Error> {
    files::prepare(&mut task)?;
    let are_several = patterns::are_several(&task);
    match task {
        Task::Pack(options) if are_several => many::pack(&options),
        Task::Track(options) if are_several => many::track(&options),
        Task::Verify(options) if are_several => many::verify(&options),
        Task::Ranges(options) if are_several => many::ranges(&options),
        Task::Look(options) => look::run(&options),
        Task::Plan(options) => plan::run(&options),
        Task::Pack(options) => pack::run(&options),
        Task::Unpack(options) => unpack::run(&options.whole()),
        Task::Cat(options) => match &options.every {
            Some(every) => stretches::run(&options, every),
            None => unpack::run(&options),
        },
        Task::Repack(options) => repack::run(&options),
        Task::Info(options) => info::run(&options),
        Task::Verify(options) => verify::run(&options),
        Task::Bench(options) => bench::run(&options),
        Task::Track(options) => track::run(&options),
        Task::Ranges(options) => track::ranges(&options),
        Task::Fit(options) => track::fit(&options),
        Task::Leak(options) => track::leak(&options),
        Task::Design(options) => design::run(&options),
        Task::Send(options) => send::run(&options),
        Task::Receive(options) => link::receive::run(&options),
        Task::Generate(options) => generate::run(&options),
        Task::Centre(options) => centre::run(&options),
        Task::Check(options) => centre::check(&options.configuration),
        Task::Sensor(options) => sensor::run(&options),
    }
}

/// The words of the command without an output `-`, which is standard output, as if none were named.
fn words() -> Vec<OsString> {
    let (mut kept, mut words) = (Vec::new(), std::env::args_os().peekable());
    while let Some(word) = words.next() {
        let is_output = word == "-o" || word == "--output";
        if word == "--" {
            kept.push(word);
            kept.extend(words);
            break;
        } else if is_output && words.peek().is_some_and(|next| next == "-") {
            words.next();
        } else if word != "-o-" && word != "--output=-" {
            kept.push(word);
        }
    }
    kept
}

fn main() -> ExitCode {
    match run(Cli::parse_from(words()).task) {
        Ok(Ending::Good) => ExitCode::SUCCESS,
        Ok(Ending::Failed) => ExitCode::FAILURE,
        Ok(Ending::Refused) => ExitCode::from(2),
        // The reader of the output has closed the pipe: not an error.
        Err(error) if error.is_closed_pipe() => ExitCode::SUCCESS,
        Err(error) => {
            let mut message = format!("error: {error}");
            let mut source = error.source();
            while let Some(cause) = source {
                message += &format!(": {cause}");
                source = cause.source();
            }
            say!("{message}");
            ExitCode::from(2)
        }
    }
}
