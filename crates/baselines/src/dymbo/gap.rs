//! A scalar filter and the exact posterior of the same reports, on simulated runs. The difference bounds what a better estimator gains.

use fewbits_core::{Belief, Dynamics, Factor, Gaussian, Observation, Scheme, Sensing};
use fewbits_dymbo::{Error, ScalarFilter, ScalarPlant};
use fewbits_filters::{PointMass, TransitionKernel, UniformGrid, smoother::smooth_step};
use nalgebra::Vector1;
use rand::Rng;
use std::f64::consts::FRAC_2_PI;

/// Grid spacing as a share of the smaller noise deviation.
const SPACING: f64 = 0.4;
/// Half width of the grid in standard deviations of the state.
const REACH: f64 = 8.5;

/// The exact filter of a plant, on a grid that is wide enough for runs of `steps` slots from the steady variance of one-bit filters.
///
/// # Errors
/// If the plant is unstable, or its process noise too small for a grid.
pub fn exact_filter(plant: &ScalarPlant, steps: usize) -> Result<TransitionKernel, Error> {
    let widest = super::widest_variance(plant, plant.steady_state(FRAC_2_PI)?.filtered_variance, steps)?;
    let spacing = SPACING * plant.process_variance().min(plant.measurement_variance()).sqrt();
    TransitionKernel::new(plant.dynamics(), UniformGrid::symmetric(REACH * widest.sqrt(), spacing)?)
}

/// One simulated run: the true state, the filter's belief, and the exact density given the same reports.
#[derive(Debug, Clone)]
pub struct Twin<'a, F> {
    filter: F,
    exact: &'a TransitionKernel,
    nodes: Vec<f64>,
    state: Vector1<f64>,
    belief: Gaussian<1>,
    density: PointMass,
    likelihood: Vec<f64>,
}

impl<'a, F: ScalarFilter> Twin<'a, F> {
    /// A run that starts from `N(0, V)`, `V` the filter's steady filtered variance. The state is drawn from it.
    ///
    /// # Errors
    /// If the filter has no steady state.
    pub fn new<R: Rng>(rng: &mut R, filter: F, exact: &'a TransitionKernel) -> Result<Self, Error> {
        let variance = filter.plant().steady_state(filter.information())?.filtered_variance;
        let belief = Gaussian::scalar(0.0, variance)?;
        let nodes: Vec<f64> = exact.grid().nodes().collect();
        Ok(Self {
            state: belief.sample(rng),
            density: PointMass::normal(*exact.grid(), 0.0, variance)?,
            likelihood: vec![0.0; nodes.len()],
            filter,
            exact,
            nodes,
            belief,
        })
    }

    /// One slot: moves the state, sends a report through the filter's link, and updates the filter's belief and the exact density with it.
    ///
    /// # Errors
    /// If the exact density leaves its grid.
    pub fn step<R: Rng>(&mut self, rng: &mut R) -> Result<(), Error> {
        let (plant, scheme, link) = (self.filter.plant(), self.filter.scheme(), self.filter.link());
        self.state = plant.dynamics().propagate(rng, &self.state);
        let sample = plant.sensor().sample(rng, &self.state);
        // Both receive the same observation; the threshold follows from the filter's belief alone.
        let predicted = self.filter.predict(&self.belief);
        let feedback = self.filter.feedback(&predicted);
        let report = scheme.encode(rng, &mut (), &sample, &feedback)?;
        let observation: Observation<_> = link.transmit(rng, report.as_ref(), &scheme.report_format())?;
        let factor = scheme.factor(&feedback, &observation, link)?;
        self.likelihood.fill(0.0);
        factor.add_log_likelihoods(&[&self.nodes], &mut self.likelihood);
        self.likelihood.iter_mut().for_each(|l| *l = l.exp());
        self.belief = self.filter.update(&predicted, &observation)?.0;
        self.density = self.exact.predict(&self.density)?;
        self.density.reweight(&self.likelihood)?;
        Ok(())
    }

    /// The filter's belief.
    pub fn belief(&self) -> &Gaussian<1> {
        &self.belief
    }

    /// The exact posterior.
    pub fn density(&self) -> &PointMass {
        &self.density
    }

    /// Squared difference between the filter's estimate and the exact posterior mean. Its mean is the filter's excess over the minimum
    /// mean squared error.
    pub fn excess(&self) -> f64 {
        (self.belief.mean()[0] - self.density.mean()).powi(2)
    }

    /// Mean of [`Twin::excess`] over `measured` slots, after `burn` slots that are not counted: one random estimate of the filter's
    /// steady excess.
    ///
    /// # Errors
    /// As [`Twin::step`].
    pub fn steady_excess<R: Rng>(&mut self, rng: &mut R, burn: usize, measured: usize) -> Result<f64, Error> {
        (0..burn).try_for_each(|_| self.step(rng))?;
        let mut sum = 0.0;
        for _ in 0..measured {
            self.step(rng)?;
            sum += self.excess();
        }
        Ok(sum / measured as f64)
    }

