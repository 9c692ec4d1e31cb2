//! The options of `ranges` as those of the library, and their language.

use super::anchors::Anchor;
use super::level_options::report;
use super::rows::Instants;
use super::target::Target;
use crate::error::Error;
use crate::files::is_regular;
use crate::numbers::{above_zero, number};
use crate::ranges_options::RangesOptions;
use crate::track_options::TrackOptions;
use fewbits_pf_mpa::{RangeSettings, Travel};
use fewbits_tracking::{Report, Strengths};

/// Parses `LEVEL,EXPONENT,SHADOWING`.
fn strengths(text: &str) -> Result<Strengths, Error> {
    const OPTION: &str = "--rssi";
    const EXPECTED: &str = "the level in dBm at a distance of 1, the exponent of the distance, and the deviation of the shadowing in dB, as `-59,2.2,4`";
    let parts: Vec<&str> = text.split(',').collect();
    let [level, exponent, shadowing] = parts.as_slice() else {
        return Err(Error::option(OPTION, text, EXPECTED));
    };
    Ok(Strengths {
        level: number(OPTION, level, EXPECTED)?,
        exponent: above_zero(OPTION, exponent, EXPECTED)?,
        shadowing: above_zero(OPTION, shadowing, EXPECTED)?,
    })
}

/// Refuses columns of odometry that the table does not have.
pub(super) fn odometry(options: &RangesOptions, anchors: &[Anchor], instants: &Instants) -> Result<(), Error> {
    let names = &options.odometry;
    if options.table.by.is_some() || !matches!(names.len(), 2 | 3) {
        return Ok(());
    }
    let is_missing =
        |name: &&String| !anchors.iter().any(|(anchor, _)| anchor == *name) && !instants.names().contains(name);
    match names.iter().find(is_missing) {
        Some(name) => {
            let problem = format!("no column `{name}` of --odometry: there are {}", instants.names().join(", "));
            Err(Error::content(instants.source().file(), problem))
        }
        None => Ok(()),
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

/// The options as the library has them.
pub(super) fn ranges_options(
    options: &RangesOptions,
    instants: &Instants,
    target: Option<&Target>,
) -> Result<fewbits_tracking::RangesOptions, Error> {
    const EXPECTED: &str = "a height as `0.3`";
    const NOISE: &str = "a deviation, as `0.4`, or a share of the distance, as `20%`";
    let travel = match report(&options.send)? {
        Report::Word { bits } => Travel::Bits(bits),
        Report::Sign => Travel::Bits(1),
        _ => Travel::Full,
    };
    let height = options.height.as_deref();
    let height = height.map(|text| number("--height", text, EXPECTED)).transpose()?;
    let (mut noise, mut proportional) = (None, false);
    if let Some(text) = options.noise.as_deref() {
        let share = text.trim().strip_suffix('%');
        proportional = share.is_some();
        noise = Some(match share {
            Some(share) => 0.01 * above_zero("--noise", share, NOISE)?,
            None => number("--noise", text, NOISE)?,
        });
    }
    let strengths = options.rssi.as_deref().map(strengths).transpose()?;
    if strengths.is_some() && (options.unknown_clock || noise.is_some()) {
        let other = if noise.is_some() { "--noise" } else { "--unknown-clock" };
        return Err(Error::option("--rssi", other, "one of the two: strengths have a shadowing and no clock"));
    }
    Ok(fewbits_tracking::RangesOptions {
        travel,
        noise,
        proportional,
        strengths,
        speed: options.speed,
        bias: options.bias,
        anchor_bias: options.anchor_bias,
        scale: options.scale,
        height,
        unknown_clock: options.unknown_clock,
        odometry: options.odometry.clone(),
        others: target.map_or_else(Vec::new, |target| target.all.to_vec()),
        has_accuracies: instants.source().roles.any_accuracy().is_some(),
        persistence: options.persistence,
        outliers: options.outliers,
        silence: options.silence,
        looks_ahead: is_regular(&options.table.file),
    })
}
