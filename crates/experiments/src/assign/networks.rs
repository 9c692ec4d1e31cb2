//! `assign-fig6-3` and `assign-fig6-4`: random networks of given mean and spread of their noise variances.

use crate::prelude::*;
use fewbits_baselines::sensor_assignment::{all_errors, by_precision, variances_with_moments};
use fewbits_sensor_assignment::{CodedSensors, Estimator, exchange, pair_costs};
use rand_distr::{Distribution, StandardNormal};

/// Least variance of a sensor in a random network.
const SMALLEST: f64 = 1e-4;
/// Draws before a network of positive variances is given up.
const MAX_DRAWS: usize = 100_000;

const DECODERS: [(&str, Estimator); 2] = [
    ("centre", Estimator::CellCentre),
    ("posterior mean", Estimator::PosteriorMean),
];

parameters! {
    /// Moments of a network's noise variances.
    pub point struct Moment {
        mean: f64 [1e-4..=10.0] => "Mean of the noise variances, V^2.",
        sd: f64 [0.0..=10.0] => "Their population standard deviation, V^2.",
    }
}

parameters! {
    pub struct Parameters {
        sensors: usize [2..=7] = 4 => "Number of sensors; all their assignments are enumerated.",
        points: Vec<Moment> [; 1..=100] = Vec::new() => "Moments of the noise variances.",
        trials: u64 [2..=10_000_000] = 1000 => quick 100 => "Networks at each point.",
    }
    check |p| {
        let slack = (p.sensors as f64 - 1.0).sqrt();
        accept_each("points", &p.points, |Moment { mean, sd }| {
            let most = mean * slack;
            (*sd >= most).then(|| format!("at a mean of {mean} the deviation must be below {most}"))
        })
    };
}

rows! {
    /// Averages over networks, one row for each decoder.
    pub struct Row by "{at} {decoder}" {
        /// What is varied: standard deviation (`assign-fig6-3`) or mean (`assign-fig6-4`) of the noise variances.
        at: f64 ["V^2"] as x("deviation or mean of the noise variances / V²"),
        decoder: &'static str as panel("{}") => "Decoder.",
        trials: u64 => "Networks averaged.",
        alg: Measured ["V^2"] as curve("linear assignment") => "Squared error of the linear assignment.",
        min: Measured ["V^2"] as curve("least of all") => "Least over all assignments.",
        ii: Measured ["V^2"] as curve("assignment II") => "Most precise sensor to the coarsest bit.",
        avg: Measured ["V^2"] as curve("mean of all") => "Mean over all assignments.",
        swap: Measured ["V^2"] as curve("with exchanges") => "Linear assignment improved by exchanges.",
        excess: Measured => "Mean of alg/min - 1.",
    }
}

/// The noise variances of a network, uniform on the sphere of the given moments.
fn draw(stream: Stream, sensors: usize, moment: &Moment) -> Result<Vec<f64>, Error> {
    let Moment { mean, sd } = *moment;
    let mut rng = stream.rng();
    for _ in 0..MAX_DRAWS {
        let direction: Vec<f64> = (0..sensors).map(|_| StandardNormal.sample(&mut rng)).collect();
        if let Some(variances) = variances_with_moments(mean, sd, SMALLEST, &direction)? {
            return Ok(variances);
        }
    }
    Err(Error::failed(format_args!("no network of mean {mean} and deviation {sd} in {MAX_DRAWS} draws")))
}

/// The errors in the order of the columns, of one decoder after the other.
fn evaluate(variances: &[f64]) -> Result<Vec<f64>, Error> {
    let sensors = CodedSensors::with_variances(1.0, variances)?;
    let linear = pair_costs(&sensors).solve();
    let second = by_precision(variances);
    let mut errors = Vec::new();
    for (_, decoder) in DECODERS {
        let all = all_errors(&sensors, decoder)?;
        let own = sensors.mse(&linear, decoder)?;
        // The enumeration and single evaluations round differently.
        let least = all.least.min(own);
        let (second, swapped) = (sensors.mse(&second, decoder)?, exchange(&sensors, &linear, decoder)?.error);
        errors.extend([own, least, second, all.mean, swapped, own / least - 1.0]);
    }
    Ok(errors)
}

