//! A simulated process, one bit per sensor and slot, and the Kalman filter beside it.

use crate::text;
use fewbits_core::{Gaussian, Link, Observation, Sign};
use fewbits_dymbo::{DymboFilter, ScalarFilter, ScalarPlant, chain};
use fewbits_monte_carlo::Stream;
use rand::RngExt;
use rand_distr::StandardNormal;
use wasm_bindgen::prelude::wasm_bindgen;

/// Largest number of slots and of sensors that a run takes.
const MAX_SLOTS: usize = 10_000;
const MAX_SENSORS: usize = 64;

/// One run.
#[wasm_bindgen(getter_with_clone)]
pub struct Run {
    /// The process, one number per slot.
    pub truth: Vec<f64>,
    /// Estimates from bits, and their standard deviations.
    pub mean: Vec<f64>,
    pub deviation: Vec<f64>,
    /// Estimates of the Kalman filter, which receives every sample.
    pub kalman: Vec<f64>,
    /// The prediction that the first sensor was sent.
    pub threshold: Vec<f64>,
    /// One entry per slot and sensor: 1 or -1; 0 if the bit was lost.
    pub bits: Vec<i8>,
    /// Mean squared errors in this run.
    pub mse: f64,
    pub kalman_mse: f64,
    /// Mean squared errors in the long run; NaN where no closed form is known.
    pub exact: f64,
    pub exact_kalman: f64,
}

/// Simulates `sensors` sensors over `slots` slots. The noise variance is one, the process variance `ratio`, the prior that of the process
/// (variance one if it has no stationary one).
#[wasm_bindgen]
pub fn one_bit(
    memory: f64,
    ratio: f64,
    flips: f64,
    loss: f64,
    sensors: usize,
    slots: usize,
    seed: u64,
) -> Result<Run, String> {
    if !(1..=MAX_SLOTS).contains(&slots) || !(1..=MAX_SENSORS).contains(&sensors) {
        return Err(format!("expected 1 to {MAX_SLOTS} slots and 1 to {MAX_SENSORS} sensors"));
    }
    simulated(memory, ratio, Link::new(loss, flips).map_err(text)?, sensors, slots, seed).map_err(text)
}

fn simulated(
    memory: f64,
    ratio: f64,
    link: Link,
    sensors: usize,
    slots: usize,
    seed: u64,
) -> Result<Run, fewbits_dymbo::Error> {
    let plant = ScalarPlant::new(memory, ratio, 1.0)?;
    let filter = DymboFilter::new(plant).with_link(link);
    let variance = if memory.abs() < 1.0 {
        ratio / (1.0 - memory * memory)
    } else {
        1.0
    };
    let prior = Gaussian::scalar(0.0, variance)?;
    let mut rng = Stream::new(seed).rng();
    let mut run = Run {
        truth: Vec::with_capacity(slots),
        mean: Vec::with_capacity(slots),
        deviation: Vec::with_capacity(slots),
        kalman: Vec::with_capacity(slots),
        threshold: Vec::with_capacity(slots),
        bits: Vec::with_capacity(slots * sensors),
        mse: 0.0,
        kalman_mse: 0.0,
        exact: exact(&filter, &link, sensors),
        exact_kalman: exact_kalman(memory, ratio, sensors),
    };
    let (mut belief, mut kalman) = (prior, (0.0, variance));
    let mut state = variance.sqrt() * normal(&mut rng);
    for _ in 0..slots {
        state = memory * state + ratio.sqrt() * normal(&mut rng);
        belief = filter.predict(&belief);
        kalman = (memory * kalman.0, memory * memory * kalman.1 + ratio);
        run.threshold.push(filter.feedback(&belief));
        for _ in 0..sensors {
            let sample = state + normal(&mut rng);
            let gain = kalman.1 / (kalman.1 + 1.0);
            kalman = (kalman.0 + gain * (sample - kalman.0), (1.0 - gain) * kalman.1);
            let sent = Sign::of(sample, filter.feedback(&belief))?;
            let flipped = rng.random::<f64>() < link.crossover();
            let observation = if rng.random::<f64>() < link.loss() {
                run.bits.push(0);
                Observation::Nothing
            } else {
                let bit = if flipped { sent.flipped() } else { sent };
                run.bits.push(bit.value() as i8);
                Observation::Received(bit)
            };
            belief = filter.update(&belief, &observation)?.0;
        }
        run.truth.push(state);
        run.mean.push(belief.mean()[0]);
        run.deviation.push(belief.covariance()[0].sqrt());
        run.kalman.push(kalman.0);
        run.mse += (state - belief.mean()[0]).powi(2) / slots as f64;
        run.kalman_mse += (state - kalman.0).powi(2) / slots as f64;
    }
    Ok(run)
}

fn normal(rng: &mut impl rand::Rng) -> f64 {
    rng.sample(StandardNormal)
}

/// Exact mean squared error in the long run, where it is known: one sensor whose bits all arrive, or up to 12 over a perfect link.
fn exact(filter: &DymboFilter, link: &Link, sensors: usize) -> f64 {
    let found = match sensors {
        1 if link.loss() == 0.0 => chain::crossover_mse(filter, link),
        2..=12 if *link == Link::PERFECT => chain::sequential_mse(filter.plant(), sensors),
        _ => return f64::NAN,
    };
    found.unwrap_or(f64::NAN)
}

/// Mean squared error in the long run of the Kalman filter with all samples: one sensor of the mean's variance.
fn exact_kalman(memory: f64, ratio: f64, sensors: usize) -> f64 {
    ScalarPlant::new(memory, ratio, 1.0 / sensors as f64)
        .and_then(|plant| plant.steady_state(1.0))
        .map_or(f64::NAN, |steady| steady.filtered_variance)
}
