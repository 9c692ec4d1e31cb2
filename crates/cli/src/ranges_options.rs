//! Options of `fewbits ranges`.

use crate::table_options::{ManyOptions, TableOptions};
use clap::Args;
use std::path::PathBuf;

#[derive(Args, Clone)]
pub(crate) struct RangesOptions {
    #[command(flatten)]
    pub(crate) table: TableOptions,
    #[command(flatten)]
    pub(crate) many: ManyOptions,
    /// Table of the anchors: name, x, y, and z if heights differ, in the unit of the ranges.
    #[arg(long, value_name = "FILE")]
    pub(crate) anchors: String,
    /// How ranges travel: `value`, `bit`, or `word:2` to `word:4`: the innovation, quantized in so many bits.
    #[arg(long, default_value = "value", value_name = "WHAT")]
    pub(crate) send: String,
    /// Largest standard deviation of a range's error that is considered; it is estimated from a quarter of that on. Default: about a quarter
    /// of the distance of the anchors from their middle, and estimated from a hundredth of that on. A share, as `40%`: errors grow with the
    /// distance, and `--bias` and `--anchor-bias` are shares of it too; taken where the first ranges of a file say so.
    #[arg(long, value_name = "DEVIATION")]
    pub(crate) noise: Option<String>,
    /// Values are signal strengths in dBm: the level at a distance of 1, the exponent of the distance, and the deviation of the shadowing in
    /// dB, as `-59,2.2,4`. A few dB, a tenth of the exponent, and half or twice the shadowing may be wrong.
    #[arg(long, value_name = "LEVEL,EXPONENT,SHADOWING", allow_hyphen_values = true)]
    pub(crate) rssi: Option<String>,
    /// Standard deviation of the velocity along an axis, per second; a factor of four off is enough. With `--odometry` that of its error. Default:
    /// estimated.
    #[arg(long, value_name = "SPEED")]
    pub(crate) speed: Option<f64>,
    /// Standard deviation of the bias that all ranges share; `0` if there is none. Default: a fifth of the distance of the anchors from their
    /// middle.
    #[arg(long, value_name = "DEVIATION")]
    pub(crate) bias: Option<f64>,
    /// Standard deviation of the bias of each single anchor beside the common one; `0` if there is none. Default: either none or a few
    /// percent of the distance of the anchors from their middle, whichever explains the ranges; with `--bias 0` none.
    #[arg(long, value_name = "DEVIATION")]
    pub(crate) anchor_bias: Option<f64>,
    /// Standard deviation of the error of scale; `0` if there is none. Ranges are `1 + scale` times the distance.
    #[arg(long, default_value_t = 0.1, value_name = "DEVIATION")]
    pub(crate) scale: f64,
    /// Height of the target, which is constant. Default: found from the first ranges of a file, if they tell it.
    #[arg(long, value_name = "HEIGHT", allow_hyphen_values = true)]
    pub(crate) height: Option<String>,
    /// The ranges of one time share an unknown offset: differences of times of arrival, times the speed of propagation.
    #[arg(long)]
    pub(crate) unknown_clock: bool,
    /// Odometry: the columns of what the target moved since the row before, along the axes of the anchors' coordinates, as `dx,dy`. With `--by`
    /// they are names in that column.
    #[arg(long, value_name = "COLUMNS", value_delimiter = ',')]
    pub(crate) odometry: Vec<String>,
    /// Column with the name of each row's target, of several in one file: each has a track of its own.
    #[arg(long, value_name = "NAME")]
    pub(crate) target: Option<String>,
    /// Column with the standard deviation of each row's ranges, right in proportion: the noise is estimated beside. Default: one that is called
    /// so.
    #[arg(long, value_name = "NAME")]
    pub(crate) accuracy_column: Option<String>,
    /// Correlation time of the velocity in seconds. Default: 6, or longer if an anchor of a file sends less often than every 5 s.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) persistence: Option<f64>,
    /// Probability that a range is an outlier, independent of the distance.
    #[arg(long, default_value_t = 0.02, value_name = "SHARE")]
    pub(crate) outliers: f64,
    /// Seconds without a range after which the place is searched again. Default: 30, or four times as long as an anchor of a file takes from
    /// range to range.
    #[arg(long, value_name = "SECONDS")]
    pub(crate) silence: Option<f64>,
    /// Rows may be so much late, as `60s`: each waits that long, by the times of the rows, for earlier ones. Default: rows are in order.
    #[arg(long, value_name = "TIME", value_parser = humantime::parse_duration)]
    pub(crate) late: Option<std::time::Duration>,
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
