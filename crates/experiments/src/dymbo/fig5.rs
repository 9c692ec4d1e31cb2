//! Convergence from the first message: simulated, exact and predicted.

use super::common::{LONGEST_RUN, bad, dymbo_steady, kalman_variance, nearest, not_empty, stationary_plant};
use crate::legacy::claim::largest;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_core::{Dynamics, Encoder, Gaussian, Observation, Sensing};
use fewbits_dymbo::chain::first_message_transient;
use fewbits_dymbo::{DymboFilter, FineSensor, Initialisation, OneBitSensor, ScalarPlant, first_message_value};
use fewbits_filters::kalman;
use fewbits_monte_carlo::{Moments, Stream};
use nalgebra::Vector1;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

const ID: &str = "dymbo-fig5";

/// The plants, the resolution of the first message in noise deviations, and the effort.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: f64,
    gamma: Vec<f64>,
    tau: f64,
    steps: usize,
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: 0.9,
            gamma: vec![0.5, 0.05],
            tau: 1.0,
            steps: 50,
            trials: 100_000,
        }
    }
}

pub(super) struct Convergence;

/// Sums over trials, one entry a step.
#[derive(Clone)]
struct Sums {
    kalman: Vec<Moments>,
    dymbo: Vec<Moments>,
    informed: Vec<Moments>,
    informed_nees: Vec<Moments>,
}

impl Sums {
    fn new(steps: usize) -> Self {
        let empty = || vec![Moments::default(); steps + 1];
        Self {
            kalman: empty(),
            dymbo: empty(),
            informed: empty(),
            informed_nees: empty(),
        }
    }

    fn merge(&mut self, other: &Self) {
        let both = [
            (&mut self.kalman, &other.kalman),
            (&mut self.dymbo, &other.dymbo),
            (&mut self.informed, &other.informed),
            (&mut self.informed_nees, &other.informed_nees),
        ];
        for (mine, theirs) in both {
            mine.iter_mut().zip(theirs).for_each(|(m, t)| m.merge(t));
        }
    }
}

/// Truth and the three estimates at one step.
struct Step {
    truth: f64,
    kalman: Gaussian<1>,
    dymbo: Gaussian<1>,
    informed: Gaussian<1>,
    bit: Option<f64>,
}

/// One run: the Kalman filter and the sign-bit filter from the same first sample without prior, and the sign-bit filter that
/// uses the stationary prior.
fn simulate(
    plant: &ScalarPlant,
    prior: &Gaussian<1>,
    p: &Parameters,
    stream: Stream,
    mut see: impl FnMut(usize, &Step),
) -> Result<(), fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let sensor = FineSensor::new(p.tau)?;
    let mut state = prior.sample(&mut rng)?;
    let sample = plant.sensor().sample(&mut rng, &state)[0];
    let message = sensor.encode(&sample, &());
    let mut step = Step {
        truth: state[0],
        kalman: Gaussian::scalar(sample, plant.measurement_variance())?,
        dymbo: filter.init(&Initialisation::Fine { sensor, message })?,
        informed: filter.init(&Initialisation::FineWithPrior {
            sensor,
            message,
            prior: *prior,
        })?,
        bit: None,
    };
    see(0, &step);
    for n in 1..=p.steps {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let hear = |belief: &Gaussian<1>| OneBitSensor.encode(&sample, &filter.threshold(belief));
        let bit = hear(&step.dymbo);
        step = Step {
            truth: state[0],
            kalman: kalman::step(plant.dynamics(), plant.sensor(), &step.kalman, &Vector1::new(sample))?.0,
            dymbo: filter.step(&step.dymbo, Observation::Received(bit))?.0,
            informed: filter
                .step(&step.informed, Observation::Received(hear(&step.informed)))?
                .0,
            bit: Some(bit.value()),
        };
        see(n, &step);
    }
    Ok(())
}

