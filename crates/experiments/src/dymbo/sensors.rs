//! Several one-bit sensors in each slot.

use super::common::{bad, not_empty, plant};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Marker, Panel, Plot};
use fewbits_dymbo::{CountFusion, ParallelFilter, ScalarPlant, chain, steady};
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-sensors";

/// Plant and numbers of sensors.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: f64,
    gamma: Vec<f64>,
    sensors: Vec<usize>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: 0.9,
            gamma: vec![0.5, 0.05],
            sensors: vec![1, 2, 3, 4, 5, 7, 10, 14, 20],
        }
    }
}

/// Most sensors whose bit strings are followed exactly.
const LONGEST: usize = 10;

pub(super) struct SeveralSensors;

impl Figure for SeveralSensors {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "Several one-bit sensors a slot",
            caption: "Steady error with K one-bit sensors: one after the other against the refreshed threshold, or all at once, \
                      fused linearly or through the count table; below, K unquantized sensors. Two one-bit sensors in turn are \
                      worth one unquantized sensor. Bits sent at once share the prediction error and saturate.",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "gamma", &p.gamma)?;
        not_empty(ID, "sensors", &p.sensors)?;
        if let Some(k) = p.sensors.iter().find(|k| !(1..=100).contains(*k)) {
            return Err(bad(ID, "sensors", k, "numbers from 1 to 100"));
        }
        p.gamma.iter().try_for_each(|g| plant(ID, p.a, *g).map(drop))
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("gamma", "", "process variance over measurement variance"),
            column("sensors", "", "sensors a slot, K"),
            column("sequential", "sigma^2", "computed steady variance, one after the other"),
            column("sequential_mse", "sigma^2", "exact error of that; up to ten sensors"),
            column("parallel", "sigma^2", "computed steady variance, all at once, linear fusion"),
            column("parallel_mse", "sigma^2", "exact error of that"),
            column("table", "sigma^2", "computed steady variance, all at once, count table"),
            column("table_mse", "sigma^2", "exact error of that"),
            column("kalman", "sigma^2", "Kalman filter with K unquantized sensors"),
        ]);
        for &gamma in &p.gamma {
            let plant = plant(ID, p.a, gamma)?;
            for &k in &p.sensors {
                let sequential = steady::sequential_steady_state(&plant, k)?.filtered_variance;
                let sequential_mse = if k <= LONGEST {
                    Some(chain::sequential_mse(&plant, k)?)
                } else {
                    None
                };
                let (parallel_mse, parallel) =
                    chain::parallel_mse(&ParallelFilter::new(plant, k, CountFusion::Linear)?)?;
                let (table_mse, table_variance) =
                    chain::parallel_mse(&ParallelFilter::new(plant, k, CountFusion::Table)?)?;
                let together = ScalarPlant::new(p.a, gamma, 1.0 / k as f64)?;
                let kalman = together.steady_state(1.0)?.filtered_variance;
                table.push(row![
                    gamma,
                    k,
                    sequential,
                    sequential_mse,
                    parallel,
                    parallel_mse,
                    table_variance,
                    table_mse,
                    kalman
                ])?;
            }
        }
        Ok(table.into())
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        let at = |gamma: f64, k: usize, name: &str| -> Result<f64, Error> {
            let rows = tables.main.only("gamma", gamma)?.only("sensors", k)?;
            Ok(rows.points("sensors", name)?.first().map_or(f64::NAN, |p| p.1))
        };
        for (name, values) in [
            ("sequential", [0.7279, 0.4670, 0.3511, 0.2387, 0.1350]),
            ("parallel_mse", [0.7296, 0.4852, 0.3732, 0.2620, 0.1563]),
            ("kalman", [0.4678, 0.2987, 0.2238, 0.1514, 0.0850]),
        ] {
            for (k, value) in [1, 2, 3, 5, 10].into_iter().zip(values) {
                let statement = format!("gamma = 0.5, {k} sensors: {name}");
                claims
                    .push(Claim::near(format!("{name}-{k}"), statement, at(0.5, k, name)?, value, 6e-5).at_defaults());
            }
        }
        let statement = "gamma = 0.5: by computed variance two one-bit sensors in turn beat one unquantized sensor";
        claims.push(
            Claim::below("two-beat-one", statement, at(0.5, 2, "sequential")?, at(0.5, 1, "kalman")?).at_defaults(),
        );
        let ratio = at(0.5, 2, "sequential_mse")? / at(0.5, 1, "kalman")?;
        let statement = "gamma = 0.5: by exact error they miss it by 0.14 %";
        claims.push(Claim::near("two-miss-one", statement, ratio, 1.00139, 1e-5).at_defaults());
        let statement = "gamma = 0.5, ten sensors: exact error through the count table";
        claims.push(Claim::near("table-10", statement, at(0.5, 10, "table_mse")?, 0.1523, 6e-5).at_defaults());
        let saved = 1.0 - at(0.5, 10, "table_mse")? / at(0.5, 10, "parallel_mse")?;
        let statement = "gamma = 0.5, ten sensors: relative saving of the count table";
        claims.push(Claim::near("table-saves", statement, saved, 0.026, 1e-3).at_defaults());
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?;
            let (sequential, parallel) = (rows.numbers("sequential")?, rows.numbers("parallel")?);
            let worse = sequential
                .iter()
                .zip(&parallel)
                .filter(|(s, q)| **s > **q * (1.0 + 1e-9))
                .count();
            let statement = format!("gamma = {gamma}: in turn is never worse than at once");
            claims.push(Claim::never(format!("turns-{gamma}"), statement, worse));
            let (table, linear) = (rows.numbers("table")?, rows.numbers("parallel")?);
            let worse = table
                .iter()
                .zip(&linear)
                .filter(|(t, l)| **t > **l * (1.0 + 1e-9))
                .count();
            let statement = format!("gamma = {gamma}: the count table is never worse than linear fusion");
            claims.push(Claim::never(format!("table-{gamma}"), statement, worse));
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for &gamma in &p.gamma {
            let rows = tables.main.only("gamma", gamma)?;
            let title = format!("a = {}, gamma = {gamma}", p.a);
            panels.push(
                Panel::new(title, Axis::log("sensors a slot"), Axis::log("steady error / sigma^2"))
                    .with(Layer::line("at once, linear, predicted", rows.points("sensors", "parallel")?).coloured(1))
                    .with(Layer::points("at once, linear, exact", rows.points("sensors", "parallel_mse")?).coloured(1))
                    .with(
                        Layer::points("at once, table, exact", rows.points("sensors", "table_mse")?)
                            .coloured(2)
                            .marked(Marker::Triangle),
                    )
                    .with(Layer::line("in turn, predicted", rows.points("sensors", "sequential")?).coloured(0))
                    .with(
                        Layer::points("in turn, exact", rows.points("sensors", "sequential_mse")?)
                            .coloured(0)
                            .marked(Marker::Square),
                    )
                    .with(Layer::dashed("unquantized", rows.points("sensors", "kalman")?).coloured(3)),
            );
        }
        Ok(Plot::grid(2, panels))
    }
}
