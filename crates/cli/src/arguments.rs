//! The command line.

use crate::design_options::DesignOptions;
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
    /// Show what a table would cost at several bounds, which steps its columns have, and how its time runs.
    Plan(PlanOptions),
    /// Pack a table (CSV) into a recording.
    Pack(PackOptions),
    /// Write a whole recording as CSV.
    Unpack(UnpackOptions),
    /// Write some rows or columns of a recording as CSV.
    Cat(CatOptions),
    /// Say what a recording holds.
    Info(InfoOptions),
    /// Check that a recording keeps its promises to the table it was made of. Exit code 1 if not.
    Verify(VerifyOptions),
    /// Compare sizes and speeds on a table: this format, pco and (with feature `zstd`) zstd, in the same run.
    Bench(BenchOptions),
    /// Estimate what sensors measure from a table (CSV) of values, of reports of few bits, or of ranges to anchors: estimates with bands.
    Track(TrackOptions),
    /// Design quantizers of few bits for one unknown that several sensors measure.
    Design(DesignOptions),
    /// Send rows from standard input or a file as frames, to a file, a pipe, UDP or a serial line.
    Send(SendOptions),
    /// Receive frames from a file, a pipe, UDP or a serial line and write their rows as CSV.
    Receive(ReceiveOptions),
    /// Run a fusion centre over UDP, MQTT or zenoh. Estimates go to standard output, a row per slot.
    Centre(CentreOptions),
    /// Run a sensor over UDP. Samples come from standard input, one per line and slot.
    Sensor(SensorOptions),
    /// Write completions for a shell, or the manual page.
    Generate(GenerateOptions),
}

/// How a table is read.
#[derive(Args, Clone)]
pub(crate) struct TableOptions {
    /// CSV file with a line of names first; `-` for standard input.
    pub(crate) file: String,
    /// Rows have times: `exact`, or how far restored times may be off, as `±10ms`. Without it rows are numbered.
    #[arg(long, value_name = "exact|±10ms", allow_hyphen_values = true)]
    pub(crate) time: Option<String>,
    /// The column of times: seconds, or UTC as 2026-01-31T12:00:00.5Z. Without it the first column, if there is `--time`.
    #[arg(long, value_name = "NAME")]
    pub(crate) time_column: Option<String>,
    /// Only these columns.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) columns: Vec<String>,
    /// What separates cells.
    #[arg(long, default_value_t = ',', value_name = "CHARACTER")]
    pub(crate) delimiter: char,
}

/// What columns promise.
#[derive(Args, Clone)]
pub(crate) struct BoundOptions {
    /// Bounds as `column=bound,...`, `*` for all others: `±0.1`, `1%` of the range, `decimals:3`, `lossless`; a circle as `±2@360`.
    /// Columns without a bound are lossless.
    #[arg(long, value_name = "BOUNDS", allow_hyphen_values = true, default_value = "")]
    pub(crate) bound: String,
    /// Rows of a block: what is lost if one is damaged.
    #[arg(long, default_value_t = fewbits_record::ROWS_PER_BLOCK, value_name = "ROWS")]
    pub(crate) rows_per_block: usize,
}

#[derive(Args)]
pub(crate) struct PlanOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// Rows of a block.
    #[arg(long, default_value_t = fewbits_record::ROWS_PER_BLOCK, value_name = "ROWS")]
    pub(crate) rows_per_block: usize,
    /// As JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// Draw bits against bounds into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct PackOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// The recording. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
    /// Some ten times as fast, at 1.03 to 1.09 times the bits (without other columns: more where they help).
    #[arg(long)]
    pub(crate) fast: bool,
    /// Go on with the recording in `--output`, with its columns and bounds.
    #[arg(long, requires = "output", conflicts_with_all = ["bound", "rows_per_block"])]
    pub(crate) append: bool,
    /// Print what was done as JSON on standard error.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct UnpackOptions {
    /// Recording; `-` for standard input.
    pub(crate) file: String,
    /// The table. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct CatOptions {
    /// Recording; `-` for standard input.
    pub(crate) file: String,
    /// First time, or row number.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) from: Option<String>,
    /// Last time, or row number.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) to: Option<String>,
    /// Only these columns, in this order.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) columns: Vec<String>,
    /// One JSON object per row instead of CSV.
    #[arg(long)]
    pub(crate) json: bool,
    /// The table. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct InfoOptions {
    /// Recording.
    pub(crate) file: PathBuf,
    /// As JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct VerifyOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// The recording that was made of the table.
    pub(crate) packed: PathBuf,
    /// As JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct BenchOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// As JSON.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Args)]
pub(crate) struct CentreOptions {
    /// Configuration (TOML): model, prior, sensors and their keys.
    pub(crate) configuration: PathBuf,
    /// End after so many slots.
    #[arg(long)]
    pub(crate) slots: Option<u64>,
    /// Show a page at this address, as 0.0.0.0:8080.
    #[cfg(feature = "live")]
    #[arg(long, value_name = "HOST:PORT")]
    pub(crate) live: Option<std::net::SocketAddr>,
}

#[derive(Args)]
pub(crate) struct SensorOptions {
    /// Configuration (TOML): the centre's address, the sensor's number, key and report.
    pub(crate) configuration: PathBuf,
}

