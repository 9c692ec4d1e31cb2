//! A filter beside the exact posterior of the same bits, on simulated runs.

use fewbits_core::{Dynamics, Encoder, Gaussian, Observation, Sensing};
use fewbits_dymbo::{DymboFilter, Error, MultibitFilter, OneBitSensor, ScalarPlant};
use fewbits_filters::{Grid, PointMass, PointMassFilter};
use fewbits_monte_carlo::{Moments, MonteCarlo, MonteCarloError};
use fewbits_numerics::normal;
use nalgebra::Vector1;
use rand::{Rng, RngExt};
use std::f64::consts::FRAC_2_PI;

/// What the sensors send.
#[derive(Debug, Clone, Copy)]
pub(super) enum Scheme {
    /// A sign bit through a link of known crossover.
    Bit { crossover: f64 },
    /// A word of this many bits.
    Word { bits: usize },
}

/// Steps before the exact posterior has forgotten that it started normal.
pub(super) const BURN: usize = 40;
/// Steps that are measured afterwards.
pub(super) const MEASURED: usize = 60;
/// Grid spacing as a share of the smaller noise deviation.
const SPACING: f64 = 0.4;
/// Deviations that the grid covers.
const REACH: f64 = 8.5;

/// One run: the state, the filter's belief and the exact density.
pub(super) struct Twin<'a, R> {
    plant: &'a ScalarPlant,
    scheme: Hearing,
    pub(super) exact: &'a PointMassFilter,
    rng: R,
    pub(super) state: f64,
    pub(super) belief: Gaussian<1>,
    pub(super) density: PointMass,
    spare: PointMass,
    /// Likelihood of the last message at the nodes.
    pub(super) likelihood: Vec<f64>,
}

enum Hearing {
    Bit(DymboFilter, f64),
    Word(MultibitFilter),
}

/// The exact filter on a grid wide enough for runs of `steps` from the steady variance.
pub(super) fn exact_filter(plant: &ScalarPlant, steps: usize) -> Result<PointMassFilter, Error> {
    let start = plant.steady_state(FRAC_2_PI)?.filtered_variance;
    let mut variance = start;
    let mut widest = start;
    for _ in 0..steps {
        variance = plant.dynamics().predict_variance(variance);
        widest = widest.max(variance);
    }
    let spacing = SPACING * plant.process_variance().min(plant.measurement_variance()).sqrt();
    Ok(PointMassFilter::new(plant.dynamics(), Grid::symmetric(REACH * widest.sqrt(), spacing)?)?)
}

impl<'a, R: Rng> Twin<'a, R> {
    /// A run that starts from a normal belief of the steady variance.
    pub(super) fn new(
        plant: &'a ScalarPlant,
        scheme: &Scheme,
        exact: &'a PointMassFilter,
        mut rng: R,
    ) -> Result<Self, Error> {
        let scheme = match *scheme {
            Scheme::Bit { crossover } => Hearing::Bit(DymboFilter::new(*plant).with_crossover(crossover)?, crossover),
            Scheme::Word { bits } => Hearing::Word(MultibitFilter::new(*plant, bits)?),
        };
        let information = match &scheme {
            Hearing::Bit(filter, _) => filter.information(),
            Hearing::Word(filter) => filter.information(),
        };
        let variance = plant.steady_state(information)?.filtered_variance;
        let belief = Gaussian::scalar(0.0, variance)?;
        let density = PointMass::normal(*exact.grid(), 0.0, variance)?;
        Ok(Self {
            plant,
            scheme,
            exact,
            state: belief.sample(&mut rng)?[0],
            rng,
            belief,
            spare: density.clone(),
            density,
            likelihood: vec![0.0; exact.grid().points()],
        })
    }

    /// Moves the state, sends a message, and lets both hear it.
    pub(super) fn step(&mut self) -> Result<(), Error> {
        self.state = self
            .plant
            .dynamics()
            .propagate(&mut self.rng, &Vector1::new(self.state))[0];
        let sample = self.plant.sensor().sample(&mut self.rng, &Vector1::new(self.state))[0];
        let sigma = self.plant.measurement_variance().sqrt();
        let nodes = self.exact.grid().nodes().zip(&mut self.likelihood);
        match &self.scheme {
            Hearing::Bit(filter, crossover) => {
                let threshold = filter.threshold(&self.belief);
                let sent = OneBitSensor.encode(&sample, &threshold);
                let inverted = *crossover > 0.0 && self.rng.random_bool(*crossover);
                let heard = if inverted { sent.flipped() } else { sent };
                for (x, l) in nodes {
                    *l = crossover + (1.0 - 2.0 * crossover) * normal::cdf(heard.value() * (x - threshold) / sigma);
                }
                self.belief = filter.step(&self.belief, Observation::Received(heard))?.0;
            }
            Hearing::Word(filter) => {
                let prediction = filter.broadcast(&self.belief);
                let word = filter.sensor().encode(&sample, &prediction);
                let cell = filter.sensor().cell(word, &prediction)?;
                for (x, l) in nodes {
                    *l = normal::interval((cell.lower() - x) / sigma, (cell.upper() - x) / sigma);
                }
                self.belief = filter.step(&self.belief, Observation::Received(word))?.0;
            }
        }
        self.exact.predict_into(&self.density, &mut self.spare)?;
        std::mem::swap(&mut self.density, &mut self.spare);
        self.density.reweight(&self.likelihood)?;
        Ok(())
    }

    /// Squared distance of the filter's estimate from the exact posterior mean.
    pub(super) fn excess(&self) -> f64 {
        (self.belief.mean()[0] - self.density.mean()).powi(2)
    }
}

/// Steady mean squared distance of a filter's estimate from the exact posterior mean, one value a run.
pub(super) fn gap_to_exact(
    plant: &ScalarPlant,
    scheme: &Scheme,
    run: &MonteCarlo<'_>,
) -> Result<Moments, MonteCarloError<Error>> {
    let failed = |source| MonteCarloError::Trial {
        index: 0,
        stream: run.trial(0).stream,
        source,
    };
    let exact = exact_filter(plant, BURN + MEASURED).map_err(failed)?;
    run.fold(
        Moments::default,
        |moments, trial| {
            let mut twin = Twin::new(plant, scheme, &exact, trial.stream.fast_rng())?;
            let mut sum = 0.0;
            for n in 0..BURN + MEASURED {
                twin.step()?;
                if n >= BURN {
                    sum += twin.excess();
                }
            }
            moments.add(sum / MEASURED as f64);
            Ok(())
        },
        |total, part| total.merge(&part),
    )
}
