//! Rows that hold a tracker's score, and what is claimed of all of them.

use super::world::{Field, Method, Point, Score, World};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::{Reports, Target};

parameters! {
    pub struct Effort {
        pub(super) trials: u64 [2..=100_000] = 120 => quick 8 => "Trajectories of every tracker but message passing with particles.",
        /// Trajectories of message passing with particles, and of the finest grid and largest clouds; the first of the others'.
        pub(super) message_trials: u64 [2..=100_000] = 40 => quick 3,
    }
}

impl Effort {
    /// The methods with their counts.
    pub(super) fn of(&self, methods: &[Method]) -> Vec<(Method, u64)> {
        let expensive = |m: &Method| match m {
            Method::Messages(_) => true,
            Method::Grid(n) => *n > 15,
            Method::Bootstrap(n, _) | Method::RaoBlackwell(n) => *n > 500,
            Method::Linear(..) | Method::Guided(_) => false,
        };
        let count = |m: &Method| if expensive(m) { self.message_trials } else { self.trials };
        methods.iter().map(|m| (*m, count(m))).collect()
    }
}

rows! {
    /// One tracker at one point.
    #[derive(Clone)]
    pub struct Row by "{point} {method}" at full_trials {
        pub(super) point: String => "Which setting.",
        pub(super) snr_db: f64 ["dB"] as panel("{} dB") => "Ratio of the powers of range and noise.",
        pub(super) levels: usize => "Levels of the quantizer.",
        pub(super) method: String as ladder => "Tracker and its particles, draws or nodes an axis.",
        pub(super) family: &'static str => "Kind of tracker.",
        pub(super) size: Option<usize> => "Particles, draws, or nodes an axis.",
        pub(super) score: Score,
    }
}

/// Every method at a point, on the trajectories that all figures share: the first ones, as many as its count says.
pub(super) fn rows(context: &Context<'_>, point: &Point, methods: &[(Method, u64)]) -> Result<Vec<Row>, Error> {
    let (network, target) = (point.network()?, Target::printed()?);
    let most = methods.iter().map(|m| m.1).max().unwrap_or(0);
    let all = context.trials(context.stream("mpa-trajectories"), most, |trial| {
        let world = World::draw(trial.stream, &target, Field::Confined)?;
        let error = |(method, count): &(Method, u64)| {
            let counts = trial.index < *count;
            let run = || Ok(world.mse(&method.run(&world, &network, &target, trial.stream)?));
            counts.then(run).transpose()
        };
        methods.iter().map(error).collect::<Result<Vec<Option<f64>>, Error>>()
    })?;
    let row = |(m, (method, _)): (usize, &(Method, u64))| Row {
        point: point.name.clone(),
        snr_db: point.snr_db,
        levels: point.levels,
        method: method.name(),
        family: method.family(),
        size: method.size(),
        score: Score::of(all.iter().filter_map(|errors| errors[m]).collect()),
    };
    Ok(methods.iter().enumerate().map(row).collect())
}

/// The axis of squared position errors.
pub(super) const MSE: &str = "mean squared error / m^2";

/// The mean squared error in the row of this name: of a tracker at a point.
pub(super) fn mse(rows: &[Row], key: &str) -> Option<f64> {
    find(rows, key).map(|r| r.score.mse.value)
}

/// Means and medians of some rows, a tracker a line.
pub(super) fn ladder<'a>(rows: impl Iterator<Item = &'a Row>) -> Plot {
    plotted(&rows.cloned().collect::<Vec<_>>(), "", &[("", "", &|title, x| Panel::semilog(title, x, MSE))])
}

/// The Gaussian trackers that linearise.
pub(super) const GAUSSIAN: [Method; 5] = [
    Method::EKF_U,
    Method::EKF_NAIVE,
    Method::EKF,
    Method::GMPA,
    Method::TRANSFER,
];

/// They and quadratures on these numbers of nodes an axis.
pub(super) fn deterministic(nodes: &[usize]) -> Vec<Method> {
    let grids = nodes.iter().map(|n| Method::Grid(*n));
    GAUSSIAN.into_iter().chain(grids).collect()
}

/// The particle trackers of one size.
pub(super) fn clouds(n: usize) -> [Method; 4] {
    [
        Method::Guided(n),
        Method::Bootstrap(n, Reports::Levels),
        Method::RaoBlackwell(n),
        Method::Bootstrap(n, Reports::Ranges),
    ]
}

/// Message passing of one size: as published, with narrow kernels, improved.
pub(super) fn messages(n: usize) -> Result<[Method; 3], Error> {
    Ok([Method::published(n)?, Method::narrow(n)?, Method::improved(n)?])
}