    /// Continues the run and smooths `anchors` states, `stride` slots apart, with each of the `lags` (slots). Per lag: the mean of the
    /// exact smoother's variance, and the mean squared difference between the Rauch-Tung-Striebel estimate and the exact smoothed mean.
    ///
    /// # Errors
    /// As [`Twin::step`].
    pub fn smoothed<R: Rng>(
        &mut self,
        rng: &mut R,
        lags: &[usize],
        anchors: usize,
        stride: usize,
    ) -> Result<Vec<SmoothedGap>, Error> {
        let longest = lags.iter().copied().max().unwrap_or(0);
        let mut beliefs = vec![self.belief];
        let mut densities = vec![self.density.clone()];
        let mut likelihoods = Vec::new();
        for n in 1..=anchors.saturating_sub(1) * stride + longest {
            self.step(rng)?;
            beliefs.push(self.belief);
            likelihoods.push(self.likelihood.clone());
            if n % stride == 0 && densities.len() < anchors {
                densities.push(self.density.clone());
            }
        }
        let mut gaps = vec![SmoothedGap::default(); lags.len()];
        for (i, density) in densities.iter().enumerate() {
            let then = i * stride;
            for (gap, lag) in gaps.iter_mut().zip(lags) {
                let now = then + lag;
                let mut estimate = beliefs[now];
                // Backward pass of the smoother from `now` to `then`, over the stored filter beliefs.
                for belief in beliefs[then..now].iter().rev() {
                    estimate = smooth_step(self.filter.plant().dynamics(), belief, &estimate)?;
                }
                let truth = self.exact.smooth(density, &likelihoods[then..now])?;
                gap.exact_variance += truth.variance() / anchors as f64;
                gap.excess += (truth.mean() - estimate.mean()[0]).powi(2) / anchors as f64;
            }
        }
        Ok(gaps)
    }
}

/// Averages of [`Twin::smoothed`] for one lag.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct SmoothedGap {
    /// Variance of the exact smoother: its mean squared error.
    pub exact_variance: f64,
    /// Mean squared difference of the smoothed estimates: the excess of Rauch-Tung-Striebel smoothing.
    pub excess: f64,
}

#[cfg(test)]
mod tests {
    use super::{Twin, exact_filter};
    use fewbits_core::Link;
    use fewbits_dymbo::{DymboFilter, MultibitFilter, ScalarFilter, ScalarPlant, chain};
    use fewbits_monte_carlo::{Moments, Stream};

    /// Minimum error and excess add up to the chain's error, within 4.5 standard errors over independent runs.
    fn adds_up<F: ScalarFilter + Clone>(filter: F, exact_mse: f64) {
        let exact = exact_filter(filter.plant(), 100).unwrap();
        let runs: Moments = (0..60)
            .map(|i| {
                let mut rng = Stream::new(i).rng();
                let mut twin = Twin::new(&mut rng, filter.clone(), &exact).unwrap();
                let mut sum = 0.0;
                for n in 0..60 {
                    twin.step(&mut rng).unwrap();
                    sum += if n < 20 {
                        0.0
                    } else {
                        twin.density().variance() + twin.excess()
                    };
                }
                sum / 40.0
            })
            .collect();
        let z = (runs.mean() - exact_mse) / runs.standard_error();
        assert!(z.abs() < 4.5, "{} {exact_mse} {z}", runs.mean());
    }

    #[test]
    fn minimum_and_excess_are_the_chains_error() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let flipping = Link::flipping(0.1).unwrap();
        let filter = DymboFilter::new(plant).with_link(flipping);
        adds_up(filter, chain::dymbo_mse(&filter).unwrap());
        let words = MultibitFilter::new(plant, 2).unwrap().with_link(flipping);
        let exact_mse = chain::multibit_mse(&words).unwrap();
        adds_up(words, exact_mse);
    }

    /// The averages over a run are those of the same run taken step by step.
    #[test]
    fn averages_are_of_the_steps() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let exact = exact_filter(&plant, 100).unwrap();
        let run = || {
            let mut rng = Stream::new(5).rng();
            (Twin::new(&mut rng, DymboFilter::new(plant), &exact).unwrap(), rng)
        };
        let (mut twin, mut rng) = run();
        let steps: Vec<(f64, f64)> = (0..12)
            .map(|_| {
                let now = (twin.density().variance(), twin.excess());
                twin.step(&mut rng).unwrap();
                now
            })
            .collect();
        let (mut twin, mut rng) = run();
        let gap = twin.smoothed(&mut rng, &[0], 3, 4).unwrap()[0];
        let mean = |f: fn(&(f64, f64)) -> f64| [0, 4, 8].map(|n| f(&steps[n])).iter().sum::<f64>() / 3.0;
        assert!((gap.exact_variance - mean(|s| s.0)).abs() < 1e-12 && (gap.excess - mean(|s| s.1)).abs() < 1e-12);
        let (mut twin, mut rng) = run();
        let excess = twin.steady_excess(&mut rng, 4, 5).unwrap();
        assert!((excess - steps[5..10].iter().map(|s| s.1).sum::<f64>() / 5.0).abs() < 1e-14);
    }

    #[test]
    fn smoothing_without_lag_is_filtering() {
        let plant = ScalarPlant::new(0.9, 0.5, 1.0).unwrap();
        let exact = exact_filter(&plant, 100).unwrap();
        let mut rng = Stream::new(1).rng();
        let mut twin = Twin::new(&mut rng, DymboFilter::new(plant), &exact).unwrap();
        let now = (twin.density().variance(), twin.excess());
        let gaps = twin.smoothed(&mut rng, &[0, 3], 1, 4).unwrap();
        assert!((gaps[0].exact_variance - now.0).abs() < 1e-12 && (gaps[0].excess - now.1).abs() < 1e-12);
        assert!(gaps[1].exact_variance < gaps[0].exact_variance);
    }
}
