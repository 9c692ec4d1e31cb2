//! What an engineer would try first, and the strong baseline.

use super::recordings::Recording;
use fewbits_adaptive::Replay;
use std::collections::BTreeMap;

/// What a scheme does with a signal.
pub(super) struct Played {
    /// Reconstructions.
    pub values: Vec<f64>,
    /// All bits.
    pub bits: f64,
    /// Slots in which something was sent.
    pub packets: usize,
}

impl From<Replay> for Played {
    fn from(replay: Replay) -> Self {
        Self {
            bits: replay.information.iter().sum(),
            packets: replay.packets,
            values: replay.values,
        }
    }
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

/// Sum in the order of NumPy: in a modulator that quantises its own output, the last bit of the first step decides everything.
fn sum(terms: &[f64]) -> f64 {
    if terms.len() > 128 {
        let half = terms.len() / 2;
        let (left, right) = terms.split_at(half - half % 8);
        return sum(left) + sum(right);
    }
    let (rows, rest) = terms.as_chunks::<8>();
    let mut r = [0.0; 8];
    for row in rows {
        r.iter_mut().zip(row).for_each(|(r, x)| *r += x);
    }
    let total = ((r[0] + r[1]) + (r[2] + r[3])) + ((r[4] + r[5]) + (r[6] + r[7]));
    rest.iter().fold(total, |total, x| total + x)
}

/// Deviation of the increments about their mean.
fn increments_deviation(samples: &[f64]) -> f64 {
    let steps: Vec<f64> = samples.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let mean = sum(&steps) / steps.len() as f64;
    let squares: Vec<f64> = steps.iter().map(|s| (s - mean) * (s - mean)).collect();
    (sum(&squares) / steps.len() as f64).sqrt()
}

fn every_slot(samples: &[f64], bits: f64, mut next: impl FnMut(f64) -> f64) -> Played {
    Played {
        values: samples.iter().map(|x| next(*x)).collect(),
        bits: bits * samples.len() as f64,
        packets: samples.len(),
    }
}

/// One bit a sample, up or down; the step grows by 1.5 where a bit repeats the last and shrinks by it elsewhere, down to `1e-6`
/// (or a thousandth of the first, if that is less).
pub(super) fn delta_modulation(samples: &[f64]) -> Played {
    let first = increments_deviation(samples);
    let least = (1e-3 * first).min(1e-6);
    let (mut step, mut value, mut last) = (first, samples[0], true);
    every_slot(samples, 1.0, |x| {
        let up = x >= value;
        step = (step * if up == last { 1.5 } else { 1.0 / 1.5 }).max(least);
        value += if up { step } else { -step };
        last = up;
        value
    })
}

/// Jayant's adaptive quantizer of the residual, 2 or 3 bits: levels `(q + 1/2) step`, and the step times a factor of `q`, down to
/// `1e-7` (or a ten-thousandth of the first, if that is less).
pub(super) fn jayant(samples: &[f64], bits: u32) -> Played {
    let factors: &[f64] = if bits == 2 { &[0.8, 1.6] } else { &[0.85, 1.0, 1.0, 1.5] };
    let first = increments_deviation(samples);
    let least = (1e-4 * first).min(1e-7);
    let (mut step, mut value) = (first, samples[0]);
    every_slot(samples, f64::from(bits), |x| {
        let residual = x - value;
        let q = ((residual.abs() / step) as usize).min(factors.len() - 1);
        if residual != 0.0 {
            value += residual.signum() * (q as f64 + 0.5) * step;
        }
        step = (step * factors[q]).max(least);
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

/// The smallest `delta` between `low` and `high`, by `steps` bisections of its logarithm, whose cost is at most `most`.
pub(super) fn delta_for(low: f64, high: f64, most: f64, steps: usize, cost: impl Fn(f64) -> f64) -> f64 {
    let (mut low, mut high) = (low, high);
    for _ in 0..steps {
        let middle = (low * high).sqrt();
        if cost(middle) <= most {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// The schemes with a `delta`, at the smallest whose cost per sample is at most `most`; its search is that of the reference.
pub(super) fn searched(
    recording: &Recording,
    most: f64,
    cost: impl Fn(&Played) -> f64,
) -> [(&'static str, f64, Played); 3] {
    let (samples, range) = (&recording.samples, recording.straight_range());
    let n = samples.len() as f64;
    let found = |scheme, low: f64, steps, play: &dyn Fn(f64) -> Played| {
        let delta = delta_for(low, range, most, steps, |d| cost(&play(d)) / n);
        (scheme, delta, play(delta))
    };
    [
        found("send-on-delta", (1e-3 * range).min(1e-6), 60, &|d| send_on_delta(samples, d)),
        found("dpcm-0", 1e-5 * range, 24, &|d| dpcm(samples, 0, d)),
        found("dpcm-1", 1e-5 * range, 24, &|d| dpcm(samples, 1, d)),
    ]
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::recordings::parse;
    use super::*;
    use serde_json::Value;

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
        assert!((delta_for(1e-5, 1.0, 0.5, 40, |d| 1.0 - d) - 0.5).abs() < 1e-9);
    }
    /// Everything as in the reference, if the recording that it was computed on is at hand.
    #[test]
    #[ignore = "set FEWBITS_RECORDING to the CSV file that the reference was computed on"]
    fn the_reference_is_reproduced() {
        let path = std::env::var("FEWBITS_RECORDING").unwrap();
        let text = std::fs::read_to_string(path).unwrap();
        let reference: Value = serde_json::from_str(include_str!("../../references/real_signals.json")).unwrap();
        let columns = reference["columns"].as_array().unwrap();
        for column in columns {
            let name = column["column"].as_str().unwrap();
            let recording = parse(&text, &[name.to_owned()]).unwrap().remove(0);
            let check = |what: &str, value: f64, expected: &Value| {
                let expected = expected.as_f64().unwrap();
                assert!((value - expected).abs() <= 1e-6 * expected, "{name} {what}: {value}, expected {expected}");
            };
            let rmse = |played: &Played| recording.rmse(&played.values);
            check("modulation", rmse(&delta_modulation(&recording.samples)), &column["adaptive_delta_modulation_1bit"]);
            check("jayant 2", rmse(&jayant(&recording.samples, 2)), &column["jayant_2bit"]);
            check("jayant 3", rmse(&jayant(&recording.samples, 3)), &column["jayant_3bit"]);
            for rate in ["0.25", "0.5", "1", "2"] {
                let [sod, zero, one] = searched(&recording, rate.parse().unwrap(), |played| played.bits);
                let dpcm = &column["deadband_dpcm"][rate];
                for ((scheme, delta, played), expected) in [
                    (sod, &column["send_on_delta_12bit_words"][rate]),
                    (zero, &dpcm["order0"]),
                    (one, &dpcm["order1"]),
                ] {
                    let what = format!("{scheme} at {rate}");
                    check(&what, rmse(&played), &expected["rmse"]);
                    check(&what, played.bits / recording.samples.len() as f64, &expected["bits_per_sample"]);
                    if expected.get("delta").is_some() {
                        check(&what, delta, &expected["delta"]);
                    }
                }
            }
        }
        assert_eq!(columns.len(), 12);
    }
}
