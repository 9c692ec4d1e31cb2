//! A two-dimensional state watched by one or three one-bit sensors.

use crate::prelude::*;
use fewbits_core::factor::InCell;
use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observation, Observed, Sensing, Sign};
use fewbits_dymbo::SignFilter;
use fewbits_filters::{CloudWorkspace, GaussianCloud, RaoBlackwellised, SteadyState, steady_state};
use fewbits_models::{LinearGaussian, LinearSensor, ScalarSensor};
use nalgebra::{Matrix2, SMatrix, Vector2};
use std::f64::consts::FRAC_1_SQRT_2;

const ID: &str = "dymbo-vector";

parameters! {
    pub struct Parameters {
        transition: Vec<f64> [-10.0..=10.0; 4..=4] = vec![0.95, 0.25, -0.1, 0.9] => "Transition matrix, row by row; stable.",
        process_variance: f64 [1e-6..=1e6] = 0.3 => "Variance of the process noise of each coordinate.",
        measurement_variance: f64 [1e-6..=1e6] = 1.0 => "Variance of the measurement noise.",
        steps: usize [1..=10_000] = 40 => quick 10 => "Steps of a run that are measured.",
        trials: u64 [2..=1_000_000] = 60 => quick 4 => "Simulated runs.",
    }
    check |p| accept("transition", stable(&p.transition), || "not a stable matrix".to_owned());
}

fn stable(transition: &[f64]) -> bool {
    let matrix = Matrix2::from_row_slice(transition.get(..4).unwrap_or(&[0.0; 4]));
    LinearGaussian::with_covariance(matrix, Matrix2::identity())
        .and_then(|dynamics| dynamics.stationary_covariance())
        .is_ok()
}

/// Steps before the exact posterior has forgotten that it started normal.
const BURN: usize = 15;

impl Parameters {
    fn dynamics(&self) -> Result<LinearGaussian<2, 2>, Error> {
        let noise = Matrix2::identity() * self.process_variance;
        Ok(LinearGaussian::with_covariance(Matrix2::from_row_slice(&self.transition), noise)?)
    }

    fn sensor(&self, direction: [f64; 2]) -> Result<ScalarSensor<2>, Error> {
        Ok(ScalarSensor::scalar(Vector2::from(direction), self.measurement_variance)?)
    }

    fn one(&self) -> Result<Filter<1>, Error> {
        Ok(SignFilter::new(self.dynamics()?, [self.sensor([1.0, 0.0])?]))
    }

    fn three(&self) -> Result<Filter<3>, Error> {
        let oblique = [FRAC_1_SQRT_2, FRAC_1_SQRT_2];
        let sensors = [
            self.sensor([1.0, 0.0])?,
            self.sensor([0.0, 1.0])?,
            self.sensor(oblique)?,
        ];
        Ok(SignFilter::new(self.dynamics()?, sensors))
    }
}

type Filter<const M: usize> = SignFilter<LinearGaussian<2, 2>, 2, M>;

/// When the sensors answer.
#[derive(Clone, Copy, PartialEq)]
enum Order {
    InTurn,
    AtOnce,
}

impl Order {
    fn steady<const M: usize>(self, filter: &Filter<M>) -> Result<SteadyState<2>, fewbits_dymbo::Error> {
        match self {
            Self::InTurn => filter.sequential_steady_state(),
            Self::AtOnce => filter.parallel_steady_state(),
        }
    }
}

/// Steady covariance of the Kalman filter of the same sensors, unquantized.
fn kalman<const M: usize>(filter: &Filter<M>) -> Result<Matrix2<f64>, Error> {
    let rows = filter.sensors().map(|sensor| sensor.direction());
    let matrix = SMatrix::<f64, M, 2>::from_fn(|i, j| rows[i][j]);
    let noise = SMatrix::<f64, M, M>::from_diagonal_element(filter.sensors()[0].noise_variance());
    let sensing = LinearSensor::new(matrix, noise)?;
    Ok(steady_state(filter.dynamics(), &sensing)?.filtered_covariance)
}

/// What one run adds up, averaged over its steps.
#[derive(Default, Clone, Copy)]
struct RunMeans {
    trace: f64,
    excess: f64,
    nees: f64,
}

fn one_run<const M: usize>(
    filter: &Filter<M>,
    order: Order,
    steps: usize,
    stream: Stream,
) -> Result<RunMeans, fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let mut belief = Gaussian::from_trusted_parts(Vector2::zeros(), order.steady(filter)?.filtered_covariance);
    // Two clouds that draw independently: the product of their distances from the filter's mean has no share of their own noise.
    let start = GaussianCloud::agreed(&belief, CLOUD).map_err(fewbits_filters::Error::from)?;
    let mut clouds = [start.clone(), start];
    let (exact, mut workspace) = (RaoBlackwellised::default(), CloudWorkspace::default());
    let mut state = belief.sample(&mut rng);
    let mut means = RunMeans::default();
    for n in 0..BURN + steps {
        state = filter.dynamics().propagate(&mut rng, &state);
        belief = filter.predict(&belief);
        for cloud in &mut clouds {
            exact.predict(&mut rng, filter.dynamics(), cloud, &mut workspace)?;
        }
        let mut observations = [Observation::Received(Sign::Above); M];
        let ahead = belief;
        for (i, sensor) in filter.sensors().iter().enumerate() {
            let sample = sensor.sample(&mut rng, &state)[0];
            let threshold = filter.threshold(if order == Order::InTurn { &belief } else { &ahead }, i)?;
            let bit = Sign::of(sample, threshold)?;
            observations[i] = Observation::Received(bit);
            let factor = InCell::sign(bit, threshold, sensor.noise_variance(), &Link::PERFECT)?;
            for cloud in &mut clouds {
                exact.update(&mut rng, cloud, &Observed::new(*sensor, factor), &mut workspace)?;
            }
            if order == Order::InTurn {
                belief = filter.update(&belief, i, &observations[i])?.0;
            }
        }
        if order == Order::AtOnce {
            belief = filter.update_parallel(&ahead, &observations)?.0;
        }
        if n >= BURN {
            let [one, other] = clouds.each_ref().map(|cloud| belief.mean() - Belief::mean(cloud));
            let covariance = (clouds[0].covariance() + clouds[1].covariance()) * 0.5;
            let share = 1.0 / steps as f64;
            means.trace += share * covariance.trace();
            means.excess += share * one.dot(&other);
            // The mean over the truth given the bits of the normalised error, free of the noise of one truth.
            let spread = covariance + one * other.transpose();
            let factor = belief.cholesky()?;
            means.nees += share * 0.5 * factor.solve(&spread).trace();
        }
    }
    Ok(means)
}

