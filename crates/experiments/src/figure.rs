//! What a figure is, and how it is run.

use crate::claim::Claim;
use crate::error::Error;
use crate::plot::Plot;
use crate::table::Tables;
use fewbits_monte_carlo::{MonteCarlo, Stream};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value as Json};
use std::sync::atomic::AtomicBool;

/// What stands above a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct About {
    /// `<system>-<fig|table><number>`, the name of all its files.
    pub id: &'static str,
    /// A few words.
    pub title: &'static str,
    /// What it shows and what to look for, in our words.
    pub caption: &'static str,
    /// Where in the publications it comes from; empty for our own.
    pub source: &'static str,
}

/// The surroundings of a run: the seed, and who wants to hear of progress.
#[derive(Clone, Copy)]
pub struct Context<'a> {
    /// Root of all randomness.
    pub seed: u64,
    /// Told the number of trials just finished.
    pub progress: Option<&'a (dyn Fn(u64) + Sync)>,
    /// Set to stop early.
    pub cancel: Option<&'a AtomicBool>,
}

impl Context<'_> {
    /// A run without listeners.
    pub fn new(seed: u64) -> Self {
        Self {
            seed,
            progress: None,
            cancel: None,
        }
    }

    /// The random stream of an experiment. Figures that name the same experiment share its truth and noise.
    pub fn stream(&self, experiment: &str) -> Stream {
        Stream::new(self.seed).named(experiment)
    }

    /// A Monte-Carlo run on `stream` that reports progress and can be cancelled.
    pub fn monte_carlo(&self, stream: Stream, trials: u64) -> MonteCarlo<'_> {
        let mut run = MonteCarlo::new(stream, trials);
        if let Some(progress) = self.progress {
            run = run.with_progress(progress);
        }
        if let Some(cancel) = self.cancel {
            run = run.with_cancellation(cancel);
        }
        run
    }
}

/// A figure or table of a publication, or one of our own: parameters in, tables out, and the claims they must meet.
///
/// `Parameters` is a flat serde struct (numbers, booleans, strings and lists of these) whose `Default` is the paper's
/// setting; derive `Serialize, Deserialize` with `#[serde(deny_unknown_fields)]`. A parameter named `trials` or ending in
/// `_trials` is effort: lowering it leaves the meaning of the figure and skips the claims that need the full count.
pub trait Figure: Sync {
    /// The figure's parameters.
    type Parameters: Serialize + DeserializeOwned + Default;

    /// What stands above the figure.
    fn about(&self) -> About;

    /// Checks ranges beyond the types, before any work. The default accepts everything.
    ///
    /// # Errors
    /// [`Error::BadParameter`] or an argument error of a crate below.
    fn check(&self, _parameters: &Self::Parameters) -> Result<(), Error> {
        Ok(())
    }

    /// Reduces effort for `--quick`: the whole figure should then take about a second. The default changes nothing.
    fn quicken(&self, _parameters: &mut Self::Parameters) {}

    /// Whether the figure measures time and must not share the machine with others.
    fn measures_time(&self) -> bool {
        false
    }

    /// Computes the tables. Same parameters and seed, same bytes, on any number of threads.
    ///
    /// # Errors
    /// If a parameter is out of range or a computation fails.
    fn run(&self, parameters: &Self::Parameters, context: &Context<'_>) -> Result<Tables, Error>;

    /// Judges the tables.
    ///
    /// # Errors
    /// If a column is missing.
    fn claims(&self, parameters: &Self::Parameters, tables: &Tables) -> Result<Vec<Claim>, Error>;

    /// Draws the tables.
    ///
    /// # Errors
    /// If a column is missing.
    fn plot(&self, parameters: &Self::Parameters, tables: &Tables) -> Result<Plot, Error>;
}

/// What came out of one run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// All parameters as they were used.
    pub parameters: Map<String, Json>,
    /// The tables.
    pub tables: Tables,
    /// The judged claims.
    pub claims: Vec<Claim>,
    /// The picture.
    pub plot: Plot,
}

/// A figure whatever its parameter type: what the registry holds. Implemented by every [`Figure`].
pub trait AnyFigure: Sync {
    /// What stands above the figure.
    fn about(&self) -> About;

    /// Whether the figure measures time and must not share the machine with others.
    fn measures_time(&self) -> bool;

    /// The parameters and their defaults.
    fn defaults(&self) -> Map<String, Json>;

    /// The defaults, quickened if asked for, with `overrides` (`name`, text) applied on top, checked.
    ///
    /// A single value stands for a list of one, and commas separate the entries of a list.
    ///
    /// # Errors
    /// [`Error::UnknownParameter`] or [`Error::BadParameter`].
    fn configure(&self, overrides: &[(String, String)], quick: bool) -> Result<Map<String, Json>, Error>;