impl Figure for Convergence {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Convergence after a fine first message",
            caption: "Mean squared error of the Kalman filter and of the sign-bit filter, simulated (points, one standard error) and \
                      exact (lines); the third curve starts from first message and stationary prior together. The level differs \
                      by the loss, the convergence by a step or two (E12); for the slow plant the first message without the \
                      prior is worse than the prior alone (E13).",
            source: "Ribeiro and Giannakis, Fig. 5",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "gamma", &p.gamma)?;
        FineSensor::new(p.tau)?;
        if p.steps > LONGEST_RUN {
            return Err(bad(ID, "steps", p.steps, "at most 10000"));
        }
        p.gamma
            .iter()
            .try_for_each(|gamma| stationary_plant(ID, p.a, *gamma).map(drop))
    }

    fn quicken(&self, p: &mut Parameters) {
        p.trials = 5_000;
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("gamma", "", "process variance over measurement variance"),
            column("n", "", "step"),
            column("trials", "", "simulated runs"),
            column("kf_pred", "sigma^2", "variance computed by the Kalman filter, which is exact"),
            column("kf_mse", "sigma^2", "mean squared error of the Kalman filter"),
            column("kf_se", "sigma^2", "its standard error"),
            column("dymbo_pred", "sigma^2", "variance computed by the sign-bit filter"),
            column("dymbo_mse", "sigma^2", "mean squared error of the sign-bit filter"),
            column("dymbo_se", "sigma^2", "its standard error"),
            column("dymbo_exact", "sigma^2", "exact mean squared error, by the error chain"),
            column("dymbo_minf", "sigma^2", "steady variance of the sign-bit filter"),
            column("kf_minf", "sigma^2", "steady variance of the Kalman filter"),
            column("nees", "", "squared error over computed variance, sign-bit filter"),
            column("nees_se", "", "its standard error"),
            column("informed_mse", "sigma^2", "mean squared error when the stationary prior is used at n = 0"),
            column("informed_se", "sigma^2", "its standard error"),
            column("informed_nees", "", "its squared error over computed variance"),
            column("informed_nees_se", "", "standard error of that"),
        ]);
        let mut path = Table::new([
            column("gamma", "", "process variance over measurement variance"),
            column("n", "", "step"),
            column("theta", "sigma", "state"),
            column("kf", "sigma", "estimate of the Kalman filter"),
            column("dymbo", "sigma", "estimate of the sign-bit filter"),
            column("bit", "", "bit heard"),
        ]);
        for &gamma in &p.gamma {
            let (plant, variance) = stationary_plant(ID, p.a, gamma)?;
            let prior = Gaussian::scalar(0.0, variance)?;
            let run = context.monte_carlo(context.stream(ID).named(&format!("{gamma}")), p.trials);
            let sums = run.fold(
                || Sums::new(p.steps),
                |sums, trial| {
                    simulate(&plant, &prior, p, trial.stream, |n, step| {
                        let squared = |belief: &Gaussian<1>| (belief.mean()[0] - step.truth).powi(2);
                        sums.kalman[n].add(squared(&step.kalman));
                        sums.dymbo[n].add(squared(&step.dymbo));
                        sums.informed[n].add(squared(&step.informed));
                        sums.informed_nees[n].add(squared(&step.informed) / step.informed.covariance()[0]);
                    })
                },
                |total, part| total.merge(&part),
            )?;
            let transient = first_message_transient(&plant, p.tau, 1.0 + p.tau * p.tau / 12.0, p.steps)?;
            let (dymbo_limit, kalman_limit) = (dymbo_steady(&plant)?.filtered_variance, kalman_variance(&plant)?);
            let mut kalman_variance = 1.0;
            for (n, exact) in transient.iter().enumerate() {
                if n > 0 {
                    kalman_variance = plant.filtered_variance(plant.dynamics().predict_variance(kalman_variance), 1.0);
                }
                let m = exact.filtered_variance;
                let (kf, dymbo, informed) = (sums.kalman[n], sums.dymbo[n], sums.informed[n]);
                table.push(row![
                    gamma,
                    n,
                    p.trials,
                    kalman_variance,
                    kf.mean(),
                    kf.standard_error(),
                    m,
                    dymbo.mean(),
                    dymbo.standard_error(),
                    exact.mse,
                    dymbo_limit,
                    kalman_limit,
                    dymbo.mean() / m,
                    dymbo.standard_error() / m,
                    informed.mean(),
                    informed.standard_error(),
                    sums.informed_nees[n].mean(),
                    sums.informed_nees[n].standard_error(),
                ])?;
            }
            run.single(0, |trial| {
                let mut rows = Vec::new();
                simulate(&plant, &prior, p, trial.stream, |n, step| {
                    rows.push(row![
                        gamma,
                        n,
                        step.truth,
                        step.kalman.mean()[0],
                        step.dymbo.mean()[0],
                        step.bit
                    ]);
                })?;
                Ok::<_, fewbits_dymbo::Error>(rows)
            })?
            .into_iter()
            .try_for_each(|row| path.push(row))?;
        }
        Ok(Tables::from(table).with("path", path))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?;
            let worst = |value: &str, error: &str, truth: &[f64]| -> Result<f64, Error> {
                let (values, errors) = (rows.numbers(value)?, rows.numbers(error)?);
                let z = values
                    .iter()
                    .zip(&errors)
                    .zip(truth)
                    .map(|((v, e), t)| ((v - t) / e).abs());
                Ok(largest(z))
            };
            let (exact, pred) = (rows.numbers("dymbo_exact")?, rows.numbers("dymbo_pred")?);
            let kalman = rows.numbers("kf_pred")?;
            let mut z_claim = |id: &str, what: &str, z: f64| {
                let statement = format!("gamma = {gamma}: {what}, worst step in standard errors");
                claims.push(Claim::below(format!("{id}-{gamma}"), statement, z, 4.5));
            };
            z_claim(
                "dymbo-exact",
                "simulated sign-bit error against the error chain",
                worst("dymbo_mse", "dymbo_se", &exact)?,
            );
            z_claim("kf-exact", "simulated Kalman error against its variance", worst("kf_mse", "kf_se", &kalman)?);
            z_claim(
                "informed-consistent",
                "normalised error of the prior-aware start against 1.002",
                worst("informed_nees", "informed_nees_se", &vec![1.002; exact.len()])? - 1.0,
            );
            let nees: Vec<f64> = exact.iter().zip(&pred).map(|(e, m)| e / m).collect();
            let outside = nees.iter().filter(|n| !(0.9995..=1.0030).contains(*n)).count();
            let statement = format!("gamma = {gamma}: exact normalised error within [0.9995, 1.0030] at every step");
            claims.push(Claim::never(format!("consistent-{gamma}"), statement, outside).at_defaults());
            let late: Vec<f64> = rows.numbers("dymbo_mse")?.split_off(30.min(p.steps));
            let average = late.iter().sum::<f64>() / late.len() as f64;
            let limit = rows.numbers("dymbo_minf")?[0];
            let statement =
                format!("gamma = {gamma}: simulated error over n >= 30 is the predicted steady variance within 2 %");
            claims.push(Claim::near_relative(format!("steady-{gamma}"), statement, average, limit, 0.02).at_defaults());
        }
        claims.extend(number_claims(tables)?);
        claims.extend(start_claims()?);
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?;
            let title = format!("a = {}, gamma = {gamma}", p.a);
            let points = |value: &str, error: &str| -> Result<Layer, Error> {
                let label = match value {
                    "kf_mse" => "Kalman, simulated",
                    "dymbo_mse" => "sign bit, simulated",
                    _ => "sign bit with prior, simulated",
                };
                Ok(Layer::points(label, rows.points("n", value)?).with_errors(rows.numbers(error)?))
            };
            panels.push(
                Panel::new(title, Axis::linear("step n"), Axis::log("mean squared error / sigma^2"))
                    .with(Layer::line("Kalman, exact", rows.points("n", "kf_pred")?).coloured(0))
                    .with(points("kf_mse", "kf_se")?.coloured(0).marked(Marker::Square))
                    .with(Layer::line("sign bit, exact", rows.points("n", "dymbo_exact")?).coloured(1))
                    .with(points("dymbo_mse", "dymbo_se")?.coloured(1))
                    .with(
                        points("informed_mse", "informed_se")?
                            .coloured(2)
                            .marked(Marker::Triangle),
                    )
                    .with(Layer::dashed("sign bit, steady", rows.points("n", "dymbo_minf")?).coloured(3)),
            );
        }
        for &gamma in &p.gamma {
            let rows = tables.named("path")?.only("gamma", gamma)?;
            panels.push(
                Panel::new(format!("One run, gamma = {gamma}"), Axis::linear("step n"), Axis::linear("state / sigma"))
                    .with(Layer::line("state", rows.points("n", "theta")?).coloured(4))
                    .with(Layer::dashed("Kalman", rows.points("n", "kf")?).coloured(0))
                    .with(Layer::line("sign bit", rows.points("n", "dymbo")?).coloured(1))
                    .legend(Legend::TopRight),
            );
        }
        Ok(Plot::grid(p.gamma.len().min(2), panels))
    }
}

