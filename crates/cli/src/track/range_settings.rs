//! What the options of `ranges` say of ranges and target.

use crate::arguments::RangesOptions;
use crate::error::Error;
use crate::numbers::{above_zero, number};
use crate::track_options::TrackOptions;
use fewbits_pf_mpa::{Height, RangeSettings};

/// The law of signal strengths: `level - 10 exponent log10(distance)` and a shadowing in decibels.
#[derive(Debug, Clone, Copy)]
pub(super) struct Strengths {
    level: f64,
    exponent: f64,
    shadowing: f64,
}

impl Strengths {
    /// Parses `LEVEL,EXPONENT,SHADOWING`.
    fn parse(text: &str) -> Result<Self, Error> {
        const OPTION: &str = "--rssi";
        const EXPECTED: &str = "the level in dBm at a distance of 1, the exponent of the distance, and the deviation of the shadowing in dB, as `-59,2.2,4`";
        let parts: Vec<&str> = text.split(',').collect();
        let [level, exponent, shadowing] = parts.as_slice() else {
            return Err(Error::option(OPTION, text, EXPECTED));
        };
        Ok(Self {
            level: number(OPTION, level, EXPECTED)?,
            exponent: above_zero(OPTION, exponent, EXPECTED)?,
            shadowing: above_zero(OPTION, shadowing, EXPECTED)?,
        })
    }

    /// The law that the options say.
    pub(super) fn of(options: &RangesOptions) -> Result<Option<Self>, Error> {
        options.rssi.as_deref().map(Self::parse).transpose()
    }

    /// Decibels of a change of the distance by the factor e.
    fn slope(&self) -> f64 {
        10.0 * self.exponent / std::f64::consts::LN_10
    }

    /// The distance at which a strength is expected.
    pub(super) fn distance(&self, strength: f64) -> f64 {
        ((self.level - strength) / self.slope()).exp()
    }
}

/// The options of `ranges` that those of `track --model ranges` stand for.
pub(super) fn options(track: &TrackOptions, anchors: &str) -> Result<RangesOptions, Error> {
    if track.reports {
        return Err(Error::option("--reports", "--model ranges", "measured ranges, which this command quantizes"));
    }
    const EXPECTED: &str = "one standard deviation for all anchors";
    if !track.noise.is_empty() {
        number("--noise", &track.noise, EXPECTED)?;
    }
    Ok(RangesOptions {
        table: track.table.clone(),
        many: track.many.clone(),
        anchors: anchors.to_owned(),
        send: track.send.clone(),
        noise: (!track.noise.is_empty()).then(|| track.noise.clone()),
        rssi: None,
        speed: track.speed,
        bias: None,
        anchor_bias: None,
        scale: RangeSettings::default().scale,
        height: None,
        unknown_clock: false,
        odometry: Vec::new(),
        target: None,
        accuracy_column: track.accuracy_column.clone(),
        persistence: Some(track.persistence),
        outliers: track.outliers,
        silence: None,
        late: track.late,
        plot: track.plot.clone(),
        json: track.json,
        output: track.output.clone(),
    })
}

/// The settings that the options say.
pub(super) fn settings(options: &RangesOptions) -> Result<RangeSettings, Error> {
    const EXPECTED: &str = "a height as `0.3`";
    const NOISE: &str = "a deviation, as `0.4`, or a share of the distance, as `20%`";
    let height = match options.height.as_deref() {
        None => Height::Unsaid,
        Some(text) => Height::Known(number("--height", text, EXPECTED)?),
    };
    let (mut noise, mut noise_factor, mut proportional) = (None, None, false);
    if let Some(text) = options.noise.as_deref() {
        let share = text.trim().strip_suffix('%');
        proportional = share.is_some();
        noise = Some(match share {
            Some(share) => 0.01 * above_zero("--noise", share, NOISE)?,
            None => number("--noise", text, NOISE)?,
        });
    }
    if let Some(strengths) = Strengths::of(options)? {
        if options.unknown_clock || noise.is_some() {
            let other = if noise.is_some() { "--noise" } else { "--unknown-clock" };
            return Err(Error::option("--rssi", other, "one of the two: strengths have a shadowing and no clock"));
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
        height,
        unknown_clock: options.unknown_clock,
        ..RangeSettings::default()
    })
}
