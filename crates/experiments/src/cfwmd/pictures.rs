//! The main tables of the simulated figures, and their pictures.

use super::rows::{Ensemble, Part, Step, Summary, in_world};
use crate::prelude::*;

pub(super) const BOTH: [Part; 2] = [Part::Position, Part::Velocity];

/// A kind of main table.
pub trait Main: Field + Sized {
    /// The rows of a run among all. `printed`: whether printed numbers may stand beside ours.
    fn of(figure: &str, run: &Ensemble, all: &[Ensemble], printed: bool) -> Vec<Self>;

    /// Their picture.
    fn plot(rows: &[Self]) -> Plot;
}

impl Main for Step {
    fn of(_: &str, run: &Ensemble, _: &[Ensemble], _: bool) -> Vec<Self> {
        let steps = run.trials.first().map_or(0, Vec::len);
        let row = |k: usize| Self {
            run: run.run.clone(),
            k: k + 1,
            position_rmse: Measured::root_mean(&run.at(k, |m| m.position)),
            velocity_rmse: Measured::root_mean(&run.at(k, |m| m.velocity)),
            messages: run.at(k, |m| m.sent).into(),
        };
        (0..steps).map(row).collect()
    }

    /// Position and velocity error against time, side by side; a row of panels for each world and budget, a curve for each scheme.
    fn plot(steps: &[Self]) -> Plot {
        let places = distinct(steps, |r| (r.run.world.clone(), r.run.l));
        let schemes = distinct(steps, |r| r.run.scheme);
        let mut panels = Vec::new();
        for (world, l) in &places {
            for part in BOTH {
                let (axis, title) = match part {
                    Part::Position => ("RMSE / m", "Position"),
                    Part::Velocity => ("RMSE / (m/s)", "Velocity"),
                };
                let own = |r: &&Step| (&r.run.world, r.run.l) == (world, *l);
                let layers = schemes.iter().enumerate().flat_map(|(order, scheme)| {
                    let rows = steps.iter().filter(own).filter(|r| r.run.scheme == *scheme);
                    let marks: Vec<_> = rows.map(|r| (r.k as f64, r.rmse(part))).collect();
                    (!marks.is_empty()).then(|| Layer::curve(*scheme, colour_of(scheme, order), marks))
                });
                // One scale for all budgets, so that heights can be compared.
                let top = steps.iter().map(|r| r.rmse(part).value).fold(0.0, f64::max);
                let axes = (Axis::linear("time step k"), Axis::linear(axis).between(0.0, 1.05 * top));
                let title = format!("{title}, l = {l}{}", in_world(world));
                panels.push(Panel::new(title, axes.0, axes.1).with_all(layers.flatten()));
            }
        }
        Plot::grid(2, panels)
    }
}

impl Main for Summary {
    fn of(_: &str, run: &Ensemble, _: &[Ensemble], _: bool) -> Vec<Self> {
        vec![Summary::of(run)]
    }

    fn plot(rows: &[Self]) -> Plot {
        let rows: Vec<&Summary> = rows.iter().collect();
        let panels = [
            by_budget(&rows, "Position", "time-averaged RMSE / m", |r| r.position_rmse),
            by_budget(&rows, "Velocity", "time-averaged RMSE / (m/s)", |r| r.velocity_rmse),
        ];
        Plot::grid(2, panels.into())
    }
}

/// One colour for a scheme in every figure; `otherwise` for schemes that stand in one figure only.
fn colour_of(scheme: &str, otherwise: usize) -> usize {
    match scheme {
        "all" => 0,
        "random" => 1,
        "CFoMD" => 2,
        "CFwMD" => 3,
        "CFwMD particles" => 4,
        "CFwMD2" => 5,
        "scheduled" => 6,
        _ => otherwise,
    }
}

/// A number of the summary against the budget, a curve for each scheme.
pub(super) fn by_budget(rows: &[&Summary], title: &str, label: &str, of: impl Fn(&Summary) -> Measured) -> Panel {
    let schemes = distinct(rows, |r| r.run.scheme);
    let layers = schemes.iter().enumerate().flat_map(|(order, scheme)| {
        let own = rows.iter().filter(|r| r.run.scheme == *scheme);
        Layer::curve(*scheme, colour_of(scheme, order), own.map(|r| (r.run.l, of(r))).collect())
    });
    Panel::linear(title, "message budget l / (messages/step)", label).with_all(layers)
}
