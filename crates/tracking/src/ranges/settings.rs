//! What is known of ranges and target.

use crate::error::Error;
use fewbits_pf_mpa::{Height, RangeSettings, Travel};
use nalgebra::Vector3;

/// Name and place of an anchor.
pub(crate) type Anchor = (String, Vector3<f64>);

/// The law of signal strengths: `level - 10 exponent log10(distance)` and a shadowing in decibels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strengths {
    /// In dBm at a distance of 1.
    pub level: f64,
    /// Of the distance.
    pub exponent: f64,
    /// Standard deviation in decibels.
    pub shadowing: f64,
}

impl Strengths {
    /// Decibels of a change of the distance by the factor e.
    fn slope(&self) -> f64 {
        10.0 * self.exponent / std::f64::consts::LN_10
    }

    /// The distance at which a strength is expected.
    pub(crate) fn distance(&self, strength: f64) -> f64 {
        ((self.level - strength) / self.slope()).exp()
    }
}

/// What is known of ranges and target. Lengths are in the unit of the ranges.
#[derive(Debug, Clone, PartialEq)]
pub struct RangesOptions {
    /// How ranges travel: in full, or the innovation in a few bits.
    pub travel: Travel,
    /// Largest standard deviation of a range's error that is considered; with `proportional` a share of the distance. Default: as
    /// [`RangeSettings::noise`].
    pub noise: Option<f64>,
    /// Errors grow with the distance: `noise`, `bias` and `anchor_bias` are shares of it. Taken where the first ranges say so.
    pub proportional: bool,
    /// Values are signal strengths, under this law.
    pub strengths: Option<Strengths>,
    /// Standard deviation of the velocity along an axis, per second. With `odometry` that of its error. Default: estimated.
    pub speed: Option<f64>,
    /// Standard deviation of the bias that all ranges share. Default: as [`RangeSettings::bias`].
    pub bias: Option<f64>,
    /// Standard deviation of the bias of each single anchor. Default: as [`RangeSettings::anchor_bias`].
    pub anchor_bias: Option<f64>,
    /// Standard deviation of the error of scale.
    pub scale: f64,
    /// Height of the target. Default: found from the first ranges, if they tell it.
    pub height: Option<f64>,
    /// The ranges of one time share an unknown offset: differences of times of arrival.
    pub unknown_clock: bool,
    /// Names of the sensors that are odometry, one for each axis: what the target moved since the row before.
    pub odometry: Vec<String>,
    /// Names of other targets, ranges to which are left out.
    pub others: Vec<String>,
    /// Rows state the accuracy of their ranges, right in proportion: the noise is estimated beside.
    pub has_accuracies: bool,
    /// Correlation time of the velocity in seconds. Default: 6, or longer if an anchor sends seldom.
    pub persistence: Option<f64>,
    /// Probability that a range does not depend on the distance.
    pub outliers: f64,
    /// Seconds without a range after which the place is searched again. Default: 30, or longer if an anchor sends seldom.
    pub silence: Option<f64>,
    /// The first rows may be read ahead, and tell what is not stated.
    pub looks_ahead: bool,
}

impl Default for RangesOptions {
    fn default() -> Self {
        let RangeSettings { scale, outliers, .. } = RangeSettings::default();
        Self {
            travel: Travel::Full,
            noise: None,
            proportional: false,
            strengths: None,
            speed: None,
            bias: None,
            anchor_bias: None,
            scale,
            height: None,
            unknown_clock: false,
            odometry: Vec::new(),
            others: Vec::new(),
            has_accuracies: false,
            persistence: None,
            outliers,
            silence: None,
            looks_ahead: true,
        }
    }
}

/// The settings that the options say.
pub(crate) fn settings(options: &RangesOptions) -> Result<RangeSettings, Error> {
    let (mut noise, mut noise_factor, mut proportional) = (options.noise, None, options.proportional);
    if let Some(strengths) = options.strengths {
        if options.unknown_clock || noise.is_some() {
            return Err(Error::Argument {
                argument: "strengths",
                value: if noise.is_some() { "noise" } else { "unknown_clock" }.to_owned(),
                expected: "one of the two: strengths have a shadowing and no clock",
            });
        }
        // The shadowing may be twice as large as said, or half of it.
        (noise, noise_factor) = (Some(2.0 * strengths.shadowing / strengths.slope()), Some(4.0));
        proportional = true;
    }
    Ok(RangeSettings {
        noise,
        noise_factor,
        proportional,
        speed: options.speed,
        bias: options.bias,
        anchor_bias: options.anchor_bias,
        scale: options.scale,
        outliers: options.outliers,
        persistence: options.persistence.unwrap_or(RangeSettings::default().persistence),
        silence: options.silence.unwrap_or(RangeSettings::default().silence),
        height: options.height.map_or(Height::Unsaid, Height::Known),
        unknown_clock: options.unknown_clock,
        ..RangeSettings::default()
    })
}
