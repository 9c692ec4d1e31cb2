//! `binary-beyond`: what the thesis leaves on the table.

use super::feedback::descend;
use super::{Scene, pattern};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::baselines::{AdaptiveRule, adaptive};
use fewbits_binary_patterns::search::{Descent, free_breakpoints};
use fewbits_binary_patterns::{BinaryQuantizer, Grid, Mask, Pattern, PatternSensor, Source, gray_basis};
use fewbits_sensor_assignment::{
    CodedSensors, Estimator, JonkerVolgenant, LinearAssignment, brute_force, exchange, pair_costs,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// `binary-beyond`.
pub struct Beyond;

/// Parameters of `binary-beyond`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Include the designs with free thresholds and the larger searches, which take most of the time.
    thorough: bool,
}

impl Default for Parameters {
    fn default() -> Self {
        Self { thorough: true }
    }
}

/// One comparison: what is changed, against what, both errors, and the change found independently.
struct Case {
    id: String,
    idea: &'static str,
    case: String,
    before: f64,
    after: f64,
    /// Expected error after the change, and its relative tolerance; one-sided where the tolerance is negative.
    expected: (f64, f64),
}

type Job = Box<dyn Fn() -> Result<Case, Error> + Sync + Send>;

fn any_rank(source: &'static str, sensors: usize, snr: f64, expected: f64) -> Job {
    Box::new(move || {
        let scene = if source == "uniform" {
            Scene::uniform(3, snr)?
        } else {
            Scene::gaussian(snr)?
        };
        let search = scene.search(sensors)?;
        let before = search.best().map_err(Error::failed)?.mse;
        let after = search.any_rank().best().map_err(Error::failed)?.mse;
        Ok(Case {
            id: format!("any-rank-{source}-n{sensors}-{snr}"),
            idea: "any rank",
            case: format!("{source}, N={sensors}, {snr} dB"),
            before,
            after,
            expected: (before * (1.0 + expected / 100.0), 6e-3),
        })
    })
}

fn resolution(bits: usize, sensors: usize, snr: f64, expected: f64) -> Job {
    Box::new(move || {
        let before = Scene::uniform(3, snr)?
            .search(sensors)?
            .best()
            .map_err(Error::failed)?
            .mse;
        let after = descend(bits, sensors, snr, 2)?.1;
        Ok(Case {
            id: format!("bits-{bits}-n{sensors}-{snr}"),
            idea: "finer grid",
            case: format!("B={bits}, N={sensors}, {snr} dB"),
            before,
            after,
            expected: (expected, 4e-3),
        })
    })
}

