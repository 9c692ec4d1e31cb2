//! Bits through a noisy link, by a filter that knows and one that does not.

use super::common::{Plant, each};
use super::gap::steady_excess;
use crate::prelude::*;
use fewbits_core::Link;
use fewbits_dymbo::{DymboFilter, ScalarFilter, chain};

const ID: &str = "dymbo-bsc";

parameters! {
    pub struct Parameters {
        a: f64 [-0.999_999..=0.999_999] = 0.9 => "Plant coefficient.",
        gamma: Vec<f64> [1e-4..=1e3; 1..] = vec![0.5, 0.05] => "Process variances over measurement variance.",
        crossover: Vec<f64> [0.0..=0.499; 1..] = vec![0.0, 0.01, 0.05, 0.1, 0.2, 0.3] => "Probabilities that a bit is inverted.",
        trials: u64 [2..=10_000_000] = 400 => quick 40 => "Runs of the comparison with the exact posterior.",
    }
}

rows! {
    pub struct Row by "{plant} {crossover}" {
        plant: Plant,
        crossover: f64 => "Probability that a bit is inverted.",
        riccati: f64 ["sigma^2"] => "Steady variance computed by the filter that knows.",
        aware_mse: f64 ["sigma^2"] => "Its exact mean squared error.",
        naive_mse: f64 ["sigma^2"] => "Exact mean squared error of the filter that does not know.",
        trials: u64 => "Runs of the comparison with the exact posterior.",
        excess: Measured ["sigma^2"] => "Mean squared distance of the aware estimate from the exact posterior mean.",
    }
}

/// Errors against the crossover.
pub struct NoisyBits;

impl Figure for NoisyBits {
    figure!(Parameters => Vec<Row>, ID, "Noisy bits", "",
        "Exact steady error when the link inverts each bit with a probability, of the filter that knows it (solid; its \
         prediction dashed) and of one that does not (points). Below one inverted bit in a hundred, knowing does not \
         pay; at three in ten it saves a tenth.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for plant in each(p.a, &p.gamma) {
            let model = plant.model()?;
            for &crossover in &p.crossover {
                let link = Link::flipping(crossover)?;
                let (aware, naive) = (DymboFilter::new(model).with_link(link), DymboFilter::new(model));
                let stream = context.stream(ID).named(&format!("{} {crossover}", plant.gamma));
                rows.push(Row {
                    plant,
                    crossover,
                    riccati: model.steady_state(aware.information())?.filtered_variance,
                    aware_mse: chain::dymbo_mse(&aware)?,
                    naive_mse: chain::crossover_mse(&naive, &link)?,
                    trials: p.trials,
                    excess: steady_excess(&aware, context, stream, p.trials)?,
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        claims.keyed("aware", "exact error of the filter that knows, at a, gamma, crossover", rows, |r| r.aware_mse);
        let what = "exact error of the filter that does not know, at a, gamma, crossover";
        claims.keyed("naive", what, rows, |r| r.naive_mse);
        let what = "relative cost of not knowing, at a, gamma, crossover";
        claims.keyed("cost", what, rows, |r| r.naive_mse / r.aware_mse - 1.0);
        let rare = rows.iter().filter(|r| r.crossover == 0.01);
        let what = "at one inverted bit in a hundred knowing changes less than 0.01 %";
        here.all("rare", what, rare, |r| (r.naive_mse / r.aware_mse - 1.0).abs() <= 1e-4);
        let fast = rows.iter().filter(|r| r.plant.gamma == 0.5);
        let under = fast.map(|r| r.aware_mse / r.riccati - 1.0).fold(0.0, f64::max);
        here.near("under-predicts", "gamma = 0.5: the prediction is too low by up to 1.6 %", under, 0.0155, 0.001);
        let noisy = rows.iter().filter(|r| r.crossover >= 0.1);
        let what = "from crossover 0.1 on the exact posterior would gain at most 0.012 %";
        paper.all("gap", what, noisy, |r| r.excess.value <= 1.2e-4 * r.aware_mse);
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let panel = |rows: &[Row]| {
            let curve = |of: fn(&Row) -> f64| points(rows, |r| (r.crossover, of(r)));
            let (x, y) =
                (Axis::linear("probability that a bit is inverted"), Axis::linear("mean squared error / sigma^2"));
            Panel::new(rows[0].plant.title(), x, y)
                .with(Layer::line("knows, exact", curve(|r| r.aware_mse)).coloured(0))
                .with(Layer::dashed("knows, predicted", curve(|r| r.riccati)).coloured(2))
                .with(Layer::points("does not know, exact", curve(|r| r.naive_mse)).coloured(1))
        };
        Plot::grid(2, rows.chunks(p.crossover.len()).map(panel).collect())
    }
}
