//! Random models, and multi-start Nelder-Mead on them.

use super::nelder_mead::minimise;
use fewbits_core::Link;
use fewbits_monte_carlo::Stream;
use fewbits_quantizer_design::solve::{BitBudget, Request, Solution};
use fewbits_quantizer_design::{
    Channel, Criterion, Error, Labelling, Noise, ObservationModel, Prior, Quantizer, System, lloyd_max,
};
use rand::RngExt;
use std::cell::Cell;

/// A model with its task.
pub struct Task {
    pub model: ObservationModel,
    pub bits: Vec<u32>,
    pub crossover: f64,
    pub what: String,
}

/// Names of the priors.
pub const PRIORS: [&str; 5] = ["normal", "uniform", "mixture", "sample", "density"];

/// A prior of standard size times `scale`.
pub fn prior(kind: usize, scale: f64) -> Result<Prior, Error> {
    match PRIORS[kind] {
        "normal" => Prior::normal(5.0 * scale, scale),
        "uniform" => Prior::uniform(-scale, 2.5 * scale),
        "mixture" => Prior::mixture(&[(0.6, -scale, 0.4 * scale), (0.4, 1.5 * scale, 0.6 * scale)]),
        "sample" => {
            // A skewed sample.
            let quantile =
                |i: usize| scale * (0.5 * fewbits_numerics::normal::quantile((i as f64 + 0.5) / 500.0)).exp();
            Prior::sample(&(0..500).map(quantile).collect::<Vec<_>>())
        }
        _ => Prior::density(|x| (x / scale) * (-x / scale).exp(), 0.0..=12.0 * scale),
    }
}

/// Task number `i` at a scale: 2 to `max_sensors` sensors, 1 to `max_bits` bits, correlation 0 to .9, flips 0 to .2.
pub fn task(i: u64, scale: f64, max_sensors: usize, max_bits: u32) -> Result<Task, Error> {
    let mut rng = Stream::new(31).named("random-models").indexed(i).rng();
    let sensors = rng.random_range(2..=max_sensors);
    let bits: Vec<u32> = (0..sensors).map(|_| rng.random_range(1..=max_bits)).collect();
    let rho = rng.random_range(0.0..0.9);
    let crossover = rng.random_range(0.0..0.2);
    let equal = rng.random_range(0.0..1.0) < 0.5;
    let first = rng.random_range(0.2..1.0);
    let deviations: Vec<f64> = (0..sensors)
        .map(|_| scale * if equal { first } else { rng.random_range(0.2..1.0) })
        .collect();
    let kind = i as usize % PRIORS.len();
    let model = ObservationModel::new(prior(kind, scale)?, Noise::equicorrelated_with_deviations(&deviations, rho)?)?;
    let what =
        format!("{i}: {} {bits:?} bits, noise {deviations:.2?}, rho {rho:.2}, flips {crossover:.3}", PRIORS[kind]);
    Ok(Task {
        model,
        bits,
        crossover,
        what,
    })
}

impl Task {
    /// Squared error of a design on the full nodes.
    pub fn exact(&self, solution: &Solution) -> Result<f64, Error> {
        System::new(self.model.clone(), solution.system().groups().to_vec())?.value(Criterion::MeanSquaredError)
    }

    /// The design problem of the task.
    pub fn request(&self) -> Result<Request<'static>, Box<dyn std::error::Error>> {
        let (bits, link) = (BitBudget::PerSensor(self.bits.clone()), Link::flipping(self.crossover)?);
        Ok(Request::estimation(self.model.clone(), bits, link))
    }

    /// Least squared error that Nelder-Mead finds until `is_over` holds of the number of its evaluations, from Lloyd-Max cells and random
    /// ones, with Gray and natural words in turn.
    pub fn nelder_mead(&self, is_over: &dyn Fn(usize) -> bool) -> Result<f64, Error> {
        let evaluations = Cell::new(0);
        let is_over = || is_over(evaluations.get());
        let mut best = f64::INFINITY;
        for start in 0.. {
            let mut rng = Stream::new(7).named("nelder-mead").indexed(start).rng();
            let (mut quantizers, mut channels, mut at) = (Vec::new(), Vec::new(), Vec::new());
            for (n, bits) in self.bits.iter().enumerate() {
                let levels = 1usize << bits;
                let words = if start % 2 == 0 {
                    Labelling::gray(levels)?
                } else {
                    Labelling::natural(levels)?
                };
                channels.push(Channel::binary_symmetric(&words, self.crossover)?);
                let (mean, deviation) = (self.model.prior().mean(), self.model.sample_deviation(n));
                let lloyd = lloyd_max::gaussian(levels)?.affine(mean, deviation)?;
                let mut b = lloyd.breakpoints().to_vec();
                if start > 1 {
                    b.iter_mut()
                        .for_each(|b| *b += 0.3 * deviation * rng.random_range(-1.0..1.0));
                    b.sort_by(f64::total_cmp);
                }
                quantizers.push(Quantizer::new(b.clone())?);
                at.extend(b);
            }
            let system = System::distinct(self.model.clone(), quantizers, channels)?;
            let mut error = |b: &[f64]| {
                evaluations.set(evaluations.get() + 1);
                let mut rest = b;
                let own = self.bits.iter().map(|bits| {
                    let (head, tail) = rest.split_at((1 << bits) - 1);
                    rest = tail;
                    Quantizer::new(head.to_vec())
                });
                let Ok(own) = own.collect::<Result<Vec<_>, _>>() else {
                    return f64::INFINITY;
                };
                let moved = system
                    .with_quantizers(own)
                    .and_then(|s| s.value(Criterion::MeanSquaredError));
                moved.unwrap_or(f64::INFINITY)
            };
            let step = 0.15 * self.model.sample_deviation(0);
            best = best.min(minimise(&mut error, &at, step, &is_over));
            if is_over() {
                break;
            }
        }
        Ok(best)
    }
}
