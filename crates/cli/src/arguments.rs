//! The command line.

use crate::design_options::DesignOptions;
pub(crate) use crate::fit_options::FitOptions;
pub(crate) use crate::fleet_options::{CentreOptions, CheckOptions, SensorOptions};
pub(crate) use crate::ranges_options::RangesOptions;
pub(crate) use crate::recording_options::{CatOptions, RepackOptions, UnpackOptions};
pub(crate) use crate::table_options::{BoundOptions, DialectOptions, ManyOptions, TableOptions};
pub(crate) use crate::track_options::TrackOptions;
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::path::PathBuf;

/// Recordings and telemetry within guaranteed errors, small.
#[derive(Parser)]
#[command(name = "fewbits", version, max_term_width = 100)]
pub(crate) struct Cli {
    #[command(subcommand)]
    pub(crate) task: Task,
}

#[derive(Subcommand)]
pub(crate) enum Task {
    /// Show how a table is understood: dialect, columns, kinds, units, times, gaps, ranges and suspicious cells.
    Look(LookOptions),
    /// Show the bits per sample of a table at several error bounds, the quantization steps of its columns, and the bits of its times.
    Plan(PlanOptions),
    /// Pack a table (CSV) into a recording.
    Pack(PackOptions),
    /// Write a whole recording, or several as one table in the order of time, as CSV.
    Unpack(UnpackOptions),
    /// Write some rows or columns of recordings as CSV, or means, minima and maxima over stretches of time.
    Cat(CatOptions),
    /// Pack recordings anew under wider bounds, in their place or into another file. Both bounds are added up and stated.
    Repack(RepackOptions),
    /// Describe a recording: rows, columns, bounds, times and damage.
    Info(InfoOptions),
    /// Check every row of a recording against the table it was made of and the error bounds. Exit code 1 if a bound is violated.
    Verify(VerifyOptions),
    /// Compare sizes and speeds on a table: this format, pco and (with feature `zstd`) zstd, in the same run.
    Bench(BenchOptions),
    /// Estimate what sensors measure from a table (CSV) of values, of reports of few bits, or of ranges to anchors: estimates with bands.
    Track(Box<TrackOptions>),
    /// Estimate a place from distances to anchors at known places, in the plane or in space: estimates with bands.
    Ranges(Box<RangesOptions>),
    /// Calibrate: find noise, offset, gain, drift and delay of each sensor and the change of the level from a table, with standard errors.
    Fit(FitOptions),
    /// Find the room of a leak, its rate and its start from readings of sensors in rooms, of values or of few bits, at any times.
    Leak(LeakOptions),
    /// Design quantizers of few bits for one unknown that several sensors measure.
    Design(DesignOptions),
    /// Send rows from standard input or a file as frames, to a file, a pipe, UDP or a serial line.
    Send(SendOptions),
    /// Receive frames from a file, a pipe, UDP or a serial line and write their rows as CSV.
    Receive(ReceiveOptions),
    /// Run a fusion centre over UDP, MQTT or zenoh. Estimates go to standard output, a row per slot.
    Centre(CentreOptions),
    /// Check the configuration of a fusion centre: all its faults are named.
    Check(CheckOptions),
    /// Run a sensor over UDP. Samples come from standard input, one per line and slot.
    Sensor(SensorOptions),
    /// Write completions for a shell, or the manual page.
    Generate(GenerateOptions),
}

#[derive(Args)]
pub(crate) struct LookOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
    /// Print only the dialect, as TOML for `--dialect`.
    #[arg(long, conflicts_with = "json")]
    pub(crate) toml: bool,
}

#[derive(Args)]
pub(crate) struct PlanOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// Number of rows per block.
    #[arg(long, default_value_t = fewbits_record::ROWS_PER_BLOCK, value_name = "ROWS")]
    pub(crate) rows_per_block: usize,
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw bits against bounds into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
}

