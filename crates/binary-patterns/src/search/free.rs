//! Optimal thresholds without a grid, by Newton's method on the exact error.

use crate::{Bank, BinaryQuantizer, Error, PatternSensor, Source};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::error::{at_least_one, non_negative, refuse};
use fewbits_quantizer_design::{Criterion, Newton, Noise, ObservationModel, Prior, Quantizer, System, design};
use rand::RngExt;

/// Largest number of sensors: distinct sensors have `2^N` outcomes.
const MAX_SENSORS: usize = 16;
/// A cell narrower than this fraction of the noise has two thresholds that have met. It is removed.
const MET: f64 = 1e-2;

/// The result of [`free_breakpoints`].
#[derive(Debug, Clone, PartialEq)]
pub struct FreeDesign {
    /// The sensors with their new thresholds. If two thresholds of a sensor met, it has two fewer.
    pub sensors: Vec<PatternSensor>,
    /// Exact mean squared error of the posterior mean.
    pub mse: f64,
}

/// Moves all thresholds of all sensors to a local minimum of the posterior mean's error.
///
/// The thresholds are the breakpoints of quantizers whose levels alternate, so this is
/// [`design::improved`] for the squared error. Its derivatives are exact.
///
/// Several local minima are usual. There are `starts` runs, all but the first with every threshold moved at random by up to `jitter` (in
/// units of `V`, or of the source's standard deviation). The best run is returned, or the given sensors if no run is better.
///
/// # Errors
/// If there is no sensor or more than 16, a noise is below `1e-4` of the source's reach, `starts` is 0, or `jitter` is
/// negative or not finite.
pub fn free_breakpoints(
    source: &Source,
    sensors: &[PatternSensor],
    jitter: f64,
    starts: usize,
) -> Result<FreeDesign, Error> {
    at_least_one("sensors", sensors.len())?;
    at_least_one("starts", starts)?;
    let jitter = source.scale() * non_negative("jitter", jitter)?;
    if sensors.len() > MAX_SENSORS {
        return refuse("sensors", sensors.len(), "at most 16 sensors");
    }
    for sensor in sensors {
        // The thresholds move, so the nodes must be dense everywhere.
        source.resolvable(sensor.noise_deviation())?;
    }
    let noise: Vec<f64> = sensors.iter().map(PatternSensor::noise_deviation).collect();
    let model = ObservationModel::new(Prior::try_from(source)?, Noise::independent_with_deviations(&noise)?)?;
    let mut best = FreeDesign {
        sensors: sensors.to_vec(),
        mse: Bank::new(*source, sensors.to_vec())?.mmse()?,
    };
    let mut rng = Stream::new(0).named("free-breakpoints").rng();
    for start in 0..starts {
        let from = sensors.iter().map(|sensor| {
            let mut moved = sensor.quantizer().breakpoints().to_vec();
            if start > 0 {
                let mut offset = || jitter * (2.0 * rng.random::<f64>() - 1.0);
                moved.iter_mut().for_each(|t| *t += offset());
                moved.sort_by(f64::total_cmp);
            }
            moved
        });
        // A start in which two thresholds coincide is left out.
        let Ok(found) = settled(&model, from.collect()) else {
            continue;
        };
        let found = found.into_iter().zip(&noise);
        let found = found.map(|(thresholds, noise)| PatternSensor::with_deviation(thresholds, *noise));
        let found = found.collect::<Result<Vec<_>, _>>()?;
        let mse = Bank::new(*source, found.clone())?.mmse()?;
        if mse < best.mse {
            best = FreeDesign { sensors: found, mse };
        }
    }
    Ok(best)
}

/// The thresholds that Newton's method reaches from these, without cells whose thresholds have met.
fn settled(model: &ObservationModel, mut thresholds: Vec<Vec<f64>>) -> Result<Vec<BinaryQuantizer>, Error> {
    loop {
        let quantizers = thresholds.into_iter().map(BinaryQuantizer::new);
        let quantizers: Vec<Quantizer> = quantizers.map(|q| Ok(q?.into())).collect::<Result<_, Error>>()?;
        let system = System::ideal(model.clone(), quantizers)?;
        let found = design::improved(&system, Criterion::MeanSquaredError, &Newton::default())?;
        thresholds = found.quantizers().iter().map(|q| q.breakpoints().to_vec()).collect();
        let mut have_met = false;
        for (n, own) in thresholds.iter_mut().enumerate() {
            let least = MET * model.noise().deviation(n);
            while let Some(at) = own.windows(2).position(|w| w[1] - w[0] < least)
                && own.len() > 2
            {
                own.drain(at..at + 2);
                have_met = true;
            }
        }
        if !have_met {
            return thresholds.into_iter().map(BinaryQuantizer::new).collect();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::patterns::linear::sensors_of;
    use crate::uniform_cells;
    use approx::assert_relative_eq;

    fn sensors() -> Vec<PatternSensor> {
        [(vec![0.1], 0.3), (vec![-0.4, 0.5], 0.2), (vec![-0.7, -0.1, 0.6], 0.25)]
            .into_iter()
            .map(|(t, s)| PatternSensor::with_deviation(BinaryQuantizer::new(t).unwrap(), s).unwrap())
            .collect()
    }

    /// The printed unit dependence: .032555 at half widths up to 1e2, .036715 at 1e4, no step at all at 1e-5.
    #[test]
    fn free_breakpoints_know_no_unit() {
        let run = |v: f64| {
            let source = Source::uniform(v).unwrap();
            let grid = uniform_cells(v, 3).unwrap();
            let noise = source.noise_deviation(5.0).unwrap();
            let start = sensors_of(&[4, 4, 6], &grid, noise).unwrap();
            let found = free_breakpoints(&source, &start, 0.05, 2).unwrap();
            assert!(found.sensors.iter().any(|s| *s != start[0]));
            (found.mse / (v * v), found.sensors[2].quantizer().breakpoints()[0] / v)
        };
        let one = run(1.0);
        for v in [1e-5, 1e-4, 1e2, 1e4, 1e5] {
            let other = run(v);
            assert_relative_eq!(other.0, one.0, max_relative = 1e-9);
            assert_relative_eq!(other.1, one.1, max_relative = 1e-3);
        }
    }

    #[test]
    fn descent_never_ends_above_its_start() {
        let source = Source::gaussian_with_deviation(0.5).unwrap();
        let before = Bank::new(source, sensors()).unwrap().mmse().unwrap();
        let found = free_breakpoints(&source, &sensors(), 0.05, 2).unwrap();
        assert!(found.mse < before);
        assert!(free_breakpoints(&source, &sensors(), -1.0, 2).is_err());
        assert!(free_breakpoints(&source, &sensors(), 0.1, 0).is_err());
        assert!(free_breakpoints(&source, &[], 0.1, 1).is_err());
    }
}
