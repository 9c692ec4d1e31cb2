//! Smoothing the sign-bit filter's output.

use super::common::{Plant, plants};
use super::gap::BURN;
use crate::prelude::*;
use fewbits_dymbo::gap::{Twin, exact_filter};
use fewbits_dymbo::{DymboFilter, ScalarFilter};
use fewbits_filters::scalar_fixed_lag_variance;

const ID: &str = "dymbo-smoother";

parameters! {
    pub struct Parameters {
        plants: Vec<Plant> [; 1..] = plants([(0.9, 0.5), (0.9, 0.05), (0.99, 1.0)]) => "Plants, `a:gamma`.",
        lag: Vec<usize> [..=200; 1..] = vec![0, 1, 2, 3, 4, 5, 10, 20] => "Steps between the state and the last bit.",
        trials: u64 [2..=10_000_000] = 400 => quick 20 => "Simulated runs of ten smoothed states.",
    }
}

/// States of a run that are smoothed.
const ANCHORS: usize = 10;
/// Steps between them.
const STRIDE: usize = 4;

rows! {
    pub struct Row by "{plant} {lag}" {
        plant: Plant,
        lag: usize => "Steps between the state and the last bit.",
        trials: u64 => "Simulated runs of ten smoothed states.",
        predicted: f64 ["sigma^2"] => "Steady variance computed by the sign-bit smoother.",
        kalman: f64 ["sigma^2"] => "Steady variance of the unquantized smoother.",
        rts_mse: Measured ["sigma^2"] => "Mean squared error of the sign-bit smoother.",
        exact_mse: Measured ["sigma^2"] => "Mean squared error of the exact smoother of the same bits.",
        excess: Measured ["sigma^2"] => "Mean squared distance of the two smoothed estimates.",
    }
}

/// Errors against the lag.
pub struct Smoothing;

impl Figure for Smoothing {
    figure!(Parameters => Vec<Row>, ID, "Fixed-lag smoothing", "",
        "Error of the state some steps ago: Rauch-Tung-Striebel smoothing of the sign-bit filter's means and variances \
         as if they were normal (points), what it predicts (lines), and the exact smoother of the same bits (crosses). \
         At gamma = 0.05 the sign-bit smoother passes the unquantized filter (dashed) from lag 4 on.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let longest = p.lag.iter().copied().max().unwrap_or(0);
        let mut rows = Vec::new();
        for &plant in &p.plants {
            let model = plant.model()?;
            let filter = DymboFilter::new(model);
            let exact = exact_filter(&model, BURN + ANCHORS * STRIDE + longest)?;
            let stream = context.stream(ID).named(&plant.to_string());
            let empty = || vec![[Moments::default(); 3]; p.lag.len()];
            let sums = context.tally(stream, p.trials, empty, |sums, trial| {
                let mut rng = trial.stream.fast_rng();
                let mut twin = Twin::new(&mut rng, filter, &exact)?;
                (0..BURN).try_for_each(|_| twin.step(&mut rng))?;
                let gaps = twin.smoothed(&mut rng, &p.lag, ANCHORS, STRIDE)?;
                for (sums, gap) in sums.iter_mut().zip(gaps) {
                    // The exact variance is the error of the exact smoother, free of the noise of one realised error.
                    sums[0].add(gap.exact_variance + gap.excess);
                    sums[1].add(gap.exact_variance);
                    sums[2].add(gap.excess);
                }
                Ok::<_, fewbits_dymbo::Error>(())
            })?;
            let (own, kalman) = (model.steady_state(filter.information())?, model.steady_state(1.0)?);
            rows.extend(p.lag.iter().zip(sums).map(|(&lag, sums)| Row {
                plant,
                lag,
                trials: p.trials,
                predicted: scalar_fixed_lag_variance(plant.a, &own, lag),
                kalman: scalar_fixed_lag_variance(plant.a, &kalman, lag),
                rts_mse: Measured::mean(&sums[0]),
                exact_mse: Measured::mean(&sums[1]),
                excess: Measured::mean(&sums[2]),
            }));
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.keyed("rts", "error of the smoother at a, gamma, lag", rows, |r| r.rts_mse);
        claims.keyed("exact", "error of the exact smoother at a, gamma, lag", rows, |r| r.exact_mse);
        claims.keyed("predicted", "predicted variance at a, gamma, lag", rows, |r| r.predicted);
        let at = |gamma: f64, lag: usize| rows.iter().find(|r| r.plant == Plant { a: 0.9, gamma } && r.lag == lag);
        for (gamma, lag, saving) in [(0.5, 5, 0.28), (0.05, 20, 0.21)] {
            let saved = at(gamma, lag)
                .zip(at(gamma, 0))
                .map(|(r, now)| 1.0 - r.rts_mse.value / now.rts_mse.value);
            let what = format!("gamma = {gamma}: a lag of {lag} saves this share of the filter's error");
            here.near(format!("saves-{gamma}"), what, saved, saving, 0.01);
        }
        let slow = rows.iter().filter(|r| r.plant.gamma == 0.5);
        let what = "gamma = 0.5: within 0.14 % of the exact smoother at every lag, less 4.5 standard errors";
        here.all("near-exact", what, slow, |r| {
            r.excess.value - 4.5 * r.excess.standard_error.unwrap_or(0.0) <= 1.45e-3 * r.exact_mse.value
        });
        let difference = at(0.05, 4).zip(at(0.05, 0)).map(|(r, now)| r.rts_mse - now.kalman);
        let what = "gamma = 0.05: from lag 4 the sign-bit smoother beats the unquantized filter";
        here.less("beats-analog", what, difference, 4.5);
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let panel = |rows: &[Row]| {
            let curve = |of: fn(&Row) -> f64| points(rows, |r| (r.lag as f64, of(r)));
            let filter = rows[0].plant.kalman_variance().ok();
            Panel::new(rows[0].plant.title(), Axis::linear("lag"), Axis::linear("error / sigma^2"))
                .with(Layer::line("sign bit, predicted", curve(|r| r.predicted)).coloured(0))
                .with(Layer::measured("sign bit", rows, |r| (r.lag as f64, r.rts_mse)).coloured(0))
                .with(Layer::measured("exact smoother", rows, |r| (r.lag as f64, r.exact_mse)).styled(1, Marker::Cross))
                .with(Layer::line("unquantized smoother", curve(|r| r.kalman)).coloured(2))
                .with(Layer::dashed("unquantized filter", points(rows, |r| (r.lag as f64, filter))).coloured(3))
        };
        let panels: Vec<Panel> = rows.chunks(p.lag.len()).map(panel).collect();
        Plot::grid(panels.len().min(2), panels)
    }
}
