//! Tables of rates: printed ones beside ours.

use super::pictures::Main;
use super::rows::Ensemble;
use crate::prelude::*;

rows! {
    /// Rates of one budget in one setting.
    pub struct Rates {
        l: f64 ["messages/step"] => "Message budget.",
        setting: String => "How start and noise are read, and the estimator.",
        state: Measured ["messages/step"] => "Mean number of messages, state feedback (CFwMD).",
        covariance: Measured ["messages/step"] => "Mean number of messages, state and covariance feedback (CFwMD2).",
        printed_state: Option<f64> ["messages/step"] => "The first as printed.",
        printed_covariance: Option<f64> ["messages/step"] => "The second as printed.",
    }
}

/// Rates of all budgets and worlds. The print does not say which world is its own: it stands beside all of them.
impl Main for Rates {
    fn of(figure: &str, run: &Ensemble, all: &[Ensemble], printed: bool) -> Vec<Self> {
        // Those of the second kind are printed too, and not met.
        let print = |column: &str| {
            let value = |kind| reference::value(&format!("{figure}/{kind}-{column}/l = {}", run.run.l));
            printed.then(|| value("printed").or_else(|| value("unmet"))).flatten()
        };
        let row = |covariance: &Ensemble| Self {
            l: run.run.l,
            setting: run.run.world.clone(),
            state: run.rate(),
            covariance: covariance.rate(),
            printed_state: print("state"),
            printed_covariance: print("covariance"),
        };
        let covariance = run.run.of("CFwMD2", all).filter(|_| run.run.scheme == "CFwMD");
        covariance.map(row).into_iter().collect()
    }

    /// Rates of both schemes against the budget, with the printed ones.
    fn plot(rows: &[Self]) -> Plot {
        let worlds = distinct(rows, |r| r.setting.clone());
        let panel = |i: usize| {
            let layers = worlds.iter().enumerate().flat_map(|(colour, world)| {
                let ours = under(rows, world).map(|r| (r.l, r.both()[i].0 - r.l));
                Layer::curve(world.as_str(), colour, ours.collect())
            });
            let first = worlds.iter().take(1).flat_map(|world| under(rows, world));
            let printed = points(first, |r| (r.l, r.both()[i].1.map(|p| p - r.l)));
            Panel::linear(FEEDBACK[i].1, "message budget l / (messages/step)", "rate minus budget / (messages/step)")
                .with(Layer::dashed("printed", printed).coloured(7))
                .with_all(layers)
        };
        Plot::grid(2, vec![panel(0), panel(1)])
    }
}

/// What is fed back, briefly and in words.
const FEEDBACK: [(&str, &str); 2] = [
    ("state", "State feedback (CFwMD)"),
    ("covariance", "State and covariance feedback (CFwMD2)"),
];

fn under<'a>(rows: &'a [Rates], world: &'a str) -> impl Iterator<Item = &'a Rates> {
    select(rows, move |r| r.setting == world)
}

impl Rates {
    /// The rate under each feedback, ours and as printed.
    fn both(&self) -> [(Measured, Option<f64>); 2] {
        [
            (self.state, self.printed_state),
            (self.covariance, self.printed_covariance),
        ]
    }
}

/// Claims that the printed rates are met in one world.
pub(super) fn as_printed(claims: &mut Claims, rows: &[Rates], world: &str) {
    for (i, (name, _)) in FEEDBACK.iter().enumerate() {
        let what = format!("rate with {name} feedback as printed ({world})");
        claims.shown(&format!("unmet-{name}"));
        claims.references(&format!("printed-{name}"), &what, under(rows, world), |r| {
            (format!("l = {}", r.l), r.both()[i].0.value)
        });
    }
}

/// Our rate minus the printed one.
pub(super) fn misses(rows: &[Rates], world: &str, l: f64) -> Option<[Measured; 2]> {
    let [(state, printed_state), (covariance, printed)] = first(rows, |r| r.setting == world && r.l == l)?.both();
    Some([state - printed_state?, covariance - printed?])
}
