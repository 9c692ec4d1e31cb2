//! Lost bits.

use super::common::{LONGEST_RUN, bad, dymbo_steady, not_empty, stationary_plant};
use crate::legacy::claim::smallest;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_core::{Dynamics, Encoder, Gaussian, Observation, Sensing};
use fewbits_dymbo::{DymboFilter, OneBitSensor, ScalarPlant, steady};
use fewbits_monte_carlo::{Moments, Stream};
use rand::RngExt;
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-erasure";

/// Plant, loss probabilities, and the effort.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: f64,
    gamma: Vec<f64>,
    loss: Vec<f64>,
    steps: u64,
    burn: u64,
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: 0.9,
            gamma: vec![0.5, 0.05],
            loss: vec![0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.7],
            steps: 1000,
            burn: 100,
            trials: 2_000,
        }
    }
}

pub(super) struct LostBits;

/// Time averages of one run: computed variance and squared error.
fn one_run(
    plant: &ScalarPlant,
    variance: f64,
    loss: f64,
    p: &Parameters,
    stream: Stream,
) -> Result<(f64, f64), fewbits_dymbo::Error> {
    let mut rng = stream.fast_rng();
    let filter = DymboFilter::new(*plant);
    let mut belief = Gaussian::scalar(0.0, variance)?;
    let mut state = belief.sample(&mut rng)?;
    let (mut variances, mut squares) = (0.0, 0.0);
    for n in 0..p.burn + p.steps {
        state = plant.dynamics().propagate(&mut rng, &state);
        let sample = plant.sensor().sample(&mut rng, &state)[0];
        let bit = OneBitSensor.encode(&sample, &filter.threshold(&belief));
        let heard = if rng.random_bool(loss) {
            Observation::Lost
        } else {
            Observation::Received(bit)
        };
        belief = filter.step(&belief, heard)?.0;
        if n >= p.burn {
            variances += belief.covariance()[0];
            squares += (belief.mean()[0] - state[0]).powi(2);
        }
    }
    Ok((variances / p.steps as f64, squares / p.steps as f64))
}

