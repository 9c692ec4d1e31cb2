//! Tracks a vehicle from recorded ranges, in full and with 1 to 4 bits a range.
//!
//! ```text
//! cargo run --release -p fewbits-pf-mpa --example plaza -- ANCHORS.csv RANGES.csv TRUTH.csv [PLOT.svg]
//! ```
//!
//! `ANCHORS.csv` has columns `anchor,x_m,y_m`, `RANGES.csv` has `t_s,anchor,range_m` (one anchor at a time, in any order of rows), and
//! `TRUTH.csv` has `t_s,x_m,y_m`; further columns are passed over. All ranges may be too long by a common amount, which is
//! estimated with the position. The first range of every anchor, and again after half a minute without ranges, travels in full
//! (32 bits) and says where to begin; after that each anchor reports the level of its innovation. The truth is only used to judge.

use fewbits_core::{Gaussian, Likelihood, Observed};
use fewbits_pf_mpa::{
    BiasedRangeSensor, GridFilter, GridWorkspace, QuantizedRange, RangeFactor, RangeNoise, RangeReference, RangeSensor,
    optimal_loading,
};
use nalgebra::{Matrix5, Vector2, Vector3, Vector5};
use plotters::prelude::*;
use std::collections::BTreeMap;
use std::error::Error;
use std::fmt;
use std::path::Path;
use std::process::ExitCode;

type Failure = Box<dyn Error>;

/// Deviation of a range's error, in metres: errors of neighbouring ranges are alike, so it is above their spread.
const NOISE: f64 = 1.5;
/// Share of ranges that have nothing to do with the distance.
const OUTLIERS: f64 = 0.02;
/// Width of where they lie, in metres.
const STRAY: f64 = 40.0;
/// Deviation of the velocity along each axis, in metres per second, and how long it lasts, in seconds.
const SPEED: f64 = 0.8;
const PERSISTENCE: f64 = 6.0;
/// Growth of the bias's variance, in square metres per second.
const DRIFT: f64 = 1e-4;
/// Deviation of the bias before the first range, in metres.
const BIAS: f64 = 5.0;
/// Seconds without a range after which the position is looked for anew.
const SILENCE: f64 = 30.0;

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let outcome = match arguments.as_slice() {
        [anchors, ranges, truth] => analyse(anchors, ranges, truth, None),
        [anchors, ranges, truth, plot] => analyse(anchors, ranges, truth, Some(plot)),
        _ => Err("usage: plaza ANCHORS.csv RANGES.csv TRUTH.csv [PLOT.svg]".into()),
    };
    match outcome {
        Ok(report) => {
            print!("{report}");
            ExitCode::SUCCESS
        }
        Err(error) => {
            eprintln!("{error}");
            ExitCode::FAILURE
        }
    }
}

/// What was recorded.
pub struct Recording {
    /// Anchors by their id.
    pub anchors: BTreeMap<String, RangeSensor>,
    /// Time, anchor and range, in order of time.
    pub ranges: Vec<(f64, String, f64)>,
    /// Time and true position, in order of time.
    pub truth: Vec<(f64, Vector2<f64>)>,
}

/// Columns of a file, by their names: each row as texts.
fn columns<const N: usize>(file: &Path, names: [&str; N]) -> Result<Vec<[String; N]>, Failure> {
    let mut reader = csv::Reader::from_path(file).map_err(|e| format!("{}: {e}", file.display()))?;
    let headers = reader.headers()?.clone();
    let mut places = [0; N];
    for (place, name) in places.iter_mut().zip(names) {
        *place = headers
            .iter()
            .position(|h| h.trim() == name)
            .ok_or_else(|| format!("{}: no column `{name}`", file.display()))?;
    }
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record?;
        rows.push(places.map(|p| record.get(p).unwrap_or_default().trim().to_owned()));
    }
    Ok(rows)
}

fn number(file: &Path, row: usize, text: &str) -> Result<f64, Failure> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite());
    value.ok_or_else(|| format!("{}: row {}: `{text}` is no number", file.display(), row + 2).into())
}

