//! What the simulated figures have in common: runs of schemes on common trials, and the rows that come of them.

use crate::Column;
use crate::prelude::*;
use crate::schema::{Cells, Described};

/// One trial of one scheme, one entry a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    /// Squared position error (m^2).
    pub(super) position: Vec<f64>,
    /// Squared velocity error (m^2/s^2).
    pub(super) velocity: Vec<f64>,
    /// Messages sent.
    pub(super) sent: Vec<f64>,
    /// Squared position error over its variance under the belief; empty where the belief has none to offer.
    pub(super) consistency: Vec<f64>,
}

/// All trials of one scheme at one message budget in one world.
#[derive(Debug, Clone)]
pub struct Ensemble {
    pub(super) scheme: &'static str,
    pub(super) world: String,
    pub(super) messages: f64,
    pub(super) records: Vec<Record>,
}

/// Every scheme on every trial: `trial(scheme's place, drawn, stream)` on the common `draw` of each.
pub(super) fn simulate<D, S>(
    context: &Context<'_>,
    stream: Stream,
    trials: u64,
    (world, messages): (&str, f64),
    schemes: &[(&'static str, S)],
    draw: impl Fn(Stream) -> Result<D, Error> + Sync,
    trial: impl Fn(&S, &D, Stream) -> Result<Record, Error> + Sync,
) -> Result<Vec<Ensemble>, Error>
where
    S: Sync,
{
    let every = |it: Trial| -> Result<Vec<Record>, Error> {
        let draws = draw(it.stream)?;
        schemes.iter().map(|(_, s)| trial(s, &draws, it.stream)).collect()
    };
    let mut trials = context.monte_carlo(stream, trials).run(every)?;
    let of = |(place, (scheme, _)): (usize, &(&'static str, S))| Ensemble {
        scheme,
        world: world.to_owned(),
        messages,
        records: trials.iter_mut().map(|t| std::mem::take(&mut t[place])).collect(),
    };
    Ok(schemes.iter().enumerate().map(of).collect())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn moments(records: &[Record], of: impl Fn(&Record) -> f64) -> Moments {
    records.iter().map(of).collect()
}

/// A component of the error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Position,
    Velocity,
}

rows! {
    /// What the rows speak of.
    #[derive(Debug, Clone, PartialEq)]
    pub struct Run {
        pub(super) scheme: &'static str => "What is sent, and what is made of silence.",
        pub(super) world: Option<String> => "Where it ran, in figures of several settings.",
        pub(super) l: f64 ["messages/step"] => "Message budget.",
    }
}

impl Run {
    fn of(e: &Ensemble) -> Self {
        Self {
            scheme: e.scheme,
            world: (!e.world.is_empty()).then(|| e.world.clone()),
            l: e.messages,
        }
    }

    /// Scheme and world.
    pub(super) fn name(&self) -> String {
        match &self.world {
            Some(world) => format!("{}, {world}", self.scheme),
            None => self.scheme.to_owned(),
        }
    }

    /// The key of its references.
    fn key(&self) -> String {
        format!("{}, l = {}", self.name(), self.l)
    }
}

rows! {
    /// One step of one run.
    #[derive(Debug, Clone)]
    pub struct Step {
        pub(super) run: Run,
        pub(super) k: usize => "Time step.",
        pub(super) position_rmse: Measured ["m"] => "Root mean squared position error.",
        pub(super) velocity_rmse: Measured ["m/s"] => "Root mean squared velocity error.",
        pub(super) messages: Measured => "Mean number of messages in this step.",
        trials: usize => "Trials.",
    }

    /// One run, averaged over its steps.
    #[derive(Debug, Clone)]
    pub struct Summary {
        pub(super) run: Run,
        pub(super) position_rmse: Measured ["m"] => "Root mean squared position error over trials and steps.",
        pub(super) velocity_rmse: Measured ["m/s"] => "Root mean squared velocity error over trials and steps.",
        pub(super) rate: Measured ["messages/step"] => "Mean number of messages.",
        /// Squared position error over its variance under the belief; 1 if the belief is consistent.
        pub(super) nees: Option<Measured>,
        pub(super) trials: usize => "Trials.",
    }

    /// Two schemes on the same truth, noise and draws.
    #[derive(Debug, Clone)]
    pub struct Paired {
        pub(super) first: &'static str => "Scheme.",
        pub(super) second: &'static str => "Scheme it is compared with.",
        pub(super) world: Option<String> => "Where both ran, in figures of several settings.",
        pub(super) l: f64 ["messages/step"] => "Message budget.",
        pub(super) position: Measured ["m^2"] => "Mean squared position error of the first minus that of the second.",
        pub(super) velocity: Measured ["m^2/s^2"] => "The same of the velocity.",
        trials: u64 => "Trials.",
    }
}

impl Step {
    pub(super) fn rmse(&self, part: Part) -> Measured {
        match part {
            Part::Position => self.position_rmse,
            Part::Velocity => self.velocity_rmse,
        }
    }
}

/// A row for each step of a run.
pub(super) fn steps_of(e: &Ensemble) -> impl Iterator<Item = Step> {
    let steps = e.records.first().map_or(0, |r| r.position.len());
    (0..steps).map(move |k| Step {
        run: Run::of(e),
        k: k + 1,
        position_rmse: Measured::root_mean(&moments(&e.records, |r| r.position[k])),
        velocity_rmse: Measured::root_mean(&moments(&e.records, |r| r.velocity[k])),
        messages: Measured::mean(&moments(&e.records, |r| r.sent[k])),
        trials: e.records.len(),
    })
}

/// Mean number of messages a step.
pub(super) fn rate(e: &Ensemble) -> Measured {
    Measured::mean(&moments(&e.records, |r| mean(&r.sent)))
}

pub(super) fn summary(e: &Ensemble) -> Summary {
    let consistent = e.records.iter().all(|r| !r.consistency.is_empty());
    Summary {
        run: Run::of(e),
        position_rmse: Measured::root_mean(&moments(&e.records, |r| mean(&r.position))),
        velocity_rmse: Measured::root_mean(&moments(&e.records, |r| mean(&r.velocity))),
        rate: rate(e),
        nees: consistent.then(|| Measured::mean(&moments(&e.records, |r| mean(&r.consistency)))),
        trials: e.records.len(),
    }
}

/// The first schemes minus the second ones, trial by trial, in every world and at every budget where both ran.
fn paired(ensembles: &[Ensemble], pairs: &[(&str, &str)]) -> Vec<Paired> {
    let mut rows = Vec::new();
    for (first, second) in pairs {
        for a in ensembles.iter().filter(|e| e.scheme == *first) {
            let same = |e: &&Ensemble| e.scheme == *second && e.world == a.world && e.messages == a.messages;
            let Some(b) = ensembles.iter().find(same) else { continue };
            let both = || a.records.iter().zip(&b.records);
            let position: Moments = both().map(|(a, b)| mean(&a.position) - mean(&b.position)).collect();
            let velocity: Moments = both().map(|(a, b)| mean(&a.velocity) - mean(&b.velocity)).collect();
            rows.push(Paired {
                first: a.scheme,
                second: b.scheme,
                world: Run::of(a).world,
                l: a.messages,
                position: (&position).into(),
                velocity: (&velocity).into(),
                trials: position.count(),
            });
        }
    }
    rows
}

/// No further tables.
#[derive(Debug, Default)]
pub struct Nothing;

impl Field for Nothing {
    fn describe(_: Column, _: &mut Described) {}

    fn put(&self, _: &mut Cells) {}
}

/// All tables of a simulated figure.
#[derive(Debug)]
pub struct Rows<M, X = Nothing> {
    /// The figure's own rows.
    pub(super) main: Vec<M>,
    /// Averages over trials and steps.
    pub(super) summary: Vec<Summary>,
    /// Differences of schemes on the same trials.
    pub(super) paired: Vec<Paired>,
    pub(super) further: X,
}

impl<M: Field, X: Field> Field for Rows<M, X> {
    fn describe(about: Column, to: &mut Described) {
        Vec::<M>::describe(Column::of("main", "", "The figure's own rows."), to);
        Vec::<Summary>::describe(Column::of("summary", "", "Averages over trials and steps."), to);
        Vec::<Paired>::describe(Column::of("paired", "", "Differences of schemes on the same trials."), to);
        X::describe(about, to);
    }

    fn put(&self, to: &mut Cells) {
        self.main.put(to);
        self.summary.put(to);
        self.paired.put(to);
        self.further.put(to);
    }
}

impl<M, X> Rows<M, X> {
    pub(super) fn of(ensembles: &[Ensemble], pairs: &[(&str, &str)], main: Vec<M>, further: X) -> Self {
        Self {
            main,
            summary: ensembles.iter().map(summary).collect(),
            paired: paired(ensembles, pairs),
            further,
        }
    }

    /// The averages of a scheme (`CFwMD`, or `CFwMD, world`).
    pub(super) fn at(&self, name: &str, l: f64) -> Option<&Summary> {
        self.summary.iter().find(|r| r.run.l == l && r.run.name() == name)
    }

    /// Position error of one scheme over that of another.
    pub(super) fn ratio(&self, a: &str, b: &str, l: f64) -> Option<f64> {
        Some(self.at(a, l)?.position_rmse.value / self.at(b, l)?.position_rmse.value)
    }

    pub(super) fn pair(&self, first: &str, second: &str, world: &str, l: f64) -> Option<&Paired> {
        let matches = |p: &&Paired| {
            p.first == first && p.second == second && p.world.as_deref().unwrap_or("") == world && p.l == l
        };
        self.paired.iter().find(matches)
    }

    /// Claims that, in squared error, `first` beats `second` by at least three paired standard errors.
    pub(super) fn beats(
        &self,
        claims: &mut Claims,
        (first, second): (&str, &str),
        (world, l): (&str, f64),
        parts: &[Part],
    ) {
        for part in parts {
            let (what, difference) = match part {
                Part::Position => ("position", self.pair(first, second, world, l).map(|p| p.position)),
                Part::Velocity => ("velocity", self.pair(first, second, world, l).map(|p| p.velocity)),
            };
            let place = if world.is_empty() {
                String::new()
            } else {
                format!(", {world}")
            };
            let id = format!("{first}-beats-{second}-{what}-l{l}{place}").replace([' ', ','], "-");
            let what = format!("{first} has the smaller {what} error than {second} at l = {l}{place}");
            claims.less(id, what, difference, 3.0);
        }
    }

    /// Claims that the runs agree with independent ones: the references of these quantities.
    pub(super) fn agree(&self, claims: &mut Claims, quantities: &[&str]) {
        for quantity in quantities {
            let what = format!("{quantity} as in the independent runs");
            claims.references(quantity, &what, &self.summary, |r| {
                let value = match *quantity {
                    "position" => r.position_rmse,
                    "velocity" => r.velocity_rmse,
                    _ => r.rate,
                };
                (r.run.key(), value)
            });
        }
    }
}

impl<X> Rows<Step, X> {
    /// Errors of a run after its `k`th step.
    pub(super) fn step(&self, scheme: &str, l: f64, k: usize) -> Option<&Step> {
        first(&self.main, |r| r.run.scheme == scheme && r.run.l == l && r.k == k)
    }

    /// Claims that at every step the schemes are in this order, smallest error first, but for two standard errors.
    pub(super) fn in_order(&self, claims: &mut Claims, schemes: &[&str], (world, l): (&str, f64), parts: &[Part]) {
        let curve = |scheme: &str| {
            let own =
                |r: &&Step| r.run.scheme == scheme && r.run.world.as_deref().unwrap_or("") == world && r.run.l == l;
            self.main.iter().filter(own).collect::<Vec<_>>()
        };
        for part in parts {
            let neighbours = schemes.windows(2).flat_map(|pair| {
                let (low, high) = (curve(pair[0]), curve(pair[1]));
                low.into_iter()
                    .zip(high)
                    .map(|(a, b)| (a.rmse(*part), b.rmse(*part)))
                    .collect::<Vec<_>>()
            });
            let id = format!("order-{part:?}{world}-l{l}").to_lowercase().replace(' ', "-");
            let order = schemes.join(" < ");
            let what = format!("at every step {order} in {part:?} error, but for two standard errors {world}");
            claims.all(id, what, neighbours, |(a, b)| {
                let error = a.standard_error.unwrap_or(0.0).hypot(b.standard_error.unwrap_or(0.0));
                a.value <= b.value + 2.0 * error
            });
        }
    }
}
