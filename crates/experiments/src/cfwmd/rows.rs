//! What the simulated figures have in common: runs of schemes on common trials, and the rows that come of them.

use crate::Column;
use crate::prelude::*;
use crate::schema::{Cells, Described};

/// A step of a trial of one scheme.
#[derive(Debug, Clone)]
pub(super) struct Moment {
    /// Squared position error (m^2).
    pub(super) position: f64,
    /// Squared velocity error (m^2/s^2).
    pub(super) velocity: f64,
    /// Messages sent.
    pub(super) sent: f64,
    /// Squared position error over its variance under the belief, where the belief has one to offer.
    pub(super) consistency: Option<f64>,
}

/// All trials of one scheme at one message budget in one world.
#[derive(Debug, Clone)]
pub struct Ensemble {
    pub(super) run: Run,
    pub(super) trials: Vec<Vec<Moment>>,
}

/// One number of a step.
type Of = fn(&Moment) -> f64;

fn mean(trial: &[Moment], of: Of) -> f64 {
    trial.iter().map(of).sum::<f64>() / trial.len().max(1) as f64
}

impl Ensemble {
    /// Over all trials at a step.
    pub(super) fn at(&self, k: usize, of: Of) -> Moments {
        self.trials.iter().map(|trial| of(&trial[k])).collect()
    }

    /// Over all trials, averaged over the steps of each.
    fn averaged(&self, of: Of) -> Moments {
        self.trials.iter().map(|trial| mean(trial, of)).collect()
    }

    /// The same of the difference from another scheme on the same trials.
    fn less(&self, other: &Self, of: Of) -> Moments {
        let both = self.trials.iter().zip(&other.trials);
        both.map(|(a, b)| mean(a, of) - mean(b, of)).collect()
    }

    /// Mean number of messages a step.
    pub(super) fn rate(&self) -> Measured {
        self.averaged(|m| m.sent).into()
    }
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
        pub(super) world: String => "Where it ran, in figures of several settings.",
        pub(super) l: f64 ["messages/step"] => "Message budget.",
    }
}

impl Run {
    /// Scheme and world.
    pub(super) fn name(&self) -> String {
        format!("{}{}", self.scheme, in_world(&self.world))
    }

    /// The run of another scheme in the same place.
    pub(super) fn of<'a>(&self, scheme: &str, all: &'a [Ensemble]) -> Option<&'a Ensemble> {
        first(all, |e| (e.run.scheme, &e.run.world, e.run.l) == (scheme, &self.world, self.l))
    }
}

/// The key of the references of a run.
fn key(summary: &Summary) -> String {
    format!("{}, l = {}", summary.run.name(), summary.run.l)
}

/// A world behind a comma, if it has a name.
pub(super) fn in_world(world: &str) -> String {
    match world {
        "" => String::new(),
        world => format!(", {world}"),
    }
}

