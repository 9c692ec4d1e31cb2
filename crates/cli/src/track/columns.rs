//! Which columns of a table are no sensors.

use crate::arguments::TableOptions;
use crate::input::Table;
use fewbits_table::Kind as Cells;
use fewbits_table::names::as_argument;

/// Names of a column that has the name of each row's sensor. Anchors may be numbers.
const LABELS: [&str; 18] = [
    "name", "id", "sensor", "device", "entity", "channel", "source", "label", "mote", "tag", "topic", "uid", "anchor",
    "node", "beacon", "station", "gateway", "gw",
];
/// From this one on, numbers are names too, where places are looked for.
const PLACED: usize = 12;
/// Names of a column of the standard deviations of each row's values.
const ACCURACIES: [&str; 10] = [
    "accuracy",
    "hacc",
    "stderr",
    "sigma",
    "std",
    "stddev",
    "stdev",
    "sd",
    "uncertainty",
    "variance",
];
/// The same beside one column of values; of several sensors they may be something else.
const ERRORS: [&str; 6] = ["error", "err", "precision", "var", "ci95", "u95"];
/// Names of the column of ranges among others.
const RANGES: [&str; 3] = ["range", "distance", "dist"];
/// Names of columns that say how good a fix is, or whose it is: no sensor measures them.
const NO_LEVELS: [&str; 10] = [
    "hdop",
    "vdop",
    "pdop",
    "gdop",
    "tdop",
    "dop",
    "mmsi",
    "imo",
    "satellites",
    "sats",
];
/// Names of columns that number rows, or say how a value came about, or when.
const NUMBERS: [&str; 11] = [
    "record", "recno", "seq", "status", "flag", "flags", "qc", "quality", "hour", "minute", "weekday",
];
/// Words of what is said of a device, or of the level by who sets or predicts it. Beside columns without such words they measure no level.
const BESIDE: [&[&str]; 3] = [
    &["rssi", "snr", "lqi", "sats", "satellites"],
    &["battery", "vbat"],
    &["setpoint", "forecast"],
];
/// Ends of what a mean is of.
const ENDS: [&str; 4] = ["min", "max", "minimum", "maximum"];
const MEANS: [&str; 4] = ["mean", "avg", "average", "median"];
/// Ends of a band around the value of which the rest of the name is that.
const BOUNDS: [&str; 8] = ["low", "high", "lower", "upper", "lo", "hi", "lwr", "upr"];
/// Words of quantities: columns of two of them measure no common level.
const QUANTITIES: [&[&str]; 8] = [
    &["lat", "latitude"],
    &["lon", "lng", "longitude"],
    &["temp", "temperature"],
    &["hum", "humidity", "rh"],
    &["pressure", "baro", "barometer"],
    &["co2"],
    &["rssi", "snr"],
    &["battery", "vbat", "voltage"],
];

/// What may be found of columns that no option names.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) enum Finds {
    /// Which column has the names of the sensors.
    #[default]
    Labels,
    /// Also which one has accuracies.
    Levels,
    /// The same, and the names may be numbers, of anchors.
    Anchors,
}

/// Which columns of a table are no sensors.
#[derive(Debug, Clone, Default)]
pub(super) struct Kind {
    /// What the names and cells of columns may say where no option does.
    pub(super) finds: Finds,
    /// Names of the sensors, if each row is one report.
    pub(super) by: Option<String>,
    /// Standard deviations of the row's values.
    pub(super) accuracy: Option<String>,
    /// Thresholds of the row's bits.
    pub(super) threshold: Option<String>,
    /// Whether a sensor that does not report at an instant says something by that.
    pub(super) is_filled: bool,
    /// Seconds by which a row may be late.
    pub(super) late: f64,
    /// Seconds between measurements of a sensor that sends some of them.
    pub(super) sampled: Option<f64>,
}

impl Kind {
    pub(super) fn columns(&self) -> impl Iterator<Item = &String> {
        self.accuracy.iter().chain(&self.threshold)
    }
}

