//! The command line.

use crate::Ending;
use crate::error::Error;
use clap::{Args, CommandFactory, Parser, Subcommand, ValueEnum};
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
    /// Send rows from standard input or a file as frames, to a file, a pipe or UDP.
    Send(SendOptions),
    /// Receive frames from a file, a pipe or UDP and write their rows as CSV.
    Receive(ReceiveOptions),
    /// Write completions for a shell, or the manual page.
    #[command(hide = true)]
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
    /// Some ten times faster, at 1.3 to 1.8 times the bits.
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

impl UnpackOptions {
    /// All rows and columns.
    pub(crate) fn whole(self) -> CatOptions {
        CatOptions {
            file: self.file,
            from: None,
            to: None,
            columns: Vec::new(),
            json: false,
            output: self.output,
        }
    }
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
    /// With UDP: the header goes before every so many frames.
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
    /// With UDP: end when nothing came for so long.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) timeout: Option<std::time::Duration>,
    /// The table. Without it standard output.
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
    what: Generated,
}

/// Writes completions or the manual page to standard output.
pub(crate) fn generate(options: &GenerateOptions) -> Result<Ending, Error> {
    use clap_complete::Shell;
    let mut command = Cli::command();
    let shell = match options.what {
        Generated::Bash => Shell::Bash,
        Generated::Elvish => Shell::Elvish,
        Generated::Fish => Shell::Fish,
        Generated::Powershell => Shell::PowerShell,
        Generated::Zsh => Shell::Zsh,
        Generated::Man => {
            let page = clap_mangen::Man::new(command);
            page.render(&mut std::io::stdout())
                .map_err(Error::file("standard output", "write"))?;
            return Ok(Ending::Good);
        }
    };
    clap_complete::generate(shell, &mut command, "fewbits", &mut std::io::stdout());
    Ok(Ending::Good)
}
