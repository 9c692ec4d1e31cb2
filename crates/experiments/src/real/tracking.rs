//! Our scheme over a signal, and the choice of its `delta`.

use super::baselines::{Played, delta_for};
use super::recordings::Recording;
use crate::{Context, Error};
use fewbits_adaptive::{Config, FixedRate, Sensor, Silence, StreamWriter};

/// Whole bits, beside the ideal ones of [`Played`].
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tracked {
    pub played: Played,
    /// Of all packets.
    pub packet_bits: f64,
    /// Largest error.
    pub worst: f64,
}

pub(super) fn config(recording: &Recording, delta: f64) -> Result<Config, Error> {
    let config = Config::new(delta)?;
    Ok(match recording.period {
        Some(period) => config.circular(period)?,
        None => config,
    })
}

/// Every sample through a sensor; the receiver holds the same value (tested in the crate).
pub(super) fn track(recording: &Recording, delta: f64) -> Result<Tracked, Error> {
    let mut sensor = Sensor::new(config(recording, delta)?);
    let mut played = Played {
        values: Vec::with_capacity(recording.samples.len()),
        bits: 0.0,
        packets: 0,
    };
    let (mut packet_bits, mut worst) = (0.0, 0.0_f64);
    for x in &recording.samples {
        if let Some(report) = sensor.encode(*x)? {
            played.bits += report.information;
            played.packets += 1;
            packet_bits += report.packet.bits() as f64;
        }
        let value = sensor.reconstruction().unwrap_or(f64::NAN);
        let error = (value - x).abs();
        worst = worst.max(recording.period.map_or(error, |p| error.min((p - error).abs())));
        played.values.push(value);
    }
    Ok(Tracked {
        played,
        packet_bits,
        worst,
    })
}

/// Bits of the whole recording as one stream, silences told or known.
pub(super) fn stream_bits(recording: &Recording, delta: f64, silence: Silence) -> Result<f64, Error> {
    let (mut sensor, mut stream) = (Sensor::new(config(recording, delta)?), StreamWriter::new(silence));
    for x in &recording.samples {
        sensor.write_after(1, *x, &mut stream)?;
    }
    Ok(32.0 * stream.finish().len() as f64)
}

/// Our scheme at a cost of at most `most`: a bisection finds about where, and the best of seventeen `delta` around it, and of half of the
/// recording's own resolution, is kept, since the cost is no smooth function of `delta` where a signal is quantised.
pub(super) fn best_within(
    recording: &Recording,
    most: f64,
    context: &Context<'_>,
    cost: impl Fn(&Tracked) -> f64,
) -> Result<(f64, Tracked), Error> {
    let n = recording.samples.len() as f64;
    let run = |delta: f64| -> Result<Tracked, Error> {
        context.check()?;
        track(recording, delta)
    };
    let centre = delta_for(recording.range(), most, 12, |d| Ok::<_, Error>(cost(&run(d)?) / n))?;
    let mut best = (centre, run(centre)?);
    let mut error = recording.rmse(&best.1.played.values);
    let around = (-8..=8).map(|i| centre * (f64::from(i) * 0.035).exp());
    for delta in around.chain(half_resolution(&recording.samples)) {
        let tracked = run(delta)?;
        let here = recording.rmse(&tracked.played.values);
        if cost(&tracked) / n <= most && here < error {
            (best, error) = ((delta, tracked), here);
        }
    }
    Ok(best)
}

/// Half of the unit of the last decimal that the samples are written with: at this `delta` a recording is kept as it is.
fn half_resolution(samples: &[f64]) -> Option<f64> {
    let tens = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];
    let written = |ten: &f64| samples.iter().all(|x| (x * ten).round() / ten == *x);
    tens.into_iter().find(written).map(|ten| 0.5 / ten)
}

/// A word of `bits` in every slot. The unit is the root mean square of the first fifty increments, as a short look at the signal
/// gives it, or a thousandth of the range if nothing moved.
pub(super) fn words(recording: &Recording, bits: u32) -> Result<Played, Error> {
    let look = recording
        .samples
        .windows(2)
        .take(50)
        .map(|pair| (pair[1] - pair[0]).powi(2));
    let unit = (look.sum::<f64>() / 50.0).sqrt().max(1e-3 * recording.range());
    let mut scheme = FixedRate::new(bits, unit, recording.samples.first().copied().unwrap_or(0.0))?;
    let mut values = Vec::with_capacity(recording.samples.len());
    for x in &recording.samples {
        scheme.encode(*x)?;
        values.push(scheme.estimate());
    }
    Ok(Played {
        packets: values.len(),
        bits: f64::from(bits) * values.len() as f64,
        values,
    })
}
