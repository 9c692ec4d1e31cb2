//! Our scheme over a signal, and the choice of its `delta`.

use super::baselines::Played;
use super::recordings::Recording;
use crate::{Context, Error};
use fewbits_adaptive::{Config, FixedRate, Replay, Sensor, Silence, StreamWriter, best_within};

/// Bits of the whole recording as one stream, silences told or known.
pub(super) fn stream_bits(recording: &Recording, config: Config, silence: Silence) -> Result<f64, Error> {
    let (mut sensor, mut stream) = (Sensor::new(config), StreamWriter::new(silence));
    for x in &recording.samples {
        sensor.write_after(1, *x, &mut stream)?;
    }
    Ok(32.0 * stream.finish().len() as f64)
}

/// Our scheme at a price per sample of at most `most`.
pub(super) fn best_for(
    recording: &Recording,
    most: f64,
    context: &Context<'_>,
    price: impl Fn(&Replay) -> f64,
) -> Result<(Config, Replay), Error> {
    // Any delta will do: the search chooses.
    let mut config = Config::new(1.0)?;
    if let Some(period) = recording.period {
        config = config.circular(period)?;
    }
    best_within(config, &recording.samples, most, |replay| {
        context.check()?;
        Ok(price(replay))
    })
}

/// A word of `bits` in every slot. The unit is the root mean square of the first fifty increments, as a short look at the signal
/// gives it, or a thousandth of the range if nothing moved.
pub(super) fn words(recording: &Recording, bits: u32) -> Result<Played, Error> {
    let increments = recording.samples.windows(2).take(50);
    let look = increments.map(|pair| (pair[1] - pair[0]).powi(2));
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

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::super::recordings::Source;
    use super::*;
    use fewbits_adaptive::SCALES;

    /// Mean of a number of the models' weights over the slots of a signal that are chosen, at half a bit a sample.
    fn mean(column: &str, chosen: fn(f64) -> bool, of: fn(&[f64]) -> f64) -> f64 {
        let source = Source {
            columns: vec![column.into()],
            samples: 1500,
            ..Source::default()
        };
        let recording = source.load("demo", &Context::new(1)).unwrap().remove(0);
        let (config, _) = best_for(&recording, 0.5, &Context::new(1), Replay::rate).unwrap();
        let (mut sensor, mut values) = (Sensor::new(config), Vec::new());
        for (slot, sample) in recording.samples.iter().enumerate() {
            sensor.encode(*sample).unwrap();
            let weights = sensor.model_weights();
            // Twenty-four weights in single precision.
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 2e-6);
            if slot > 300 && chosen(*sample) {
                values.push(of(&weights));
            }
        }
        values.iter().sum::<f64>() / values.len() as f64
    }

    #[test]
    fn smooth_drifts_are_given_to_the_velocities() {
        let velocities = mean("drift", |_| true, |weights| weights[SCALES..].iter().sum());
        assert!(velocities > 0.5, "{velocities}");
    }

    /// By a factor of at least four: two in the logarithm to base 2.
    #[test]
    fn gusts_raise_the_scale_over_a_calm() {
        let scale = |weights: &[f64]| {
            let all = weights.iter().enumerate();
            all.map(|(m, w)| w * (2.0 * (m % SCALES) as f64 - 6.0)).sum()
        };
        let (moving, calm) = (mean("gusts", |x| x > 0.3, scale), mean("gusts", |x| x == 0.0, scale));
        assert!(moving - calm > 2.0, "{moving} {calm}");
    }
}
