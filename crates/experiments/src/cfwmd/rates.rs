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
        type Columns = (fn(&Rates) -> Measured, fn(&Rates) -> Option<f64>);
        let columns: [(&str, Columns); 2] = [
            ("State feedback (CFwMD)", (|r| r.state, |r| r.printed_state)),
            ("State and covariance feedback (CFwMD2)", (|r| r.covariance, |r| r.printed_covariance)),
        ];
        let panel = |(title, (ours, printed)): (&str, Columns)| {
            let worlds = distinct(rows, |r| r.setting.clone());
            let first = rows.iter().filter(|r| Some(&r.setting) == worlds.first());
            let layers = worlds.iter().enumerate().flat_map(|(colour, world)| {
                let own = rows.iter().filter(|r| r.setting == *world);
                Layer::curve(world.as_str(), colour, own.map(|r| (r.l, ours(r) - r.l)).collect())
            });
            Panel::linear(title, "message budget l / (messages/step)", "rate minus budget / (messages/step)")
                .with(Layer::dashed("printed", points(first, |r| (r.l, printed(r).map(|p| p - r.l)))).coloured(7))
                .with_all(layers)
        };
        Plot::grid(2, columns.map(panel).into())
    }
}

/// Claims that the printed rates are met in one world.
pub(super) fn as_printed(claims: &mut Claims, rows: &[Rates], world: &str) {
    type Column = fn(&Rates) -> Measured;
    let columns: [(&str, Column); 2] = [("state", |r| r.state), ("covariance", |r| r.covariance)];
    for (name, of) in columns {
        let what = format!("rate with {name} feedback as printed ({world})");
        let own = rows.iter().filter(|r| r.setting == world);
        claims.shown(&format!("unmet-{name}"));
        claims.references(&format!("printed-{name}"), &what, own, |r| (format!("l = {}", r.l), of(r).value));
    }
}

/// Our rate minus the printed one.
pub(super) fn misses(rows: &[Rates], world: &str, l: f64) -> Option<[Measured; 2]> {
    let row = rows.iter().find(|r| r.setting == world && r.l == l)?;
    Some([row.state - row.printed_state?, row.covariance - row.printed_covariance?])
}
