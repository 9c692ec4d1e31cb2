//! Options of `fewbits leak`.

use crate::table_options::TableOptions;
use clap::Args;
use std::path::PathBuf;

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