/// Any of the 127 patterns, by descent from linear ones.
fn any_patterns(scene: &Scene, linear: &[Mask]) -> Result<(Vec<BinaryQuantizer>, f64), Error> {
    let all = Pattern::all(8).map_err(Error::failed)?;
    let start = linear
        .iter()
        .map(|&m| {
            let wanted = pattern(m, 3)?;
            all.iter()
                .position(|p| *p == wanted)
                .ok_or_else(|| Error::Table("no such pattern".into()))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let candidates = all
        .iter()
        .map(|p| p.on(&scene.grid))
        .collect::<Result<Vec<_>, _>>()
        .map_err(Error::failed)?;
    let descent =
        Descent::with_deviations(scene.source, vec![scene.noise; linear.len()], candidates.clone()).map_err(Error::failed)?;
    let found = descent.run(&[start], 12, |_| true).map_err(Error::failed)?;
    Ok((found.choice.into_iter().map(|c| candidates[c].clone()).collect(), found.mse))
}

fn any_pattern(snr: f64, expected: f64) -> Job {
    Box::new(move || {
        let scene = Scene::uniform(3, snr)?;
        let best = scene.search(8)?.best().map_err(Error::failed)?;
        let after = any_patterns(&scene, &best.masks)?.1;
        Ok(Case {
            id: format!("any-pattern-{snr}"),
            idea: "any of 127 patterns",
            case: format!("uniform, N=8, {snr} dB"),
            before: best.mse,
            after,
            expected: (expected, -1e-3),
        })
    })
}

/// The quantizers of masks on a scene's grid.
fn quantizers(scene: &Scene, masks: &[Mask], bits: usize) -> Result<Vec<BinaryQuantizer>, Error> {
    masks
        .iter()
        .map(|&m| pattern(m, bits)?.on(&scene.grid).map_err(Error::failed))
        .collect()
}

/// Free thresholds from the best linear patterns, from the best of any patterns and from those of a finer grid.
///
/// `expected` is an error, or, if negative, a relative change; and its tolerance.
fn free(id: &'static str, name: &'static str, scene: Scene, sensors: usize, jitter: f64, expected: (f64, f64)) -> Job {
    Box::new(move || {
        let search = scene.search(sensors)?;
        let linear = search.best().map_err(Error::failed)?;
        let any = search.any_rank().best().map_err(Error::failed)?;
        let mut starts = vec![
            quantizers(&scene, &linear.masks, 3)?,
            quantizers(&scene, &any.masks, 3)?,
        ];
        if sensors > 3 {
            let fine = Scene {
                grid: Grid::uniform(1.0, 4).map_err(Error::failed)?,
                ..scene.clone()
            };
            let best = fine.search(sensors)?.any_rank().best().map_err(Error::failed)?;
            starts.push(quantizers(&fine, &best.masks, 4)?);
            starts.push(any_patterns(&scene, &linear.masks)?.0);
        }
        let results = starts
            .into_par_iter()
            .map(|quantizers| {
                let sensors = quantizers
                    .into_iter()
                    .map(|q| PatternSensor::with_deviation(q, scene.noise))
                    .collect::<Result<Vec<_>, _>>()?;
                free_breakpoints(&scene.source, &sensors, jitter / scene.source.scale(), 4)
            })
            .collect::<Result<Vec<_>, _>>()
            .map_err(Error::failed)?;
        Ok(Case {
            id: format!("free-{id}"),
            idea: "free thresholds",
            case: name.to_owned(),
            before: linear.mse,
            after: crate::legacy::claim::smallest(results.iter().map(|r| r.mse)),
            expected: if expected.0 > 0.0 {
                expected
            } else {
                (linear.mse * (1.0 + expected.0), expected.1)
            },
        })
    })
}

fn posterior_mean(snr: f64) -> Job {
    Box::new(move || {
        let source = Source::uniform(1.0).map_err(Error::failed)?;
        let noise = source.noise_std(snr).map_err(Error::failed)?;
        let run = |rule| adaptive(&source, noise, 10, rule).map_err(Error::failed);
        let before = run(AdaptiveRule::MaximumLikelihood)?.mle;
        Ok(Case {
            id: format!("posterior-mean-{snr}"),
            idea: "posterior-mean thresholds",
            case: format!("against AQ-ML, N=10, {snr} dB"),
            before,
            after: run(AdaptiveRule::PosteriorMean)?.mmse,
            expected: (before * 0.84, 0.04),
        })
    })
}

fn least_variance(snr: f64) -> Job {
    Box::new(move || {
        let source = Source::uniform(1.0).map_err(Error::failed)?;
        let noise = source.noise_std(snr).map_err(Error::failed)?;
        let run = |rule| adaptive(&source, noise, 10, rule).map_err(Error::failed);
        let before = run(AdaptiveRule::PosteriorMean)?.mmse;
        Ok(Case {
            id: format!("least-variance-{snr}"),
            idea: "variance-minimising thresholds",
            case: format!("against posterior mean, N=10, {snr} dB"),
            before,
            after: run(AdaptiveRule::LeastVariance)?.mmse,
            expected: (before * 0.996_5, 2.5e-3),
        })
    })
}

fn smaller_steps(snr: f64) -> Job {
    Box::new(move || {
        let source = Source::uniform(1.0).map_err(Error::failed)?;
        let noise = source.noise_std(snr).map_err(Error::failed)?;
        let run = |step, factor| {
            adaptive(&source, noise, 10, AdaptiveRule::VariableStep { step, factor }).map_err(Error::failed)
        };
        let before = run(0.5, 1.5)?.mle;
        Ok(Case {
            id: format!("small-steps-{snr}"),
            idea: "smaller AQ-VS steps",
            case: format!("0.2 and 1.2 for 0.5 and 1.5, N=10, {snr} dB"),
            before,
            after: run(0.2, 1.2)?.mle,
            expected: (before * 0.895, 0.04),
        })
    })
}

/// Variances of Table 6.1.
const VARIANCES: [f64; 8] = [0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001];

fn decoder_of_table_6_1() -> Result<Case, Error> {
    let sensors = CodedSensors::with_variances(1.0, &VARIANCES).map_err(Error::failed)?;
    let best = pair_costs(&sensors)
        .and_then(|c| JonkerVolgenant.solve(&c))
        .map_err(Error::failed)?;
    Ok(Case {
        id: "assign-mmse".into(),
        idea: "posterior mean for Gray bits",
        case: "sensors of table 6.1".into(),
        before: sensors.centre_mse(&best).map_err(Error::failed)?,
        after: sensors.mmse(&best).map_err(Error::failed)?,
        expected: (0.005_341_950_076_346_691, 1e-8),
    })
}

fn joint_of_table_6_1() -> Result<Case, Error> {
    let sensors = CodedSensors::with_variances(1.0, &VARIANCES).map_err(Error::failed)?;
    let before = brute_force(&sensors, Estimator::PosteriorMean)
        .map_err(Error::failed)?
        .1;
    let grid = Grid::uniform(1.0, 4).map_err(Error::failed)?;
    let candidates = (1..16)
        .map(|mask| pattern(mask, 4)?.on(&grid).map_err(Error::failed))
        .collect::<Result<Vec<_>, _>>()?;
    let source = Source::uniform(1.0).map_err(Error::failed)?;
    let descent = Descent::with_deviations(source, sensors.noise_stds().to_vec(), candidates).map_err(Error::failed)?;
    let gray = gray_basis(4).map_err(Error::failed)?;
    // The most precise sensors come last, and serve the finest bits well.
    let start: Vec<usize> = gray.iter().cycle().take(8).map(|&m| m as usize - 1).collect();
    let constant: Vec<Vec<usize>> = gray.iter().map(|&m| vec![m as usize - 1; 8]).collect();
    let starts: Vec<Vec<usize>> = std::iter::once(start).chain(constant).collect();
    let found = descent.run(&starts, 40, |_| true).map_err(Error::failed)?;
    Ok(Case {
        id: "joint".into(),
        idea: "joint pattern and sensor design",
        case: "sensors of table 6.1, B=4".into(),
        before,
        after: found.mse,
        expected: (0.003_709_4, -1e-3),
    })
}

fn exchange_of_table_6_1() -> Result<Case, Error> {
    let sensors = CodedSensors::with_variances(1.0, &VARIANCES).map_err(Error::failed)?;
    let linear = pair_costs(&sensors)
        .and_then(|c| JonkerVolgenant.solve(&c))
        .map_err(Error::failed)?;
    let found = exchange(&sensors, &linear, Estimator::PosteriorMean).map_err(Error::failed)?;
    Ok(Case {
        id: "exchange".into(),
        idea: "exchange of two sensors",
        case: "sensors of table 6.1, posterior mean".into(),
        before: sensors.mmse(&linear).map_err(Error::failed)?,
        after: found.error,
        expected: (0.005_341_913_073_477_367, 1e-8),
    })
}

fn jobs(thorough: bool) -> Result<Vec<Job>, Error> {
    let mut jobs: Vec<Job> = vec![
        any_rank("uniform", 3, 0.0, -33.1),
        any_rank("uniform", 3, 5.0, -29.9),
        any_rank("uniform", 3, 10.0, -18.4),
        any_rank("uniform", 8, 0.0, -14.4),
        any_rank("uniform", 8, 5.0, -8.6),
        any_rank("gaussian", 3, 5.2, -23.7),
        resolution(4, 8, 18.2, 0.002_856_7),
        resolution(4, 10, 30.0, 0.000_640),
        resolution(5, 10, 30.0, 0.000_199),
        posterior_mean(5.0),
        posterior_mean(15.0),
        posterior_mean(30.0),
        smaller_steps(5.0),
        smaller_steps(10.0),
        smaller_steps(20.0),
        Box::new(decoder_of_table_6_1),
        Box::new(exchange_of_table_6_1),
    ];
    if thorough {
        jobs.push(resolution(6, 10, 30.0, 0.000_191));
        jobs.push(any_pattern(10.0, 0.012_399));
        jobs.push(Box::new(joint_of_table_6_1));
        jobs.push(least_variance(5.0));
        jobs.push(least_variance(20.0));
        let uniform = |snr| Scene::uniform(3, snr);
        jobs.push(free("n8-18.2", "uniform, N=8, 18.2 dB", uniform(18.2)?, 8, 0.04, (0.002_772_0, -1e-3)));
        jobs.push(free("n8-10", "uniform, N=8, 10 dB", uniform(10.0)?, 8, 0.06, (0.012_181_6, -1e-3)));
        jobs.push(free(
            "gaussian",
            "Gaussian, N=3, 5.2 dB",
            Scene::gaussian(5.2)?,
            3,
            0.03,
            (0.025_432_839_690_406_16, -1e-6),
        ));
        // Little is gained with as many sensors as bits and little noise: less than one per cent.
        jobs.push(free("n3-25", "uniform, N=3, 25 dB", uniform(25.0)?, 3, 0.02, (-0.005, 0.005)));
    }
    Ok(jobs)
}

impl Figure for Beyond {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-beyond",
            title: "Beyond the thesis",
            caption: "Exact errors before and after each change: no rank constraint, finer grids, any pattern, thresholds off the grid, joint \
                      choice of patterns for unequal sensors, the posterior mean instead of the cell's centre, better adaptive thresholds.",
            source: "",
        }
    }

    fn quicken(&self, p: &mut Parameters) {
        p.thorough = false;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let cases = jobs(p.thorough)?
            .par_iter()
            .map(|job| job())
            .collect::<Result<Vec<_>, _>>()?;
        let mut table = Table::new([
            column("id", "", "name of the comparison"),
            column("idea", "", "what is changed"),
            column("case", "", "where"),
            column("before", "V^2", "error before"),
            column("after", "V^2", "error after"),
            column("change_percent", "%", "relative change"),
            column("expected", "V^2", "error found independently"),
            column("tolerance", "", "relative; negative: the error may be lower, but not higher by more"),
        ]);
        for c in cases {
            let change = 100.0 * (c.after / c.before - 1.0);
            table.push(row![
                c.id,
                c.idea,
                c.case,
                c.before,
                c.after,
                change,
                c.expected.0,
                c.expected.1
            ])?;
        }
        Ok(table.into())
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let get = |name: &str| tables.main.numbers(name);
        let (after, before, expected, tolerance) = (get("after")?, get("before")?, get("expected")?, get("tolerance")?);
        let (ids, ideas, cases) = (tables.main.texts("id")?, tables.main.texts("idea")?, tables.main.texts("case")?);
        let mut claims = vec![Claim::never(
            "improvements",
            "every change lowers the error",
            (0..after.len()).filter(|&i| after[i] >= before[i]).count(),
        )];
        for i in 0..after.len() {
            let statement = format!("{}: {}", ideas[i], cases[i]);
            claims.push(if tolerance[i] < 0.0 {
                Claim::at_most(ids[i].clone(), statement, after[i], expected[i] * (1.0 - tolerance[i]))
            } else {
                Claim::near_relative(ids[i].clone(), statement, after[i], expected[i], tolerance[i])
            });
        }
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let change = tables.main.numbers("change_percent")?;
        let (ideas, cases) = (tables.main.texts("idea")?, tables.main.texts("case")?);
        let place = |i: usize| (change.len() - i) as f64;
        let bars = change
            .iter()
            .enumerate()
            .map(|(i, c)| (c.min(0.0), 0.0, place(i) - 0.35, place(i) + 0.35))
            .collect();
        // The descriptions stand right of the bars: no axis has room for them.
        let names = (0..change.len())
            .map(|i| (58.0, place(i), format!("{}: {}", ideas[i], cases[i])))
            .collect();
        let numbers = change
            .iter()
            .enumerate()
            .map(|(i, c)| (c - 5.0, place(i), format!("{c:.1}")))
            .collect();
        Ok(Plot::of(
            Panel::new(
                "Change of the mean squared error",
                Axis::linear("change / %")
                    .between(-105.0, 115.0)
                    .named([-100.0, -75.0, -50.0, -25.0, 0.0].map(|at| (at, format!("{at}")))),
                Axis::linear("")
                    .between(0.4, change.len() as f64 + 0.6)
                    .named([(1.0, String::new())]),
            )
            .with(Layer::boxes("", bars).coloured(0))
            .with(Layer::texts(numbers).coloured(6))
            .with(Layer::texts(names).coloured(6))
            .legend(Legend::Hidden),
        ))
    }
}
