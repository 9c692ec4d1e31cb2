//! A two-dimensional state watched by one or three one-bit sensors.

use super::common::{LONGEST_RUN, bad};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_core::{Dynamics, Encoder, Gaussian, Sensing, Sign};
use fewbits_dymbo::OneBitSensor;
use fewbits_dymbo::vector::SignFilter;
use fewbits_filters::{PlaneFilter, SteadyState, steady_state};
use fewbits_models::{LinearGaussian, LinearSensor, ScalarSensor};
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_numerics::normal;
use nalgebra::{Matrix2, SMatrix, Vector2};
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_1_SQRT_2;

const ID: &str = "dymbo-vector";

/// The system and the effort.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    /// Transition matrix, row by row.
    transition: Vec<f64>,
    process_variance: f64,
    measurement_variance: f64,
    steps: usize,
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            transition: vec![0.95, 0.25, -0.1, 0.9],
            process_variance: 0.3,
            measurement_variance: 1.0,
            steps: 40,
            trials: 60,
        }
    }
}

/// Steps before the exact posterior has forgotten that it started normal.
const BURN: usize = 15;

impl Parameters {
    fn dynamics(&self) -> Result<LinearGaussian<2, 2>, Error> {
        let noise = Matrix2::identity() * self.process_variance;
        LinearGaussian::with_covariance(Matrix2::from_row_slice(&self.transition), noise).map_err(Error::failed)
    }

    fn sensor(&self, direction: [f64; 2]) -> Result<ScalarSensor<2>, Error> {
        ScalarSensor::scalar(Vector2::from(direction), self.measurement_variance).map_err(Error::failed)
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

/// Steady covariance of the Kalman filter that hears the same sensors unquantized.
fn kalman<const M: usize>(filter: &Filter<M>) -> Result<Matrix2<f64>, Error> {
    let rows = filter.sensors().map(|sensor| sensor.direction());
    let matrix = SMatrix::<f64, M, 2>::from_fn(|i, j| rows[i][j]);
    let noise = SMatrix::<f64, M, M>::from_diagonal_element(filter.sensors()[0].noise_variance());
    let sensing = LinearSensor::new(matrix, noise).map_err(Error::failed)?;
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
    exact: &PlaneFilter,
    steps: usize,
    stream: Stream,
) -> Result<RunMeans, fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let mut belief = Gaussian::from_trusted_parts(Vector2::zeros(), order.steady(filter)?.filtered_covariance);
    let mut density = exact.normal(belief.mean(), belief.covariance())?;
    let mut state = belief.sample(&mut rng)?;
    let mut means = RunMeans::default();
    for n in 0..BURN + steps {
        state = filter.dynamics().propagate(&mut rng, &state);
        belief = filter.predict(&belief);
        density = exact.predict(&density)?;
        let mut bits = [Sign::Above; M];
        let mut thresholds = [0.0; M];
        let ahead = belief;
        for i in 0..M {
            let sample = filter.sensors()[i].sample(&mut rng, &state)[0];
            thresholds[i] = filter.threshold(if order == Order::InTurn { &belief } else { &ahead }, i);
            bits[i] = OneBitSensor.encode(&sample, &thresholds[i]);
            if order == Order::InTurn {
                belief = filter.update(&belief, i, bits[i]);
            }
        }
        if order == Order::AtOnce {
            belief = filter.update_parallel(&ahead, &bits)?;
        }
        exact.update(&mut density, |x| {
            (0..M)
                .map(|i| {
                    let sensor = &filter.sensors()[i];
                    let margin = sensor.direction().dot(x) - thresholds[i];
                    normal::log_cdf(bits[i].value() * margin / sensor.noise_variance().sqrt())
                })
                .sum()
        })?;
        if n >= BURN {
            let (mean, covariance) = exact.moments(&density);
            let share = 1.0 / steps as f64;
            means.trace += share * covariance.trace();
            means.excess += share * (belief.mean() - mean).norm_squared();
            // The mean over the truth given the bits of the normalised error, free of the noise of one truth.
            let offset = belief.mean() - mean;
            let spread = covariance + offset * offset.transpose();
            let factor = belief.cholesky()?;
            means.nees += share * 0.5 * factor.solve(&spread).trace();
        }
    }
    Ok(means)
}

pub(super) struct VectorState;

impl Figure for VectorState {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "A two-dimensional state",
            caption: "Trace of the error covariance of a rotating two-dimensional state with one sensor or three: computed by the \
                      sign-bit filter (circles), exact minimum given its bits by a filter on a lattice (crosses), and the Kalman \
                      filter of the unquantized samples (squares). The sign-bit filter is within 0.06 % of the exact minimum.",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        if p.transition.len() != 4 {
            return Err(bad(ID, "transition", format!("{} numbers", p.transition.len()), "four numbers, row by row"));
        }
        if !(1..=LONGEST_RUN).contains(&p.steps) {
            return Err(bad(ID, "steps", p.steps, "a number from 1 to 10000"));
        }
        if p.process_variance <= 0.0 {
            return Err(bad(ID, "process_variance", p.process_variance, "a number above 0"));
        }
        if p.measurement_variance <= 0.0 {
            return Err(bad(ID, "measurement_variance", p.measurement_variance, "a number above 0"));
        }
        p.dynamics()?
            .stationary_covariance()
            .map(drop)
            .map_err(|error| bad(ID, "transition", error, "a stable matrix"))
    }

