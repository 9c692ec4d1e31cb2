//! The options of `fewbits design`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What a design is to be good at.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Criterion {
    /// Least mean squared error of the estimate.
    Error,
    /// Most information between the unknown and what arrives.
    Information,
    /// Least probability of deciding for the wrong value; needs `--prior discrete:..`.
    Decision,
}

/// The form of a design.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Form {
    Table,
    Json,
    /// C header.
    C,
    /// Constants for Rust without the standard library.
    Rust,
}

#[derive(Args)]
pub(crate) struct DesignOptions {
    /// CSV file with a sample of the unknown in one column; `-` for standard input. Without it `--prior` says what is known.
    #[arg(conflicts_with = "prior")]
    pub(crate) file: Option<String>,
    /// The column of the sample. Without it the only one.
    #[arg(long, value_name = "NAME")]
    pub(crate) column: Option<String>,
    /// What separates cells.
    #[arg(long, default_value_t = ',', value_name = "CHARACTER")]
    pub(crate) delimiter: char,
    /// What is known of the unknown: `20±4` (normal), `uniform:0..40`, `discrete:0,10` or `discrete:0@0.9,10@0.1`.
    #[arg(long, value_name = "PRIOR", allow_hyphen_values = true)]
    pub(crate) prior: Option<String>,
    /// Standard deviations of the sensors' noise, one per sensor, as `1,1.5`.
    #[arg(long, value_delimiter = ',', required = true, value_name = "DEVIATIONS")]
    pub(crate) noise: Vec<f64>,
    /// Correlation of the noise of any two sensors.
    #[arg(long, default_value_t = 0.0, value_name = "RHO", allow_hyphen_values = true)]
    pub(crate) correlation: f64,
    /// Bits of a word: `3` for every sensor, `3,1` one by one, `total:8` to be shared out.
    #[arg(long, default_value = "3", value_name = "BITS")]
    pub(crate) bits: String,
    /// Probability that a bit arrives inverted; one for all sensors, or one per sensor.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) flips: Vec<f64>,
    /// Probability that a word is known to be lost.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) erasures: Vec<f64>,
    /// Probability that a word is lost without a trace.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) loss: Vec<f64>,
    /// What the design is to be good at.
    #[arg(long, value_enum, default_value = "error")]
    pub(crate) criterion: Criterion,
    /// Let a word stand for several intervals.
    #[arg(long)]
    pub(crate) folded: bool,
    /// Integer thresholds for a converter, as `12:0..40`: its bits and its range in the unit of the unknown.
    #[arg(long, value_name = "BITS:LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) adc: Option<String>,
    /// End the search after this time with the best design so far.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) time_limit: Option<std::time::Duration>,
    /// What is written.
    #[arg(long, value_enum, default_value = "table")]
    pub(crate) form: Form,
    /// The same as `--form json`.
    #[arg(long, conflicts_with = "form")]
    pub(crate) json: bool,
    /// Beginning of all names in C.
    #[arg(long, default_value = "fewbits", value_name = "NAME")]
    pub(crate) name: String,
    /// Longest table of a decoder in bytes; a larger one is replaced by numbers that are added up.
    #[arg(long, default_value_t = 65536, value_name = "BYTES")]
    pub(crate) decoder_bytes: usize,
    /// Draw the cells into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
    /// The design. Without it standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
