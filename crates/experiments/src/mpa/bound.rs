//! `mpa-crlb`: posterior Cramer-Rao bounds and what trackers reach on free trajectories.

use super::world::{Field, Method, Point, STEPS, Score, World, prior};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::{CramerRao, Target, position_information};

parameters! {
    pub struct Parameters {
        trials: u64 [2..=100_000] = 120 => quick 10 => "Free trajectories.",
    }
}

rows! {
    pub struct Row by "{snr_db}dB-L{levels}" at full_trials {
        snr_db: f64 ["dB"] as x("SNR / dB") => "Ratio of the powers of range and noise.",
        levels: usize as panel("{} levels") => "Levels of the quantizer.",
        quantized: Measured as line("bound") => "Bound for levels, mean over the steps.",
        unquantized: Measured as dashed("bound of ranges") => "Bound for the ranges themselves, which has no mean over free trajectories (erratum mpa-17).",
        grid: Measured as points("grid, mean") => "Grid of 25 nodes an axis.",
        message_passing: Measured => "Gaussian message passing.",
        unquantized_filter: Measured => "Extended Kalman filter of the ranges.",
        grid_median: f64 as points("grid, median") => "Median of the grid.",
        message_passing_median: f64 => "Median.",
        unquantized_filter_median: f64 => "Median.",
    }
}

pub struct Bounds;

const LEVELS: [usize; 3] = [2, 4, 16];
/// Groups of trajectories for standard errors.
const GROUPS: usize = 20;
const SNRS: [f64; 4] = [20.0, 30.0, 40.0, 50.0];

/// Sums of both information matrices over trajectories, a step each.
type Sums = Vec<[Matrix4<f64>; 2]>;

impl Figure for Bounds {
    figure!(Parameters => Vec<Row>, "mpa-crlb", "Bounds for quantized ranges", "",
        "Posterior Cramer-Rao bounds over free trajectories, accelerations known, with the references of the grid filter; \
         and what is reached. At 50 dB the bound is far below: information sits at the edges of the cells."; semilog(super::scores::MSE));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let target = Target::printed()?;
        let mut bounds = Vec::new();
        for snr_db in SNRS {
            for levels in LEVELS {
                let network = Point::published(snr_db, levels)?.network()?;
                let one = |trial: Trial| -> Result<([f64; 3], Sums), Error> {
                    let world = World::draw(trial.stream, &target, Field::Free)?;
                    let run = |method: Method| method.run(&world, &network, &target, trial.stream);
                    let runs = [run(Method::Grid(25))?, run(Method::GMPA)?, run(Method::EKF_U)?];
                    let mut previous = prior()?;
                    let mut sums = Vec::with_capacity(STEPS);
                    for (k, x) in world.track.iter().enumerate() {
                        let references = network.references(&target, k, &previous)?;
                        let place = Vector2::new(x[0], x[1]);
                        let information = |levels| position_information(network.sensors(), &place, levels);
                        sums.push([information(Some((&references, levels)))?, information(None)?]);
                        previous = runs[0][k];
                    }
                    Ok((runs.map(|run| world.mse(&run)), sums))
                };
                let all = context.trials(context.stream("mpa-free"), p.trials, one)?;
                // The bound without the trajectories of one group of `GROUPS`.
                let without = |which: usize, group: Option<usize>| -> Result<f64, Error> {
                    let mut bound = CramerRao::new(*prior()?.covariance());
                    let mut mean = Moments::default();
                    let kept = || all.iter().enumerate().filter(|(i, _)| Some(i % GROUPS) != group);
                    for k in 0..STEPS {
                        let sum: Matrix4<f64> = kept().map(|(_, (_, sums))| sums[k][which]).sum();
                        bound.step_with(&target, &(sum / kept().count().max(1) as f64))?;
                        mean.add(bound.position());
                    }
                    Ok(mean.mean())
                };
                // Standard error by the jackknife: the information is averaged before it is inverted.
                let bound = |which: usize| -> Result<Measured, Error> {
                    let groups = (0..GROUPS).map(|group| without(which, Some(group)));
                    let spread: Moments = groups.collect::<Result<Vec<f64>, Error>>()?.into_iter().collect();
                    Ok(Measured::new(without(which, None)?, spread.standard_error() * (GROUPS - 1) as f64))
                };
                let score = |m: usize| Score::of(all.iter().map(|(errors, _)| errors[m]).collect());
                let [grid, message_passing, filter] = [0, 1, 2].map(score);
                bounds.push(Row {
                    snr_db,
                    levels,
                    quantized: bound(0)?,
                    unquantized: bound(1)?,
                    grid: grid.mse,
                    message_passing: message_passing.mse,
                    unquantized_filter: filter.mse,
                    grid_median: grid.median.value,
                    message_passing_median: message_passing.median.value,
                    unquantized_filter_median: filter.median.value,
                });
            }
        }
        Ok(bounds)
    }

    fn claims(&self, _: &Parameters, t: &Vec<Row>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        claims.all("floor", "no tracker of levels is below its bound", t, |r| {
            let above = |m: Measured| m.value > r.quantized.value - 3.0 * m.error();
            above(r.grid) && above(r.message_passing)
        });
        claims.all("order", "levels never tell more than ranges", t, |r| r.quantized.value > r.unquantized.value);
        for snr in SNRS {
            let of = select(t, |r| r.snr_db == snr).map(|r| r.quantized.value);
            full.decreasing(format!("levels-{snr}"), "fewer levels, larger bound", of);
        }
        let loose = first(t, |r| r.snr_db == 50.0 && r.levels == 4);
        full.above("loose", "at 50 dB the bound says little", loose.map(|r| r.grid_median / r.quantized.value), 5.0);
    }
}
