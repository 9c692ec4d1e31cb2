//! What the tables of this system share: scenes, starting quantizers, rows of designs and their panel.

use crate::prelude::*;
use fewbits_baselines::quantizer_design::random_starts;
use fewbits_quantizer_design::design::{self, Design};
use fewbits_quantizer_design::{
    Channel, Criterion, Error as Refused, Labelling, Newton, Noise, ObservationModel, Prior, Quantizer, System,
    lloyd_max,
};

pub(super) const MI: Criterion = Criterion::MutualInformation;
pub(super) const MSE: Criterion = Criterion::MeanSquaredError;

/// A standard normal unknown in noise of these standard deviations and this common correlation.
pub(super) fn scene(sds: &[f64], rho: f64) -> Result<ObservationModel, Refused> {
    ObservationModel::new(Prior::normal(0.0, 1.0)?, Noise::equicorrelated_with_deviations(sds, rho)?)
}

/// A Lloyd-Max quantizer of a normal variable at every sensor, its standard deviation as `sd` says.
pub(super) fn lloyd_system(
    scene: &ObservationModel,
    levels: usize,
    sd: impl Fn(usize) -> f64,
) -> Result<System, Error> {
    let unit = lloyd_max::gaussian(levels)?;
    let scaled = |n| Ok(Quantizer::from(&unit.affine(0.0, sd(n))?));
    Ok(System::ideal(scene.clone(), (0..scene.sensors()).map(scaled).collect::<Result<_, Error>>()?)?)
}

/// How many of so many random starts about a system end at the best design's value.
pub(super) fn arrived(about: &System, criterion: Criterion, starts: usize, best: &Design) -> usize {
    let reached = |start: &&System| {
        design::joint(start, criterion, &Newton::default()).is_ok_and(|d| (d.value - best.value).abs() < 1e-10)
    };
    random_starts(about, starts, 1).iter().filter(reached).count()
}

/// Sensors with the odd quantizers of these positive breakpoints and one at zero.
pub(super) fn odd(start: &System, positive: [&[f64]; 2]) -> Result<System, Error> {
    let quantizer = |positive: &[f64]| {
        let mirrored = positive.iter().rev().map(|b| -b);
        Quantizer::new(mirrored.chain([0.0]).chain(positive.iter().copied()).collect())
    };
    Ok(start.with_quantizers(vec![quantizer(positive[0])?, quantizer(positive[1])?])?)
}

/// The binary symmetric channel of these words at both sensors.
pub(super) fn over_bsc(system: &System, words: &[u32], crossover: f64) -> Result<System, Error> {
    let channel = Channel::binary_symmetric(&Labelling::new(words.to_vec())?, crossover)?;
    Ok(system.with_channels(vec![channel; 2])?)
}

/// The largest breakpoint of a sensor.
pub(super) fn outer(system: &System, sensor: usize) -> f64 {
    let own = system.quantizers()[sensor].breakpoints().last().copied();
    own.unwrap_or_default()
}

rows! {
    /// A design of two sensors.
    pub(super) struct Pair {
        pub(super) gamma1: String => "Breakpoints of sensor 1.",
        pub(super) gamma2: String => "Breakpoints of sensor 2.",
        pub(super) outer1: f64 => "Largest breakpoint of sensor 1.",
        pub(super) outer2: f64 => "Largest breakpoint of sensor 2.",
        pub(super) mi_nats: f64 ["nat"] => "Mutual information between the unknown and all symbols.",
        pub(super) mi_bits: f64 ["bit"] => "The same in bits.",
        pub(super) mse: f64 as points("exact") => "Mean squared error of the posterior mean, in prior variances.",
        /// Largest eigenvalue of the criterion's Hessian where it was a joint design.
        pub(super) curvature: Option<f64>,
        pub(super) printed_mse: Option<f64> as points("printed") => "The publication's squared error.",
    }
}

impl Pair {
    /// The design of a system.
    pub(super) fn of(system: &System) -> Result<Self, Error> {
        // Zero has a sign, and an optimum at zero a rounding error.
        let rounded = |b: &f64| format!("{:.10}", if b.abs() < 5e-11 { 0.0 } else { *b });
        let breakpoints = |sensor: usize| joined(system.quantizers()[sensor].breakpoints().iter().map(rounded), " ");
        let mi_nats = system.value(MI)?;
        Ok(Self {
            gamma1: breakpoints(0),
            gamma2: breakpoints(1),
            outer1: outer(system, 0),
            outer2: outer(system, 1),
            mi_nats,
            mi_bits: mi_nats / std::f64::consts::LN_2,
            mse: system.value(MSE)?,
            curvature: None,
            printed_mse: None,
        })
    }

    /// A joint design, with its curvature.
    pub(super) fn joint(design: &Design) -> Result<Self, Error> {
        let curvature = Some(design.largest_curvature);
        let pair = Self::of(&design.system)?;
        Ok(Self { curvature, ..pair })
    }

    /// With the error that the publication prints for it.
    pub(super) fn beside(self, printed_mse: Option<f64>) -> Self {
        Self { printed_mse, ..self }
    }
}
