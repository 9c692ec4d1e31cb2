//! One shape for all simulated figures: schemes on common trials, step and summary tables, paired differences.

use super::ensemble::{Ensemble, find, paired_table, step_table, summary_table};
use crate::error::Error;
use crate::legacy::claim::Claim;
use crate::legacy::{About, Context, Figure};
use crate::legacy::{Table, Tables};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::marker::PhantomData;

/// A simulated figure: what to run and what to claim.
pub(super) trait Case: Sync + 'static {
    /// Parameters.
    type Setting: Serialize + DeserializeOwned;

    fn about() -> About;
    /// The publication's setting.
    fn setting() -> Self::Setting;
    /// Less work.
    fn quicken(setting: &mut Self::Setting);
    /// Runs all schemes at all budgets.
    fn simulate(setting: &Self::Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error>;
    /// Schemes to compare trial by trial, at each budget where both ran.
    fn pairs() -> Vec<(&'static str, &'static str)>;
    fn claims(setting: &Self::Setting, tables: &Tables) -> Result<Vec<Claim>, Error>;
    /// Ids (or their beginnings) of claims that no trial count blurs; all others need the full one.
    fn exact() -> &'static [&'static str] {
        &[]
    }
    /// The main table; the RMSE of every step unless overridden.
    fn main(ensembles: &[Ensemble]) -> Result<Table, Error> {
        step_table(ensembles)
    }
    /// Further tables.
    fn further(_setting: &Self::Setting, _context: &Context<'_>, tables: Tables) -> Result<Tables, Error> {
        Ok(tables)
    }
    fn measures_time() -> bool {
        false
    }
    /// The picture; RMSE against time unless overridden.
    fn plot(tables: &Tables) -> Result<Plot, Error> {
        rmse_by_step(&tables.main)
    }
}

/// The figure of a case.
pub(super) struct Simulated<C>(PhantomData<fn() -> C>);

impl<C> Simulated<C> {
    pub(super) const fn new() -> Self {
        Self(PhantomData)
    }
}

/// A case's parameters with its default.
#[derive(Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub(super) struct Preset<C: Case> {
    setting: C::Setting,
}

impl<C: Case> Default for Preset<C> {
    fn default() -> Self {
        Self { setting: C::setting() }
    }
}

impl<C: Case> Figure for Simulated<C> {
    type Parameters = Preset<C>;

    fn about(&self) -> About {
        C::about()
    }

    fn quicken(&self, parameters: &mut Preset<C>) {
        C::quicken(&mut parameters.setting);
    }

    fn measures_time(&self) -> bool {
        C::measures_time()
    }

    fn run(&self, parameters: &Preset<C>, context: &Context<'_>) -> Result<Tables, Error> {
        let ensembles = C::simulate(&parameters.setting, context)?;
        let mut pairs = Vec::new();
        for (first, second) in C::pairs() {
            for ensemble in ensembles.iter().filter(|e| e.scheme == first) {
                if let Ok(other) = find(&ensembles, second, ensemble.messages)
                    && other.records.len() == ensemble.records.len()
                {
                    pairs.push((ensemble, other));
                }
            }
        }
        let tables = Tables::from(C::main(&ensembles)?)
            .with("summary", summary_table(&ensembles)?)
            .with("paired", paired_table(&pairs)?);
        C::further(&parameters.setting, context, tables)
    }

    fn claims(&self, parameters: &Preset<C>, tables: &Tables) -> Result<Vec<Claim>, Error> {
        // Claims speak of the publication's budgets and schemes; elsewhere there may be nothing to claim.
        let own = serde_json::to_value(&parameters.setting).ok() == serde_json::to_value(C::setting()).ok();
        match C::claims(&parameters.setting, tables) {
            Err(Error::Table(_)) if !own => Ok(Vec::new()),
            claims => Ok(claims?
                .into_iter()
                .map(|claim| {
                    let exact = C::exact().iter().any(|id| claim.id.starts_with(id));
                    if exact { claim } else { claim.needs_full_trials() }
                })
                .collect()),
        }
    }

