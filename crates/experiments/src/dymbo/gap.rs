//! How much any estimator could gain from the same bits.

use super::common::{Plant, plants};
use crate::prelude::*;
use fewbits_baselines::dymbo::gap::{Twin, exact_filter};
use fewbits_baselines::dymbo::tree;
use fewbits_dymbo::chain::{self, MessageLaw};
use fewbits_dymbo::{DymboFilter, MultibitFilter, ScalarFilter, innovation_gain};

parameters! {
    pub struct Parameters {
        plants: Vec<Plant> [; 1..] = plants([(0.9, 0.5), (0.9, 0.05), (0.99, 1.0), (1.0, 1.0)]) => "Plants, `a:gamma`.",
        tau: f64 [0.01..=10.0] = 1.0 => "Resolution of the first message in noise deviations.",
        depth: usize [1..=14] = 12 => quick 8 => "Bits after the first message whose strings are all followed.",
        trials: u64 [2..=10_000_000] = 400 => quick 50 => "Runs of the steady comparison.",
    }
}

rows! {
    pub struct Rows {
        tree: Vec<Row> => "After a first message, all bit strings.",
        steady: Vec<Steady> => "In the steady state.",
    }

    struct Row by "{plant} {n}" {
        plant: Plant,
        n: usize => "Bits after the first message.",
        mmse: f64 ["sigma^2"] => "Exact minimum mean squared error given the bits.",
        excess: f64 ["sigma^2"] => "What the sign-bit filter adds.",
        riccati: f64 ["sigma^2"] => "Variance that it computes.",
        chain_mse: f64 ["sigma^2"] => "Its error by the error chain: mmse + excess.",
    }

    struct Steady by "{plant}" {
        plant: Plant,
        bits: usize => "Bits a sample.",
        exact_mse: f64 ["sigma^2"] => "Exact steady error of the filter.",
        riccati: f64 ["sigma^2"] => "Variance that it computes.",
        excess: Measured ["sigma^2"] => "Steady distance from the exact posterior mean, squared.",
        mmse: f64 ["sigma^2"] => "Minimum error given the bits, `exact_mse - excess`.",
        kurtosis: f64 => "Kurtosis of the error; 3 if normal.",
        tuned_mse: Option<f64> ["sigma^2"] => "Exact steady error at the best constant gain; one bit only.",
    }
}

/// Steps before the exact posterior has forgotten that it started normal.
const BURN: usize = 40;
/// Steps that are measured afterwards.
const MEASURED: usize = 60;

/// Steady mean squared distance of a filter's estimate from the exact posterior mean.
fn steady_excess(
    filter: &MultibitFilter,
    context: &Context<'_>,
    stream: Stream,
    trials: u64,
) -> Result<Measured, Error> {
    let exact = exact_filter(filter.plant(), BURN + MEASURED)?;
    let sums = context.moments(stream, trials, |trial| {
        let mut rng = trial.stream.fast_rng();
        let mut twin = Twin::new(&mut rng, filter.clone(), &exact)?;
        Ok([twin.steady_excess(&mut rng, BURN, MEASURED)?])
    })?;
    Ok(sums[0].into())
}

/// Exact steady error when the filter's gain is multiplied by a factor: it is that at another predicted variance.
fn scaled_gain_mse(filter: &DymboFilter, factor: f64) -> Result<f64, Error> {
    let (plant, r) = (filter.plant(), filter.plant().measurement_variance());
    let wanted = factor * innovation_gain(plant.steady_state(filter.information())?.predicted_variance, r);
    // P/sqrt(P + r) = g has the root P = (g^2 + g sqrt(g^2 + 4 r))/2.
    let p = 0.5 * wanted * (wanted + (wanted * wanted + 4.0 * r).sqrt());
    Ok(chain::stationary(plant, &MessageLaw::bit(filter, p, &Link::PERFECT)?)?.filtered_mse)
}

/// Least steady error over constant gains, by golden section on a bracket that holds it.
fn tuned_gain_mse(filter: &DymboFilter) -> Result<f64, Error> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.8, 1.3);
    for _ in 0..16 {
        let (left, right) = (high - golden * (high - low), low + golden * (high - low));
        if scaled_gain_mse(filter, left)? < scaled_gain_mse(filter, right)? {
            high = right;
        } else {
            low = left;
        }
    }
    scaled_gain_mse(filter, 0.5 * (low + high))
}

