//! Smoothing the sign-bit filter's output.

use super::common::{bad, dymbo_steady, not_empty, pairs, plant};
use super::referee::{BURN, Scheme, Twin, exact_filter};
use crate::legacy::claim::largest;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Marker, Panel, Plot};
use fewbits_dymbo::ScalarPlant;
use fewbits_filters::{PointMassFilter, scalar_fixed_lag_variance, smoother::smooth_step};
use fewbits_monte_carlo::{Moments, Stream};
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-smoother";

/// Plants as pairs, lags, and the effort.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
    lag: Vec<usize>,
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: vec![0.9, 0.9, 0.99],
            gamma: vec![0.5, 0.05, 1.0],
            lag: vec![0, 1, 2, 3, 4, 5, 10, 20],
            trials: 400,
        }
    }
}

/// States of a run that are smoothed.
const ANCHORS: usize = 10;
/// Steps between them.
const STRIDE: usize = 4;

pub(super) struct Smoothing;

/// For each lag the mean over the anchors of one run of the exact smoothed variance, and of the squared distance of the
/// Rauch-Tung-Striebel estimate from the exact smoothed mean.
fn one_run(
    plant: &ScalarPlant,
    exact: &PointMassFilter,
    lags: &[usize],
    stream: Stream,
) -> Result<Vec<(f64, f64)>, fewbits_dymbo::Error> {
    let longest = lags.iter().copied().max().unwrap_or(0);
    let mut twin = Twin::new(plant, &Scheme::Bit { crossover: 0.0 }, exact, stream.fast_rng())?;
    for _ in 0..BURN {
        twin.step()?;
    }
    let mut beliefs = vec![twin.belief];
    let mut densities = vec![twin.density.clone()];
    let mut likelihoods = Vec::new();
    for n in 1..=(ANCHORS - 1) * STRIDE + longest {
        twin.step()?;
        beliefs.push(twin.belief);
        likelihoods.push(twin.likelihood.clone());
        densities.push(if n % STRIDE == 0 {
            twin.density.clone()
        } else {
            densities[0].clone()
        });
    }
    let mut sums = vec![(0.0, 0.0); lags.len()];
    for anchor in (0..ANCHORS).map(|i| i * STRIDE) {
        for (sum, &lag) in sums.iter_mut().zip(lags) {
            let now = anchor + lag;
            let mut estimate = beliefs[now];
            for n in (anchor..now).rev() {
                estimate = smooth_step(plant.dynamics(), &beliefs[n], &estimate)?;
            }
            let truth = exact.smooth(&densities[anchor], &likelihoods[anchor..now])?;
            sum.0 += truth.variance() / ANCHORS as f64;
            sum.1 += (truth.mean() - estimate.mean()[0]).powi(2) / ANCHORS as f64;
        }
    }
    Ok(sums)
}