impl Recording {
    /// Reads the three files.
    pub fn read(anchors: &Path, ranges: &Path, truth: &Path) -> Result<Self, Failure> {
        let noise = RangeNoise::constant(NOISE)?;
        let mut places = BTreeMap::new();
        for (i, [id, x, y]) in columns(anchors, ["anchor", "x_m", "y_m"])?.into_iter().enumerate() {
            let at = Vector2::new(number(anchors, i, &x)?, number(anchors, i, &y)?);
            places.insert(id, RangeSensor::new(at, noise)?);
        }
        let mut all = Vec::new();
        for (i, [t, id, range]) in columns(ranges, ["t_s", "anchor", "range_m"])?.into_iter().enumerate() {
            if !places.contains_key(&id) {
                return Err(format!("{}: row {}: there is no anchor `{id}`", ranges.display(), i + 2).into());
            }
            // A range that is missing says nothing.
            if !range.is_empty() && !range.eq_ignore_ascii_case("nan") {
                all.push((number(ranges, i, &t)?, id, number(ranges, i, &range)?));
            }
        }
        let mut track = Vec::new();
        for (i, [t, x, y]) in columns(truth, ["t_s", "x_m", "y_m"])?.into_iter().enumerate() {
            let at = Vector2::new(number(truth, i, &x)?, number(truth, i, &y)?);
            track.push((number(truth, i, &t)?, at));
        }
        all.sort_by(|a, b| a.0.total_cmp(&b.0));
        track.sort_by(|a, b| a.0.total_cmp(&b.0));
        if places.len() < 3 || all.is_empty() || track.is_empty() {
            return Err("at least three anchors, one range and one true position are needed".into());
        }
        Ok(Self {
            anchors: places,
            ranges: all,
            truth: track,
        })
    }

    /// The true position at a time, between its neighbours.
    pub fn truth_at(&self, t: f64) -> Vector2<f64> {
        let after = self.truth.partition_point(|p| p.0 < t);
        let (last, first) = (self.truth.len() - 1, &self.truth[0]);
        if after == 0 {
            return first.1;
        }
        if after > last {
            return self.truth[last].1;
        }
        let (a, b) = (&self.truth[after - 1], &self.truth[after]);
        let share = if b.0 > a.0 { (t - a.0) / (b.0 - a.0) } else { 0.0 };
        a.1 + (b.1 - a.1) * share
    }
}

/// A range that may have nothing to do with the distance: `(1 - e) p + e c`, `c` what such a range has on average.
struct Robust {
    observed: Observed<BiasedRangeSensor, RangeFactor, 1>,
    log_outlier: f64,
}

impl Likelihood<3> for Robust {
    fn log_likelihood(&self, state: &Vector3<f64>) -> f64 {
        self.mixed(self.observed.log_likelihood(state))
    }

    fn add_log_likelihoods(&self, states: fewbits_core::Columns<'_, 3>, logs: &mut [f64]) {
        let mut own = vec![0.0; logs.len()];
        self.observed.add_log_likelihoods(states, &mut own);
        logs.iter_mut().zip(own).for_each(|(log, own)| *log += self.mixed(own));
    }
}

impl Robust {
    fn mixed(&self, log: f64) -> f64 {
        let (own, other) = (log + (1.0 - OUTLIERS).ln(), self.log_outlier);
        let (high, low) = (own.max(other), own.min(other));
        high + (low - high).exp().ln_1p()
    }
}

/// How a range travels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Travel {
    /// In full.
    Full,
    /// As the level of its innovation, this many bits.
    Bits(u32),
}

/// What a filter made of a recording.
pub struct Track {
    /// Time, estimated position and bias after each range.
    pub estimates: Vec<(f64, Vector2<f64>, f64)>,
    /// Bits of all ranges.
    pub bits: usize,
}

impl Track {
    /// Root mean squared position error.
    pub fn error(&self, recording: &Recording) -> f64 {
        let squares = self
            .estimates
            .iter()
            .map(|(t, p, _)| (p - recording.truth_at(*t)).norm_squared());
        (squares.sum::<f64>() / self.estimates.len().max(1) as f64).sqrt()
    }

    /// Median of the position error.
    pub fn median(&self, recording: &Recording) -> f64 {
        let mut all: Vec<f64> = self
            .estimates
            .iter()
            .map(|(t, p, _)| (p - recording.truth_at(*t)).norm())
            .collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied().unwrap_or(f64::NAN)
    }
}

/// State `[x, y, bias, vx, vy]` after `dt` seconds: a velocity that is forgotten, a bias that hardly moves.
fn predicted(belief: &Gaussian<5>, dt: f64) -> Gaussian<5> {
    let u = dt / PERSISTENCE;
    let (keep, reach) = ((-u).exp(), -PERSISTENCE * (-u).exp_m1());
    let mut f = Matrix5::identity();
    let mut q = Matrix5::zeros();
    let squared = SPEED * SPEED;
    for (position, velocity) in [(0, 3), (1, 4)] {
        f[(position, velocity)] = reach;
        f[(velocity, velocity)] = keep;
        q[(velocity, velocity)] = -squared * (-2.0 * u).exp_m1();
        let cross = squared * reach * reach / PERSISTENCE;
        q[(position, velocity)] = cross;
        q[(velocity, position)] = cross;
        let spread = 2.0 * u - 3.0 + 4.0 * keep - keep * keep;
        q[(position, position)] = (squared * PERSISTENCE * PERSISTENCE * spread).max(0.0);
    }
    q[(2, 2)] = DRIFT * dt;
    Gaussian::from_trusted_parts(f * belief.mean(), f * belief.covariance() * f.transpose() + q)
}

