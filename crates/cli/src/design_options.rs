//! The options of `fewbits design`.

use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Criterion that the design optimizes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Criterion {
    /// Minimum mean squared error of the estimate.
    Error,
    /// Maximum mutual information between the unknown and the received words.
    Information,
    /// Minimum probability of a wrong decision; needs `--prior discrete:..`.
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

#[derive(Args, Clone)]
pub(crate) struct DesignOptions {
    /// CSV file with a sample of the unknown in one column; `-` for standard input. Default: the prior of `--prior`.
    #[arg(conflicts_with = "prior")]
    pub(crate) file: Option<String>,
    /// Column of the sample. Default: the only one.
    #[arg(long, value_name = "NAME")]
    pub(crate) column: Option<String>,
    /// What separates cells of the sample's table: a character, `tab` or `spaces`. Default: detected.
    #[arg(long, value_name = "MARK")]
    pub(crate) delimiter: Option<String>,
    /// Prior of the unknown: `20±4` (normal), `uniform:0..40`, `discrete:0,10` or `discrete:0@0.9,10@0.1`.
    #[arg(long, value_name = "PRIOR", allow_hyphen_values = true)]
    pub(crate) prior: Option<String>,
    /// Standard deviations of the sensors' noise in the unit of the unknown, one per sensor, as `1,1.5`.
    #[arg(
        long,
        value_delimiter = ',',
        required_unless_present = "settings",
        allow_negative_numbers = true,
        value_name = "DEVIATIONS"
    )]
    pub(crate) noise: Vec<f64>,
    /// File of `fewbits fit -o`: noises in the unit of the level, and the prior of a level that returns to its mean, which other options do not state.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) settings: Option<PathBuf>,
    /// Correlation of the noise of any two sensors.
    #[arg(long, default_value_t = 0.0, value_name = "RHO", allow_hyphen_values = true)]
    pub(crate) correlation: f64,
    /// Bits per word: `3` for each sensor, `3,1` one number per sensor, or `total:8` for the best division of 8 bits.
    #[arg(long, default_value = "3", value_name = "BITS")]
    pub(crate) bits: String,
    /// Probability that a bit is inverted; one for all sensors, or one per sensor. Default: 0.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) flips: Vec<f64>,
    /// Probability that a word is erased: the receiver knows that one was sent. Default: 0.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) erasures: Vec<f64>,
    /// Probability that a word is lost, which the receiver cannot distinguish from silence. Default: 0.
    #[arg(long, value_delimiter = ',', value_name = "PROBABILITIES")]
    pub(crate) loss: Vec<f64>,
    /// Criterion that the design optimizes.
    #[arg(long, value_enum, default_value = "error")]
    pub(crate) criterion: Criterion,
    /// Allow words that stand for several intervals. Default: one interval per word.
    #[arg(long)]
    pub(crate) folded: bool,
    /// Round thresholds to codes of an analogue-to-digital converter, as `12:0..40`: its bits and its range in the unit of the unknown.
    #[arg(long, value_name = "BITS:LOW..HIGH", allow_hyphen_values = true)]
    pub(crate) adc: Option<String>,
    /// Stop the search after this time with the best design so far, as `10s`. Default: no limit.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) time_limit: Option<std::time::Duration>,
    /// Form of the output.
    #[arg(long, value_enum, default_value = "table")]
    pub(crate) form: Form,
    /// The same as `--form json`.
    #[arg(long, conflicts_with = "form")]
    pub(crate) json: bool,
    /// Prefix of all names in C.
    #[arg(long, default_value = "fewbits", value_name = "NAME")]
    pub(crate) name: String,
    /// Largest lookup table of the decoder in bytes. Above it, the decoder adds up numbers instead.
    #[arg(long, default_value_t = 65536, value_name = "BYTES")]
    pub(crate) decoder_bytes: usize,
    /// Draw the cells into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
    /// File of the design. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