rows! {
    /// One step of one run.
    pub struct Step {
        pub(super) run: Run,
        pub(super) k: usize => "Time step.",
        pub(super) position_rmse: Measured ["m"] => "Root mean squared position error.",
        pub(super) velocity_rmse: Measured ["m/s"] => "Root mean squared velocity error.",
        pub(super) messages: Measured => "Mean number of messages in this step.",
    }

    /// One run, averaged over its steps.
    pub struct Summary by key at full_trials {
        pub(super) run: Run,
        pub(super) position_rmse: Measured ["m"] => "Root mean squared position error over trials and steps.",
        pub(super) velocity_rmse: Measured ["m/s"] => "Root mean squared velocity error over trials and steps.",
        pub(super) rate: Measured ["messages/step"] => "Mean number of messages.",
        /// Squared position error over its variance under the belief; 1 if the belief is consistent.
        pub(super) nees: Option<Measured>,
        pub(super) trials: usize => "Trials.",
    }

    /// Two schemes on the same truth, noise and draws.
    pub struct Paired {
        pub(super) first: &'static str => "Scheme.",
        pub(super) second: &'static str => "Scheme it is compared with.",
        pub(super) world: String => "Where both ran, in figures of several settings.",
        pub(super) l: f64 ["messages/step"] => "Message budget.",
        pub(super) position: Measured ["m^2"] => "Mean squared position error of the first minus that of the second.",
        pub(super) velocity: Measured ["m^2/s^2"] => "The same of the velocity.",
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

impl Summary {
    pub(super) fn of(e: &Ensemble) -> Self {
        let consistent = e.trials.iter().flatten().all(|m| m.consistency.is_some());
        Self {
            run: e.run.clone(),
            position_rmse: Measured::root_mean(&e.averaged(|m| m.position)),
            velocity_rmse: Measured::root_mean(&e.averaged(|m| m.velocity)),
            rate: e.rate(),
            nees: consistent.then(|| e.averaged(|m| m.consistency.unwrap_or_default()).into()),
            trials: e.trials.len(),
        }
    }
}

/// The first schemes minus the second ones, trial by trial, in every world and at every budget where both ran.
pub(super) fn paired(ensembles: &[Ensemble], pairs: &[(&'static str, &'static str)]) -> Vec<Paired> {
    let of = |(first, second)| {
        let firsts = select(ensembles, move |e| e.run.scheme == first);
        firsts.filter_map(move |a| {
            let b = a.run.of(second, ensembles)?;
            Some(Paired {
                first,
                second,
                world: a.run.world.clone(),
                l: a.run.l,
                position: a.less(b, |m| m.position).into(),
                velocity: a.less(b, |m| m.velocity).into(),
            })
        })
    };
    pairs.iter().copied().flat_map(of).collect()
}

/// All tables of a simulated figure.
pub struct Rows<M, X = ()> {
    /// The figure's own rows.
    pub(super) main: Vec<M>,
    /// Averages over trials and steps.
    pub(super) summary: Vec<Summary>,
    /// Differences of schemes on the same trials.
    pub(super) paired: Vec<Paired>,
    pub(super) further: X,
}

impl<M: Field, X: Field> Field for Rows<M, X> {
    fn describe(_: Column, to: &mut Described) {
        Vec::<M>::describe(Column::of("main", "", "The figure's own rows."), to);
        Vec::<Summary>::describe(Column::of("summary", "", "Averages over trials and steps."), to);
        Vec::<Paired>::describe(Column::of("paired", "", "Differences of schemes on the same trials."), to);
        X::describe(Column::of("bound", "", "Bounds of any filter that receives these messages."), to);
    }

    fn put(&self, to: &mut Cells) {
        self.main.put(to);
        self.summary.put(to);
        self.paired.put(to);
        self.further.put(to);
    }
}

impl<M, X> Rows<M, X> {
    /// The averages of a scheme (`CFwMD`, or `CFwMD, world`).
    pub(super) fn at(&self, name: &str, l: f64) -> Option<&Summary> {
        self.summary.iter().find(|r| r.run.l == l && r.run.name() == name)
    }

    /// Position error of one scheme over that of another.
    pub(super) fn ratio(&self, a: &str, b: &str, l: f64) -> Option<f64> {
        over(self.at(a, l)?.position_rmse, self.at(b, l)?.position_rmse)
    }

    pub(super) fn pair(&self, (a, b): (&str, &str), world: &str, l: f64) -> Option<&Paired> {
        first(&self.paired, |p| (p.first, p.second, p.world.as_str(), p.l) == (a, b, world, l))
    }

    /// Claims that, in squared error, the first of each pair beats the second by at least three paired standard errors.
    pub(super) fn beat(&self, claims: &Claims, pairs: &[(&str, &str)], (world, l): (&str, f64), parts: &[Part]) {
        for ((first, second), part) in product(pairs, parts) {
            let pair = self.pair((first, second), world, l);
            let (what, difference) = match part {
                Part::Position => ("position", pair.map(|p| p.position)),
                Part::Velocity => ("velocity", pair.map(|p| p.velocity)),
            };
            let place = in_world(world);
            let id = format!("{first}-beats-{second}-{what}-l{l}{place}").replace([' ', ','], "-");
            let what = format!("{first} has the smaller {what} error than {second} at l = {l}{place}");
            claims.less(id, what, difference, 3.0);
        }
    }
}

impl<X> Rows<Step, X> {
    /// Errors of a run after its `k`th step.
    pub(super) fn step(&self, scheme: &str, l: f64, k: usize) -> Option<&Step> {
        first(&self.main, |r| r.run.scheme == scheme && r.run.l == l && r.k == k)
    }

    /// Claims that at every step the schemes are in this order, smallest error first, but for two standard errors.
    pub(super) fn in_order(&self, claims: &Claims, schemes: &[&str], (world, l): (&str, f64), parts: &[Part]) {
        let curve = |scheme: &str| -> Vec<&Step> {
            select(&self.main, |r| (r.run.scheme, r.run.world.as_str(), r.run.l) == (scheme, world, l)).collect()
        };
        for part in parts {
            let both = |pair: &[&str]| curve(pair[0]).into_iter().zip(curve(pair[1]));
            let neighbours = schemes
                .windows(2)
                .flat_map(both)
                .map(|(a, b)| (a.rmse(*part), b.rmse(*part)));
            let id = format!("order-{part:?}{world}-l{l}").to_lowercase().replace(' ', "-");
            let order = schemes.join(" < ");
            let what = format!("at every step {order} in {part:?} error, but for two standard errors {world}");
            claims.all(id, what, neighbours, |(a, b)| a.value <= b.value + 2.0 * a.error().hypot(b.error()));
        }
    }
}