impl Figure for Smoothing {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Fixed-lag smoothing",
            caption: "Error of the state some steps ago: Rauch-Tung-Striebel smoothing of the sign-bit filter's means and variances \
                      as if they were normal (points), what it predicts (lines), and the exact smoother of the same bits (crosses). \
                      At gamma = 0.05 the sign-bit smoother passes the unquantized filter (dashed) from lag 4 on.",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "lag", &p.lag)?;
        if let Some(lag) = p.lag.iter().find(|lag| **lag > 200) {
            return Err(bad(ID, "lag", lag, "lags up to 200"));
        }
        pairs(ID, &p.a, &p.gamma)?
            .into_iter()
            .try_for_each(|(a, g)| plant(ID, a, g).map(drop))
    }

    fn quicken(&self, p: &mut Parameters) {
        p.trials = 20;
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("lag", "", "steps between the state and the last bit"),
            column("trials", "", "simulated runs of ten smoothed states"),
            column("predicted", "sigma^2", "steady variance computed by the sign-bit smoother"),
            column("kalman", "sigma^2", "steady variance of the unquantized smoother"),
            column("rts_mse", "sigma^2", "mean squared error of the sign-bit smoother"),
            column("rts_se", "sigma^2", "its standard error"),
            column("exact_mse", "sigma^2", "mean squared error of the exact smoother of the same bits"),
            column("exact_se", "sigma^2", "its standard error"),
            column("excess", "sigma^2", "mean squared distance of the two smoothed estimates"),
            column("excess_se", "sigma^2", "its standard error"),
        ]);
        for (a, gamma) in pairs(ID, &p.a, &p.gamma)? {
            let plant = plant(ID, a, gamma)?;
            let longest = p.lag.iter().copied().max().unwrap_or(0);
            let exact = exact_filter(&plant, BURN + ANCHORS * STRIDE + longest)?;
            let run = context.monte_carlo(context.stream(ID).named(&format!("{a} {gamma}")), p.trials);
            let runs = run.run(|trial| one_run(&plant, &exact, &p.lag, trial.stream))?;
            let (dymbo, kalman) = (dymbo_steady(&plant)?, plant.steady_state(1.0)?);
            for (i, &lag) in p.lag.iter().enumerate() {
                // The exact variance is the error of the exact smoother, free of the noise of one realised error.
                let best: Moments = runs.iter().map(|run| run[i].0).collect();
                let excess: Moments = runs.iter().map(|run| run[i].1).collect();
                let smoothed: Moments = runs.iter().map(|run| run[i].0 + run[i].1).collect();
                table.push(row![
                    a,
                    gamma,
                    lag,
                    p.trials,
                    scalar_fixed_lag_variance(a, &dymbo, lag),
                    scalar_fixed_lag_variance(a, &kalman, lag),
                    smoothed.mean(),
                    smoothed.standard_error(),
                    best.mean(),
                    best.standard_error(),
                    excess.mean(),
                    excess.standard_error(),
                ])?;
            }
        }
        Ok(table.into())
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        let entry = |a: f64, gamma: f64, lag: usize, name: &str| -> Result<f64, Error> {
            let rows = tables.main.only("a", a)?.only("gamma", gamma)?.only("lag", lag)?;
            Ok(rows.numbers(name)?.first().copied().unwrap_or(f64::NAN))
        };
        // Errors with the standard errors of an independent simulation.
        for (a, gamma, lag, rts, exact, error) in [
            (0.9, 0.5, 1, 0.599460, 0.599260, 4.9e-4),
            (0.9, 0.5, 2, 0.552483, 0.552086, 5.2e-4),
            (0.9, 0.5, 5, 0.527125, 0.526414, 5.2e-4),
            (0.9, 0.5, 20, 0.525673, 0.524937, 5.2e-4),
            (0.9, 0.05, 1, 0.154459, 0.154458, 1.2e-5),
            (0.9, 0.05, 5, 0.135655, 0.135653, 1.5e-5),
            (0.9, 0.05, 20, 0.131343, 0.131340, 1.5e-5),
            (0.99, 1.0, 1, 0.962036, 0.959706, 1.9e-3),
            (0.99, 1.0, 20, 0.827644, 0.820008, 2.0e-3),
        ] {
            for (who, value) in [("rts", rts), ("exact", exact)] {
                let tolerance = 4.5 * entry(a, gamma, lag, &format!("{who}_se"))?.hypot(error);
                let statement = format!("a = {a}, gamma = {gamma}, lag {lag}: error of the {who} smoother");
                let found = entry(a, gamma, lag, &format!("{who}_mse"))?;
                claims.push(
                    Claim::near(format!("{who}-{a}-{gamma}-{lag}"), statement, found, value, tolerance).at_defaults(),
                );
            }
        }
        for (gamma, lag, saving) in [(0.5, 5, 0.28), (0.05, 20, 0.21)] {
            let saved = 1.0 - entry(0.9, gamma, lag, "rts_mse")? / entry(0.9, gamma, 0, "rts_mse")?;
            let statement = format!("gamma = {gamma}: a lag of {lag} saves this share of the filter's error");
            claims.push(Claim::near(format!("saves-{gamma}"), statement, saved, saving, 0.01).at_defaults());
        }
        let rows = tables.main.only("gamma", 0.5)?;
        let shares = rows
            .numbers("excess")?
            .into_iter()
            .zip(rows.numbers("excess_se")?)
            .zip(rows.numbers("exact_mse")?);
        let gap = largest(shares.map(|((excess, error), exact)| (excess - 4.5 * error) / exact));
        let statement = "gamma = 0.5: within 0.14 % of the exact smoother at every lag, less 4.5 standard errors";
        claims.push(Claim::at_most("near-exact", statement, gap, 1.45e-3).at_defaults());
        let analog = entry(0.9, 0.05, 0, "kalman")?;
        let beaten = entry(0.9, 0.05, 4, "rts_mse")? + 4.5 * entry(0.9, 0.05, 4, "rts_se")?;
        let statement = "gamma = 0.05: from lag 4 the sign-bit smoother beats the unquantized filter";
        claims.push(Claim::below("beats-analog", statement, beaten, analog).at_defaults());
        for (lag, value) in [(4, 0.137882), (3, 0.141305)] {
            let statement = format!("gamma = 0.05: predicted variance at lag {lag}");
            claims.push(
                Claim::near(format!("predicted-{lag}"), statement, entry(0.9, 0.05, lag, "predicted")?, value, 6e-7)
                    .at_defaults(),
            );
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for (a, gamma) in pairs(ID, &p.a, &p.gamma)? {
            let rows = tables.main.only("a", a)?.only("gamma", gamma)?;
            let filter = rows.only("lag", 0.0)?.numbers("kalman")?.first().copied();
            let analog = filter.map(|m| {
                rows.numbers("lag")
                    .map(|lags| lags.into_iter().map(|lag| (lag, m)).collect())
            });
            let mut panel =
                Panel::new(format!("a = {a}, gamma = {gamma}"), Axis::linear("lag"), Axis::linear("error / sigma^2"))
                    .with(Layer::line("sign bit, predicted", rows.points("lag", "predicted")?).coloured(0))
                    .with(
                        Layer::points("sign bit", rows.points("lag", "rts_mse")?)
                            .with_errors(rows.numbers("rts_se")?)
                            .coloured(0),
                    )
                    .with(
                        Layer::points("exact smoother", rows.points("lag", "exact_mse")?)
                            .coloured(1)
                            .marked(Marker::Cross),
                    )
                    .with(Layer::line("unquantized smoother", rows.points("lag", "kalman")?).coloured(2));
            if let Some(points) = analog {
                panel = panel.with(Layer::dashed("unquantized filter", points?).coloured(3));
            }
            panels.push(panel);
        }
        Ok(Plot::grid(panels.len().min(2), panels))
    }
}