/// A figure over one of the moments.
pub struct Networks {
    about: About,
    points: fn() -> Vec<Moment>,
    varied: fn(&Moment) -> f64,
    /// What is claimed besides the orders that hold everywhere.
    claims: fn(&[Row], &Claims),
}

pub static SPREAD: Networks = Networks {
    about: About::of("assign-fig6-3", "Error against the spread of the noise variances", "Movaghati, thesis, figure 6.3")
        .showing("Random networks of four sensors with mean noise variance 0.03. The more the sensors differ, the more a good assignment \
        gains; an arbitrary one gains nearly nothing. For the posterior mean the linear assignment is not quite right, and a few \
        exchanges of two sensors mend it."),
    points: || [0.0, 0.005, 0.01, 0.015, 0.02, 0.025, 0.03].map(|sd| Moment { mean: 0.03, sd }).into(),
    varied: |moment| moment.sd,
    claims: |rows, claims| {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
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
    },
};

pub static MEAN: Networks = Networks {
    about: About::of("assign-fig6-4", "Error against the mean of the noise variances", "Movaghati, thesis, figure 6.4")
        .showing("Random networks of four sensors whose noise variances have standard deviation 0.015. As the noise grows the cost \
        approximation, which counts single wrong bits only, loses its edge: at a mean of 0.1 giving the best sensor the \
        coarsest bit is slightly better."),
    points: || {
        let means = [0.015, 0.02, 0.03, 0.04, 0.05, 0.06, 0.07, 0.08, 0.09, 0.1];
        means.map(|mean| Moment { mean, sd: 0.015 }).into()
    },
    varied: |moment| moment.mean,
    claims: |rows, claims| {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        let what = "the error of the linear assignment grows with the mean";
        here.increasing("increasing", what, centre(rows).map(|r| r.alg));
        let what = "it beats assignment II up to a mean of 0.08, centre decoder";
        let quiet = centre(rows).filter(|r| r.at <= 0.08);
        paper.all("better-than-ii", what, quiet, |r| r.alg.value < r.ii.value);
        let last = centre(rows).find(|r| r.at == 0.1);
        let what = "and loses to it at 0.1 (erratum assign-3)";
        paper.below("ii-at-last", what, last.map(|r| r.ii.value - r.alg.value), 0.0);
        here.near("ii-value", "assignment II at 0.1", last.map(|r| r.ii.value), 0.1112, 4e-4);
        here.near("alg-value", "linear assignment at 0.1", last.map(|r| r.alg.value), 0.1119, 4e-4);
    },
};

fn centre(rows: &[Row]) -> impl Iterator<Item = &Row> {
    select(rows, |r| r.decoder == "centre")
}

impl Figure for Networks {
    figure!(Parameters => Vec<Row>, about; linear("mean squared error / V²"));

    fn defaults(&self) -> Parameters {
        Parameters {
            points: (self.points)(),
            ..Parameters::default()
        }
    }

    /// Both figures share their networks where their points meet.
    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for moment in &p.points {
            let places = [moment.mean, moment.sd].map(|v| (v * 1e9).round() as u64);
            let stream = context.stream("assign-networks").indexed(places[0]).indexed(places[1]);
            // Without spread there is only one network.
            let trials = if moment.sd == 0.0 { 1 } else { p.trials };
            let one = |trial: Trial| {
                let variances = match moment.sd {
                    0.0 => vec![moment.mean; p.sensors],
                    _ => draw(trial.stream, p.sensors, moment)?,
                };
                evaluate(&variances)
            };
            let sums = context.moments(stream, trials, one)?;
            for ((decoder, _), sums) in DECODERS.into_iter().zip(sums.chunks(6)) {
                rows.push(Row {
                    at: (self.varied)(moment),
                    decoder,
                    trials,
                    alg: sums[0].into(),
                    min: sums[1].into(),
                    ii: sums[2].into(),
                    avg: sums[3].into(),
                    swap: sums[4].into(),
                    excess: sums[5].into(),
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let what = "exchanges end on average within 0.5 % of the minimum";
        claims.all("exchange", what, rows, |r| r.swap.value / r.min.value - 1.0 <= 5e-3);
        let what = "for the centre decoder the linear assignment is on average within 2.5 % of the minimum";
        claims.all("excess-center", what, centre(rows), |r| r.excess.value <= 0.025);
        (self.claims)(rows, claims);
    }
}
