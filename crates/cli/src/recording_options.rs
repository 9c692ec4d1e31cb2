//! Options of tasks on recordings.

use clap::Args;
use std::path::PathBuf;

#[derive(Args)]
pub(crate) struct UnpackOptions {
    /// Recording, or several that are written as one table in the order of time; `-` for standard input. Wildcards are expanded.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<String>,
    /// File of the table. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct CatOptions {
    /// Recording, or several that are written as one table in the order of time; `-` for standard input. Wildcards are expanded.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<String>,
    /// First time or row number. Default: that of the first row.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) from: Option<String>,
    /// Last time or row number. Default: that of the last row.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) to: Option<String>,
    /// Columns to write, in this order, separated by commas; a name with commas in double quotes. Default: all.
    #[arg(long, value_name = "NAMES")]
    pub(crate) columns: Vec<String>,
    /// Write one row for each stretch of this time (as `1h`, from full hours on) or number of rows, instead of each row.
    #[arg(long, value_name = "TIME", allow_hyphen_values = true)]
    pub(crate) every: Option<String>,
    /// With `--every`: the mean of each column's finite values. The default, if no other is asked for.
    #[arg(long, requires = "every")]
    pub(crate) mean: bool,
    /// With `--every`: the smallest finite value of each column.
    #[arg(long, requires = "every")]
    pub(crate) min: bool,
    /// With `--every`: the largest finite value of each column.
    #[arg(long, requires = "every")]
    pub(crate) max: bool,
    /// With `--every`: the number of finite values of each column.
    #[arg(long, requires = "every")]
    pub(crate) count: bool,
    /// One JSON object per row instead of CSV.
    #[arg(long)]
    pub(crate) json: bool,
    /// File of the table. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(Args)]
pub(crate) struct RepackOptions {
    /// Recordings. Wildcards are expanded. Each is replaced when its new one is complete.
    #[arg(required = true, value_name = "FILE")]
    pub(crate) files: Vec<String>,
    /// Bounds as for `pack`, relative to what is in the recording: they are added to its own. Columns without a bound, and those whose
    /// bound would not be wider, keep their values.
    #[arg(long, value_name = "BOUNDS", allow_hyphen_values = true)]
    pub(crate) bound: String,
    /// Leave recordings whose last row is not older than this, as `30d`.
    #[arg(long, value_name = "AGE", value_parser = humantime::parse_duration)]
    pub(crate) older_than: Option<std::time::Duration>,
    /// Number of rows per block. A damaged block loses its rows only.
    #[arg(long, visible_alias = "independent", default_value_t = fewbits_record::ROWS_PER_BLOCK, value_name = "ROWS")]
    pub(crate) rows_per_block: usize,
    /// Encode more than ten times as fast, with 1.03 to 1.12 times the bits in the mean of many series.
    #[arg(long)]
    pub(crate) fast: bool,
    /// Write the new recording here, and leave the old one. Only for one recording.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}
