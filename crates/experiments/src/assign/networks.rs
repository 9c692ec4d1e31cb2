//! `assign-fig6-3` and `assign-fig6-4`: random networks of given mean and spread of their noise variances.

use crate::legacy::claim::{largest, not_decreasing, not_increasing};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_monte_carlo::{Moments, Stream};
use fewbits_sensor_assignment::{
    CodedSensors, Criterion, JonkerVolgenant, LinearAssignment, all_errors, by_precision, exchange, pair_costs,
    variances_with_moments,
};
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

/// Draws before a network of positive variances is given up.
const MAX_DRAWS: usize = 100_000;

/// Errors of one network: alg, min, II, avg, exchange for the centre, then for the posterior mean.
type Errors = [f64; 10];

const NAMES: [&str; 10] = [
    "alg_center",
    "min_center",
    "ii_center",
    "avg_center",
    "swap_center",
    "alg_mmse",
    "min_mmse",
    "ii_mmse",
    "avg_mmse",
    "swap_mmse",
];
const STDERR_NAMES: [&str; 10] = [
    "stderr_alg_center",
    "stderr_min_center",
    "stderr_ii_center",
    "stderr_avg_center",
    "stderr_swap_center",
    "stderr_alg_mmse",
    "stderr_min_mmse",
    "stderr_ii_mmse",
    "stderr_avg_mmse",
    "stderr_swap_mmse",
];

/// A network uniform on the sphere of the given moments.
fn draw(stream: Stream, sensors: usize, mean: f64, std: f64) -> Result<Vec<f64>, Error> {
    let mut rng = stream.rng();
    for _ in 0..MAX_DRAWS {
        let direction: Vec<f64> = (0..sensors).map(|_| StandardNormal.sample(&mut rng)).collect();
        if let Some(variances) = variances_with_moments(mean, std, &direction).map_err(Error::failed)? {
            return Ok(variances);
        }
    }
    Err(Error::Table(format!("no network of mean {mean} and deviation {std} in {MAX_DRAWS} draws")))
}

fn evaluate(variances: &[f64]) -> Result<Errors, fewbits_sensor_assignment::Error> {
    let sensors = CodedSensors::new(1.0, variances)?;
    let linear = JonkerVolgenant.solve(&pair_costs(&sensors)?)?;
    let second = by_precision(variances);
    let mut errors = [0.0; 10];
    for (criterion, part) in [Criterion::Centre, Criterion::Mmse]
        .into_iter()
        .zip(errors.chunks_mut(5))
    {
        let all = all_errors(&sensors, criterion)?;
        part[0] = sensors.mse(&linear, criterion)?;
        // The enumeration and single evaluations round differently.
        part[1] = all.least.min(part[0]);
        part[2] = sensors.mse(&second, criterion)?;
        part[3] = all.mean;
        part[4] = exchange(&sensors, &linear, criterion)?.error;
    }
    Ok(errors)
}

/// Statistics over networks of one mean and spread; the relative excess of alg over min comes last, for both decoders.
fn point(context: &Context<'_>, sensors: usize, mean: f64, std: f64, trials: u64) -> Result<Vec<Moments>, Error> {
    // Without spread there is only one network.
    let trials = if std == 0.0 { 1 } else { trials };
    let stream = context
        .stream("assign-networks")
        .indexed((mean * 1e9).round() as u64)
        .indexed((std * 1e9).round() as u64);
    let run = context.monte_carlo(stream, trials);
    let moments = run.fold(
        || vec![Moments::default(); 12],
        |sums, trial| {
            let variances = if std == 0.0 {
                vec![mean; sensors]
            } else {
                draw(trial.stream, sensors, mean, std)?
            };
            let errors = evaluate(&variances).map_err(Error::failed)?;
            let gaps = [errors[0] / errors[1] - 1.0, errors[5] / errors[6] - 1.0];
            sums.iter_mut()
                .zip(errors.into_iter().chain(gaps))
                .for_each(|(m, e)| m.add(e));
            Ok::<(), Error>(())
        },
        |total, chunk| total.iter_mut().zip(chunk).for_each(|(t, c)| t.merge(&c)),
    )?;
    Ok(moments)
}

