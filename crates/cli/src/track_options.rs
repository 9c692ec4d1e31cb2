//! Options of `fewbits track`.

use crate::table_options::{ManyOptions, TableOptions};
use clap::{Args, ValueEnum};
use std::path::PathBuf;

/// Dynamics model of the state.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Model {
    /// Level: random walk.
    Walk,
    /// Level and slope: the slope is a random walk (nearly constant velocity).
    Velocity,
    /// Level, slope and curvature: the curvature is a random walk (nearly constant acceleration).
    Acceleration,
    /// Level: Ornstein-Uhlenbeck process that returns to the mean of `--prior`.
    Returning,
    /// Place from ranges to anchors: the task `ranges`, which has more options.
    Ranges,
}

#[derive(Args, Clone)]
pub(crate) struct TrackOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) many: ManyOptions,
    /// Dynamics model of the level. Default: a walk, or a level with a slope if the first rows decide for one and `--change` is not said.
    #[arg(long, value_enum)]
    pub(crate) model: Option<Model>,
    /// Report of each sensor: `value` (the measurement), `bit` (its sign relative to the prediction), `word:2` to `word:4` (the
    /// innovation, quantized in 2 to 4 bits); per column as `column=word:3,*=bit`.
    #[arg(long, default_value = "value", value_name = "WHAT")]
    pub(crate) send: String,
    /// The table contains reports (a value, 0 or 1, or the number of a quantizer cell). Without it, it contains measurements, which this
    /// command quantizes.
    #[arg(long)]
    pub(crate) reports: bool,
    /// Fixed thresholds of bits in the unit of the column, as `column=2.5,*=3`. Default: the prediction.
    #[arg(long, default_value = "", value_name = "THRESHOLDS", allow_hyphen_values = true)]
    pub(crate) threshold: String,
    /// Column with the threshold of each row's bits, which may change from row to row.
    #[arg(long, value_name = "NAME")]
    pub(crate) threshold_column: Option<String>,
    /// Column with the standard deviation of each row's values. Rows without it have the noise of `--noise`.
    #[arg(long, value_name = "NAME")]
    pub(crate) accuracy_column: Option<String>,
    /// Values are rounded to multiples of this step: a value says that the measurement is within half a step. `found`: the step is found
    /// where it is coarser than the noise; `no`: values are not rounded. Default: `found`.
    #[arg(long, value_name = "STEP|found|no")]
    pub(crate) rounded: Option<String>,
    /// An empty cell says that the measurement is within this width of the sensor's last value, as from sensors that send on change. `0.5/60s`:
    /// it measured every minute, also where there is no row.
    #[arg(long, value_name = "WIDTH[/TIME]")]
    pub(crate) silent_within: Option<String>,
    /// Detection limits, as `0.25..` or `0.25..40`: a value at or beyond a limit says only that the measurement is beyond it.
    /// `no`: there are none. Default: found, if many values are equal at an end where others hardly ever are, and it is not 0.
    #[arg(long, value_name = "LOW..HIGH|no", allow_hyphen_values = true)]
    pub(crate) limits: Option<String>,
    /// Standard deviation of the measurement noise in the unit of the column, as `0.3` or `column=0.3,*=0.5`. Default: estimated from the
    /// first 200 rows. With `--model ranges` as in the task `ranges`.
    #[arg(long, default_value = "", value_name = "DEVIATION")]
    pub(crate) noise: String,
    /// Standard deviation of the level from its forecast after a time, as `0.5/1h`. Default: estimated from the first 200 rows.
    #[arg(long, value_name = "SIZE/TIME")]
    pub(crate) change: Option<String>,
    /// Mean and standard deviation of the level before the first row, as `20±5`. Default: estimated from the first 200 rows.
    #[arg(long, value_name = "MEAN±DEVIATION", allow_hyphen_values = true)]
    pub(crate) prior: Option<String>,
    /// Whether the change is adapted during the run. Default: on, unless `--change` states it or cells are intervals.
    #[arg(long, value_enum, value_name = "on|off")]
    pub(crate) learning: Option<Switch>,
    /// With `--model velocity` and `acceleration`: mean and standard deviation of the slope per second before the first row, as `0±3`.
    /// Default: 0, and what the first rows suggest; if they are not waited for, ten times the change.
    #[arg(long, value_name = "MEAN±DEVIATION", allow_hyphen_values = true)]
    pub(crate) slope: Option<String>,
    /// Improve each estimate by the rows after it: by all (`all`), or by those up to a time later (`30s`). Rows are then written at the end.
    #[arg(long, value_name = "all|LAG")]
    pub(crate) smooth: Option<String>,
    /// The level is an angle with this period, as 360: values that differ by whole periods are equal. `no`: it is a number. Default: an angle of
    /// 360 degrees or 2 pi if the first rows jump by nearly that and back as if they went on around the circle.
    #[arg(long, value_name = "PERIOD|no")]
    pub(crate) period: Option<String>,
    /// Track the values' roots (`root`: counts, whose noise grows as the root of the value) or logarithms (`log`: a noise in proportion to the value).
    /// Estimates are written as values; noise, change and prior are those of `2 sqrt(v + 3/8)` and `ln v`.
    #[arg(long, value_enum, conflicts_with_all = ["accuracy_column", "limits", "period", "reports", "rounded", "settings", "silent_within", "threshold_column"])]
    pub(crate) transform: Option<Transform>,
    /// Subtract from each sensor its offset, found from this many first rows. The median of all offsets is zero. Default: no correction.
    #[arg(long, value_name = "ROWS")]
    pub(crate) align: Option<usize>,
    /// Rows may be so much late, as `60s`: each waits that long, by the times of the rows, for earlier ones. Default: rows are in order.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) late: Option<std::time::Duration>,
    /// File of `fewbits fit -o`: noises, offsets, gains, drifts, thresholds and change that other options do not state.
    #[arg(long, value_name = "FILE.json")]
    pub(crate) settings: Option<PathBuf>,
    /// With `--model ranges`: CSV file of the anchors with columns name, x, y.
    #[arg(long, value_name = "FILE", required_if_eq("model", "ranges"))]
    pub(crate) anchors: Option<String>,
    /// With `--model ranges`: as in the task `ranges`.
    #[arg(long, value_name = "SPEED")]
    pub(crate) speed: Option<f64>,
    /// With `--model ranges`: as in the task `ranges`.
    #[arg(long, default_value_t = 6.0, value_name = "SECONDS")]
    pub(crate) persistence: f64,
    /// With `--model ranges`: as in the task `ranges`.
    #[arg(long, default_value_t = 0.02, value_name = "SHARE")]
    pub(crate) outliers: f64,
    /// Draw the estimates into this SVG file.
    #[arg(long, value_name = "FILE.svg")]
    pub(crate) plot: Option<PathBuf>,
    /// One JSON object per row instead of CSV, and the summary as JSON.
    #[arg(long)]
    pub(crate) json: bool,
    /// File of the estimates. Default: standard output.
    #[arg(long, short, value_name = "FILE")]
    pub(crate) output: Option<PathBuf>,
}

/// On or off.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Switch {
    On,
    Off,
}

/// A function of values.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum Transform {
    /// `2 sqrt(v + 3/8)`, for counts.
    Root,
    /// `ln v`, for a noise in proportion to the value.
    Log,
}

impl From<Transform> for fewbits_tracking::Transform {
    fn from(transform: Transform) -> Self {
        match transform {
            Transform::Root => Self::Root,
            Transform::Log => Self::Log,
        }
    }
}
