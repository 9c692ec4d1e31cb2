//! The old trait, and what lets it stand in the registry.

use super::claim::Claim;
use super::table::Tables;
use crate::error::Error;
use crate::figure::{About, AnyFigure, Context, Outcome};
use crate::parameters::{self, is_effort};
use crate::plot::Plot;
use crate::schema::{Fields, Parameter, plain};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::{Map, Value as Json};

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

/// Lets a figure of the old idiom stand in the registry.
pub struct Old<F>(pub F);

impl<F: Figure> AnyFigure for Old<F> {
    fn about(&self) -> About {
        Figure::about(&self.0)
    }

    fn measures_time(&self) -> bool {
        Figure::measures_time(&self.0)
    }

    fn parameters(&self) -> Vec<Parameter> {
        let of = |(name, value): (&String, &Json)| Parameter {
            name: name.clone(),
            default: plain(value),
            range: String::new(),
            meaning: String::new(),
            entries: Vec::new(),
        };
        parameters::map(&F::Parameters::default()).iter().map(of).collect()
    }

    fn tables(&self) -> Vec<Fields> {
        Vec::new()
    }

    fn configure(&self, overrides: &[(String, String)], quick: bool) -> Result<Map<String, Json>, Error> {
        let figure = Figure::about(&self.0).id;
        let mut start = F::Parameters::default();
        if quick {
            self.0.quicken(&mut start);
        }
        let mut map = parameters::map(&start);
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
        self.0.check(&typed::<F>(figure, &map)?)?;
        Ok(map)
    }

    fn produce(&self, parameters: &Map<String, Json>, context: &Context<'_>) -> Result<Outcome, Error> {
        let typed = typed::<F>(Figure::about(&self.0).id, parameters)?;
        self.0.check(&typed)?;
        let tables = self.0.run(&typed, context)?;
        let (defaults, full) = parameters::meaning(parameters, &parameters::map(&F::Parameters::default()));
        let claims = self.0.claims(&typed, &tables)?;
        let claims = claims
            .into_iter()
            .map(|claim| claim.judged(defaults, full).into())
            .collect();
        let plot = self.0.plot(&typed, &tables)?;
        Ok(Outcome {
            parameters: parameters.clone(),
            tables: tables.into(),
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
