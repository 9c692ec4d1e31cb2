//! How much any estimator could gain from the same bits.

use super::common::{bad, dymbo_steady, pairs, plant};
use super::referee::{Scheme, gap_to_exact};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_dymbo::chain::{self, MessageLaw};
use fewbits_dymbo::{MultibitFilter, ScalarPlant, tree};
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-gap";

/// Plants of the tree, and as pairs those of the steady comparison.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    a: Vec<f64>,
    gamma: Vec<f64>,
    /// Resolution of the first message in noise deviations.
    tau: f64,
    depth: usize,
    trials: u64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            a: vec![0.9, 0.9, 0.99, 1.0],
            gamma: vec![0.5, 0.05, 1.0, 1.0],
            tau: 1.0,
            depth: 12,
            trials: 400,
        }
    }
}

pub(super) struct GapToExact;

/// Exact steady error when the filter's gain is multiplied by a factor.
fn scaled_gain_mse(plant: &ScalarPlant, factor: f64) -> Result<f64, Error> {
    // A crossover assumed by the filter scales its gain; a factor above 1 is reached from a larger predicted variance.
    let wanted = factor * plant.innovation_gain(dymbo_steady(plant)?.predicted_variance);
    // P/sqrt(P + r) = g has the root P = (g^2 + g sqrt(g^2 + 4 r))/2.
    let p = 0.5 * wanted * (wanted + (wanted * wanted + 4.0 * plant.measurement_variance()).sqrt());
    Ok(chain::stationary(plant, &MessageLaw::bit(plant, p, 0.0, 0.0)?)?.filtered_mse)
}

/// Least steady error over constant gains, by golden section on a bracket that holds it.
fn tuned_gain_mse(plant: &ScalarPlant) -> Result<f64, Error> {
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut low, mut high) = (0.8, 1.3);
    for _ in 0..16 {
        let (left, right) = (high - golden * (high - low), low + golden * (high - low));
        if scaled_gain_mse(plant, left)? < scaled_gain_mse(plant, right)? {
            high = right;
        } else {
            low = left;
        }
    }
    scaled_gain_mse(plant, 0.5 * (low + high))
}

