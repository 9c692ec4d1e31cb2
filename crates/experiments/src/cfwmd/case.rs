//! A simulated figure in few words: a setting, the runs, what is claimed of them, a picture.

use super::pictures::Main;
use super::rows::{Ensemble, Rows, Run, Summary, paired};
use super::setting::Setting;
use crate::parameters;
use crate::prelude::*;

/// What a simulated figure runs and claims.
pub(crate) struct Simulated<S, M, X = ()> {
    pub(super) about: About,
    pub(super) caption: &'static str,
    /// Schemes that are compared trial by trial, wherever both ran.
    pub(super) pairs: &'static [(&'static str, &'static str)],
    /// The publication's setting.
    pub(super) setting: fn() -> S,
    /// All runs.
    pub(super) simulate: fn(&S, &Context<'_>) -> Result<Vec<Ensemble>, Error>,
    /// Further tables.
    pub(super) further: fn(&S) -> Result<X, Error>,
    /// Whether the main table shows this run.
    pub(super) shown: fn(&S, &Run) -> bool,
    /// Claims about the publication's setting at its full number of trials.
    pub(super) claims: fn(&Rows<M, X>, &mut Claims),
    pub(super) plot: fn(&S, &Rows<M, X>) -> Plot,
}

impl<S: Setting, M: Main, X: Default> Simulated<S, M, X> {
    /// What a figure does not say otherwise.
    pub(super) const BASE: Self = Self {
        about: About::of("", "", ""),
        caption: "",
        pairs: &[],
        setting: S::default,
        simulate: |_, _| Ok(Vec::new()),
        further: |_| Ok(X::default()),
        shown: |_, _| true,
        claims: |_, _| {},
        plot: |_, rows| M::plot(&rows.main),
    };

    /// Whether the setting is the publication's but for effort and the choice of budgets.
    fn is_printed(&self, setting: &S) -> bool {
        let (own, default) = (parameters::map(setting), parameters::map(&(self.setting)()));
        let free = |name: &str| parameters::is_effort(name) || ["messages", "particles"].contains(&name);
        own.iter()
            .all(|(name, value)| free(name) || default.get(name) == Some(value))
    }
}

impl<S: Setting, M: Main, X: Default + Field> Figure for Simulated<S, M, X> {
    type Parameters = S;
    type Tables = Rows<M, X>;

    fn about(&self) -> About {
        self.about.showing(self.caption)
    }

    fn defaults(&self) -> S {
        (self.setting)()
    }

    fn run(&self, setting: &S, context: &Context<'_>) -> Result<Rows<M, X>, Error> {
        let ensembles = (self.simulate)(setting, context)?;
        let printed = self.is_printed(setting);
        let shown = ensembles.iter().filter(|e| (self.shown)(setting, &e.run));
        Ok(Rows {
            main: shown
                .flat_map(|e| M::of(self.about.id, e, &ensembles, printed))
                .collect(),
            summary: ensembles.iter().map(Summary::of).collect(),
            paired: paired(&ensembles, self.pairs),
            further: (self.further)(setting)?,
        })
    }

    fn claims(&self, _: &S, rows: &Rows<M, X>, claims: &mut Claims) {
        (self.claims)(rows, &mut claims.at_defaults().at_full_trials());
    }

    fn plot(&self, setting: &S, rows: &Rows<M, X>) -> Plot {
        (self.plot)(setting, rows)
    }
}
