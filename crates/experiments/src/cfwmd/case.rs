//! A simulated figure in few words: a setting, the runs, what is claimed of them, a picture.

use super::rows::{Ensemble, Further, Main, Rows};
use super::setting::Setting;
use crate::parameters;
use crate::prelude::*;
use schemars::{JsonSchema, Schema, SchemaGenerator};
use std::borrow::Cow;
use std::marker::PhantomData;

/// What a simulated figure runs and claims.
pub(super) trait Case: Sync + 'static {
    type Setting: Setting;
    type Main: Main;
    type Further: Further<Self::Setting>;

    const ABOUT: About;
    const CAPTION: &'static str;
    /// Schemes that are compared trial by trial, wherever both ran.
    const PAIRS: &'static [(&'static str, &'static str)];
    /// Quantities with independent references.
    const REFERENCES: &'static [&'static str] = &["position", "velocity", "rate"];
    const MEASURES_TIME: bool = false;

    /// The publication's setting.
    fn setting() -> Self::Setting;

    /// All runs.
    fn simulate(setting: &Self::Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error>;

    /// Whether the main table shows this run.
    fn shown(_setting: &Self::Setting, _run: &Ensemble) -> bool {
        true
    }

    /// Claims about the publication's setting at its full number of trials.
    fn claims(rows: &Rows<Self::Main, Self::Further>, claims: &mut Claims);

    /// Claims about any setting and number of trials.
    fn always(_setting: &Self::Setting, _rows: &Rows<Self::Main, Self::Further>, _claims: &mut Claims) {}

    fn plot(_setting: &Self::Setting, rows: &Rows<Self::Main, Self::Further>) -> Plot {
        Self::Main::plot(&rows.main)
    }
}

/// The figure of a case.
pub(super) struct Simulated<C>(PhantomData<fn() -> C>);

impl<C> Simulated<C> {
    pub(super) const NEW: Self = Self(PhantomData);
}

/// A case's parameters with its default.
#[derive(Serialize, Deserialize)]
#[serde(transparent, bound = "")]
pub(super) struct Preset<C: Case>(C::Setting);

impl<C: Case> Default for Preset<C> {
    fn default() -> Self {
        Self(C::setting())
    }
}

impl<C: Case> Quick for Preset<C> {
    fn quicken(&mut self) {
        self.0.quicken();
    }
}

impl<C: Case> JsonSchema for Preset<C> {
    fn schema_name() -> Cow<'static, str> {
        C::Setting::schema_name()
    }

    fn json_schema(generator: &mut SchemaGenerator) -> Schema {
        C::Setting::json_schema(generator)
    }
}

impl<C: Case> Validate for Preset<C> {
    type Context = ();

    fn validate_into(&self, (): &(), parent: &mut dyn FnMut() -> garde::Path, report: &mut garde::Report) {
        self.0.validate_into(&(), parent, report);
    }
}

/// Whether the setting is the publication's but for effort and the choice of budgets.
fn is_printed<C: Case>(setting: &C::Setting) -> bool {
    let (own, default) = (parameters::map(setting), parameters::map(&C::setting()));
    let free = |name: &str| parameters::is_effort(name) || ["messages", "particles"].contains(&name);
    own.iter()
        .all(|(name, value)| free(name) || default.get(name) == Some(value))
}

impl<C: Case> Figure for Simulated<C> {
    type Parameters = Preset<C>;
    type Tables = Rows<C::Main, C::Further>;

    fn about(&self) -> About {
        C::ABOUT.showing(C::CAPTION)
    }

    fn cost(&self, parameters: &Preset<C>) -> Cost {
        parameters.0.cost()
    }

    fn measures_time(&self) -> bool {
        C::MEASURES_TIME
    }

    fn run(&self, Preset(setting): &Preset<C>, context: &Context<'_>) -> Result<Self::Tables, Error> {
        let ensembles = C::simulate(setting, context)?;
        let shown: Vec<_> = ensembles.iter().filter(|e| C::shown(setting, e)).collect();
        let main = C::Main::of(C::ABOUT.id, &shown, is_printed::<C>(setting));
        Ok(Rows::of(&ensembles, C::PAIRS, main, C::Further::of(setting, context)?))
    }

    fn claims(&self, Preset(setting): &Preset<C>, rows: &Self::Tables, claims: &mut Claims) {
        let mut limited = claims.at_defaults().at_full_trials();
        rows.agree(&mut limited, C::REFERENCES);
        C::claims(rows, &mut limited);
        C::always(setting, rows, claims);
    }

    fn plot(&self, Preset(setting): &Preset<C>, rows: &Self::Tables) -> Plot {
        C::plot(setting, rows)
    }
}
