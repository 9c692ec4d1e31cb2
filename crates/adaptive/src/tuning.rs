//! Replay of a recording, and the choice of `delta` for it.

use crate::{Config, Error, Sensor};
use fewbits_numerics::ArgumentError;

/// Result of the replay of a recording.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub struct Replay {
    /// Reconstruction of each sample.
    pub values: Vec<f64>,
    /// Reconstruction minus sample for each sample, around the circle if there is one.
    pub errors: Vec<f64>,
    /// Ideal code length of each slot in bits.
    pub information: Vec<f64>,
    /// Total bits of all packets.
    pub packet_bits: usize,
    /// Number of packets.
    pub packets: usize,
}

impl Replay {
    /// Root mean square error.
    fn rms_error(&self) -> f64 {
        let worst = self.worst_error();
        if worst == 0.0 {
            return 0.0;
        }
        // Errors are divided by the largest one, so that no square overflows.
        let squares: f64 = self.errors.iter().map(|e| (e / worst).powi(2)).sum();
        worst * (squares / self.errors.len() as f64).sqrt()
    }

    /// Largest error in size.
    pub fn worst_error(&self) -> f64 {
        self.errors.iter().fold(0.0, |worst, e| worst.max(e.abs()))
    }

    /// Ideal bits per sample, averaged over the recording.
    pub fn rate(&self) -> f64 {
        self.information.iter().sum::<f64>() / self.information.len().max(1) as f64
    }
}

/// Runs a new sensor over a recording.
///
/// # Errors
/// If a sample is not finite.
pub fn replay(config: Config, samples: &[f64]) -> Result<Replay, Error> {
    let mut sensor = Sensor::new(config);
    let mut replay = Replay::default();
    for sample in samples {
        let report = sensor.encode(*sample)?;
        replay.information.push(report.map_or(0.0, |report| report.information));
        replay.packet_bits += report.map_or(0, |report| report.packet.bits());
        replay.packets += usize::from(report.is_some());
        let value = sensor.reconstruction().unwrap_or(*sample);
        let straight = value - sample;
        let error = config
            .period()
            .map_or(straight, |period| straight - period * (straight / period).round());
        replay.values.push(value);
        replay.errors.push(error);
    }
    Ok(replay)
}

/// Number of bisections of the logarithm of `delta`.
const BISECTIONS: usize = 12;
/// Further values on each side, so far apart on a logarithmic scale: about where the price is met, then about the best.
const AROUND: [(i32, f64); 2] = [(24, 0.012), (8, 0.001)];

/// The configuration of least error among those that cost at most `most`, and its replay.
///
/// A bisection of the logarithm of `delta` finds approximately where the price meets `most`. Of values near it, and of those that fit the
/// steps of the instrument ([`own_steps`]), the best is kept, because neither price nor error is a smooth function of `delta` if the signal
/// is quantised. If nothing meets `most`, `delta` is the range of the samples; if they are constant, it is that of `config`.
///
/// # Errors
/// If a sample is not finite, the range of the samples overflows, or `price` fails.
pub fn best_within<E: From<Error>>(
    config: Config,
    samples: &[f64],
    most: f64,
    mut price: impl FnMut(&Replay) -> Result<f64, E>,
) -> Result<(Config, Replay), E> {
    let ends = samples
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let range = config.period().unwrap_or(ends.1 - ends.0);
    if range == f64::INFINITY {
        return Err(Error::from(ArgumentError::new("samples", range, "a finite range")).into());
    }
    let (mut low, mut high) = (1e-5 * range, range);
    if samples.is_empty() || range == 0.0 || low == 0.0 {
        return Ok((config, replay(config, samples)?));
    }
    let with = |delta: f64| config.with_delta(delta).map_err(|error| E::from(error.into()));
    for _ in 0..BISECTIONS {
        // The geometric mean; roots first, so that no product overflows.
        let middle = low.sqrt() * high.sqrt();
        if price(&replay(with(middle)?, samples)?)? <= most {
            high = middle;
        } else {
            low = middle;
        }
    }
    let first = with(high)?;
    let mut best = (first, replay(first, samples)?);
    let mut candidates: Vec<Config> = Vec::new();
    for step in own_steps(samples) {
        candidates.push(with(0.5 * step)?.made_exact());
        // Multiples of the step, a little above: their cells stay aligned with the instrument's.
        let middle = (2.0 * high / step).round();
        let multiples = (-3..=3).map(|i| middle + f64::from(i)).chain([1.0]);
        for multiple in multiples.filter(|m| *m >= 1.0) {
            candidates.push(with(0.5 * step * multiple * (1.0 + 2.0 * f64::EPSILON.sqrt()))?);
        }
    }
    for (count, apart) in AROUND {
        let centre = best.0.delta();
        for i in (-count..=count).filter(|i| *i != 0) {
            candidates.extend(config.with_delta(centre * (f64::from(i) * apart).exp()).ok());
        }
        for candidate in candidates.drain(..) {
            let replay = replay(candidate, samples)?;
            if price(&replay)? <= most && replay.rms_error() < best.1.rms_error() {
                best = (candidate, replay);
            }
        }
    }
    Ok(best)
}