/// Columns that are no sensors, as options name them or as they were found.
#[derive(Debug, Clone, Default)]
pub(super) struct Roles {
    pub(super) by: Option<String>,
    pub(super) accuracy: Option<String>,
    /// Names of sensors, and of columns of the accuracies of their values alone.
    pub(super) own_accuracies: Vec<(String, String)>,
    /// The column of values, if it is found among others that are left out.
    pub(super) value: Option<String>,
    /// What was found, a line each.
    pub(super) told: Vec<String>,
}

/// Whether a column of this name has the names of anchors.
pub(super) fn is_place(word: &str) -> bool {
    LABELS[PLACED..].contains(&word)
}

/// The words of a name, in small letters.
pub(super) fn words(name: &str) -> Vec<String> {
    let name = name.to_lowercase();
    let parts = name.split(|letter: char| !letter.is_alphanumeric());
    parts.filter(|part| !part.is_empty()).map(str::to_owned).collect()
}

/// The sensor whose name is that of a column of accuracies without the word that says so, and that column.
fn accuracy_of(name: &str, all: &[&String]) -> Option<(String, String)> {
    let own = words(name);
    let is_said_by = |word: &String| ACCURACIES.contains(&word.as_str()) || ERRORS.contains(&word.as_str());
    let rests = [(own.last()?, &own[..own.len() - 1]), (own.first()?, &own[1..])];
    let of = |rest: &[String]| all.iter().find(|other| !rest.is_empty() && words(other) == rest);
    let mut sensors = rests
        .iter()
        .filter(|(word, _)| is_said_by(word))
        .filter_map(|(_, rest)| of(rest));
    Some(((*sensors.next()?).clone(), name.to_owned()))
}

fn holds_words(table: &Table, column: usize) -> bool {
    matches!(table.kind(column), Cells::Words | Cells::Text)
}

