//! What the parameters of a figure say about themselves, and which values are accepted.

use crate::schema::on_one_line;
use serde::Serialize;
use serde_json::{Map, Value as Json};

/// A parameter as `describe` shows it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Name for `--set`.
    pub name: String,
    /// Default, as `--set` takes it.
    pub default: String,
    /// What is accepted, in words.
    pub range: String,
    /// Meaning.
    pub meaning: String,
    /// Names of the entries of one point, where the parameter is a list of points.
    pub entries: Vec<String>,
    #[serde(skip)]
    limits: Limits,
    #[serde(skip)]
    points: Vec<Parameter>,
}

/// What is accepted: the least and the greatest number, and of a list the same of its length.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[doc(hidden)]
pub struct Limits {
    pub low: Option<f64>,
    pub high: Option<f64>,
    pub length: Option<(Option<f64>, Option<f64>)>,
}

/// Why parameters are refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// The parameter, or the entry of it, such as `points[1].a`.
    pub path: String,
    /// Why.
    pub reason: String,
}

/// A type of parameters: a number, a word, a list of these, or a struct that [`parameters!`](crate::parameters!) writes.
pub trait Argument {
    /// The fields of a struct.
    fn fields() -> Vec<Parameter> {
        Vec::new()
    }
}

/// Rough need of a run: seconds on one core, bytes at its peak.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Cost {
    /// Seconds on one core.
    pub seconds: f64,
    /// Bytes.
    pub bytes: f64,
}

impl Cost {
    /// So many seconds on one core and bytes at the peak.
    pub fn new(seconds: f64, bytes: f64) -> Self {
        Self { seconds, bytes }
    }

    /// More is refused: a day on one core, 2 GB.
    pub(crate) const LIMIT: Self = Self {
        seconds: 86_400.0,
        bytes: 2e9,
    };
}

/// Parameters that `--quick` lowers, and that may depend on each other.
pub trait Quick {
    /// Reduces effort: the whole figure should then take about a second. The default changes nothing.
    fn quicken(&mut self) {}

    /// What a run with these parameters needs, roughly. The default is nothing.
    fn cost(&self) -> Cost {
        Cost::default()
    }

    /// Refuses what is beyond the limits of the fields themselves. The default refuses nothing.
    ///
    /// # Errors
    /// If a field does not fit the others.
    fn check(&self) -> Result<(), Refusal> {
        Ok(())
    }
}

macro_rules! arguments {
    ($($type:ty)*) => {$(impl Argument for $type {})*};
}

arguments! { f64 bool u8 u32 u64 usize i64 String }

impl<T: Argument> Argument for Vec<T> {
    fn fields() -> Vec<Parameter> {
        T::fields()
    }
}

impl<T: Argument> Argument for Option<T> {
    fn fields() -> Vec<Parameter> {
        T::fields()
    }
}

/// A limit in its shorter form.
fn shown(limit: f64) -> String {
    let (plain, short) = (limit.to_string(), format!("{limit:e}"));
    if short.len() < plain.len() { short } else { plain }
}

impl Limits {
    /// `from 1 to 9`, of the numbers.
    fn range(&self) -> Option<String> {
        match (self.low.map(shown), self.high.map(shown)) {
            (Some(low), Some(high)) => Some(format!("from {low} to {high}")),
            (Some(low), None) => Some(format!("at least {low}")),
            (None, Some(high)) => Some(format!("at most {high}")),
            (None, None) => None,
        }
    }

    /// `1 to 9 entries`.
    fn entries(&self) -> Option<String> {
        match self.length? {
            (None, None) => None,
            (Some(low), Some(high)) if low == high => Some(format!("{low} entries")),
            (low, Some(high)) => Some(format!("{} to {high} entries", low.unwrap_or(0.0))),
            (Some(low), None) => Some(format!("at least {low} entries")),
        }
    }
}

/// Why a number, or the length of a list, is not within limits.
fn outside(path: &str, x: f64, what: &str, limits: (Option<f64>, Option<f64>)) -> Option<Refusal> {
    let reason = match limits {
        (Some(low), _) if x < low => format!("{what}lower than {}", shown(low)),
        (_, Some(high)) if x > high => format!("{what}greater than {}", shown(high)),
        _ => return None,
    };
    let path = path.to_owned();
    Some(Refusal { path, reason })
}

