//! From `--set name=value` to checked parameters.

use crate::arguments::{self, Argument, Parameter, Quick, Refusal, plain};
use crate::error::Error;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value as Json};

/// Whether a parameter is effort: lowering it leaves the meaning of the figure.
pub(crate) fn is_effort(name: &str) -> bool {
    name == "trials" || name.ends_with("_trials")
}

/// Whether these parameters are the defaults (but for effort), and whether effort is not below the defaults.
pub(crate) fn meaning(map: &Map<String, Json>, defaults: &Map<String, Json>) -> (bool, bool) {
    let (effort, setting): (Vec<_>, Vec<_>) = map.iter().partition(|(name, _)| is_effort(name));
    let number = |value: Option<&Json>| value.and_then(Json::as_f64).unwrap_or(0.0);
    let same = |(name, value): (&String, &Json)| defaults.get(name) == Some(value);
    let enough = |(name, value): (&String, &Json)| number(Some(value)) >= number(defaults.get(name));
    (setting.into_iter().all(same), effort.into_iter().all(enough))
}

/// A struct as the map of its fields.
pub(crate) fn map<P: Serialize>(parameters: &P) -> Map<String, Json> {
    match serde_json::to_value(parameters) {
        Ok(Json::Object(map)) => map,
        _ => Map::new(),
    }
}

/// The parameters that `map` describes, within their limits.
pub(crate) fn typed<P: DeserializeOwned + Argument + Quick>(
    figure: &'static str,
    map: &Map<String, Json>,
) -> Result<P, Error> {
    let json = Json::Object(map.clone());
    let refuse = |Refusal { path, reason }| {
        let value = pointed(&json, &path).map(plain).unwrap_or_default();
        Error::refused(figure, &path, &value, reason)
    };
    let parameters: P = serde_path_to_error::deserialize(&json).map_err(|error| {
        refuse(Refusal {
            path: error.path().to_string().trim_start_matches('.').to_owned(),
            reason: in_words(&error.inner().to_string()),
        })
    })?;
    arguments::within(&P::fields(), map).map_err(&refuse)?;
    parameters.check().map_err(&refuse)?;
    Ok(parameters)
}

/// The reason of a type mismatch without the names of types.
fn in_words(reason: &str) -> String {
    let words = |kind: &str| match kind {
        "f64" => "a number",
        "u64" | "u32" | "usize" => "a whole number, 0 or above",
        "i64" | "i32" => "a whole number",
        "a boolean" => "true or false",
        _ => "",
    };
    match reason.rsplit_once("expected ").map(|(_, kind)| words(kind)) {
        Some(known) if !known.is_empty() => format!("expected {known}"),
        _ => reason.to_owned(),
    }
}

/// The value at a path such as `points[1].a`.
fn pointed<'a>(json: &'a Json, path: &str) -> Option<&'a Json> {
    json.pointer(&format!("/{}", path.replace(['.', '['], "/").replace(']', "")))
}

/// Sets one parameter of a figure from its text.
pub(crate) fn set(
    figure: &'static str,
    values: &mut Map<String, Json>,
    described: &[Parameter],
    name: &str,
    text: &str,
) -> Result<(), Error> {
    let Some(slot) = values.get_mut(name) else {
        let valid: Vec<_> = described.iter().map(|p| p.name.as_str()).collect();
        let valid = if valid.is_empty() {
            "none".to_owned()
        } else {
            valid.join(", ")
        };
        let unknown = format!("figure `{figure}` has no parameter `{name}`");
        return Err(Error::failed(format_args!("{unknown}: expected one of {valid}")));
    };
    let own = described.iter().find(|p| p.name == name);
    let entries = own.map_or(&[][..], |p| &p.entries);
    let refused = |reason: &str| Error::refused(figure, name, text, reason);
    *slot = match slot {
        _ if text.trim_start().starts_with(['[', '{']) => {
            serde_json::from_str(text).map_err(|error| refused(&error.to_string()))?
        }
        Json::Array(list) if list.first().is_some_and(Json::is_string) => {
            text.split(',').map(|word| Json::from(word.trim())).collect()
        }
        Json::Array(_) if entries.is_empty() => text.split(',').map(scalar).collect(),
        Json::Array(_) => {
            let point = |text: &str| -> Result<Json, Error> {
                let values: Vec<&str> = text.split(':').collect();
                if values.len() != entries.len() {
                    return Err(refused(&format!("expected points {}, separated by commas", entries.join(":"))));
                }
                Ok(Json::Object(entries.iter().cloned().zip(values.into_iter().map(scalar)).collect()))
            };
            text.split(',').map(point).collect::<Result<_, _>>()?
        }
        _ => scalar(text),
    };
    if is_effort(name) && slot.as_u64() == Some(0) {
        return Err(refused("expected at least 1"));
    }
    Ok(())
}