/// The printed and recomputed numbers at the default plants.
fn number_claims(tables: &Tables) -> Result<Vec<Claim>, Error> {
    let mut claims = Vec::new();
    let expected = [
        (
            0.5,
            [1.083333, 0.869244, 0.786614, 0.753234, 0.739463, 0.733723, 0.731316],
            [1.0, 0.567100, 0.489627, 0.472740, 0.468910],
            [0.768, 0.745, 0.735, 0.730],
            (3, 2),
            (1.6066, 1.604),
        ),
        (
            0.05,
            [1.083333, 0.643182, 0.439305, 0.331496, 0.269643, 0.232307, 0.209032],
            [1.0, 0.462366, 0.298007, 0.225638, 0.188817],
            [0.2117, 0.1964, 0.1856, 0.1790],
            (10, 8),
            (1.4741, 1.473),
        ),
    ];
    for (gamma, exact, kalman, informed, steps, peaks) in expected {
        let rows = tables.main.only("gamma", gamma)?;
        let column = |name: &str| rows.points("n", name);
        let (own, kf) = (column("dymbo_exact")?, column("kf_pred")?);
        let mut compare = |id: &str, points: &[(f64, f64)], expected: &[f64], tolerance: f64| {
            for (n, value) in expected.iter().enumerate() {
                let statement = format!("gamma = {gamma}: {id} at n = {n}");
                let at = nearest(points, n as f64);
                claims.push(Claim::near(format!("{id}-{gamma}-{n}"), statement, at, *value, tolerance).at_defaults());
            }
        };
        compare("exact sign-bit error", &own, &exact, 1e-6);
        compare("Kalman variance", &kf, &kalman, 1e-6);
        for ((n, value), expected) in column("informed_mse")?.into_iter().zip(informed) {
            let error = nearest(&column("informed_se")?, n);
            let statement = format!("gamma = {gamma}: error at n = {n} when the prior is used");
            let claim = Claim::near(format!("informed-{gamma}-{n}"), statement, value, expected, 4.5 * error + 5e-4);
            claims.push(claim.at_defaults());
        }
        for (who, points, limit, wanted) in [
            ("sign-bit", &own, "dymbo_minf", steps.0),
            ("Kalman", &kf, "kf_minf", steps.1),
        ] {
            // The Kalman filter settles on its own variance, the sign-bit filter on its own exact error.
            let limit = if who == "Kalman" {
                rows.numbers(limit)?.first().copied()
            } else {
                points.last().map(|p| p.1)
            };
            let limit = limit.unwrap_or(f64::NAN);
            let first = points
                .iter()
                .position(|p| p.1 <= 1.05 * limit)
                .map_or(f64::NAN, |n| n as f64);
            let statement = format!("E12, gamma = {gamma}: steps of the {who} filter to within 5 % of its level");
            claims
                .push(Claim::near(format!("steps-{who}-{gamma}"), statement, first, wanted as f64, 0.0).at_defaults());
        }
        for (what, points, peak) in [
            ("exact errors", &own, peaks.0),
            ("computed variances", &column("dymbo_pred")?, peaks.1),
        ] {
            let ratios: Vec<(f64, f64)> = points.iter().zip(&kf).map(|(d, k)| (d.0, d.1 / k.1)).collect();
            let top = ratios
                .iter()
                .copied()
                .max_by(|p, q| p.1.total_cmp(&q.1))
                .unwrap_or((f64::NAN, f64::NAN));
            let statement = format!("gamma = {gamma}: the ratio of {what} peaks at n = 2");
            let id = what.replace(' ', "-");
            claims.push(Claim::near(format!("peak-at-{id}-{gamma}"), statement, top.0, 2.0, 0.0).at_defaults());
            let statement = format!("gamma = {gamma}: the ratio of {what} at its peak");
            claims.push(Claim::near(format!("peak-{id}-{gamma}"), statement, top.1, peak, 5e-4).at_defaults());
        }
    }
    Ok(claims)
}

