//! Days on two AA cells.

use super::schemes::{self, Scheme};
use super::worlds;
use crate::prelude::*;
use fewbits_network::{Radio, TWO_AA_CELLS};

parameters! {
    pub struct Parameters {
        /// Lengths of a slot, s.
        period: Vec<f64> [0.01..=1e4; 1..] = vec![0.02, 0.1, 1.0],
        /// Power of the rest of the node, mW; 6 is that of a node whose processor never sleeps.
        baseline: Vec<f64> [0.0..=1e3; 1..] = vec![6.0, 0.1],
        /// Slots of a run.
        slots: usize [40..=100_000] = 200 => quick 60,
        /// Runs of each scheme.
        trials: u64 [2..=100_000] = 8 => quick 2,
    }
}

rows! {
    pub struct Row {
        /// The scheme.
        scheme: &'static str,
        /// Its setting.
        setting: String,
        /// How sensors learn the question.
        feedback: &'static str,
        /// Length of a slot.
        period: f64 ["s"],
        /// Power of the rest of the node.
        baseline: f64 ["mW"],
        /// Root mean squared error.
        rmse: Measured,
        /// Energy of the busiest sensor's radio in a slot, beyond what it takes asleep.
        energy: Measured ["J"],
        /// Days until the batteries of the busiest sensor are empty.
        days: f64 ["d"],
        /// Days of a node that neither sends nor receives.
        idle_days: f64 ["d"],
    }
}

/// Lifetimes.
pub struct Lifetime;

const DAY: f64 = 86_400.0;

impl Figure for Lifetime {
    figure!(Parameters => Vec<Row>, "network-lifetime", "Days on two AA cells", "our own comparison",
        "Life of the busiest sensor (CC2420, two AA cells) against the error of the scheme it runs, in the scalar world. At a \
         slot a second the node's own 6 mW decide and no scheme matters; at fifty slots a second, or once the processor sleeps, \
         the scheme decides.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let (world, schemes) = (worlds::scalar()?, schemes::scalar_schemes());
        let runs = context.compare(
            "network-lifetime",
            p.trials,
            &["scalar"],
            |n| (*n).to_owned(),
            &schemes,
            |_, scheme: &Scheme, it| world.run(*scheme, it.stream, p.slots).map(|bill| bill.numbers()),
        )?;
        let radio = Radio::cc2420(0.0)?;
        let mut rows = Vec::new();
        for (baseline, period) in p.baseline.iter().flat_map(|b| p.period.iter().map(move |t| (*b, *t))) {
            for (i, scheme) in schemes.iter().enumerate() {
                let energy = Measured::mean(&runs[0].moments(i, 4));
                let idle = 1e-3 * baseline + radio.sleep.value();
                let days = |power: f64| TWO_AA_CELLS.value() / power / DAY;
                rows.push(Row {
                    scheme: scheme.family(),
                    setting: scheme.setting(),
                    feedback: scheme.talk(),
                    period,
                    baseline,
                    rmse: Measured::root_mean(&runs[0].moments(i, 0)),
                    energy,
                    days: days(idle + energy.value / period),
                    idle_days: days(idle),
                });
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.all("idle", "no node outlives one that is silent", rows, |r| r.days <= r.idle_days);
        let at = |scheme: &str, setting: &str, period: f64, baseline: f64| {
            first(rows, |r| {
                (r.scheme, r.setting.as_str(), r.period, r.baseline) == (scheme, setting, period, baseline)
                    && r.feedback != "told"
            })
            .map(|r| r.days)
        };
        let ratio = |period, baseline| {
            at("CFwMD", "n=0.25", period, baseline)
                .zip(at("all-send", "32 bit", period, baseline))
                .map(|(a, b)| a / b)
        };
        let what = "at a slot a second and 6 mW the scheme matters by five per cent at most";
        here.near("slow", what, ratio(1.0, 6.0), 1.0, 0.05);
        let bits = over(at("Dymbo", "K=4", 0.02, 0.1), at("all-send", "32 bit", 0.02, 0.1));
        let what = "a sensor that must listen before it sends one bit dies before one that sends 32 unasked";
        here.below("echo", what, bits, 1.0);
        let table = over(at("Lloyd-Max-table", "L=2", 0.02, 0.1), at("all-send", "32 bit", 0.02, 0.1));
        here.above("table", "one bit unasked outlives 32 bits", table, 1.0);
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let families = distinct(rows, |r| r.scheme);
        let mut panels = Vec::new();
        for baseline in &p.baseline {
            for period in &p.period {
                let here = || rows.iter().filter(|r| r.baseline == *baseline && r.period == *period);
                let title = format!("{} ms a slot, {baseline} mW", period * 1e3);
                let mut panel = Panel::semilog(title, "days", "RMSE / noise deviation");
                for (colour, family) in families.iter().enumerate() {
                    let rows = here().filter(|r| r.scheme == *family);
                    panel = panel.with(Layer::measured(*family, rows, |r| (r.days, r.rmse)).coloured(colour));
                }
                panels.push(panel);
            }
        }
        Plot::grid(p.period.len(), panels)
    }
}