    /// Runs the figure with a full set of parameters, as [`AnyFigure::configure`] gives it.
    ///
    /// # Errors
    /// If a parameter is refused or a computation fails.
    fn produce(&self, parameters: &Map<String, Json>, context: &Context<'_>) -> Result<Outcome, Error>;
}

fn is_effort(name: &str) -> bool {
    name == "trials" || name.ends_with("_trials")
}

/// Reads `text` as a value of the same kind as `example`.
fn parse_like(example: &Json, text: &str) -> Result<Json, String> {
    let number = |text: &str| -> Result<f64, String> {
        let value: f64 = text.trim().parse().map_err(|_| "a number".to_owned())?;
        if value.is_finite() {
            Ok(value)
        } else {
            Err("a finite number".to_owned())
        }
    };
    match example {
        Json::Number(n) if n.is_f64() => Ok(number(text)?.into()),
        Json::Number(n) if n.is_u64() => text
            .trim()
            .parse::<u64>()
            .map(Json::from)
            .map_err(|_| "a whole number, 0 or above".to_owned()),
        Json::Number(_) => text
            .trim()
            .parse::<i64>()
            .map(Json::from)
            .map_err(|_| "a whole number".to_owned()),
        Json::Bool(_) => text
            .trim()
            .parse::<bool>()
            .map(Json::from)
            .map_err(|_| "true or false".to_owned()),
        Json::Array(entries) => {
            let first = entries.first().unwrap_or(&Json::Null);
            text.split(',')
                .map(|entry| parse_like(first, entry))
                .collect::<Result<Vec<_>, _>>()
                .map(Json::from)
                .map_err(|expected| format!("a list, entries separated by commas, each {expected}"))
        }
        _ => Ok(Json::from(text)),
    }
}

fn as_map<P: Serialize>(parameters: &P) -> Map<String, Json> {
    match serde_json::to_value(parameters) {
        Ok(Json::Object(map)) => map,
        _ => Map::new(),
    }
}

impl<F: Figure> AnyFigure for F {
    fn about(&self) -> About {
        Figure::about(self)
    }

    fn measures_time(&self) -> bool {
        Figure::measures_time(self)
    }

    fn defaults(&self) -> Map<String, Json> {
        as_map(&F::Parameters::default())
    }

    fn configure(&self, overrides: &[(String, String)], quick: bool) -> Result<Map<String, Json>, Error> {
        let figure = Figure::about(self).id;
        let mut start = F::Parameters::default();
        if quick {
            self.quicken(&mut start);
        }
        let mut map = as_map(&start);
        for (name, text) in overrides {
            let Some(example) = map.get(name) else {
                let valid: Vec<_> = map.keys().map(String::as_str).collect();
                let valid = if valid.is_empty() {
                    "none".to_owned()
                } else {
                    valid.join(", ")
                };
                return Err(Error::UnknownParameter {
                    figure,
                    name: name.clone(),
                    valid,
                });
            };
            let value = parse_like(example, text).map_err(|expected| Error::BadParameter {
                figure,
                name: name.clone(),
                value: text.clone(),
                expected,
            })?;
            if is_effort(name) && value.as_u64() == Some(0) {
                return Err(Error::BadParameter {
                    figure,
                    name: name.clone(),
                    value: text.clone(),
                    expected: "at least 1".to_owned(),
                });
            }
            map.insert(name.clone(), value);
        }
        self.check(&typed::<F>(figure, &map)?)?;
        Ok(map)
    }

    fn produce(&self, parameters: &Map<String, Json>, context: &Context<'_>) -> Result<Outcome, Error> {
        let typed = typed::<F>(Figure::about(self).id, parameters)?;
        self.check(&typed)?;
        let tables = self.run(&typed, context)?;
        let defaults = AnyFigure::defaults(self);
        let lowered = |name: &String, value: &Json| match (value.as_f64(), defaults.get(name).and_then(Json::as_f64)) {
            (Some(value), Some(default)) => value < default,
            _ => false,
        };
        let at_defaults = parameters
            .iter()
            .all(|(n, v)| is_effort(n) || defaults.get(n) == Some(v));
        let full_effort = !parameters.iter().any(|(n, v)| is_effort(n) && lowered(n, v));
        let claims = self
            .claims(&typed, &tables)?
            .into_iter()
            .map(|claim| claim.judged(at_defaults, full_effort))
            .collect();
        let plot = self.plot(&typed, &tables)?;
        Ok(Outcome {
            parameters: parameters.clone(),
            tables,
            claims,
            plot,
        })
    }
}

fn typed<F: Figure>(figure: &'static str, map: &Map<String, Json>) -> Result<F::Parameters, Error> {
    serde_json::from_value(Json::Object(map.clone())).map_err(|error| Error::BadParameter {
        figure,
        name: "(all)".to_owned(),
        value: Json::Object(map.clone()).to_string(),
        expected: error.to_string(),
    })
}