/// A number, `true`, `false`, or else a word. Whole numbers may be written `1e5`.
fn scalar(text: &str) -> Json {
    let text = text.trim();
    let value = serde_json::from_str(text)
        .ok()
        .filter(|v: &Json| v.is_number() || v.is_boolean());
    match value {
        Some(Json::Number(n)) if n.is_f64() => {
            let number = n.as_f64().unwrap_or(f64::NAN);
            match text.contains(['e', 'E']) && number.fract() == 0.0 && (0.0..9e15).contains(&number) {
                true => Json::from(number as u64),
                false => Json::Number(n),
            }
        }
        Some(value) => value,
        None => Json::from(text),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    parameters! {
        point struct Point {
            a: f64 [-1.0..=1.0] => "Plant coefficient.",
            gamma: f64 [1e-12..=1e12] => "Noise ratio.",
        }
    }

    parameters! {
        struct Parameters {
            points: Vec<Point> [; 1..=9] = vec![Point { a: 0.5, gamma: 0.1 }] => "Plants.",
            levels: Vec<u32> [2..=64; 1..] = vec![4] => "Levels.",
            patterns: Vec<String> [; 1..] = vec!["01".to_owned()] => "Patterns.",
            trials: u64 [1..=1_000_000] = 100 => "Trials.",
        }
    }

    fn described() -> (Map<String, Json>, Vec<Parameter>) {
        let start = map(&Parameters::default());
        let described = arguments::described::<Parameters>(&start);
        (start, described)
    }

    fn set(name: &str, text: &str) -> Result<Parameters, Error> {
        let (mut values, described) = described();
        super::set("demo-fig1", &mut values, &described, name, text)?;
        typed("demo-fig1", &values)
    }

    #[test]
    fn settings_are_written_as_they_are_described() {
        assert_eq!(set("points", "0.9:0.2,-0.5:3").unwrap().points[1].gamma, 3.0);
        assert_eq!(set("points", r#"[{"a": 0.9, "gamma": 1}]"#).unwrap().points[0].a, 0.9);
        assert_eq!(set("levels", "2, 8").unwrap().levels, [2, 8]);
        assert_eq!(set("trials", "1e5").unwrap().trials, 100_000);
        assert_eq!(set("patterns", "01, 10").unwrap().patterns, ["01", "10"]);
        let (_, described) = described();
        assert_eq!(described[0].default, "0.5:0.1");
        assert_eq!(described[0].range, "1 to 9 entries; a from -1 to 1; gamma from 1e-12 to 1e12");
        assert_eq!(described[1].range, "at least 1 entries; from 2 to 64");
    }

    #[test]
    fn what_is_refused_is_named_with_its_place_and_value() {
        for (name, text, words) in [
            ("points", "0.9:0.2,1.5:3", ["points[1].a", "1.5", "1"]),
            ("points", "0.9", ["points", "0.9", "a:gamma"]),
            ("points", "", ["points", "", "a:gamma"]),
            ("points", "a:b", ["points[0].a", "a", "expected a number"]),
            ("levels", "4,1", ["levels[1]", "1", "2"]),
            ("levels", "4.5", ["levels[0]", "4.5", "whole"]),
            ("levels", "-4", ["levels[0]", "-4", "0 or above"]),
            ("trials", "0", ["trials", "0", "1"]),
            ("trials", "many", ["trials", "many", "whole"]),
            ("trials", "NaN", ["trials", "NaN", "whole"]),
            ("trials", "1e30", ["trials", "1e+30", "whole"]),
            ("trail", "5", ["trail", "points, levels, patterns, trials", ""]),
        ] {
            let message = set(name, text).err().map(|e| e.to_string()).unwrap_or_default();
            assert!(!message.is_empty() && words.iter().all(|w| message.contains(w)), "{name}={text}: {message}");
        }
    }

    #[test]
    fn effort_and_setting_are_told_apart() {
        let (defaults, _) = described();
        let with = |name: &str, value: Json| {
            let mut map = defaults.clone();
            map.insert(name.to_owned(), value);
            meaning(&map, &defaults)
        };
        assert_eq!(meaning(&defaults, &defaults), (true, true));
        assert_eq!(with("trials", 99.into()), (true, false));
        assert_eq!(with("trials", 101.into()), (true, true));
        assert_eq!(with("levels", Json::from(vec![8])), (false, true));
    }
}
