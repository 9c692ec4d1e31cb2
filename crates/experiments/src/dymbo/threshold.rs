//! Where the threshold belongs, and what an unstable plant does.

use super::common::{LONGEST_RUN, bad, pairs, stationary_plant};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Panel, Plot};
use fewbits_core::{Dynamics, Encoder, Gaussian, Observation, Sensing};
use fewbits_dymbo::{DymboFilter, FineSensor, Initialisation, OneBitSensor, ScalarPlant, ThresholdRule};
use fewbits_monte_carlo::{Estimate, Moments, Stream};
use nalgebra::Vector1;
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-threshold";

/// Plants as pairs, the length of runs, and the unstable plant.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
    steps: u64,
    burn: u64,
    trials: u64,
    unstable_a: f64,
    unstable_gamma: f64,
    unstable_trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: vec![0.9, 0.9, -0.9],
            gamma: vec![0.5, 0.05, 0.5],
            steps: 1000,
            burn: 100,
            trials: 6_000,
            unstable_a: 1.2,
            unstable_gamma: 0.5,
            unstable_trials: 20_000,
        }
    }
}

pub(super) struct ThresholdPlace;

/// The three schemes, in the order of the table.
const RULES: [&str; 3] = ["prediction", "eq14", "eq14_exact"];

/// Time averages of one run: squared error for each rule, and normalised for the first and last.
fn one_run(
    plant: &ScalarPlant,
    variance: f64,
    p: &Parameters,
    stream: Stream,
) -> Result<([f64; 3], [f64; 3]), fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let prediction = DymboFilter::new(*plant);
    let literal = prediction.with_threshold_rule(ThresholdRule::PreviousEstimate);
    let start = Gaussian::scalar(0.0, variance)?;
    let mut state = start.sample(&mut rng)?;
    let mut beliefs = [start; 3];
    let (mut squared, mut normalised) = ([0.0; 3], [0.0; 3]);
    for n in 0..p.burn + p.steps {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let bit = OneBitSensor.encode(&sample, &prediction.threshold(&beliefs[0]));
        beliefs[0] = prediction.step(&beliefs[0], Observation::Received(bit))?.0;
        // Equation (14) as printed: the threshold is the old estimate, the update that of a bit at the prediction.
        let bit = OneBitSensor.encode(&sample, &literal.threshold(&beliefs[1]));
        beliefs[1] = prediction.update(&prediction.predict(&beliefs[1]), bit).0;
        let bit = OneBitSensor.encode(&sample, &literal.threshold(&beliefs[2]));
        beliefs[2] = literal.step(&beliefs[2], Observation::Received(bit))?.0;
        if n >= p.burn {
            for (i, belief) in beliefs.iter().enumerate() {
                let error = belief.mean()[0] - state[0];
                squared[i] += error * error;
                normalised[i] += error * error / belief.covariance()[0];
            }
        }
    }
    let average = |sums: [f64; 3]| sums.map(|sum| sum / p.steps as f64);
    Ok((average(squared), average(normalised)))
}

/// Excess of `b` over `a` relative to `a`, from paired runs.
fn relative(a: &[f64], b: &[f64]) -> Estimate {
    let ratio = b.iter().sum::<f64>() / a.iter().sum::<f64>();
    let mean = a.iter().sum::<f64>() / a.len() as f64;
    let residuals: Moments = a.iter().zip(b).map(|(a, b)| (b - ratio * a) / mean).collect();
    Estimate {
        value: ratio - 1.0,
        standard_error: residuals.standard_error(),
    }
}

/// Largest error that counts as held.
const LOST: f64 = 50.0;
/// Steps of an unstable run.
const UNSTABLE_STEPS: usize = 500;