rows! {
    pub struct Row by "{scheme}" {
        scheme: &'static str => "Number of sensors and when they answer.",
        p11: f64 ["unit^2"] => "Computed steady variance of the first coordinate.",
        p12: f64 ["unit^2"] => "Computed steady covariance.",
        p22: f64 ["unit^2"] => "Computed steady variance of the second coordinate.",
        trace: f64 ["unit^2"] => "Computed steady trace.",
        kalman_trace: f64 ["unit^2"] => "Steady trace of the Kalman filter of the same sensors, unquantized.",
        trials: u64 => "Simulated runs.",
        mmse_trace: Measured ["unit^2"] => "Exact minimum given the bits.",
        excess: Measured ["unit^2"] => "Mean squared distance from the exact mean.",
        nees: Measured => "Normalised error over the dimension.",
    }
}

impl Row {
    fn of<const M: usize>(
        scheme: &'static str,
        filter: &Filter<M>,
        order: Order,
        p: &Parameters,
        context: &Context<'_>,
    ) -> Result<Self, Error> {
        let stream = context.stream(ID).named(scheme);
        let sums = context.tally(
            stream,
            p.trials,
            || [Moments::default(); 3],
            |sums, trial| {
                let run = one_run(filter, order, p.steps, trial.stream)?;
                sums[0].add(run.trace);
                sums[1].add(run.excess);
                sums[2].add(run.nees);
                Ok::<_, fewbits_dymbo::Error>(())
            },
        )?;
        let steady = order.steady(filter)?.filtered_covariance;
        Ok(Self {
            scheme,
            p11: steady[(0, 0)],
            p12: steady[(0, 1)],
            p22: steady[(1, 1)],
            trace: steady.trace(),
            kalman_trace: kalman(filter)?.trace(),
            trials: p.trials,
            mmse_trace: Measured::mean(&sums[0]),
            excess: Measured::mean(&sums[1]),
            nees: Measured::mean(&sums[2]),
        })
    }
}

/// Particles of each Rao-Blackwellised filter that gives the exact mean and covariance: its own share of the error is about 1e-4.
const CLOUD: usize = 4000;

/// Traces of three arrangements of sensors.
pub struct VectorState;

impl Figure for VectorState {
    figure!(Parameters => Vec<Row>, ID, "A two-dimensional state", "",
        "Trace of the error covariance of a rotating two-dimensional state with one sensor or three: computed by the \
         sign-bit filter (circles), exact minimum given its bits by Rao-Blackwellised particles (crosses), and the Kalman \
         filter of the unquantized samples (squares). The sign-bit filter is within 0.06 % of the exact minimum.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        Ok(vec![
            Row::of("one sensor", &p.one()?, Order::InTurn, p, context)?,
            Row::of("three in turn", &p.three()?, Order::InTurn, p, context)?,
            Row::of("three at once", &p.three()?, Order::AtOnce, p, context)?,
        ])
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        claims.keyed("trace", "computed steady trace", rows, |r| r.trace);
        claims.keyed("kalman", "trace of the Kalman filter", rows, |r| r.kalman_trace);
        claims.keyed("mmse", "exact minimum given the bits", rows, |r| r.mmse_trace);
        claims.keyed("excess", "excess of the sign-bit filter", rows, |r| r.excess);
        let what = "the excess in percent of the minimum";
        claims.keyed("percent", what, rows, |r| r.excess.scaled(100.0 / r.mmse_trace.value));
        claims.keyed("nees", "normalised error", rows, |r| r.nees);
        let of = |scheme: &str| rows.iter().find(|r| r.scheme == scheme).map(|r| r.trace);
        let what = "three sensors in turn are better than three at once";
        claims.increasing("turns", what, [of("three in turn"), of("three at once")]);
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        let names = rows.iter().map(|r| r.scheme.to_owned());
        let x = Axis::categories("", names);
        let marks = |of: fn(&Row) -> f64, shift: f64| {
            rows.iter()
                .enumerate()
                .map(|(i, r)| (i as f64 + shift, of(r)))
                .collect()
        };
        let exact =
            Layer::measured("exact minimum given the bits", rows.iter().enumerate(), |(i, r)| (i as f64, r.mmse_trace));
        let y = Axis::linear("trace of the covariance").between(0.0, 2.2);
        Plot::of(
            Panel::new("Steady error of a two-dimensional state", x, y)
                .with(Layer::points("sign bits, computed", marks(|r| r.trace, -0.12)).coloured(0))
                .with(exact.styled(1, Marker::Cross))
                .with(Layer::points("Kalman, unquantized", marks(|r| r.kalman_trace, 0.12)).styled(2, Marker::Square)),
        )
    }
}