pub struct GapToExact;

impl Figure for GapToExact {
    figure!(Parameters => Rows, "dymbo-gap", "The gap to the exact posterior", "",
        "Mean squared distance of the sign-bit filter's estimate from the exact posterior mean given the same bits, as a \
         fraction of its error: after a first message over all bit strings (left), and in the steady state (right). \
         It stays near a hundredth of a percent: that is all that a better estimator of the present state could gain.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let (mut rows, mut steady) = (Vec::new(), Vec::new());
        for &plant in &p.plants {
            let model = plant.model()?;
            let levels = tree::first_message_tree(&model, p.tau, p.depth)?;
            let exact = chain::first_message_transient(&model, p.tau, 1.0 + p.tau * p.tau / 12.0, p.depth)?;
            rows.extend(levels.iter().zip(&exact[1..]).zip(1..).map(|((level, step), n)| Row {
                plant,
                n,
                mmse: level.mmse,
                excess: level.excess,
                riccati: step.filtered_variance,
                chain_mse: step.mse,
            }));
            for bits in [1, 2] {
                let filter = MultibitFilter::new(model, bits)?;
                let settled = model.steady_state(filter.information())?;
                let error = chain::stationary(&model, &MessageLaw::word(&filter, settled.predicted_variance)?)?;
                let stream = context.stream(self.about().id).named(&format!("{plant} {bits}"));
                let excess = steady_excess(&filter, context, stream, p.trials)?;
                steady.push(Steady {
                    plant,
                    bits,
                    exact_mse: error.filtered_mse,
                    riccati: settled.filtered_variance,
                    excess,
                    mmse: error.filtered_mse - excess.value,
                    kurtosis: error.kurtosis,
                    tuned_mse: (bits == 1)
                        .then(|| tuned_gain_mse(&DymboFilter::new(model)))
                        .transpose()?,
                });
            }
        }
        Ok(Rows { tree: rows, steady })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "minimum error and excess add up to the error chain's, at every step";
        claims.all("adds-up", what, &rows.tree, |r| (r.mmse + r.excess - r.chain_mse).abs() <= 1e-12);
        let of = |bits: usize| rows.steady.iter().filter(move |r| r.bits == bits);
        let what = "the same in percent of the minimum error, at a, gamma";
        claims.keyed("percent", what, of(1), |r| r.excess.scaled(100.0 / r.mmse));
        let what =
            "percent that two-bit words leave to the exact posterior: at most .03 at a = .9, .08 at a = 1, and a tenth";
        here.all("two-bits", what, of(2).filter(|r| r.plant.a != 0.99), |r| {
            let most = if r.plant.a < 1.0 { 0.033 } else { 0.088 };
            100.0 * r.excess.value / r.mmse <= most
        });
        let what = "percent that the best constant gain would save, at a, gamma";
        claims.keyed("tuned", what, of(1), |r| r.tuned_mse.map(|tuned| 100.0 * (1.0 - tuned / r.exact_mse)));
        let what = "exact error over computed variance in the steady state, at a, gamma";
        claims.keyed("nees", what, of(1), |r| r.exact_mse / r.riccati);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let y = Axis::log("excess / minimum error");
        let mut left = Panel::new("After a first message", Axis::linear("bits n"), y.clone());
        for (i, curve) in rows.tree.chunks(p.depth).enumerate() {
            let shares = points(curve, |r| (r.n as f64, r.excess / r.mmse));
            left = left.with(Layer::line(curve[0].plant.title(), shares).coloured(i));
        }
        let x = Axis::categories("plant a, gamma", p.plants.iter().map(|p| format!("{}, {}", p.a, p.gamma)));
        let mut right = Panel::new("Steady state", x, y);
        for (bits, label, marker) in [
            (1, "one bit a sample", Marker::Circle),
            (2, "two bits a sample", Marker::Square),
        ] {
            let those = rows.steady.iter().filter(|r| r.bits == bits).enumerate();
            let shares = Layer::measured(label, those, |(i, r)| (i as f64, r.excess.scaled(1.0 / r.mmse)));
            right = right.with(shares.styled(bits + 3, marker));
        }
        Plot::grid(2, vec![left, right])
    }
}