impl Roles {
    /// `is_whole`: no option says which columns are used.
    pub(super) fn find(table: &Table, kind: &Kind, is_whole: bool) -> Self {
        let mut found = Self {
            by: kind.by.clone(),
            accuracy: kind.accuracy.clone(),
            own_accuracies: Vec::new(),
            value: None,
            told: Vec::new(),
        };
        let is_free = |i: &usize| {
            let name = Some(&table.names[*i]);
            name != kind.by.as_ref() && name != kind.accuracy.as_ref() && name != kind.threshold.as_ref()
        };
        let free: Vec<usize> = (0..table.names.len()).filter(is_free).collect();
        if is_whole && kind.finds != Finds::Labels && found.accuracy.is_none() {
            let is_beside_one = free.iter().filter(|i| !holds_words(table, **i)).count() == 2;
            let is_said_by = |word: &str| ACCURACIES.contains(&word) || (is_beside_one && ERRORS.contains(&word));
            let is_accuracy = |i: &&usize| {
                let words = words(&table.names[**i]);
                !holds_words(table, **i)
                    && [words.first(), words.last()]
                        .iter()
                        .any(|word| word.is_some_and(|word| is_said_by(word)))
            };
            let mut those: Vec<&String> = free.iter().filter(is_accuracy).map(|i| &table.names[*i]).collect();
            let all: Vec<&String> = free.iter().map(|i| &table.names[*i]).collect();
            let pairs: Vec<(String, String)> = all.iter().filter_map(|name| accuracy_of(name, &all)).collect();
            if all.len() - pairs.len() > 1 {
                those.retain(|name| pairs.iter().all(|(_, accuracy)| accuracy != *name));
                found.told.extend(pairs.iter().map(|(sensor, accuracy)| {
                    format!(
                        "{accuracy} is taken for the accuracy of the values of {sensor}; with --columns it is a sensor"
                    )
                }));
                found.own_accuracies = pairs;
            }
            match those.as_slice() {
                [] => {}
                [name] if free.len() > 1 && found.own_accuracies.is_empty() => {
                    found.told.push(format!(
                        "{name} is taken for the accuracy of each row's values, as --accuracy-column {} says; with --columns it is a sensor",
                        as_argument([name])
                    ));
                    found.accuracy = Some((*name).clone());
                }
                _ => found.told.push(format!(
                    "taken for sensors: {}: if they are accuracies, choose one sensor by --columns and its --accuracy-column",
                    those.iter().map(|name| name.as_str()).collect::<Vec<_>>().join(", ")
                )),
            }
        }
        if found.by.is_none() {
            let is_label = |i: &&usize| {
                let words = words(&table.names[**i]);
                let known = |word: &String| LABELS.iter().position(|label| label == word);
                let place = words.first().and_then(known);
                let is_plain = words.len() == 1 || words.get(1).is_some_and(|word| word == "id");
                let is_number = is_plain && kind.finds == Finds::Anchors;
                place.is_some_and(|place| holds_words(table, **i) || (is_number && place >= PLACED))
            };
            let labels: Vec<&String> = free.iter().filter(is_label).map(|i| &table.names[*i]).collect();
            let values = free
                .iter()
                .filter(|i| !holds_words(table, **i) && !found.is_accuracy(&table.names[**i]));
            let values: Vec<&usize> = values.filter(|i| !labels.contains(&&table.names[**i])).collect();
            let is_told = values.len() == 1 || is_whole && found.range(table, kind, &values).is_some();
            if let ([name], true) = (labels.as_slice(), is_told) {
                found.told.push(format!(
                    "each row is one reading of the sensor that {name} names, as --by {} says",
                    as_argument([name])
                ));
                found.by = Some((*name).clone());
            }
        }
        if is_whole && found.by.is_some() {
            let is_other =
                |i: &&usize| found.by.as_ref() != Some(&table.names[**i]) && !found.is_accuracy(&table.names[**i]);
            let others: Vec<&usize> = free.iter().filter(is_other).collect();
            if let (2.., Some(value)) = (others.len(), found.range(table, kind, &others)) {
                let rest = others
                    .iter()
                    .map(|i| table.names[**i].as_str())
                    .filter(|name| *name != value);
                found.told.push(format!(
                    "{value} is taken for the range, as --columns {} says; left out: {}",
                    as_argument([&value]),
                    rest.collect::<Vec<_>>().join(", ")
                ));
                found.value = Some(value);
            }
        }
        found
    }

    /// How a table is read of which one column of values is taken.
    pub(super) fn narrowed(&self, options: &TableOptions, kind: &Kind) -> Option<(TableOptions, Kind)> {
        let value = self.value.as_ref()?;
        let options = TableOptions {
            columns: vec![as_argument([value])],
            without: None,
            ..options.clone()
        };
        let kind = Kind {
            by: self.by.clone(),
            accuracy: self.any_accuracy().cloned(),
            ..kind.clone()
        };
        Some((options, kind))
    }

    /// The one of these columns that is called a range, where ranges are looked for.
    fn range(&self, table: &Table, kind: &Kind, columns: &[&usize]) -> Option<String> {
        let is_range = |i: &&&usize| {
            !holds_words(table, ***i)
                && words(&table.names[***i])
                    .iter()
                    .any(|word| RANGES.contains(&word.as_str()))
        };
        let mut found = columns.iter().filter(is_range).filter(|_| kind.finds == Finds::Anchors);
        let first = found.next()?;
        found.next().is_none().then(|| table.names[**first].clone())
    }

    /// A column of accuracies, if there is one.
    pub(super) fn any_accuracy(&self) -> Option<&String> {
        let own = self.own_accuracies.iter().map(|(_, accuracy)| accuracy);
        self.accuracy.iter().chain(own).next()
    }

    /// The column of the accuracies of a sensor's values.
    pub(super) fn accuracy_of(&self, sensor: &str) -> Option<&String> {
        let own = self.own_accuracies.iter().find(|(name, _)| name == sensor);
        own.map(|(_, accuracy)| accuracy).or(self.accuracy.as_ref())
    }