/// Largest root mean square distance from a multiple of a step, in steps: evenly spread samples have 0.29.
const COHERENT: f64 = 0.1;

/// Steps that a recording may have been quantised with: sizes of frequent increments, refined by a line through all samples that
/// are near a multiple, and kept if the samples are. Usually the instrument's resolution, if it is coarser than its noise or its
/// last decimal; none for continuous signals.
///
/// ```
/// let samples: Vec<f64> = (0..500).map(|n| (100.0 * (0.03 * f64::from(n)).sin()).round() / 16.0).collect();
/// assert_eq!(fewbits_adaptive::own_steps(&samples), [0.0625]);
/// ```
pub fn own_steps(samples: &[f64]) -> Vec<f64> {
    let mut increments: Vec<f64> = samples.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    increments.retain(|d| *d > 0.0 && d.is_finite());
    increments.sort_by(f64::total_cmp);
    // Sums of decimal numbers differ in their last bits.
    let mut groups: Vec<(usize, f64)> = Vec::new();
    for d in increments {
        match groups.last_mut() {
            Some((count, first)) if d <= *first * (1.0 + 1e-9) => *count += 1,
            _ => groups.push((1, d)),
        }
    }
    let smallest = groups.first().map(|group| group.1);
    groups.sort_by(|a, b| b.0.cmp(&a.0).then(a.1.total_cmp(&b.1)));
    let frequent = groups.iter().filter(|group| group.0 > 1).map(|group| group.1).take(3);
    let mut steps: Vec<f64> = smallest
        .into_iter()
        .chain(frequent)
        .filter_map(|seed| refined(samples, seed))
        .collect();
    steps.sort_by(f64::total_cmp);
    steps.dedup_by(|a, b| *a <= *b * (1.0 + 1e-9));
    steps
}

fn refined(samples: &[f64], seed: f64) -> Option<f64> {
    let origin = *samples.first()?;
    let mut step = seed;
    // From near to far, so that the error of the step never grows to a step.
    for power in 2..40 {
        let reach = 2.0_f64.powi(power) * step;
        let near = || samples.iter().map(|x| x - origin).filter(|y| y.abs() <= reach);
        let (mut n, mut k1, mut k2, mut y1, mut ky) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for y in near() {
            let k = (y / step).round();
            (n, k1, k2, y1, ky) = (n + 1.0, k1 + k, k2 + k * k, y1 + y, ky + k * y);
        }
        // The slope of the regression line of the samples on their multiples.
        let spread = n * k2 - k1 * k1;
        if spread > 0.0 {
            step = (n * ky - k1 * y1) / spread;
        }
        if !(step > 0.5 * seed && step < 2.0 * seed) {
            return None;
        }
        if n >= samples.len() as f64 {
            break;
        }
    }
    // A short decimal, if it is one.
    let written = fewbits_node::adaptive::TENS
        .iter()
        .map(|ten| (step * ten).round() / ten);
    let step = written
        .into_iter()
        .find(|w| (w - step).abs() <= 1e-7 * step)
        .unwrap_or(step);
    let off = |x: &f64| ((x - origin) / step - ((x - origin) / step).round()).powi(2);
    let mean = samples.iter().map(off).sum::<f64>() / samples.len() as f64;
    (mean.sqrt() <= COHERENT).then_some(step)
}