fn sweep(
    context: &Context<'_>,
    first: (&'static str, &'static str),
    sensors: usize,
    trials: u64,
    points: &[(f64, f64, f64)],
) -> Result<Tables, Error> {
    let mut columns = vec![
        column(first.0, "V^2", first.1),
        column("trials", "", "networks averaged"),
    ];
    columns.extend(NAMES.iter().map(|n| {
        let meaning = match n.split('_').next() {
            Some("alg") => "linear assignment",
            Some("min") => "least over all assignments",
            Some("ii") => "most precise sensor to the coarsest bit",
            Some("avg") => "mean over all assignments",
            _ => "linear assignment improved by exchanges",
        };
        column(n, "V^2", meaning)
    }));
    columns.extend(STDERR_NAMES.iter().map(|n| column(n, "V^2", "standard error")));
    columns.push(column("excess_center", "", "mean of alg/min - 1, cell's centre"));
    columns.push(column("excess_mmse", "", "mean of alg/min - 1, posterior mean"));
    let mut table = Table::new(columns);
    for &(at, mean, std) in points {
        let moments = point(context, sensors, mean, std, trials)?;
        let mut row = row![at, moments[0].count()];
        row.extend(moments[..10].iter().map(|m| m.mean().into()));
        row.extend(moments[..10].iter().map(|m| m.standard_error().into()));
        row.extend(moments[10..].iter().map(|m| m.mean().into()));
        table.push(row)?;
    }
    Ok(table.into())
}

/// Independent values: mean, spread, decoder (0 centre, 1 posterior mean), (value, standard error) of alg, min, II, avg.
type Reference = (f64, f64, usize, [(f64, f64); 4]);

/// Claims that every reference is met within four standard errors of both sides.
fn references(tables: &Tables, axis: &str, pick: impl Fn(&Reference) -> Option<f64>) -> Result<Vec<Claim>, Error> {
    let at = tables.main.numbers(axis)?;
    let mut claims = Vec::new();
    for reference in REFERENCES {
        let Some(value) = pick(reference) else { continue };
        let Some(row) = at.iter().position(|a| (a - value).abs() < 1e-12) else {
            continue;
        };
        let mut worst: f64 = 0.0;
        for (k, (mean, stderr)) in reference.3.iter().enumerate() {
            let ours = tables.main.numbers(NAMES[5 * reference.2 + k])?[row];
            let own = tables.main.numbers(STDERR_NAMES[5 * reference.2 + k])?[row];
            worst = worst.max((ours - mean).abs() / (4.0 * stderr + 4.0 * own));
        }
        let decoder = ["centre", "posterior mean"][reference.2];
        claims.push(
            Claim::at_most(
                format!("reference-{value}-{decoder}"),
                format!("alg, min, II and avg of an independent program, {axis} {value}, {decoder}: deviation in units of four standard errors of both"),
                worst,
                1.0,
            )
            .at_defaults(),
        );
    }
    Ok(claims)
}

fn orders(tables: &Tables) -> Result<Vec<Claim>, Error> {
    let get = |name: &str| tables.main.numbers(name);
    let mut claims = Vec::new();
    for decoder in ["center", "mmse"] {
        let (alg, min, avg) =
            (get(&format!("alg_{decoder}"))?, get(&format!("min_{decoder}"))?, get(&format!("avg_{decoder}"))?);
        let swap = get(&format!("swap_{decoder}"))?;
        let slack = 1.0 + 1e-9;
        claims.push(Claim::never(
            format!("order-{decoder}"),
            "min <= exchanges <= alg <= avg",
            (0..alg.len())
                .filter(|&i| min[i] > swap[i] * slack || swap[i] > alg[i] * slack || alg[i] > avg[i] * slack)
                .count(),
        ));
        claims.push(Claim::at_most(
            format!("exchange-{decoder}"),
            "exchanges end on average within 0.5 % of the minimum",
            largest((0..alg.len()).map(|i| swap[i] / min[i] - 1.0)),
            5e-3,
        ));
    }
    claims.push(Claim::at_most(
        "excess-center",
        "for the centre decoder the linear assignment is on average within 2.5 % of the minimum",
        largest(get("excess_center")?),
        0.025,
    ));
    Ok(claims)
}