impl Parameter {
    #[doc(hidden)]
    pub fn of(name: &str, documentation: &str, limits: Limits) -> Self {
        Self {
            name: name.trim_start_matches("r#").to_owned(),
            default: String::new(),
            range: String::new(),
            meaning: on_one_line(documentation),
            entries: Vec::new(),
            limits,
            points: Vec::new(),
        }
    }

    /// Appends the parameter, or the fields of its type where `serde` flattens it.
    #[doc(hidden)]
    pub fn add(mut self, serde: &str, fields: Vec<Self>, mut all: Vec<Self>) -> Vec<Self> {
        if serde == "flatten" {
            all.extend(fields);
            return all;
        }
        self.entries = fields.iter().map(|field| field.name.clone()).collect();
        let named = |field: &Self| Some(format!("{} {}", field.name, field.limits.range()?));
        let ranges = fields.iter().filter_map(named);
        let own = [self.limits.entries(), self.limits.range()];
        self.range = own.into_iter().flatten().chain(ranges).collect::<Vec<_>>().join("; ");
        self.points = fields;
        all.push(self);
        all
    }

    /// Why a value of the parameter is refused, or an entry of it, whose own length has no limits.
    fn refusal(&self, value: &Json, path: &str, is_entry: bool) -> Option<Refusal> {
        match value {
            Json::Number(x) => outside(path, x.as_f64()?, "", (self.limits.low, self.limits.high)),
            Json::Array(list) => {
                let length = self.limits.length.filter(|_| !is_entry).unwrap_or_default();
                let entry = |(i, value)| self.refusal(value, &format!("{path}[{i}]"), true);
                outside(path, list.len() as f64, "length is ", length)
                    .or_else(|| list.iter().enumerate().find_map(entry))
            }
            Json::Object(point) => {
                let path = |field: &Self| format!("{path}.{}", field.name);
                let of = |field: &Self| field.refusal(point.get(&field.name)?, &path(field), false);
                self.points.iter().find_map(of)
            }
            _ => None,
        }
    }
}

/// The parameters of `P` with the given defaults; those without one are not the figure's.
pub(crate) fn described<P: Argument>(defaults: &Map<String, Json>) -> Vec<Parameter> {
    let with_default = |mut parameter: Parameter| {
        parameter.default = plain(defaults.get(&parameter.name)?);
        Some(parameter)
    };
    P::fields().into_iter().filter_map(with_default).collect()
}

/// Refuses values beyond their limits.
pub(crate) fn within(described: &[Parameter], values: &Map<String, Json>) -> Result<(), Refusal> {
    let of = |p: &Parameter| p.refusal(values.get(&p.name)?, &p.name, false);
    described.iter().find_map(of).map_or(Ok(()), Err)
}

/// Refuses a parameter for this reason where the condition does not hold.
pub(crate) fn accept(path: impl Into<String>, holds: bool, reason: impl FnOnce() -> String) -> Result<(), Refusal> {
    let refusal = || Refusal {
        path: path.into(),
        reason: reason(),
    };
    holds.then_some(()).ok_or_else(refusal)
}

/// Refuses the first entry of a list for which there is a reason.
pub(crate) fn accept_each<T>(name: &str, list: &[T], reason: impl Fn(&T) -> Option<String>) -> Result<(), Refusal> {
    let refused = |(i, entry)| Some((i, reason(entry)?));
    match list.iter().enumerate().find_map(refused) {
        Some((i, reason)) => accept(format!("{name}[{i}]"), false, || reason),
        None => Ok(()),
    }
}

/// A value as `--set` takes it: `0.5,0.9` for a list, `0.5:0.1,0.9:0.2` for a list of points.
pub fn plain(value: &Json) -> String {
    let joined = |entries: Vec<String>, by: &str| entries.join(by);
    match value {
        Json::String(text) => text.clone(),
        Json::Array(entries) => joined(entries.iter().map(plain).collect(), ","),
        Json::Object(fields) => joined(fields.values().map(plain).collect(), ":"),
        Json::Null => "none".to_owned(),
        other => other.to_string(),
    }
}
