//! `assign-fig6-3` and `assign-fig6-4`: random networks of given mean and spread of their noise variances.

use crate::prelude::*;
use fewbits_sensor_assignment::{
    CodedSensors, Estimator, all_errors, by_precision, exchange, pair_costs, variances_with_moments,
};
use rand_distr::{Distribution, StandardNormal};

/// Least variance of a sensor in a random network.
const SMALLEST: f64 = 1e-4;
/// Draws before a network of positive variances is given up.
const MAX_DRAWS: usize = 100_000;

/// Errors of the assignments of one network.
const ALG: usize = 0;
const MIN: usize = 1;
const II: usize = 2;
const AVG: usize = 3;
const SWAP: usize = 4;

/// A network uniform on the sphere of the given moments.
fn draw(stream: Stream, sensors: usize, mean: f64, std: f64) -> Result<Vec<f64>, Error> {
    let mut rng = stream.rng();
    for _ in 0..MAX_DRAWS {
        let direction: Vec<f64> = (0..sensors).map(|_| StandardNormal.sample(&mut rng)).collect();
        if let Some(variances) = variances_with_moments(mean, std, SMALLEST, &direction)? {
            return Ok(variances);
        }
    }
    Err(Error::Table(format!("no network of mean {mean} and deviation {std} in {MAX_DRAWS} draws")))
}

/// The five errors of each decoder, and how far the linear assignment's exceeds the least, relative.
fn evaluate(variances: &[f64]) -> Result<[[f64; 6]; 2], fewbits_sensor_assignment::Error> {
    let sensors = CodedSensors::with_variances(1.0, variances)?;
    let linear = pair_costs(&sensors).solve();
    let second = by_precision(variances);
    let mut errors = [[0.0; 6]; 2];
    for (criterion, part) in [Estimator::CellCentre, Estimator::PosteriorMean]
        .into_iter()
        .zip(&mut errors)
    {
        let all = all_errors(&sensors, criterion)?;
        part[ALG] = sensors.mse(&linear, criterion)?;
        // The enumeration and single evaluations round differently.
        part[MIN] = all.least.min(part[ALG]);
        part[II] = sensors.mse(&second, criterion)?;
        part[AVG] = all.mean;
        part[SWAP] = exchange(&sensors, &linear, criterion)?.error;
        part[5] = part[ALG] / part[MIN] - 1.0;
    }
    Ok(errors)
}

rows! {
    /// Averages over networks, one row for each decoder.
    pub struct Row by "{at} {decoder}" {
        /// What is varied: standard deviation (`assign-fig6-3`) or mean (`assign-fig6-4`) of the noise variances.
        at: f64 ["V^2"],
        decoder: &'static str => "Decoder.",
        trials: u64 => "Networks averaged.",
        alg: Measured ["V^2"] => "Squared error of the linear assignment.",
        min: Measured ["V^2"] => "Least over all assignments.",
        ii: Measured ["V^2"] => "Most precise sensor to the coarsest bit.",
        avg: Measured ["V^2"] => "Mean over all assignments.",
        swap: Measured ["V^2"] => "Linear assignment improved by exchanges.",
        excess: Measured => "Mean of alg/min - 1.",
    }
}

const DECODERS: [(&str, &str); 2] = [("centre", "Cell's centre"), ("posterior mean", "Posterior mean")];