fn picture(tables: &Tables, axis: &str, label: &str) -> Result<Plot, Error> {
    let mut panels = Vec::new();
    for (decoder, title) in [("center", "Cell's centre"), ("mmse", "Posterior mean")] {
        let mut panel = Panel::new(title, Axis::linear(label), Axis::linear("mean squared error / V^2"));
        for (colour, (name, text)) in [
            ("avg", "mean of all"),
            ("ii", "assignment II"),
            ("alg", "linear assignment"),
            ("min", "least of all"),
            ("swap", "with exchanges"),
        ]
        .into_iter()
        .enumerate()
        {
            let points = tables.main.points(axis, &format!("{name}_{decoder}"))?;
            let layer = match name {
                "min" => Layer::dashed(text, points),
                "swap" => {
                    Layer::points(text, points).with_errors(tables.main.numbers(&format!("stderr_{name}_{decoder}"))?)
                }
                _ => Layer::line(text, points),
            };
            panel = panel.with(layer.coloured(colour));
        }
        panels.push(panel.legend(if axis == "sd" {
            Legend::BottomLeft
        } else {
            Legend::TopLeft
        }));
    }
    Ok(Plot::grid(2, panels))
}

fn check(figure: &'static str, sensors: usize, trials: u64, feasible: bool) -> Result<(), Error> {
    if (2..=7).contains(&sensors) && trials >= 2 && feasible {
        return Ok(());
    }
    Err(Error::BadParameter {
        figure,
        name: "sensors, trials, means and deviations".into(),
        value: format!("{sensors} sensors, {trials} trials"),
        expected: "2 to 7 sensors, 2 trials or more, means above 1e-4 and deviations up to mean sqrt(N - 1)".into(),
    })
}

fn feasible(sensors: usize, mean: f64, std: f64) -> bool {
    mean.is_finite() && mean > 1e-4 && std >= 0.0 && std < mean * (sensors as f64 - 1.0).sqrt()
}

/// `assign-fig6-3`.
pub struct Spread;

/// Parameters of `assign-fig6-3`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpreadParameters {
    /// Number of sensors.
    sensors: usize,
    /// Mean of the noise variances, V^2.
    mean: f64,
    /// Their population standard deviations, V^2.
    sds: Vec<f64>,
    /// Networks a point.
    trials: u64,
}

impl Default for SpreadParameters {
    fn default() -> Self {
        Self {
            sensors: 4,
            mean: 0.03,
            sds: vec![0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03],
            trials: 1000,
        }
    }
}

impl Figure for Spread {
    type Parameters = SpreadParameters;

    fn about(&self) -> About {
        About {
            id: "assign-fig6-3",
            title: "Error against the spread of the noise variances",
            caption: "Random networks of four sensors with mean noise variance 0.03. The more the sensors differ, the more a good assignment \
                      gains; an arbitrary one gains nearly nothing. For the posterior mean the linear assignment is not quite right, and a few \
                      exchanges of two sensors mend it.",
            source: "Movaghati, thesis, figure 6.3",
        }
    }

    fn check(&self, p: &SpreadParameters) -> Result<(), Error> {
        check("assign-fig6-3", p.sensors, p.trials, p.sds.iter().all(|&sd| feasible(p.sensors, p.mean, sd)))
    }

    fn quicken(&self, p: &mut SpreadParameters) {
        p.trials = 100;
    }

    fn run(&self, p: &SpreadParameters, context: &Context<'_>) -> Result<Tables, Error> {
        let points: Vec<_> = p.sds.iter().map(|&sd| (sd, p.mean, sd)).collect();
        sweep(
            context,
            ("sd", "population standard deviation of the noise variances"),
            p.sensors,
            p.trials,
            &points,
        )
    }

    fn claims(&self, p: &SpreadParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let get = |name: &str| tables.main.numbers(name);
        let mut claims = orders(tables)?;
        let (sd, alg, ii, avg) = (get("sd")?, get("alg_center")?, get("ii_center")?, get("avg_center")?);
        claims.push(
            Claim::never(
                "better-than-ii",
                "the linear assignment beats assignment II as soon as sensors differ, centre decoder",
                (0..sd.len()).filter(|&i| sd[i] > 0.0 && alg[i] >= ii[i]).count(),
            )
            .at_defaults(),
        );
        claims.push(Claim::never("decreasing", "its error falls with the spread", not_decreasing(&alg)).at_defaults());
        claims.push(
            Claim::near(
                "average",
                "the mean over all assignments falls by 6.6 % only",
                1.0 - avg[avg.len() - 1] / avg[0],
                0.066,
                0.004,
            )
            .at_defaults(),
        );
        claims.push(
            Claim::near(
                "gap",
                "the gap between mean and linear assignment grows to 0.020",
                avg[avg.len() - 1] - alg[alg.len() - 1],
                0.020,
                1.5e-3,
            )
            .at_defaults()
            .needs_full_trials(),
        );
        claims.push(
            Claim::at_most(
                "excess-mmse",
                "for the posterior mean the linear assignment is up to 15 % above the minimum",
                largest(get("excess_mmse")?),
                0.15,
            )
            .at_defaults(),
        );
        claims.extend(references(tables, "sd", |r| (r.0 == p.mean).then_some(r.1))?);
        Ok(claims)
    }

