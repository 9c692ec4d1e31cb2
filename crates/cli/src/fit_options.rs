//! Options of `fewbits fit`.

use crate::table_options::TableOptions;
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// What is looked for beside noises, offsets and change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Sought {
    /// Factors of the level.
    Gain,
    /// Offsets that grow linearly.
    Slope,
    /// Offsets that wander.
    Walk,
    /// Sensors that are late.
    Delay,
    /// The time in which the level returns to its mean.
    TimeConstant,
}

#[derive(Args, Clone)]
pub(crate) struct FitOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    /// The sensor that is right: offsets, gains, drifts and delays are relative to it. Default: they are relative to the sensor with the most
    /// values, and what all have in common cannot be found.
    #[arg(long, value_name = "NAME")]
    pub(crate) reference: Option<String>,
    /// What is looked for beside noises, offsets and change.
    #[arg(long, value_enum, value_delimiter = ',', value_name = "WHAT,...")]
    pub(crate) find: Vec<Sought>,
    /// Sensors whose readings are bits, 0 or 1: whether the level is above a threshold, which is found.
    #[arg(long, value_delimiter = ',', value_name = "NAMES")]
    pub(crate) bits: Vec<String>,
    /// Noises that are known, as `0.3` or `column=0.3`: standard deviations.
    #[arg(long, default_value = "", value_name = "DEVIATION")]
    pub(crate) noise: String,
    /// Detection limits, as `0.25..` or `0.25..40`: a value at or beyond a limit says only that the measurement is beyond it.
    /// `no`: there are none. Default: found, if many values are equal at an end where others hardly ever are, and it is not 0.
    #[arg(long, value_name = "LOW..HIGH|no", allow_hyphen_values = true)]
    pub(crate) limits: Option<String>,
    /// Write what was found as JSON to standard output.
    #[arg(long)]
    pub(crate) json: bool,
    /// Write what was found as JSON into this file, which `fewbits track --settings` takes.
    #[arg(long, short, value_name = "FILE.json")]
    pub(crate) output: Option<PathBuf>,
}