/// The belief that a few full ranges, one per anchor, leave: the best point of a fine grid over the field, the bias eliminated.
fn acquired(recording: &Recording, first: &BTreeMap<String, f64>, bias: (f64, f64)) -> Gaussian<5> {
    let known: Vec<(&RangeSensor, f64)> = first
        .iter()
        .filter_map(|(id, z)| Some((recording.anchors.get(id)?, *z)))
        .collect();
    let spread = |axis: usize| {
        let all = || recording.anchors.values().map(|a| a.position()[axis]);
        (all().fold(f64::INFINITY, f64::min), all().fold(f64::NEG_INFINITY, f64::max))
    };
    let ((x0, x1), (y0, y1)) = (spread(0), spread(1));
    let margin = 0.3 * (x1 - x0).max(y1 - y0);
    let noise = NOISE * NOISE + 1.0;
    // Sum of squares with the best bias, which has its own prior.
    let fit = |x: f64, y: f64| {
        let rest: Vec<f64> = known.iter().map(|(a, z)| z - a.distance(x, y)).collect();
        let precision = rest.len() as f64 / noise + 1.0 / bias.1;
        let best = (rest.iter().sum::<f64>() / noise + bias.0 / bias.1) / precision;
        let squares = rest.iter().map(|r| (r - best) * (r - best)).sum::<f64>() / noise;
        (squares + (best - bias.0) * (best - bias.0) / bias.1, best)
    };
    let mut best = (f64::INFINITY, Vector2::zeros(), bias.0);
    const STEPS: usize = 240;
    for i in 0..=STEPS {
        for j in 0..=STEPS {
            let share =
                |low: f64, high: f64, k: usize| low - margin + (high - low + 2.0 * margin) * k as f64 / STEPS as f64;
            let (x, y) = (share(x0, x1, i), share(y0, y1, j));
            let (squares, own) = fit(x, y);
            if squares < best.0 {
                best = (squares, Vector2::new(x, y), own);
            }
        }
    }
    let mean = Vector5::new(best.1[0], best.1[1], best.2, 0.0, 0.0);
    let variances = Vector5::new(9.0, 9.0, bias.1.min(4.0), SPEED * SPEED, SPEED * SPEED);
    Gaussian::from_trusted_parts(mean, Matrix5::from_diagonal(&variances))
}

/// Tracks the whole recording with the default filter.
pub fn track(recording: &Recording, travel: Travel) -> Result<Track, Failure> {
    let noise = RangeNoise::constant(NOISE)?;
    let quantizer = match travel {
        Travel::Full => None,
        Travel::Bits(bits) => Some((QuantizedRange::new(1 << bits, noise)?, optimal_loading(1 << bits)?)),
    };
    let (filter, mut workspace) = (GridFilter::default(), GridWorkspace::<3>::default());
    let mut track = Track {
        estimates: Vec::new(),
        bits: 0,
    };
    let mut belief: Option<Gaussian<5>> = None;
    let (mut first, mut bias) = (BTreeMap::new(), (0.0, BIAS * BIAS));
    let mut before = f64::NEG_INFINITY;
    for (t, id, range) in &recording.ranges {
        let dt = t - before;
        before = *t;
        if let Some(lost) = belief.filter(|_| dt > SILENCE) {
            // What is known of the bias stays.
            bias = (lost.mean()[2], lost.covariance()[(2, 2)] + DRIFT * dt);
            (belief, first) = (None, BTreeMap::new());
        }
        let Some(known) = belief else {
            first.insert(id.clone(), *range);
            track.bits += 32;
            if first.len() >= recording.anchors.len().min(4) {
                belief = Some(acquired(recording, &first, bias));
            }
            continue;
        };
        let Some(anchor) = recording.anchors.get(id) else {
            continue;
        };
        let sensor = BiasedRangeSensor(*anchor);
        let prediction = predicted(&known, dt);
        let mean = fewbits_core::Sensing::mean(&sensor, prediction.mean())[0];
        let row = fewbits_core::Sensing::jacobian(&sensor, prediction.mean());
        let spread = (row * prediction.covariance() * row.transpose())[0].sqrt();
        let (factor, log_outlier) = match &quantizer {
            None => (RangeFactor::value(*range, noise)?, (OUTLIERS / STRAY).ln()),
            Some((scheme, loading)) => {
                let reference = RangeReference {
                    centre: mean,
                    half_width: loading * spread.hypot(NOISE),
                };
                let (level, levels) = (scheme.level(*range, &reference)?, scheme.levels());
                // An outlier seldom falls into an inner cell.
                let inner = (2.0 * reference.half_width / STRAY).min(1.0) / levels as f64;
                let outer = 0.5 * (1.0 - (levels - 2) as f64 * inner);
                let share = if level.0 == 0 || level.0 + 1 == levels {
                    outer
                } else {
                    inner
                };
                (scheme.received(level, &reference)?, (OUTLIERS * share).ln())
            }
        };
        track.bits += quantizer.as_ref().map_or(32, |q| q.0.bits() as usize);
        let observed = Robust {
            observed: Observed::new(sensor, factor),
            log_outlier,
        };
        let updated = filter.update(&prediction, [0, 1, 2], &observed, &mut workspace)?.0;
        let mean = updated.mean();
        track.estimates.push((*t, Vector2::new(mean[0], mean[1]), mean[2]));
        belief = Some(updated);
    }
    Ok(track)
}