#[derive(Args)]
pub(crate) struct SendOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) bounds: BoundOptions,
    /// Longest frame in bytes.
    #[arg(long, default_value_t = 1200, value_name = "BYTES")]
    pub(crate) max_bytes: usize,
    /// No row waits longer than this for its frame, as `60s`.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) deadline: Option<std::time::Duration>,
    /// Send UDP datagrams to this address instead of writing a stream.
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "output")]
    pub(crate) udp: Option<String>,
    /// Send over a serial line: its device.
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["output", "udp"])]
    pub(crate) serial: Option<String>,
    /// Bits per second of the serial line.
    #[arg(long, default_value_t = 115200, value_name = "BAUD")]
    pub(crate) baud: u32,
    /// With UDP or a serial line: the header goes before every so many frames.
    #[arg(long, default_value_t = 32, value_name = "FRAMES", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) header_every: u64,
    /// Where the stream goes. Without it standard output.
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
    /// Listen at a serial line instead: its device.
    #[arg(long, value_name = "DEVICE", conflicts_with_all = ["udp", "file"])]
    pub(crate) serial: Option<String>,
    /// Bits per second of the serial line.
    #[arg(long, default_value_t = 115200, value_name = "BAUD")]
    pub(crate) baud: u32,
    /// Frames are those of one sensor with the adaptive encoder of `fewbits-node`, within this bound: `±0.05`, on a circle `±2@360`. Rows
    /// are slots and values. From a loss that is noticed to the next refresh there are gaps.
    #[arg(long, value_name = "BOUND", conflicts_with = "udp", allow_hyphen_values = true)]
    pub(crate) sensor: Option<String>,
    /// With `--sensor`: bits of the number in each of its packets.
    #[arg(long, default_value_t = 4, value_name = "BITS", value_parser = clap::value_parser!(u32).range(1..=16))]
    pub(crate) sequence_bits: u32,
    /// With UDP or a serial line: end when nothing came for so long.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) timeout: Option<std::time::Duration>,
    /// The table. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// How the world moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Model {
    /// A level that wanders.
    Walk,
    /// A level with a slope that wanders.
    Velocity,
    /// A level with slope and curvature that wanders.
    Acceleration,
    /// A level that returns to the mean of `--prior` (Ornstein-Uhlenbeck).
    Returning,
    /// A place in the plane, from its distances to anchors at known places.
    Ranges,
}

#[derive(Args)]
pub(crate) struct TrackOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// How what is measured moves.
    #[arg(long, value_enum, default_value = "walk")]
    pub(crate) model: Model,
    /// What sensors send: `value`, `bit`, `word:2` to `word:4`; or as `column=word:3,*=bit`.
    #[arg(long, default_value = "value", value_name = "WHAT")]
    pub(crate) send: String,
    /// Cells are reports as they were sent (`value`, 0 or 1, number of a cell), not measurements that this command is to quantize.
    #[arg(long)]
    pub(crate) reports: bool,
    /// Bits compare with these thresholds, as `column=2.5,*=3`, instead of with the prediction.
    #[arg(long, default_value = "", value_name = "THRESHOLDS", allow_hyphen_values = true)]
    pub(crate) threshold: String,
    /// One report per row: the column that names the sensor (or anchor). The column of values is the other one, or that of `--columns`.
    #[arg(long, value_name = "NAME")]
    pub(crate) by: Option<String>,
    /// Standard deviation of a measurement's noise, as `0.3` or `column=0.3,*=0.5`. Without it found from the first rows.
    #[arg(long, default_value = "", value_name = "DEVIATION")]
    pub(crate) noise: String,
    /// How far the level strays from its forecast (standard deviation) in some time, as `0.5/1h`. Without it found from the first rows,
    /// and always corrected on the way.
    #[arg(long, value_name = "SIZE/TIME")]
    pub(crate) change: Option<String>,
    /// What is known before the first row, as `20±5`. Without it found from the first rows.
    #[arg(long, value_name = "MEAN±DEVIATION", allow_hyphen_values = true)]
    pub(crate) prior: Option<String>,
    /// Subtract each sensor's mean difference from the others in this many first rows.
    #[arg(long, value_name = "ROWS")]
    pub(crate) align: Option<usize>,
    /// With `--model ranges`: a CSV of anchors: name, x, y.
    #[arg(long, value_name = "FILE", required_if_eq("model", "ranges"))]
    pub(crate) anchors: Option<String>,
    /// With `--model ranges`: standard deviation of the velocity along an axis, to a factor of four.
    #[arg(long, default_value_t = 1.0, value_name = "SPEED")]
    pub(crate) speed: f64,
    /// With `--model ranges`: seconds that a velocity lasts.
    #[arg(long, default_value_t = 6.0, value_name = "SECONDS")]
    pub(crate) persistence: f64,
    /// With `--model ranges`: share of ranges that have nothing to do with the distance.
    #[arg(long, default_value_t = 0.02, value_name = "SHARE")]
    pub(crate) outliers: f64,
    /// Draw the estimates into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
    /// One JSON object per row instead of CSV, and the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// The estimates. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// What is generated.
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