    fn quicken(&self, p: &mut Parameters) {
        (p.trials, p.steps) = (4, 10);
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("scheme", "", "number of sensors and when they answer"),
            column("p11", "unit^2", "computed steady variance of the first coordinate"),
            column("p12", "unit^2", "computed steady covariance"),
            column("p22", "unit^2", "computed steady variance of the second coordinate"),
            column("trace", "unit^2", "computed steady trace"),
            column("kalman_trace", "unit^2", "steady trace of the Kalman filter of the same sensors, unquantized"),
            column("trials", "", "simulated runs"),
            column("mmse_trace", "unit^2", "exact minimum given the bits"),
            column("mmse_se", "unit^2", "its standard error"),
            column("excess", "unit^2", "mean squared distance from the exact mean"),
            column("excess_se", "unit^2", "its standard error"),
            column("nees", "", "normalised error over the dimension"),
            column("nees_se", "", "its standard error"),
        ]);
        push(&mut table, "one sensor", &p.one()?, Order::InTurn, p, context)?;
        push(&mut table, "three in turn", &p.three()?, Order::InTurn, p, context)?;
        push(&mut table, "three at once", &p.three()?, Order::AtOnce, p, context)?;
        Ok(table.into())
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        // Trace, Kalman trace, exact trace and excess with the standard errors of an independent simulation, percent.
        let expected = [
            ("one sensor", 1.92105845, 1.54257728, (1.924357, 1.7e-3), (8.317e-4, 8.4e-5), 0.04, 1.002),
            ("three in turn", 0.92193228, 0.63263829, (0.923286, 6e-4), (2.737e-4, 1.8e-5), 0.03, 1.002),
            ("three at once", 0.93247696, 0.63263829, (0.934968, 1.1e-3), (5.925e-4, 3.5e-5), 0.06, 1.003),
        ];
        for (scheme, trace, kalman, exact, excess, percent, nees) in expected {
            let rows = tables.main.only("scheme", scheme)?;
            let entry =
                |name: &str| -> Result<f64, Error> { Ok(rows.numbers(name)?.first().copied().unwrap_or(f64::NAN)) };
            let id = scheme.replace(' ', "-");
            let mut near = |what: &str, statement: String, value: f64, expected: f64, tolerance: f64| {
                claims.push(Claim::near(format!("{id}-{what}"), statement, value, expected, tolerance).at_defaults());
            };
            near("trace", format!("{scheme}: computed steady trace"), entry("trace")?, trace, 1e-8);
            near("kalman", format!("{scheme}: trace of the Kalman filter"), entry("kalman_trace")?, kalman, 1e-8);
            let tolerance = |se: f64, reference: f64| 4.5 * se.hypot(reference);
            near(
                "mmse",
                format!("{scheme}: exact minimum given the bits"),
                entry("mmse_trace")?,
                exact.0,
                tolerance(entry("mmse_se")?, exact.1),
            );
            near(
                "excess",
                format!("{scheme}: excess of the sign-bit filter"),
                entry("excess")?,
                excess.0,
                tolerance(entry("excess_se")?, excess.1),
            );
            let share = 100.0 * entry("excess")? / entry("mmse_trace")?;
            let slack = 450.0 * entry("excess_se")? / entry("mmse_trace")? + 0.006;
            near("percent", format!("{scheme}: the excess in percent"), share, percent, slack);
            near(
                "nees",
                format!("{scheme}: normalised error"),
                entry("nees")?,
                nees,
                4.5 * entry("nees_se")?.hypot(2e-3),
            );
        }
        let traces = tables.main.numbers("trace")?;
        claims.push(Claim::below("turns", "three sensors in turn are better than three at once", traces[1], traces[2]));
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let names = tables
            .main
            .texts("scheme")?
            .into_iter()
            .enumerate()
            .map(|(i, name)| (i as f64, name));
        let x = Axis::linear("").named(names).between(-0.6, 2.6);
        let at = |name: &str, shift: f64| -> Result<Vec<(f64, f64)>, Error> {
            Ok(tables
                .main
                .numbers(name)?
                .into_iter()
                .enumerate()
                .map(|(i, v)| (i as f64 + shift, v))
                .collect())
        };
        Ok(Plot::of(
            Panel::new(
                "Steady error of a two-dimensional state",
                x,
                Axis::linear("trace of the covariance").between(0.0, 2.2),
            )
            .with(Layer::points("sign bits, computed", at("trace", -0.12)?).coloured(0))
            .with(
                Layer::points("exact minimum given the bits", at("mmse_trace", 0.0)?)
                    .with_errors(tables.main.numbers("mmse_se")?)
                    .coloured(1)
                    .marked(Marker::Cross),
            )
            .with(
                Layer::points("Kalman, unquantized", at("kalman_trace", 0.12)?)
                    .coloured(2)
                    .marked(Marker::Square),
            )
            .legend(Legend::TopRight),
        ))
    }
}

fn push<const M: usize>(
    table: &mut Table,
    scheme: &'static str,
    filter: &Filter<M>,
    order: Order,
    p: &Parameters,
    context: &Context<'_>,
) -> Result<(), Error> {
    let exact = PlaneFilter::new(filter.dynamics(), SPACING)?;
    let run = context.monte_carlo(context.stream(ID).named(scheme), p.trials);
    let runs = run.run(|trial| one_run(filter, order, &exact, p.steps, trial.stream))?;
    let over = |pick: fn(&RunMeans) -> f64| runs.iter().map(pick).collect::<Moments>();
    let (trace, excess, nees) = (over(|r| r.trace), over(|r| r.excess), over(|r| r.nees));
    let steady = order.steady(filter)?.filtered_covariance;
    table.push(row![
        scheme,
        steady[(0, 0)],
        steady[(0, 1)],
        steady[(1, 1)],
        steady.trace(),
        kalman(filter)?.trace(),
        p.trials,
        trace.mean(),
        trace.standard_error(),
        excess.mean(),
        excess.standard_error(),
        nees.mean(),
        nees.standard_error(),
    ])
}

/// Lattice spacing of the exact filter in process-noise deviations.
const SPACING: f64 = 0.75;