/// All tracks of a recording.
pub struct Report {
    /// How ranges travelled, root mean squared error, median error, last bias, bits per range.
    pub rows: Vec<(Travel, f64, f64, f64, f64)>,
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let full = self.rows.first().map_or(f64::NAN, |r| r.1);
        writeln!(f, "ranges    RMS error / m   against full   median / m   bias / m   bits per range")?;
        for (travel, error, median, bias, bits) in &self.rows {
            let name = match travel {
                Travel::Full => "in full".to_owned(),
                Travel::Bits(1) => "1 bit".to_owned(),
                Travel::Bits(bits) => format!("{bits} bits"),
            };
            writeln!(f, "{name:<8}  {error:13.3}   {:12.3}   {median:10.3}   {bias:8.2}   {bits:14.2}", error / full)?;
        }
        Ok(())
    }
}

/// Tracks with full ranges and with 1 to 4 bits, and draws the tracks of full ranges and of two bits.
pub fn analyse(anchors: &str, ranges: &str, truth: &str, plot: Option<&String>) -> Result<Report, Failure> {
    let recording = Recording::read(Path::new(anchors), Path::new(ranges), Path::new(truth))?;
    let travels = [
        Travel::Full,
        Travel::Bits(1),
        Travel::Bits(2),
        Travel::Bits(3),
        Travel::Bits(4),
    ];
    let mut tracks = Vec::new();
    for travel in travels {
        tracks.push(track(&recording, travel)?);
    }
    if let Some(file) = plot {
        draw(Path::new(file), &recording, &[("ranges in full", &tracks[0]), ("two bits a range", &tracks[2])])?;
    }
    let row = |(travel, track): (Travel, &Track)| {
        let bias = track.estimates.last().map_or(f64::NAN, |e| e.2);
        let bits = track.bits as f64 / recording.ranges.len() as f64;
        (travel, track.error(&recording), track.median(&recording), bias, bits)
    };
    Ok(Report {
        rows: travels.into_iter().zip(&tracks).map(row).collect(),
    })
}

/// The true track and estimates, to an SVG file.
pub fn draw(file: &Path, recording: &Recording, tracks: &[(&str, &Track)]) -> Result<(), Failure> {
    let all: Vec<Vector2<f64>> = recording
        .truth
        .iter()
        .map(|p| p.1)
        .chain(recording.anchors.values().map(|a| *a.position()))
        .collect();
    let range = |axis: usize| {
        let low = all.iter().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
        let high = all.iter().map(|p| p[axis]).fold(f64::NEG_INFINITY, f64::max);
        let margin = 0.05 * (high - low).max(1.0);
        low - margin..high + margin
    };
    let area = SVGBackend::new(file, (900, 760)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(12)
        .x_label_area_size(36)
        .y_label_area_size(48)
        .build_cartesian_2d(range(0), range(1))?;
    chart
        .configure_mesh()
        .x_desc("x / m")
        .y_desc("y / m")
        .disable_mesh()
        .draw()?;
    let truth = recording.truth.iter().map(|p| (p.1[0], p.1[1]));
    chart
        .draw_series(LineSeries::new(truth, BLACK.stroke_width(2)))?
        .label("truth")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], BLACK));
    for ((name, track), colour) in tracks.iter().zip([RGBColor(0, 114, 178), RGBColor(213, 94, 0)]) {
        let points = track.estimates.iter().map(|e| (e.1[0], e.1[1]));
        chart
            .draw_series(LineSeries::new(points, colour))?
            .label(*name)
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour));
    }
    let marks = recording.anchors.values().map(|a| (a.position()[0], a.position()[1]));
    chart.draw_series(marks.map(|p| TriangleMarker::new(p, 7, BLACK.filled())))?;
    chart
        .configure_series_labels()
        .background_style(WHITE)
        .border_style(BLACK)
        .draw()?;
    area.present()?;
    Ok(())
}
