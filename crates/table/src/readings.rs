//! Long tables by their look: rows of single readings, with the name of their sensor beside them.

use crate::column::Kind;
use crate::names;
use crate::table::Table;

/// Words in names of columns that hold names of sensors, the likeliest first.
const SENSORS: &str = "entity_id|_field|sensor|parameter|variable|metric|signal|channel|quantity|measurand|tag|field|series|device|\
    point|station|source|probe|name|id";
/// Names of columns of readings.
const VALUES: &str =
    "value|_value|state|reading|val|values|result|wert|measurement|valor|valeur|raw_value|sensor_value|data";

/// The columns of a table whose rows look like single readings.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Readings {
    /// The column with the name of the sensor of each row.
    pub by: String,
    /// The column with the reading.
    pub value: String,
}

impl Readings {
    /// The options that make a column of each sensor.
    pub fn as_options(&self) -> String {
        format!("--by {} --columns {}", names::as_argument([&self.by]), names::as_argument([&self.value]))
    }
}

impl Table {
    /// The columns of names and readings if the first rows look like single readings of several sensors.
    pub fn readings(&self) -> Option<Readings> {
        let value = VALUES.split('|').find_map(|name| {
            let is_it = |i: &usize| self.columns[*i].own_name.to_lowercase() == name;
            (0..self.columns.len()).find(is_it)
        })?;
        let is_sensor = |i: &usize| {
            let profile = &self.profiles[*i];
            let words = profile.words.len() as u64;
            *i != value
                && matches!(profile.kind(), Kind::Words | Kind::Text)
                && words >= 2
                && 2 * words <= profile.values()
        };
        let by = SENSORS.split('|').find_map(|name| {
            let is_named = |i: &usize| {
                let own = self.columns[*i].own_name.to_lowercase();
                own == name || (name.len() > 3 && own.contains(name))
            };
            (0..self.columns.len()).find(|i| is_named(i) && is_sensor(i))
        })?;
        let is_long = self.label.is_none() && self.own_dialect.is_none();
        is_long.then(|| Readings {
            by: self.columns[by].name.clone(),
            value: self.columns[value].name.clone(),
        })
    }

    /// What would mend a cell of this column if its table is a long one.
    pub(crate) fn readings_mend(&self, column: usize, mend: &str) -> Option<String> {
        let readings = self
            .readings()
            .filter(|readings| readings.value == self.columns[column].name)?;
        Some(format!("if each row is one reading of a sensor, say {}; otherwise {mend}", readings.as_options()))
    }
}
