//! Several one-bit sensors in each slot.

use super::common::{Plant, each};
use crate::prelude::*;
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant, chain, steady};
use fewbits_monte_carlo::parallel;

parameters! {
    pub struct Parameters {
        a: f64 [-1.0..=1.0] = 0.9 => "Plant coefficient.",
        gamma: Vec<f64> [1e-4..=1e3; 1..] = vec![0.5, 0.05] => "Process variances over measurement variance.",
        sensors: Vec<usize> [1..=100; 1..] = vec![1, 2, 3, 4, 5, 7, 10, 14, 20] => "Sensors a slot.",
    }
}

rows! {
    pub struct Row by "{plant} {sensors}" {
        plant: Plant,
        sensors: usize => "Sensors a slot, K.",
        sequential: f64 ["sigma^2"] => "Computed steady variance, one after the other.",
        sequential_mse: Option<f64> ["sigma^2"] => "Exact error of that; up to ten sensors.",
        parallel: f64 ["sigma^2"] => "Computed steady variance, all at once, linear fusion.",
        parallel_mse: f64 ["sigma^2"] => "Exact error of that.",
        table: f64 ["sigma^2"] => "Computed steady variance, all at once, count table.",
        table_mse: f64 ["sigma^2"] => "Exact error of that.",
        kalman: f64 ["sigma^2"] => "Kalman filter with K unquantized sensors.",
    }
}

/// Most sensors whose bit strings are followed exactly.
const LONGEST: usize = 10;

/// Errors against the number of sensors.
pub struct SeveralSensors;

impl Figure for SeveralSensors {
    figure!(Parameters => Vec<Row>, "dymbo-sensors", "Several one-bit sensors a slot", "",
        "Steady error with K one-bit sensors: one after the other against the refreshed threshold, or all at once, \
         fused linearly or through the count table; below, K unquantized sensors. Two one-bit sensors in turn are \
         worth one unquantized sensor, but for 0.14 %. Bits sent at once share the prediction error and saturate.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        let plants = each(p.a, &p.gamma);
        let cases: Vec<_> = plants
            .iter()
            .flat_map(|plant| p.sensors.iter().map(move |k| (*plant, *k)))
            .collect();
        let row = |&(plant, k): &(Plant, usize)| {
            let model = plant.model()?;
            let fused =
                |fusion| -> Result<_, Error> { Ok(chain::parallel_mse(&ParallelFilter::new(model, k, fusion)?)?) };
            let (parallel_mse, parallel) = fused(CountFusion::Linear)?;
            let (table_mse, table) = fused(CountFusion::Exact)?;
            let together = ScalarPlant::new(plant.a, plant.gamma, 1.0 / k as f64)?;
            Ok(Row {
                plant,
                sensors: k,
                sequential: steady::sequential_steady_state(&model, k)?.filtered_variance,
                sequential_mse: (k <= LONGEST).then(|| chain::sequential_mse(&model, k)).transpose()?,
                parallel,
                parallel_mse,
                table,
                table_mse,
                kalman: together.steady_state(1.0)?.filtered_variance,
            })
        };
        parallel::try_map(&cases, row)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = |what: &str| format!("{what}, at a, gamma, sensors");
        claims.keyed("sequential", &what("computed variance in turn"), rows, |r| r.sequential);
        claims.keyed("parallel", &what("exact error at once, linear fusion"), rows, |r| r.parallel_mse);
        claims.keyed("table", &what("exact error at once, count table"), rows, |r| r.table_mse);
        claims.keyed("kalman", &what("variance of unquantized sensors"), rows, |r| r.kalman);
        let at = |k: usize| first(rows, |r| r.plant == Plant { a: 0.9, gamma: 0.5 } && r.sensors == k);
        let two = at(2).zip(at(1));
        let what = "gamma = 0.5: by computed variance two one-bit sensors in turn beat one unquantized sensor";
        let ratio = two.map(|(two, one)| two.sequential / one.kalman);
        here.below("two-beat-one", what, ratio, 1.0);
        let what = "gamma = 0.5: by exact error they miss it by 0.14 %";
        let ratio = two.and_then(|(two, one)| Some(two.sequential_mse? / one.kalman));
        here.near("two-miss-one", what, ratio, 1.00139, 1e-5);
        let what = "gamma = 0.5, ten sensors: relative saving of the count table";
        let saved = at(10).map(|r| 1.0 - r.table_mse / r.parallel_mse);
        here.near("table-saves", what, saved, 0.026, 1e-3);
        claims.all("turns", "in turn is never worse than at once", rows, |r| r.sequential <= r.parallel * (1.0 + 1e-9));
        let what = "the count table is never worse than linear fusion";
        claims.all("table-wins", what, rows, |r| r.table <= r.parallel * (1.0 + 1e-9));
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let panel = |rows: &[Row]| {
            let curve = |of: fn(&Row) -> Option<f64>| points(rows, |r| (r.sensors as f64, of(r)));
            Panel::new(rows[0].plant.title(), Axis::log("sensors a slot"), Axis::log("steady error / sigma^2"))
                .with(Layer::line("at once, linear, predicted", curve(|r| Some(r.parallel))).coloured(1))
                .with(Layer::points("at once, linear, exact", curve(|r| Some(r.parallel_mse))).coloured(1))
                .with(Layer::points("at once, table, exact", curve(|r| Some(r.table_mse))).styled(2, Marker::Triangle))
                .with(Layer::line("in turn, predicted", curve(|r| Some(r.sequential))).coloured(0))
                .with(Layer::points("in turn, exact", curve(|r| r.sequential_mse)).styled(0, Marker::Square))
                .with(Layer::dashed("unquantized", curve(|r| Some(r.kalman))).coloured(3))
        };
        Plot::grid(2, rows.chunks(p.sensors.len()).map(panel).collect())
    }
}