/// Rows of the points `(what is varied, mean, spread)`. Both figures share their networks where their points meet.
fn rows(context: &Context<'_>, sensors: usize, trials: u64, points: &[(f64, f64, f64)]) -> Result<Vec<Row>, Error> {
    let mut rows = Vec::new();
    for &(at, mean, std) in points {
        // Without spread there is only one network.
        let trials = if std == 0.0 { 1 } else { trials };
        let places = [mean, std].map(|v| (v * 1e9).round() as u64);
        let stream = places
            .into_iter()
            .fold(context.stream("assign-networks"), Stream::indexed);
        let sums = context.tally(
            stream,
            trials,
            || [[Moments::default(); 6]; 2],
            |sums, trial| {
                let variances = if std == 0.0 {
                    vec![mean; sensors]
                } else {
                    draw(trial.stream, sensors, mean, std)?
                };
                let errors = evaluate(&variances)?;
                sums.iter_mut()
                    .flatten()
                    .zip(errors.into_iter().flatten())
                    .for_each(|(sum, e)| sum.add(e));
                Ok::<(), Error>(())
            },
        )?;
        for ((decoder, _), sum) in DECODERS.into_iter().zip(sums) {
            let [alg, min, ii, avg, swap, excess] = sum.each_ref().map(Measured::mean);
            rows.push(Row {
                at,
                decoder,
                trials: sum[0].count(),
                alg,
                min,
                ii,
                avg,
                swap,
                excess,
            });
        }
    }
    Ok(rows)
}

fn claim_orders(rows: &[Row], claims: &mut Claims) {
    claims.keyed("alg", "linear assignment", rows, |r| r.alg);
    claims.keyed("min", "least of all", rows, |r| r.min);
    claims.keyed("ii", "assignment II", rows, |r| r.ii);
    claims.keyed("avg", "mean of all", rows, |r| r.avg);
    let what = "exchanges end on average within 0.5 % of the minimum";
    claims.all("exchange", what, rows, |r| r.swap.value / r.min.value - 1.0 <= 5e-3);
    let what = "for the centre decoder the linear assignment is on average within 2.5 % of the minimum";
    claims.all("excess-center", what, centre(rows), |r| r.excess.value <= 0.025);
}

fn centre(rows: &[Row]) -> impl Iterator<Item = &Row> {
    rows.iter().filter(|r| r.decoder == "centre")
}

fn picture(rows: &[Row], label: &str) -> Plot {
    let panel = |(decoder, title): (&'static str, &str)| {
        let curve = |text: &str, colour, value: fn(&Row) -> Measured| {
            Layer::curve(
                text,
                colour,
                select(rows, |r| r.decoder == decoder)
                    .map(|r| (r.at, value(r)))
                    .collect(),
            )
        };
        Panel::linear(title, label, "mean squared error / V²")
            .with_all(curve("mean of all", 0, |r| r.avg))
            .with_all(curve("assignment II", 1, |r| r.ii))
            .with_all(curve("linear assignment", 2, |r| r.alg))
            .with_all(curve("with exchanges", 3, |r| r.swap))
            .with_all(curve("least of all", 6, |r| r.min))
    };
    Plot::grid(2, DECODERS.map(panel).to_vec())
}

/// Refuses moments that no network of positive variances has.
fn infeasible(sensors: usize, mean: f64, std: f64) -> Option<String> {
    let most = mean * (sensors as f64 - 1.0).sqrt();
    (std >= most).then(|| format!("at a mean of {mean} the deviation must be below {most}"))
}

pub struct Spread;

parameters! {
    pub struct SpreadParameters {
        sensors: usize [2..=7] = 4 => "Number of sensors; all their assignments are enumerated.",
        mean: f64 [1e-4..=10.0] = 0.03 => "Mean of the noise variances, V^2.",
        /// Their population standard deviations, V^2.
        sds: Vec<f64> [0.0..=10.0; 1..=100] = vec![0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03],
        trials: u64 [2..=10_000_000] = 1000 => quick 100 => "Networks at each point.",
    }
    check |p| accept_each("sds", &p.sds, |sd| infeasible(p.sensors, p.mean, *sd));
}

impl Figure for Spread {
    figure!(SpreadParameters => Vec<Row>, "assign-fig6-3", "Error against the spread of the noise variances", "Movaghati, thesis, figure 6.3",
        "Random networks of four sensors with mean noise variance 0.03. The more the sensors differ, the more a good assignment \
         gains; an arbitrary one gains nearly nothing. For the posterior mean the linear assignment is not quite right, and a few \
         exchanges of two sensors mend it.");

