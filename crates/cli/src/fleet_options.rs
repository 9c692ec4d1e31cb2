//! Options of `centre`, `check` and `sensor`.

use crate::centre::RowFormat;
use clap::Args;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub(crate) struct CentreOptions {
    /// Configuration (TOML): model, prior, sensors and their keys.
    pub(crate) configuration: PathBuf,
    /// Stop after this number of slots. Default: run until stopped.
    #[arg(long)]
    pub(crate) slots: Option<u64>,
    /// Serve a live page over HTTP at this address, as 0.0.0.0:8080; numbers for Prometheus are at /metrics. Default: none.
    #[arg(long, value_name = "HOST:PORT")]
    pub(crate) live: Option<SocketAddr>,
    /// Format of the rows.
    #[arg(long, value_enum, default_value = "csv")]
    pub(crate) rows: RowFormat,
    /// One JSON object per row instead of CSV, and the summary as JSON.
    #[arg(long, conflicts_with = "rows")]
    pub(crate) json: bool,
    /// Begin with the prior in the slot of the clock, also if the stored state is of a later slot or of other sensors. Counters that protect
    /// against replays go on.
    #[arg(long)]
    pub(crate) new_start: bool,
    /// Write a commented configuration, a fleet key and the files of sensors beside it, and end.
    #[arg(long, conflicts_with_all = ["slots", "live", "new_start"])]
    pub(crate) init: bool,
    /// With `--init`: number of sensors.
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=10_000))]
    pub(crate) sensors: u32,
    /// With `--init`: the sensors of this file of `fewbits fit -o`, with their noises, offsets, gains and thresholds, and its model.
    #[arg(long, value_name = "FILE.json", requires = "init", conflicts_with = "sensors")]
    pub(crate) settings: Option<PathBuf>,
    /// Print the configuration of this sensor with its key, which follows from the fleet key, and end.
    #[arg(long, value_name = "NUMBER", conflicts_with = "init")]
    pub(crate) sensor_file: Option<u32>,
}

impl CentreOptions {
    /// No options but the configuration.
    pub(crate) fn of(configuration: &Path) -> Self {
        Self {
            configuration: configuration.to_owned(),
            slots: None,
            live: None,
            rows: RowFormat::Csv,
            json: false,
            new_start: false,
            init: false,
            sensors: 2,
            settings: None,
            sensor_file: None,
        }
    }

    pub(crate) fn format(&self) -> RowFormat {
        match self.json {
            true => RowFormat::Json,
            false => self.rows,
        }
    }
}

#[derive(Args)]
pub(crate) struct CheckOptions {
    /// Configuration (TOML) of a centre.
    pub(crate) configuration: PathBuf,
}

#[derive(Args)]
pub(crate) struct SensorOptions {
    /// Configuration (TOML): the centre's address, the sensor's number, key and report.
    pub(crate) configuration: PathBuf,
}