    fn plot(&self, _: &Preset<C>, tables: &Tables) -> Result<Plot, Error> {
        C::plot(tables)
    }
}

/// Distinct entries of a column, in order of appearance.
pub(super) fn distinct(table: &Table, name: &str) -> Result<Vec<String>, Error> {
    let mut seen: Vec<String> = Vec::new();
    for text in table.texts(name)? {
        if !seen.contains(&text) {
            seen.push(text);
        }
    }
    Ok(seen)
}

/// Distinct budgets, in order of appearance.
pub(super) fn budgets(table: &Table) -> Result<Vec<f64>, Error> {
    let mut seen: Vec<f64> = Vec::new();
    for l in table.numbers("l")? {
        if !seen.contains(&l) {
            seen.push(l);
        }
    }
    Ok(seen)
}

/// Position and velocity RMSE against the time step, a curve for each scheme (and budget).
pub(super) fn rmse_by_step(steps: &Table) -> Result<Plot, Error> {
    let mut panels = Vec::new();
    let budgets = budgets(steps)?;
    for (title, column, error, label) in [
        ("Position", "pos_rmse_m", "pos_se", "RMSE (m)"),
        ("Velocity", "vel_rmse_mps", "vel_se", "RMSE (m/s)"),
    ] {
        let mut panel = Panel::new(title, Axis::linear("time step k"), Axis::linear(label)).legend(Legend::Outside);
        for (order, scheme) in distinct(steps, "scheme")?.iter().enumerate() {
            for (b, l) in budgets.iter().enumerate() {
                let rows = steps.only("scheme", scheme.as_str())?.only("l", *l)?;
                let points = rows.points("k", column)?;
                if points.is_empty() {
                    continue;
                }
                let one_budget = budgets.len() == 1;
                let (name, colour, solid) = if one_budget {
                    // A suffix marks the same scheme in a second world.
                    (scheme.clone(), colour_of(scheme, order), !scheme.ends_with(SECOND_WORLD))
                } else {
                    (format!("{scheme}, l = {l}"), b, scheme == "CFwMD")
                };
                let curve = if solid {
                    Layer::line(name, points.clone())
                } else {
                    Layer::dashed(name, points.clone())
                };
                let bars = Layer::points("", points).with_errors(rows.numbers(error)?);
                panel = panel.with(curve.coloured(colour)).with(bars.coloured(colour));
            }
        }
        panels.push(panel);
    }
    Ok(Plot::grid(1, panels))
}

/// Ends the names of schemes that run in a second world of the same figure.
const SECOND_WORLD: &str = " 4";

/// One colour a scheme in every figure; `otherwise` for schemes that stand in one figure only.
fn colour_of(scheme: &str, otherwise: usize) -> usize {
    match scheme.trim_end_matches(SECOND_WORLD) {
        "all" => 0,
        "random" => 1,
        "CFoMD" => 2,
        "CFwMD" => 3,
        "CFwMD particles" => 4,
        "CFwMD2" => 5,
        _ => otherwise.max(4),
    }
}

/// A number of the summary against the budget, a curve for each scheme, with error bars.
pub(super) fn by_budget(summary: &Table, title: &str, column: &str, error: &str, label: &str) -> Result<Panel, Error> {
    let mut panel = Panel::new(title, Axis::linear("message budget l (messages/step)"), Axis::linear(label));
    for (order, scheme) in distinct(summary, "scheme")?.iter().enumerate() {
        let colour = colour_of(scheme, order);
        let rows = summary.only("scheme", scheme.as_str())?;
        let points = rows.points("l", column)?;
        panel = panel.with(Layer::line("", points.clone()).coloured(colour)).with(
            Layer::points(scheme.as_str(), points)
                .with_errors(rows.numbers(error)?)
                .coloured(colour),
        );
    }
    Ok(panel)
}