    fn run(&self, p: &SpreadParameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let points: Vec<_> = p.sds.iter().map(|&sd| (sd, p.mean, sd)).collect();
        rows(context, p.sensors, p.trials, &points)
    }

    fn claims(&self, _: &SpreadParameters, rows: &Vec<Row>, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        claim_orders(rows, claims);
        let what = "the linear assignment beats assignment II as soon as sensors differ, centre decoder";
        let differ = centre(rows).filter(|r| r.at > 0.0);
        here.all("better-than-ii", what, differ, |r| r.alg.value < r.ii.value);
        here.decreasing("decreasing", "its error falls with the spread", centre(rows).map(|r| r.alg));
        let ends = centre(rows).next().zip(centre(rows).last());
        let what = "the mean over all assignments falls by 6.6 % only";
        let fall = ends.map(|(first, last)| 1.0 - last.avg.value / first.avg.value);
        here.near("average", what, fall, 0.066, 0.004);
        let what = "the gap between mean and linear assignment grows to 0.020";
        let gap = ends.map(|(_, last)| last.avg.value - last.alg.value);
        paper.near("gap", what, gap, 0.020, 1.5e-3);
        let what = "for the posterior mean the linear assignment is up to 15 % above the minimum";
        let excess = rows.iter().map(|r| r.excess.value).fold(0.0, f64::max);
        here.at_most("excess-mmse", what, excess, 0.15);
    }

    fn plot(&self, _: &SpreadParameters, rows: &Vec<Row>) -> Plot {
        picture(rows, "standard deviation of the noise variances / V²")
    }
}

pub struct Mean;

parameters! {
    pub struct MeanParameters {
        sensors: usize [2..=7] = 4 => "Number of sensors; all their assignments are enumerated.",
        /// Means of the noise variances, V^2.
        means: Vec<f64> [1e-4..=10.0; 1..=100] = vec![0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1],
        sd: f64 [0.0..=10.0] = 0.015 => "Their population standard deviation, V^2.",
        trials: u64 [2..=10_000_000] = 1000 => quick 100 => "Networks at each point.",
    }
    check |p| accept_each("means", &p.means, |mean| infeasible(p.sensors, *mean, p.sd));
}

impl Figure for Mean {
    figure!(MeanParameters => Vec<Row>, "assign-fig6-4", "Error against the mean of the noise variances", "Movaghati, thesis, figure 6.4",
        "Random networks of four sensors whose noise variances have standard deviation 0.015. As the noise grows the cost \
         approximation, which counts single wrong bits only, loses its edge: at a mean of 0.1 giving the best sensor the \
         coarsest bit is slightly better.");

    fn run(&self, p: &MeanParameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let points: Vec<_> = p.means.iter().map(|&mean| (mean, mean, p.sd)).collect();
        rows(context, p.sensors, p.trials, &points)
    }

    fn claims(&self, _: &MeanParameters, rows: &Vec<Row>, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        claim_orders(rows, claims);
        let what = "the error of the linear assignment grows with the mean";
        here.increasing("increasing", what, centre(rows).map(|r| r.alg));
        let what = "it beats assignment II up to a mean of 0.08, centre decoder";
        let quiet = centre(rows).filter(|r| r.at <= 0.08);
        paper.all("better-than-ii", what, quiet, |r| r.alg.value < r.ii.value);
        let last = centre(rows).find(|r| r.at == 0.1);
        let what = "and loses to it at 0.1 (erratum assign-3)";
        let loss = last.map(|r| r.ii.value - r.alg.value);
        paper.below("ii-at-last", what, loss, 0.0);
        here.near("ii-value", "assignment II at 0.1", last.map(|r| r.ii.value), 0.1112, 4e-4);
        here.near("alg-value", "linear assignment at 0.1", last.map(|r| r.alg.value), 0.1119, 4e-4);
    }

    fn plot(&self, _: &MeanParameters, rows: &Vec<Row>) -> Plot {
        picture(rows, "mean of the noise variances / V²")
    }
}