    fn is_accuracy(&self, name: &str) -> bool {
        let own = self.own_accuracies.iter().map(|(_, accuracy)| accuracy);
        self.accuracy.iter().chain(own).any(|accuracy| accuracy == name)
    }

    /// What to do if columns beside each other cannot measure one level, by their names, and no option chooses among them.
    pub(super) fn mixed(&self, table: &Table) -> Option<String> {
        let own = |name: &&String| self.by.as_ref() != Some(*name) && !self.is_accuracy(name);
        let quantity = |name: &String| {
            let words = words(name);
            let mut those = QUANTITIES
                .iter()
                .filter(|own| words.iter().any(|word| own.contains(&word.as_str())));
            those.next().filter(|_| those.next().is_none())
        };
        let mut known = table
            .names
            .iter()
            .filter(own)
            .filter_map(|name| Some((name, quantity(name)?)));
        if let Some((one, first)) = known.next()
            && let Some((other, _)) = known.find(|(_, quantity)| *quantity != first)
        {
            let [one, other] = [one, other].map(|name| crate::say::name(name));
            return Some(format!("columns {one} and {other} do not measure one level: choose with --columns"));
        }
        let all: Vec<&String> = table.names.iter().filter(own).collect();
        let has = |name: &String, those: &[&str]| words(name).iter().any(|word| those.contains(&word.as_str()));
        // The temperature of a battery is one.
        let is_other = |name: &String, those: &[&str]| {
            let mut others = QUANTITIES.iter().filter(|own| !own.contains(&those[0]));
            others.any(|own| has(name, own))
        };
        // A forecast of a temperature is none.
        let is_said_beside =
            |name: &String, those: &[&str]| has(name, those) && (those == BESIDE[2] || !is_other(name, those));
        let is_beside = |those: &&&[&str]| !all.iter().all(|name| is_said_beside(name, those));
        // `level_low` and `level_high` beside `level`.
        let is_bound = |name: &String| {
            let own = words(name);
            let (Some(last), rest) = (own.last(), &own[..own.len().saturating_sub(1)]) else {
                return false;
            };
            BOUNDS.contains(&last.as_str()) && !rest.is_empty() && all.iter().any(|other| words(other) == rest)
        };
        let is_mean_there = all.iter().any(|name| has(name, &MEANS));
        let measures_none = |name: &&&String| {
            let first = words(name);
            first.first().is_some_and(|word| NO_LEVELS.contains(&word.as_str()))
                || (first.len() == 1 && has(name, &NUMBERS))
                || BESIDE.iter().filter(is_beside).any(|those| is_said_beside(name, those))
                || is_bound(name)
                || (is_mean_there && has(name, &ENDS) && !has(name, &MEANS))
        };
        let those: Vec<String> = all
            .iter()
            .filter(measures_none)
            .map(|name| crate::say::name(name).into_owned())
            .collect();
        if those.is_empty() || all.len() == 1 {
            return None;
        }
        let dilution = if those.iter().any(|name| name.to_lowercase().ends_with("dop")) {
            "; a column of standard deviations, the dilution times the error of a range, is an --accuracy-column"
        } else {
            ""
        };
        let (word, verb) = if those.len() == 1 {
            ("column", "does")
        } else {
            ("columns", "do")
        };
        Some(format!(
            "{word} {} {verb} not measure the level: say --without {}{dilution}",
            those.join(", "),
            as_argument(&those)
        ))
    }

    /// What to do with a column of words, if rows may be readings of the sensors that it names.
    pub(super) fn hint(&self, table: &Table) -> Option<String> {
        let worded: Vec<usize> = (0..table.names.len()).filter(|i| holds_words(table, *i)).collect();
        let ([column], None, true) = (worded.as_slice(), &self.by, table.names.len() > 1) else {
            return None;
        };
        let name = crate::say::name(&table.names[*column]);
        Some(format!(
            "column `{name}` holds words, and numbers are expected: if it names the sensor of each row, say --by {}; otherwise choose \
             columns with --columns or --without, or name gaps with --missing",
            as_argument([&name])
        ))
    }
}