impl Figure for GapToExact {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "The gap to the exact posterior",
            caption: "Mean squared distance of the sign-bit filter's estimate from the exact posterior mean given the same bits, as a \
                      fraction of its error: after a first message over all bit strings (left), and in the steady state (right). \
                      It stays near a hundredth of a percent; no better estimator of the present state is worth building from \
                      these bits.",
            source: "",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        if !(1..=14).contains(&p.depth) {
            return Err(bad(ID, "depth", p.depth, "a depth from 1 to 14"));
        }
        if !(p.tau > 0.0 && p.tau.is_finite()) {
            return Err(bad(ID, "tau", p.tau, "a finite number above 0"));
        }
        pairs(ID, &p.a, &p.gamma)?
            .into_iter()
            .try_for_each(|(a, g)| plant(ID, a, g).map(drop))
    }

    fn quicken(&self, p: &mut Parameters) {
        (p.depth, p.trials) = (8, 50);
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("n", "", "bits after the first message"),
            column("mmse", "sigma^2", "exact minimum mean squared error given the bits"),
            column("excess", "sigma^2", "what the sign-bit filter adds"),
            column("riccati", "sigma^2", "variance that it computes"),
            column("chain_mse", "sigma^2", "its error by the error chain: mmse + excess"),
        ]);
        let mut steady = Table::new([
            column("a", "", "plant coefficient"),
            column("gamma", "", "process variance over measurement variance"),
            column("bits", "", "bits a sample"),
            column("exact_mse", "sigma^2", "exact steady error of the filter"),
            column("riccati", "sigma^2", "variance that it computes"),
            column("trials", "", "simulated runs"),
            column("excess", "sigma^2", "steady distance from the exact posterior mean, squared"),
            column("excess_se", "sigma^2", "its standard error"),
            column("mmse", "sigma^2", "exact_mse - excess"),
            column("kurtosis", "", "of the error; 3 if normal"),
            column("tuned_mse", "sigma^2", "exact steady error at the best constant gain; one bit only"),
        ]);
        for (a, gamma) in pairs(ID, &p.a, &p.gamma)? {
            let plant = plant(ID, a, gamma)?;
            let levels = tree::first_message_tree(&plant, p.tau, p.depth)?;
            let exact = chain::first_message_transient(&plant, p.tau, 1.0 + p.tau * p.tau / 12.0, p.depth)?;
            for (n, (level, step)) in levels.iter().zip(&exact[1..]).enumerate() {
                table.push(row![
                    a,
                    gamma,
                    n + 1,
                    level.mmse,
                    level.excess,
                    step.filtered_variance,
                    step.mse
                ])?;
            }
            for bits in [1, 2] {
                let filter = MultibitFilter::new(plant, bits)?;
                let settled = plant.steady_state(filter.information())?;
                let law = MessageLaw::word(&filter, settled.predicted_variance);
                let error = chain::stationary(&plant, &law)?;
                let run = context.monte_carlo(context.stream(ID).named(&format!("{a} {gamma} {bits}")), p.trials);
                let scheme = if bits == 1 {
                    Scheme::Bit { crossover: 0.0 }
                } else {
                    Scheme::Word { bits }
                };
                let excess = gap_to_exact(&plant, &scheme, &run)?;
                let tuned = if bits == 1 { Some(tuned_gain_mse(&plant)?) } else { None };
                steady.push(row![
                    a,
                    gamma,
                    bits,
                    error.filtered_mse,
                    settled.filtered_variance,
                    p.trials,
                    excess.mean(),
                    excess.standard_error(),
                    error.filtered_mse - excess.mean(),
                    error.kurtosis,
                    tuned,
                ])?;
            }
        }
        Ok(Tables::from(table).with("steady", steady))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (mmse, excess) = (tables.main.numbers("mmse")?, tables.main.numbers("excess")?);
        let chain = tables.main.numbers("chain_mse")?;
        let off = mmse
            .iter()
            .zip(&excess)
            .zip(&chain)
            .map(|((m, e), c)| (m + e - c).abs());
        let statement = "minimum error and excess add up to the error chain's, at every step";
        let mut claims = vec![Claim::at_most(
            "adds-up",
            statement,
            crate::legacy::claim::largest(off),
            1e-12,
        )];
        for (gamma, value) in [(0.5, 0.729457924632), (0.05, 0.169930778412)] {
            let last = tables
                .main
                .only("a", 0.9)?
                .only("gamma", gamma)?
                .only("n", 12.0)?
                .numbers("mmse")?;
            let statement = format!("gamma = {gamma}: minimum error after 12 bits");
            let last = last.first().copied().unwrap_or(f64::NAN);
            claims.push(Claim::near(format!("tree-{gamma}"), statement, last, value, 1e-11).at_defaults());
        }
        let steady = tables.named("steady")?;
        let one = steady.only("bits", 1.0)?;
        let entry = |rows: &Table, a: f64, gamma: f64, name: &str| -> Result<f64, Error> {
            let rows = rows.only("a", a)?.only("gamma", gamma)?;
            Ok(rows.numbers(name)?.first().copied().unwrap_or(f64::NAN))
        };
        for (a, gamma, value, error) in [
            (0.9, 0.5, 1.18239e-4, 5.7e-7),
            (0.9, 0.05, 5.87089e-7, 5.3e-9),
            (0.99, 1.0, 1.500426e-3, 1.01e-5),
        ] {
            let tolerance = 4.5 * entry(&one, a, gamma, "excess_se")?.hypot(error);
            let statement = format!("a = {a}, gamma = {gamma}: steady excess over the exact posterior mean");
            let claim = Claim::near(
                format!("excess-{a}-{gamma}"),
                statement,
                entry(&one, a, gamma, "excess")?,
                value,
                tolerance,
            );
            claims.push(claim.at_defaults());
        }
        for (a, gamma, percent) in [
            (0.9, 0.5, 0.016),
            (0.9, 0.05, 0.0004),
            (0.99, 1.0, 0.12),
            (1.0, 1.0, 0.14),
        ] {
            let share = 100.0 * entry(&one, a, gamma, "excess")? / entry(&one, a, gamma, "mmse")?;
            let slack = 450.0 * entry(&one, a, gamma, "excess_se")? / entry(&one, a, gamma, "mmse")?;
            let statement = format!("a = {a}, gamma = {gamma}: the same in percent of the minimum error");
            let claim = Claim::near(format!("percent-{a}-{gamma}"), statement, share, percent, slack + 0.05 * percent);
            claims.push(claim.at_defaults());
        }
        let two = steady.only("bits", 2.0)?;
        for (a, gamma, percent) in [(0.9, 0.5, 0.03), (0.9, 0.05, 0.03), (1.0, 1.0, 0.08)] {
            let share = 100.0 * entry(&two, a, gamma, "excess")? / entry(&two, a, gamma, "mmse")?;
            let statement =
                format!("a = {a}, gamma = {gamma}: percent that two-bit words leave to the exact posterior");
            claims.push(Claim::at_most(format!("two-bits-{a}-{gamma}"), statement, share, 1.1 * percent).at_defaults());
        }
        for (gamma, kurtosis) in [(0.5, 3.097), (0.05, 3.006)] {
            let statement = format!("gamma = {gamma}: kurtosis of the error");
            let found = entry(&one, 0.9, gamma, "kurtosis")?;
            claims.push(Claim::near(format!("kurtosis-{gamma}"), statement, found, kurtosis, 6e-4).at_defaults());
        }
        for (a, gamma, percent) in [(0.9, 0.5, 0.007), (1.0, 1.0, 0.13)] {
            let gain = 100.0 * (1.0 - entry(&one, a, gamma, "tuned_mse")? / entry(&one, a, gamma, "exact_mse")?);
            let statement = format!("a = {a}, gamma = {gamma}: percent that the best constant gain would save");
            claims.push(
                Claim::near(format!("tuned-{a}-{gamma}"), statement, gain, percent, 0.06 * percent + 5e-4)
                    .at_defaults(),
            );
        }
        for (gamma, value) in [(0.5, 1.0023), (0.05, 1.00005)] {
            let statement = format!("gamma = {gamma}: exact error over computed variance in the steady state");
            let ratio = entry(&one, 0.9, gamma, "exact_mse")? / entry(&one, 0.9, gamma, "riccati")?;
            claims.push(Claim::near(format!("nees-{gamma}"), statement, ratio, value, 1e-5).at_defaults());
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let y = Axis::log("excess / minimum error");
        let plants = pairs(ID, &p.a, &p.gamma)?;
        let mut left = Panel::new("After a first message", Axis::linear("bits n"), y.clone());
        for (i, (a, gamma)) in plants.iter().enumerate() {
            let rows = tables.main.only("a", *a)?.only("gamma", *gamma)?;
            let shares = rows
                .numbers("n")?
                .into_iter()
                .zip(rows.points("mmse", "excess")?)
                .map(|(n, (m, e))| (n, e / m));
            left = left.with(Layer::line(format!("a = {a}, gamma = {gamma}"), shares.collect()).coloured(i));
        }
        let names = plants
            .iter()
            .enumerate()
            .map(|(i, (a, g))| (i as f64, format!("{a}, {g}")));
        let x = Axis::linear("plant a, gamma")
            .named(names)
            .between(-0.5, plants.len() as f64 - 0.5);
        let mut right = Panel::new("Steady state", x, y);
        for (bits, marker) in [(1_usize, Marker::Circle), (2, Marker::Square)] {
            let rows = tables.named("steady")?.only("bits", bits)?;
            let shares = rows
                .points("mmse", "excess")?
                .into_iter()
                .enumerate()
                .map(|(i, (m, e))| (i as f64, e / m));
            let errors = rows
                .points("mmse", "excess_se")?
                .into_iter()
                .map(|(m, se)| se / m)
                .collect();
            let label = if bits == 1 {
                "one bit a sample"
            } else {
                "two bits a sample"
            };
            right = right.with(
                Layer::points(label, shares.collect())
                    .with_errors(errors)
                    .coloured(bits + 3)
                    .marked(marker),
            );
        }
        Ok(Plot::grid(2, vec![left.legend(Legend::BottomRight), right.legend(Legend::TopLeft)]))
    }
}