/// Whether the error of an unstable plant passes [`LOST`].
///
/// The state itself grows beyond what a double resolves, so the origin follows the estimate: filter and plant are linear, and
/// only the error counts.
fn escapes(plant: &ScalarPlant, stream: Stream) -> Result<bool, fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let sensor = FineSensor::new(1.0)?;
    let mut error = Vector1::new(0.0);
    let message = sensor.encode(&plant.sensor().sample(&mut rng, &error)[0], &());
    let mut belief = filter.init(&Initialisation::Fine { sensor, message })?;
    for _ in 0..UNSTABLE_STEPS {
        error -= belief.mean();
        belief = Gaussian::from_trusted_parts(Vector1::zeros(), *belief.covariance());
        if error[0].abs() > LOST {
            return Ok(true);
        }
        error = plant.dynamics().propagate(&mut rng, &error);
        let sample = plant.sensor().sample(&mut rng, &error)[0];
        let bit = OneBitSensor.encode(&sample, &filter.threshold(&belief));
        belief = filter.step(&belief, Observation::Received(bit))?.0;
    }
    Ok((error - belief.mean())[0].abs() > LOST)
}

impl Figure for ThresholdPlace {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Where the threshold belongs",
            caption: "Steady mean squared error with the threshold at the prediction a theta_hat(n-1), at theta_hat(n-1) as equation \
                      (14) prints it with the update unchanged, and the same with the exact update (E1). For a > 0 the mistake \
                      hides within the width of a line; for a < 0 it is a catastrophe. A second table counts the runs of an \
                      unstable plant that escape although the computed variance stays finite.",
            source: "Ribeiro and Giannakis, equation (14)",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        if !(1..=LONGEST_RUN).contains(&(p.steps as usize)) {
            return Err(bad(ID, "steps", p.steps, "a number from 1 to 10000"));
        }
        ScalarPlant::new_unstable(p.unstable_a, p.unstable_gamma, 1.0)?;
        pairs(ID, &p.a, &p.gamma)?
            .into_iter()
            .try_for_each(|(a, g)| stationary_plant(ID, a, g).map(drop))
    }

    fn quicken(&self, p: &mut Parameters) {
        (p.trials, p.unstable_trials) = (200, 2_000);
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("rule", "", "place of the threshold"),
            column("trials", "", "simulated runs"),
            column("mse", "sigma^2", "mean squared error"),
            column("se", "sigma^2", "its standard error"),
            column("excess", "", "relative excess over the prediction rule, same noise"),
            column("excess_se", "", "its standard error"),
            column("nees", "", "squared error over computed variance"),
            column("nees_se", "", "its standard error"),
        ]);
        for (a, gamma) in pairs(ID, &p.a, &p.gamma)? {
            let (plant, variance) = stationary_plant(ID, a, gamma)?;
            let stream = context.stream(ID).named(&format!("{a} {gamma}"));
            let runs = context
                .monte_carlo(stream, p.trials)
                .run(|trial| one_run(&plant, variance, p, trial.stream))?;
            let column = |i: usize| runs.iter().map(|run| run.0[i]).collect::<Vec<f64>>();
            let reference = column(0);
            for (i, rule) in RULES.into_iter().enumerate() {
                let squared: Moments = column(i).into_iter().collect();
                let normalised: Moments = runs.iter().map(|run| run.1[i]).collect();
                let excess = relative(&reference, &column(i));
                table.push(row![
                    a,
                    gamma,
                    rule,
                    p.trials,
                    squared.mean(),
                    squared.standard_error(),
                    excess.value,
                    excess.standard_error,
                    normalised.mean(),
                    normalised.standard_error(),
                ])?;
            }
        }
        let wild = ScalarPlant::new_unstable(p.unstable_a, p.unstable_gamma, 1.0)?;
        let run = context.monte_carlo(context.stream(ID).named("unstable"), p.unstable_trials);
        let escaped: Moments = run
            .run(|trial| escapes(&wild, trial.stream))?
            .into_iter()
            .map(f64::from)
            .collect();
        let mut unstable = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("trials", "", "simulated runs"),
            column("escaped", "", "fraction of runs whose error exceeds 50 within 500 steps"),
            column("se", "", "its standard error"),
            column("riccati", "sigma^2", "steady variance that the filter computes meanwhile"),
        ]);
        let riccati = wild
            .steady_state(std::f64::consts::FRAC_2_PI)
            .map(|s| s.filtered_variance)
            .ok();
        unstable.push(row![
            p.unstable_a,
            p.unstable_gamma,
            p.unstable_trials,
            escaped.mean(),
            escaped.standard_error(),
            riccati
        ])?;
        Ok(Tables::from(table).with("unstable", unstable))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        // Mean squared error and relative excess with the standard errors of an independent simulation.
        let expected = [
            (
                0.9,
                0.5,
                [(0.729566, 0.0), (0.73932, 3.0e-4), (0.73099, 2.9e-4)],
                [(0.01298, 2.2e-4), (0.00156, 2.6e-4)],
            ),
            (
                0.9,
                0.05,
                [(0.166517, 0.0), (0.16677, 9e-5), (0.16661, 9e-5)],
                [(9.6e-4, 1.0e-4), (2.1e-5, 1.15e-4)],
            ),
            (-0.9, 0.5, [(0.729566, 0.0), (38.431, 0.0144), (1.29894, 8e-4)], [(51.69, 0.02), (0.7810, 1e-3)]),
        ];
        for (a, gamma, errors, excesses) in expected {
            let rows = tables.main.only("a", a)?.only("gamma", gamma)?;
            let entry = |rule: &str, name: &str| -> Result<f64, Error> {
                Ok(rows
                    .only("rule", rule)?
                    .numbers(name)?
                    .first()
                    .copied()
                    .unwrap_or(f64::NAN))
            };
            for (rule, (value, error)) in RULES.into_iter().zip(errors) {
                let tolerance = 4.5 * entry(rule, "se")?.hypot(error);
                let statement = format!("a = {a}, gamma = {gamma}: mean squared error with the {rule} rule");
                let claim =
                    Claim::near(format!("mse-{a}-{gamma}-{rule}"), statement, entry(rule, "mse")?, value, tolerance);
                claims.push(claim.at_defaults());
            }
            for (rule, (value, error)) in RULES.into_iter().skip(1).zip(excesses) {
                let tolerance = 4.5 * entry(rule, "excess_se")?.hypot(error);
                let statement = format!("E1, a = {a}, gamma = {gamma}: relative excess of the {rule} rule");
                let claim = Claim::near(
                    format!("excess-{a}-{gamma}-{rule}"),
                    statement,
                    entry(rule, "excess")?,
                    value,
                    tolerance,
                );
                claims.push(claim.at_defaults());
            }
            let value = if gamma < 0.1 { 1.00005 } else { 1.0023 };
            let tolerance = 4.5 * entry("prediction", "nees_se")?;
            let statement = format!("a = {a}, gamma = {gamma}: normalised error with the prediction rule");
            let claim =
                Claim::near(format!("nees-{a}-{gamma}"), statement, entry("prediction", "nees")?, value, tolerance);
            claims.push(claim.at_defaults());
        }
        let unstable = tables.named("unstable")?;
        let (fraction, error) = (unstable.numbers("escaped")?[0], unstable.numbers("se")?[0]);
        let statement = "at a = 1.2, gamma = 0.5 a tenth of the runs escapes within 500 steps";
        claims.push(Claim::near("unstable", statement, fraction, 0.10615, 4.5 * error.hypot(0.00154)).at_defaults());
        let riccati = unstable.points("escaped", "riccati")?.first().map_or(f64::NAN, |p| p.1);
        let statement = "while the computed variance stays finite";
        claims.push(Claim::near("unstable-riccati", statement, riccati, 1.3246, 5e-5).at_defaults());
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let plants = pairs(ID, &p.a, &p.gamma)?;
        let names = plants
            .iter()
            .enumerate()
            .map(|(i, (a, g))| (i as f64, format!("a = {a}, gamma = {g}")));
        let x = Axis::linear("plant")
            .named(names)
            .between(-0.6, plants.len() as f64 - 0.4);
        let mut panel = Panel::new("Place of the threshold", x, Axis::log("mean squared error / sigma^2"));
        let labels = [
            "at the prediction",
            "equation (14) as printed",
            "equation (14), exact update",
        ];
        for (r, (rule, label)) in RULES.into_iter().zip(labels).enumerate() {
            let rows = tables.main.only("rule", rule)?;
            let shift = 0.2 * (r as f64 - 1.0);
            let points = rows
                .numbers("mse")?
                .into_iter()
                .enumerate()
                .map(|(i, mse)| (i as f64 + shift, mse))
                .collect();
            panel = panel.with(
                Layer::points(label, points)
                    .with_errors(rows.numbers("se")?)
                    .coloured(r),
            );
        }
        Ok(Plot::of(panel.legend(crate::plot::Legend::TopLeft)))
    }
}