impl Figure for LostBits {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Lost bits",
            caption: "Mean computed variance and mean squared error when each bit is lost with a probability that both ends notice \
                      (points), below the bound that averages the information, (1 - p) 2/pi, in closed form (line).",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "gamma", &p.gamma)?;
        not_empty(ID, "loss", &p.loss)?;
        if !(1..=LONGEST_RUN).contains(&(p.steps as usize)) {
            return Err(bad(ID, "steps", p.steps, "a number from 1 to 10000"));
        }
        if let Some(loss) = p.loss.iter().find(|loss| !(0.0..=1.0).contains(*loss)) {
            return Err(bad(ID, "loss", loss, "probabilities"));
        }
        p.gamma.iter().try_for_each(|g| stationary_plant(ID, p.a, *g).map(drop))
    }

    fn quicken(&self, p: &mut Parameters) {
        p.trials = 100;
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("gamma", "", "process variance over measurement variance"),
            column("loss", "", "probability that a bit is lost"),
            column("trials", "", "simulated runs"),
            column("mean_variance", "sigma^2", "mean of the computed variance"),
            column("mean_variance_se", "sigma^2", "its standard error"),
            column("mse", "sigma^2", "mean squared error"),
            column("mse_se", "sigma^2", "its standard error"),
            column("bound", "sigma^2", "upper bound on the mean variance"),
        ]);
        for &gamma in &p.gamma {
            let (plant, variance) = stationary_plant(ID, p.a, gamma)?;
            for &loss in &p.loss {
                let run = context.monte_carlo(context.stream(ID).named(&format!("{gamma} {loss}")), p.trials);
                let runs = run.run(|trial| one_run(&plant, variance, loss, p, trial.stream))?;
                let variances: Moments = runs.iter().map(|r| r.0).collect();
                let squares: Moments = runs.iter().map(|r| r.1).collect();
                let bound = steady::erasure_bound(&plant, loss)?.filtered_variance;
                table.push(row![
                    gamma,
                    loss,
                    p.trials,
                    variances.mean(),
                    variances.standard_error(),
                    squares.mean(),
                    squares.standard_error(),
                    bound,
                ])?;
            }
        }
        Ok(table.into())
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mean = tables.main.numbers("mean_variance")?;
        let (error, bound) = (tables.main.numbers("mean_variance_se")?, tables.main.numbers("bound")?);
        let margins = mean
            .iter()
            .zip(&error)
            .zip(&bound)
            .map(|((m, se), b)| b - m + 4.5 * se + 1e-12);
        let statement = "the mean variance stays below the bound (Jensen), within 4.5 standard errors";
        let mut claims = vec![Claim::at_least("bounded", statement, smallest(margins), 0.0)];
        for (gamma, means, bounds) in [
            (0.5, [0.792619, 0.953483, 1.178619], [0.793605, 0.956328, 1.182712]),
            (0.05, [0.172127, 0.184954, 0.200594], [0.172163, 0.185053, 0.200721]),
        ] {
            for ((loss, mean), bound) in [0.1, 0.3, 0.5].into_iter().zip(means).zip(bounds) {
                let rows = tables.main.only("gamma", gamma)?.only("loss", loss)?;
                let entry =
                    |name: &str| -> Result<f64, Error> { Ok(rows.numbers(name)?.first().copied().unwrap_or(f64::NAN)) };
                let statement = format!("gamma = {gamma}, loss {loss}: mean variance");
                // The reference values carry a standard error of up to a fiftieth of a percent themselves.
                let tolerance = 4.5 * entry("mean_variance_se")?.hypot(1.5e-4 * mean);
                let claim =
                    Claim::near(format!("mean-{gamma}-{loss}"), statement, entry("mean_variance")?, mean, tolerance);
                claims.push(claim.at_defaults());
                let statement = format!("gamma = {gamma}, loss {loss}: the bound");
                claims.push(
                    Claim::near(format!("bound-{gamma}-{loss}"), statement, entry("bound")?, bound, 6e-7).at_defaults(),
                );
                let statement = format!("gamma = {gamma}, loss {loss}: the bound is tight to 0.35 %");
                let slack = entry("bound")? / entry("mean_variance")? - 1.0;
                let noise = 4.5 * entry("mean_variance_se")? / entry("mean_variance")?;
                claims.push(
                    Claim::at_most(format!("tight-{gamma}-{loss}"), statement, slack, 3.5e-3 + noise).at_defaults(),
                );
                let statement =
                    format!("gamma = {gamma}, loss {loss}: the error is the computed variance within 0.5 %");
                let ratio = entry("mse")? / entry("mean_variance")?;
                let tolerance = 0.005 + 4.5 * entry("mse_se")? / entry("mse")?;
                claims.push(
                    Claim::near(format!("consistent-{gamma}-{loss}"), statement, ratio, 1.0, tolerance).at_defaults(),
                );
            }
        }
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?.only("loss", 0.0)?;
            if let Some(found) = rows.numbers("mean_variance")?.first() {
                let steady = dymbo_steady(&super::common::plant(ID, p.a, gamma)?)?.filtered_variance;
                let statement = format!("gamma = {gamma}: without loss it is the steady variance");
                claims.push(Claim::near_relative(format!("clean-{gamma}"), statement, *found, steady, 1e-6));
            }
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?;
            let title = format!("a = {}, gamma = {gamma}", p.a);
            panels.push(
                Panel::new(title, Axis::linear("probability that a bit is lost"), Axis::linear("variance / sigma^2"))
                    .with(Layer::line("bound on the mean variance", rows.points("loss", "bound")?).coloured(0))
                    .with(
                        Layer::points("mean squared error", rows.points("loss", "mse")?)
                            .with_errors(rows.numbers("mse_se")?)
                            .coloured(1),
                    )
                    .legend(Legend::TopLeft),
            );
        }
        Ok(Plot::grid(2, panels))
    }
}