    fn plot(&self, _: &SpreadParameters, tables: &Tables) -> Result<Plot, Error> {
        picture(tables, "sd", "standard deviation of the noise variances / V^2")
    }
}

/// `assign-fig6-4`.
pub struct Mean;

/// Parameters of `assign-fig6-4`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeanParameters {
    /// Number of sensors.
    sensors: usize,
    /// Means of the noise variances, V^2.
    means: Vec<f64>,
    /// Their population standard deviation, V^2.
    sd: f64,
    /// Networks a point.
    trials: u64,
}

impl Default for MeanParameters {
    fn default() -> Self {
        Self {
            sensors: 4,
            means: vec![0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1],
            sd: 0.015,
            trials: 1000,
        }
    }
}

impl Figure for Mean {
    type Parameters = MeanParameters;

    fn about(&self) -> About {
        About {
            id: "assign-fig6-4",
            title: "Error against the mean of the noise variances",
            caption: "Random networks of four sensors whose noise variances have standard deviation 0.015. As the noise grows the cost \
                      approximation, which counts single wrong bits only, loses its edge: at a mean of 0.1 giving the best sensor the \
                      coarsest bit is slightly better.",
            source: "Movaghati, thesis, figure 6.4",
        }
    }

    fn check(&self, p: &MeanParameters) -> Result<(), Error> {
        check("assign-fig6-4", p.sensors, p.trials, p.means.iter().all(|&mean| feasible(p.sensors, mean, p.sd)))
    }

    fn quicken(&self, p: &mut MeanParameters) {
        p.trials = 100;
    }

    fn run(&self, p: &MeanParameters, context: &Context<'_>) -> Result<Tables, Error> {
        let points: Vec<_> = p.means.iter().map(|&mean| (mean, mean, p.sd)).collect();
        sweep(context, ("mu", "mean of the noise variances"), p.sensors, p.trials, &points)
    }

    fn claims(&self, p: &MeanParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let get = |name: &str| tables.main.numbers(name);
        let mut claims = orders(tables)?;
        let (mu, alg, ii) = (get("mu")?, get("alg_center")?, get("ii_center")?);
        claims.push(
            Claim::never("increasing", "the error of the linear assignment grows with the mean", not_increasing(&alg))
                .at_defaults(),
        );
        claims.push(
            Claim::never(
                "better-than-ii",
                "it beats assignment II up to a mean of 0.08, centre decoder",
                (0..mu.len()).filter(|&i| mu[i] <= 0.08 && alg[i] >= ii[i]).count(),
            )
            .at_defaults()
            .needs_full_trials(),
        );
        if let Some(i) = mu.iter().position(|m| *m == 0.1) {
            claims.push(
                Claim::below("ii-at-last", "and loses to it at 0.1 (erratum assign-3)", ii[i], alg[i])
                    .at_defaults()
                    .needs_full_trials(),
            );
            claims.push(Claim::near("ii-value", "assignment II at 0.1", ii[i], 0.1112, 4e-4).at_defaults());
            claims.push(Claim::near("alg-value", "linear assignment at 0.1", alg[i], 0.1119, 4e-4).at_defaults());
        }
        claims.extend(references(tables, "mu", |r| (r.1 == p.sd).then_some(r.0))?);
        Ok(claims)
    }

    fn plot(&self, _: &MeanParameters, tables: &Tables) -> Result<Plot, Error> {
        picture(tables, "mu", "mean of the noise variances / V^2")
    }
}