/// What the start is worth, from closed forms.
fn start_claims() -> Result<Vec<Claim>, Error> {
    let mut claims = Vec::new();
    for (gamma, start, dymbo_steps, kalman_steps) in [
        (0.5, 1e2, 8, 3),
        (0.05, 1e2, 15, 9),
        (0.5, 1e4, 12, 3),
        (0.05, 1e4, 19, 9),
    ] {
        let plant = ScalarPlant::with_noise_ratio(0.9, gamma)?;
        for (who, c, expected) in [("sign-bit", FRAC_2_PI, dymbo_steps), ("Kalman", 1.0, kalman_steps)] {
            let limit = plant.steady_state(c)?.filtered_variance;
            let (mut m, mut n) = (start, 0);
            while m > 1.05 * limit && n < 100 {
                m = plant.filtered_variance(plant.dynamics().predict_variance(m), c);
                n += 1;
            }
            let id = format!("cold-{who}-{gamma}-{start}");
            let statement =
                format!("gamma = {gamma}: steps of the {who} filter from a prior variance of {start} alone");
            claims.push(Claim::near(id, statement, f64::from(n), f64::from(expected), 0.0));
        }
    }
    for (gamma, expected, bits) in [(0.5, 0.767414, 2.99), (0.05, 0.211726, 2.26)] {
        let (plant, variance) = stationary_plant(ID, 0.9, gamma)?;
        let value = first_message_value(&plant, &FineSensor::new(1.0)?, &Gaussian::scalar(0.0, variance)?)?;
        let statement = format!("E13, gamma = {gamma}: mean variance after first message and prior together");
        claims.push(Claim::near(format!("e13-{gamma}"), statement, value.expected_variance, expected, 1e-6));
        let statement = format!("gamma = {gamma}: entropy of the first message in bits");
        claims.push(Claim::near(format!("entropy-{gamma}"), statement, value.entropy_bits, bits, 5e-3));
    }
    let (_, stationary) = stationary_plant(ID, 0.9, 0.05)?;
    let statement = "E13: at gamma = 0.05 the first message without the prior is worse than the prior alone";
    claims.push(Claim::below("e13-worse", statement, stationary, 13.0 / 12.0));
    Ok(claims)
}
