//! What the tables of this system share: scenes, starting quantizers and rows of designs.

use crate::prelude::*;
use fewbits_quantizer_design::design::{self, Design};
use fewbits_quantizer_design::{
    Channel, Criterion, Labelling, Newton, Noise, ObservationModel, Prior, Quantizer, System, lloyd_max,
};

pub(super) const MI: Criterion = Criterion::MutualInformation;
pub(super) const MSE: Criterion = Criterion::MeanSquaredError;

/// Name of a criterion in the tables.
pub(super) fn name(criterion: Criterion) -> &'static str {
    match criterion {
        Criterion::MutualInformation => "mi",
        Criterion::MeanSquaredError => "mse",
        Criterion::BayesError => "pe",
    }
}

/// A standard normal unknown in noise of these standard deviations and this common correlation.
pub(super) fn scene(sds: &[f64], rho: f64) -> Result<ObservationModel, Error> {
    Ok(ObservationModel::new(
        Prior::gaussian_with_deviation(1.0)?,
        Noise::equicorrelated_with_deviations(sds, rho)?,
    )?)
}

/// The Lloyd-Max quantizer of a normal variable of standard deviation `sd`.
pub(super) fn lloyd(levels: usize, sd: f64) -> Result<Quantizer, Error> {
    Ok(Quantizer::from(&lloyd_max::gaussian(levels)?.affine(0.0, sd)?))
}

/// A Lloyd-Max quantizer at every sensor, scaled as `sd` says.
pub(super) fn lloyd_system(
    scene: &ObservationModel,
    levels: usize,
    sd: impl Fn(usize) -> f64,
) -> Result<System, Error> {
    let quantizers = (0..scene.sensors())
        .map(|n| lloyd(levels, sd(n)))
        .collect::<Result<_, _>>()?;
    Ok(System::ideal(scene.clone(), quantizers)?)
}

/// How many of so many random starts about a system end at the best design's value.
pub(super) fn arrived(about: &System, criterion: Criterion, starts: usize, best: &Design) -> usize {
    let reached = |start: &&System| {
        design::joint(start, criterion, &Newton::default()).is_ok_and(|d| (d.value - best.value).abs() < 1e-10)
    };
    design::random_starts(about, starts, 1).iter().filter(reached).count()
}

/// The odd quantizer with these positive breakpoints and one at zero.
pub(super) fn odd(positive: &[f64]) -> Result<Quantizer, Error> {
    let mirrored = positive.iter().rev().map(|b| -b);
    Ok(Quantizer::new(mirrored.chain([0.0]).chain(positive.iter().copied()).collect())?)
}

/// The binary symmetric channel of these words.
pub(super) fn bsc(words: &[u32], crossover: f64) -> Result<Channel, Error> {
    Ok(Channel::binary_symmetric_with_gaps(&Labelling::new(words.to_vec())?, crossover)?)
}

/// Breakpoints as text, ten decimals.
pub(super) fn breakpoints(quantizer: &Quantizer) -> String {
    // Zero has a sign, and an optimum at zero a rounding error.
    let rounded = |b: &f64| format!("{:.10}", if b.abs() < 5e-11 { 0.0 } else { *b });
    joined(quantizer.breakpoints().iter().map(rounded), " ")
}

rows! {
    /// A design of two sensors.
    #[derive(Debug, Clone)]
    pub(super) struct Pair {
        pub(super) gamma1: String => "Breakpoints of sensor 1.",
        pub(super) gamma2: String => "Breakpoints of sensor 2.",
        pub(super) outer1: f64 => "Largest breakpoint of sensor 1.",
        pub(super) outer2: f64 => "Largest breakpoint of sensor 2.",
        pub(super) mi_nats: f64 ["nat"] => "Mutual information between the unknown and all symbols.",
        pub(super) mi_bits: f64 ["bit"] => "The same in bits.",
        pub(super) mse: f64 => "Mean squared error of the posterior mean, in prior variances.",
        /// Largest eigenvalue of the criterion's Hessian where it was a joint design.
        pub(super) curvature: Option<f64>,
    }
}

impl Pair {
    /// The first and the last sensor of a system.
    pub(super) fn of(system: &System) -> Result<Self, Error> {
        let quantizers = system.quantizers();
        let (first, last) = (&quantizers[0], &quantizers[quantizers.len() - 1]);
        let outer = |q: &Quantizer| q.breakpoints().last().copied().unwrap_or_default();
        let mi_nats = system.value(MI)?;
        Ok(Self {
            gamma1: breakpoints(first),
            gamma2: breakpoints(last),
            outer1: outer(first),
            outer2: outer(last),
            mi_nats,
            mi_bits: mi_nats / std::f64::consts::LN_2,
            mse: system.value(MSE)?,
            curvature: None,
        })
    }

    /// As [`Pair::of`], with the curvature of a joint design.
    pub(super) fn joint(design: &Design) -> Result<Self, Error> {
        Ok(Self {
            curvature: Some(design.largest_curvature),
            ..Self::of(&design.system)?
        })
    }
}