const REFERENCES: &[Reference] = &[
    (
        0.02,
        0.015,
        0,
        [
            (1.787835e-02, 1.9e-05),
            (1.787835e-02, 1.9e-05),
            (2.391832e-02, 5.0e-05),
            (2.744375e-02, 1.8e-06),
        ],
    ),
    (
        0.02,
        0.015,
        1,
        [
            (1.412822e-02, 2.1e-05),
            (1.412822e-02, 2.1e-05),
            (1.868093e-02, 3.0e-05),
            (2.350092e-02, 6.7e-06),
        ],
    ),
    (
        0.03,
        0.005,
        0,
        [
            (3.859053e-02, 7.2e-06),
            (3.859053e-02, 7.2e-06),
            (3.996965e-02, 2.4e-05),
            (4.179691e-02, 7.3e-08),
        ],
    ),
    (
        0.03,
        0.005,
        1,
        [
            (3.311093e-02, 7.7e-06),
            (3.294001e-02, 4.9e-06),
            (3.382069e-02, 1.9e-05),
            (3.611846e-02, 1.7e-07),
        ],
    ),
    (
        0.03,
        0.01,
        0,
        [
            (3.575797e-02, 2.7e-05),
            (3.531361e-02, 1.7e-05),
            (3.811414e-02, 4.8e-05),
            (4.152647e-02, 6.5e-07),
        ],
    ),
    (
        0.03,
        0.01,
        1,
        [
            (3.121497e-02, 3.2e-05),
            (2.961318e-02, 8.8e-06),
            (3.146881e-02, 3.7e-05),
            (3.570698e-02, 1.5e-06),
        ],
    ),
    (
        0.03,
        0.015,
        0,
        [
            (3.194209e-02, 3.3e-05),
            (3.191887e-02, 3.1e-05),
            (3.638423e-02, 7.5e-05),
            (4.105153e-02, 2.5e-06),
        ],
    ),
    (
        0.03,
        0.015,
        1,
        [
            (2.761356e-02, 3.3e-05),
            (2.628695e-02, 1.1e-05),
            (2.920789e-02, 5.5e-05),
            (3.495992e-02, 6.0e-06),
        ],
    ),
    (
        0.03,
        0.02,
        0,
        [
            (2.717854e-02, 2.2e-05),
            (2.717854e-02, 2.2e-05),
            (3.311897e-02, 6.0e-05),
            (4.045711e-02, 3.5e-06),
        ],
    ),
    (
        0.03,
        0.02,
        1,
        [
            (2.283686e-02, 2.0e-05),
            (2.275389e-02, 1.7e-05),
            (2.580322e-02, 3.8e-05),
            (3.404931e-02, 9.4e-06),
        ],
    ),
    (
        0.03,
        0.025,
        0,
        [
            (2.308406e-02, 3.6e-05),
            (2.308406e-02, 3.6e-05),
            (2.949484e-02, 5.2e-05),
            (3.979869e-02, 3.9e-06),
        ],
    ),
    (
        0.03,
        0.025,
        1,
        [
            (1.872434e-02, 3.3e-05),
            (1.871841e-02, 3.3e-05),
            (2.231552e-02, 2.5e-05),
            (3.308743e-02, 1.1e-05),
        ],
    ),
    (
        0.03,
        0.03,
        0,
        [
            (1.917062e-02, 2.7e-05),
            (1.917062e-02, 2.7e-05),
            (2.541750e-02, 4.3e-05),
            (3.913266e-02, 3.3e-06),
        ],
    ),
    (
        0.03,
        0.03,
        1,
        [
            (1.492689e-02, 2.6e-05),
            (1.492689e-02, 2.6e-05),
            (1.915379e-02, 2.0e-05),
            (3.220939e-02, 1.2e-05),
        ],
    ),
    (
        0.04,
        0.015,
        0,
        [
            (4.443459e-02, 2.3e-05),
            (4.428035e-02, 1.9e-05),
            (4.739468e-02, 6.6e-05),
            (5.406659e-02, 1.2e-06),
        ],
    ),
    (
        0.04,
        0.015,
        1,
        [
            (3.706944e-02, 3.9e-05),
            (3.576329e-02, 1.4e-05),
            (3.821345e-02, 4.6e-05),
            (4.556198e-02, 2.9e-06),
        ],
    ),
    (
        0.06,
        0.015,
        0,
        [
            (6.755685e-02, 1.7e-05),
            (6.755685e-02, 1.7e-05),
            (6.953994e-02, 4.8e-05),
            (7.841011e-02, 7.0e-07),
        ],
    ),
    (
        0.06,
        0.015,
        1,
        [
            (5.466744e-02, 2.7e-05),
            (5.466744e-02, 2.7e-05),
            (5.551406e-02, 3.3e-05),
            (6.444015e-02, 1.3e-06),
        ],
    ),
];
