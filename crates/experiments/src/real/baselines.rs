//! What an engineer would try first, and the strong baseline.

use std::collections::BTreeMap;

/// What a scheme does with a signal.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Played {
    /// Reconstructions.
    pub values: Vec<f64>,
    /// All bits.
    pub bits: f64,
    /// Slots in which something was sent.
    pub packets: usize,
}

/// Bits of a whole word.
pub(super) const WORD: f64 = 12.0;

/// The sample itself in a word whenever it is further than `delta` from the last one sent.
pub(super) fn send_on_delta(samples: &[f64], delta: f64) -> Played {
    let mut values = Vec::with_capacity(samples.len());
    let mut packets = 0;
    for x in samples {
        let value = match values.last() {
            Some(last) if f64::abs(x - last) <= delta => *last,
            _ => {
                packets += 1;
                *x
            }
        };
        values.push(value);
    }
    Played {
        values,
        bits: WORD * packets as f64,
        packets,
    }
}

/// Deviation of the increments about their mean.
fn increments_deviation(samples: &[f64]) -> f64 {
    let steps: Vec<f64> = samples.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = steps.iter().sum::<f64>() / steps.len() as f64;
    (steps.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / steps.len() as f64).sqrt()
}

fn every_slot(samples: &[f64], bits: f64, mut next: impl FnMut(f64) -> f64) -> Played {
    Played {
        values: samples.iter().map(|x| next(*x)).collect(),
        bits: bits * samples.len() as f64,
        packets: samples.len(),
    }
}

/// One bit a sample, up or down; the step grows by 1.5 where a bit repeats the last and shrinks by it elsewhere.
pub(super) fn delta_modulation(samples: &[f64]) -> Played {
    let (mut step, mut value, mut last) = (increments_deviation(samples), samples[0], true);
    every_slot(samples, 1.0, |x| {
        let up = x >= value;
        step = if up == last { step * 1.5 } else { step / 1.5 };
        value += if up { step } else { -step };
        last = up;
        value
    })
}

/// Jayant's adaptive quantizer of the residual, 2 or 3 bits: levels `(q + 1/2) step`, and the step times a factor of `q`.
pub(super) fn jayant(samples: &[f64], bits: u32) -> Played {
    let factors: &[f64] = if bits == 2 { &[0.8, 1.6] } else { &[0.85, 1.0, 1.0, 1.5] };
    let (mut step, mut value) = (increments_deviation(samples), samples[0]);
    every_slot(samples, f64::from(bits), |x| {
        let residual = x - value;
        let q = ((residual.abs() / step) as usize).min(factors.len() - 1);
        if residual != 0.0 {
            value += residual.signum() * (q as f64 + 0.5) * step;
        }
        step *= factors[q];
        value
    })
}

/// Deadband DPCM: silent within `delta` of the prediction (the last value, or the line through the last two if `linear`), otherwise
/// the residual's index in steps of `2 delta` at the ideal length of an adaptive code; 12 bits for the first sample.
pub(super) fn dpcm(samples: &[f64], order: usize, delta: f64) -> Played {
    let mut counts: BTreeMap<i64, f64> = BTreeMap::new();
    let (mut total, mut bits, mut packets) = (0.0, WORD, 1);
    let mut values = vec![samples[0]];
    let (mut last, mut before) = (samples[0], samples[0]);
    for x in &samples[1..] {
        let prediction = if order == 0 { last } else { 2.0 * last - before };
        let residual = x - prediction;
        let mut value = prediction;
        if residual.abs() > delta {
            let k = ((residual.abs() - delta) / (2.0 * delta)).ceil().copysign(residual);
            let count = counts.entry(k as i64).or_insert(0.0);
            bits -= ((*count + 0.25 * 0.5_f64.powf(k.abs())) / (total + 0.5)).log2();
            *count += 1.0;
            total += 1.0;
            packets += 1;
            value += 2.0 * delta * k;
        }
        values.push(value);
        (before, last) = (last, value);
    }
    Played { values, bits, packets }
}

/// The smallest `delta` between `1e-5` and 1 times `range`, by `steps` bisections of its logarithm, whose cost is at most `most`.
pub(super) fn delta_for<E>(
    range: f64,
    most: f64,
    steps: usize,
    mut cost: impl FnMut(f64) -> Result<f64, E>,
) -> Result<f64, E> {
    let (mut low, mut high) = (1e-5 * range, range);
    for _ in 0..steps {
        let middle = (low * high).sqrt();
        if cost(middle)? <= most {
            high = middle;
        } else {
            low = middle;
        }
    }
    Ok(high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand.
    #[test]
    fn definitions() {
        let sod = send_on_delta(&[0.0, 1.0, 1.5, 3.0, 2.0, -5.0], 1.0);
        assert_eq!((sod.values, sod.packets, sod.bits), (vec![0.0, 0.0, 1.5, 3.0, 3.0, -5.0], 4, 48.0));
        // Increments 0, 2: deviation 1. Bits up, down, up: steps 1.5, 1, 2/3.
        let dm = delta_modulation(&[0.0, 0.0, 2.0]);
        let expected = [1.5, 0.5, 0.5 + 2.0 / 3.0 * 0.5];
        assert!((dm.values[0] - expected[0]).abs() < 1e-12 && (dm.values[1] - expected[1]).abs() < 1e-12);
        // Residuals 0, 0, 2: steps 1, .8, .64; the last is beyond the range: level 1.5.
        let jay = jayant(&[0.0, 0.0, 2.0], 2);
        assert!(jay.values[..2] == [0.0, 0.0] && (jay.values[2] - 1.5 * 0.64).abs() < 1e-12);
        // Residual 5 at delta 1: index 2; then the line goes on to 8.
        let line = dpcm(&[0.0, 5.0, 8.5], 1, 1.0);
        assert_eq!((line.values, line.packets), (vec![0.0, 4.0, 8.0], 2));
        assert!((line.bits - (12.0 - (0.0625_f64 / 0.5).log2())).abs() < 1e-12);
        assert_eq!(delta_for(1.0, 0.5, 40, |d| Ok::<_, ()>(1.0 - d)).map(|d| (d * 1e6).round()), Ok(5e5));
    }
}