#[derive(Args, Clone)]
pub(crate) struct PackOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) many: ManyOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// File of the recording, or folder of the recordings of several files. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Encode more than ten times as fast, with 1.03 to 1.12 times the bits in the mean of many series. Columns are then not predicted from each other.
    #[arg(long)]
    pub(crate) fast: bool,
    /// Continue the recording in `--output`, with its columns and bounds.
    #[arg(long, requires = "output", conflicts_with_all = ["bound", "rows_per_block"])]
    pub(crate) append: bool,
    /// Longest time that a row of a pipe waits in memory, as `60s`. Default: until its block is full, or the pipe ends.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) deadline: Option<std::time::Duration>,
    /// Print the summary as JSON on standard error.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct InfoOptions {
    /// Recording.
    pub(crate) file: PathBuf,
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args, Clone)]
pub(crate) struct VerifyOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// The recording that was made of the table. Behind several tables: the folder of their recordings.
    pub(crate) packed: PathBuf,
    #[command(flatten)]
    pub(crate) many: ManyOptions,
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct BenchOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// Print JSON instead of text.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct SendOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// Largest length of a frame in bytes.
    #[arg(long, default_value_t = 1200, value_name = "BYTES")]
    pub(crate) max_bytes: usize,
    /// Longest time that a row waits for its frame, as `60s`. Default: until the frame is full.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) deadline: Option<std::time::Duration>,
    /// Send UDP datagrams to this address instead of writing a stream.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "output")]
    pub(crate) udp: Option<String>,
    /// Send over the serial line of this device.
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["output", "udp"])]
    pub(crate) serial: Option<String>,
    /// Bits per second of the serial line.
    #[arg(long, default_value_t = 115200, value_name = "BAUD")]
    pub(crate) baud: u32,
    /// With UDP or a serial line: percentage of the bytes that is used to repeat the header, so that a lost piece of it is soon replaced.
    #[arg(long, default_value_t = 10.0, value_name = "PERCENT")]
    pub(crate) header_share: f64,
    /// With UDP or a serial line: repeat the whole header after this number of frames instead.
    #[arg(long, value_name = "FRAMES", value_parser = clap::value_parser!(u64).range(1..), conflicts_with = "header_share")]
    pub(crate) header_every: Option<u64>,
    /// File of the stream. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct ReceiveOptions {
    /// A stream of frames; `-` for standard input.
    #[arg(default_value = "-", conflicts_with = "udp")]
    pub(crate) file: String,
    /// Listen for UDP datagrams at this address instead.
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) udp: Option<String>,
    /// Listen at the serial line of this device instead.
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["udp", "file"])]
    pub(crate) serial: Option<String>,
    /// Bits per second of the serial line.
    #[arg(long, default_value_t = 115200, value_name = "BAUD")]
    pub(crate) baud: u32,
    /// Messages of other programs instead of frames: readings as rows `time,name,value,unit`.
    #[arg(long, value_enum, conflicts_with_all = ["udp", "serial"])]
    pub(crate) format: Option<crate::link::format::Format>,
    /// With `--format`: read the messages on this topic of a broker, as `mqtt://user:password@host/application/+/device/+/event/up`.
    #[arg(long, value_name = "MQTT", requires = "format", conflicts_with = "file")]
    pub(crate) mqtt: Option<String>,
    /// With `--format lorawan`: only this device, by its EUI or name.
    #[arg(long, value_name = "DEVICE", requires = "format")]
    pub(crate) device: Option<String>,
    /// Frames are those of one sensor that reports by the clock. With a bound, `±0.05`, on a circle `±2@360`, it runs the adaptive encoder of
    /// `fewbits-node`: rows are slots and values; from a loss that is noticed to the next refresh there are gaps. With `bit`, `word:1` to
    /// `word:32` or `value` rows are slots and what was sent; silent slots are gaps.
    #[arg(long, value_name = "BOUND", conflicts_with = "udp", allow_hyphen_values = true)]
    pub(crate) sensor: Option<String>,
    /// With `--sensor`: bits of the sequence number in each packet.
    #[arg(long, default_value_t = 4, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) sequence_bits: u32,
    /// With UDP or a serial line: stop after this time without a frame, as `10s`. Default: wait without limit.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) timeout: Option<std::time::Duration>,
    /// File of the table. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// Kind of the output.
#[derive(Clone, Copy, ValueEnum)]
pub(crate) enum Generated {
    Bash,
    Elvish,
    Fish,
    Powershell,
    Zsh,
    /// Manual page (roff).
    Man,
}

#[derive(Args)]
pub(crate) struct GenerateOptions {
    pub(crate) what: Generated,
    /// Write one manual page per task into this folder, instead of the first one to standard output.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) folder: Option<PathBuf>,
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::Cli;
    use clap::CommandFactory;
    use std::collections::HashSet;

    /// Defect: `fit` had `--by` from two structures, and read the one that was never filled.
    #[test]
    fn no_task_has_an_option_twice() {
        let mut waiting = vec![Cli::command()];
        while let Some(command) = waiting.pop() {
            let (mut ids, mut names) = (HashSet::new(), HashSet::new());
            for argument in command.get_arguments() {
                assert!(ids.insert(argument.get_id().clone()), "{}: {argument}", command.get_name());
                if let Some(long) = argument.get_long() {
                    assert!(names.insert(long.to_owned()), "{}: --{long}", command.get_name());
                }
            }
            waiting.extend(command.get_subcommands().cloned());
        }
    }
}

#[derive(Args, Clone)]
pub(crate) struct LeakOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// Rooms, air, sensors and what is known of the leak, as TOML.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) rooms: PathBuf,
    /// Write only the last row.
    #[arg(long)]
    pub(crate) last: bool,
    /// One JSON object per row instead of CSV, and the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// File of the estimates. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
