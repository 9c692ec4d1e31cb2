//! How a table is written. What is not said is detected from the first lines; all of it can be printed, said and stored.

use crate::error::Error;
use crate::names;
use crate::profile::Meaning;
use serde::{Deserialize, Serialize};

/// How a table is written. A field of `None` is detected by [`Table::open`](crate::Table::open); after that, all that matter are set.
///
/// Its text form is TOML ([`Dialect::to_toml`]), for a file `dialect.toml` beside the tables of one logger:
///
/// ```
/// use fewbits_table::Dialect;
///
/// let dialect = Dialect::from_toml("delimiter = ';'\ndecimal = ','\ntime-column = ['Datum', 'Zeit']")?;
/// assert_eq!(dialect.decimal, Some(','));
/// assert_eq!(Dialect::from_toml(&dialect.to_toml())?, dialect);
/// assert_eq!(dialect.as_options(), "--delimiter ';' --decimal , --time-column Datum,Zeit");
/// # Ok::<(), fewbits_table::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "kebab-case")]
pub struct Dialect {
    /// Name of a format that was recognised, as `TOA5`; only told to users.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<String>,
    /// Encoding of the text, by its label of the WHATWG standard, as `utf-8`, `latin1`, `utf-16le`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoding: Option<String>,
    /// What separates cells: one character, `tab`, or `spaces` for runs of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub delimiter: Option<String>,
    /// The mark around cells that contain the delimiter: `"` or `'`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub quote: Option<char>,
    /// Lines that begin with this text are comments.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comment: Option<String>,
    /// Lines before the line of names, comments not counted.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skip: Option<u64>,
    /// Whether there is no line of names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub no_header: Option<bool>,
    /// Whether units stand in the line behind the names.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub units_row: Option<bool>,
    /// Lines behind the names, and the units if there are any, that are no data.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skip_after_names: Option<u64>,
    /// The mark before decimals: `.` or `,`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub decimal: Option<char>,
    /// The mark between groups of three digits.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub thousands: Option<char>,
    /// Whether units behind numbers are cut off, as in `19.75 °C`.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub strip_units: bool,
    /// Spellings of gaps besides the usual ones: `-9999` in all columns, `wind=999` in one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub missing: Vec<String>,
    /// Columns whose cells are words though they could be numbers or times, as `007`, `1e5`, `1.10`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub words: Vec<String>,
    /// Columns that give the time, one or several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub time_column: Vec<String>,
    /// How times are written: as of `strftime`, `dmy`, `mdy`, `ymd`, or the unit of numbers: `s`, `ms`, `us`, `ns`, `min`, `h`, `d`; numbers of
    /// days or seconds of other programs: `excel`, `matlab`, `mjd`, `jd`, `labview`; `be` for dates with years of the Buddhist era.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_format: Option<String>,
    /// Zone of times without an offset: a name, as `Europe/Berlin`, or an offset, as `+01:00`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub time_zone: Option<String>,
    /// Whether the cells that a short row lacks are gaps.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub short_rows: bool,
    /// Number of lines that may be left out because they cannot be read.
    #[serde(skip_serializing_if = "is_zero")]
    pub skip_bad: u64,
}

fn is_zero(number: &u64) -> bool {
    *number == 0
}

/// What separates cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Delimiter {
    Byte(u8),
    Spaces,
}

impl Delimiter {
    pub(crate) fn parse(text: &str) -> Result<Self, Error> {
        match text {
            "tab" | "\\t" | "\t" => Ok(Self::Byte(b'\t')),
            "spaces" | "space" | "" | " " => Ok(Self::Spaces),
            "comma" => Ok(Self::Byte(b',')),
            "semicolon" => Ok(Self::Byte(b';')),
            _ => match text.as_bytes() {
                [byte] if byte.is_ascii() && !byte.is_ascii_alphanumeric() => Ok(Self::Byte(*byte)),
                _ => Err(Error::option("--delimiter", text, "one character of ASCII, `tab` or `spaces`")),
            },
        }
    }

    pub(crate) fn shown(self) -> String {
        match self {
            Self::Byte(b'\t') => "tab".to_owned(),
            Self::Byte(byte) => char::from(byte).to_string(),
            Self::Spaces => "spaces".to_owned(),
        }
    }
}

impl Dialect {
    /// The dialect of a TOML text.
    ///
    /// # Errors
    /// If the text is no TOML, or has another key or kind of value.
    pub fn from_toml(text: &str) -> Result<Self, Error> {
        let found: Self = toml::from_str(text).map_err(|error| {
            Error::option("the dialect", text.trim(), format!("TOML with the options of tables: {error}"))
        })?;
        found.checked()
    }

    /// The dialect as TOML.
    pub fn to_toml(&self) -> String {
        // Only strings, numbers, booleans and lists of strings: nothing that TOML refuses.
        toml::to_string(self).unwrap_or_default()
    }

    /// Settings of `said`, and those of `self` where it has none.
    #[must_use]
    pub fn overruled_by(self, said: &Self) -> Self {
        let list = |said: &Vec<String>, own: Vec<String>| if said.is_empty() { own } else { said.clone() };
        Self {
            format: said.format.clone().or(self.format),
            encoding: said.encoding.clone().or(self.encoding),
            delimiter: said.delimiter.clone().or(self.delimiter),
            quote: said.quote.or(self.quote),
            comment: said.comment.clone().or(self.comment),
            skip: said.skip.or(self.skip),
            no_header: said.no_header.or(self.no_header),
            units_row: said.units_row.or(self.units_row),
            skip_after_names: said.skip_after_names.or(self.skip_after_names),
            decimal: said.decimal.or(self.decimal),
            thousands: said.thousands.or(self.thousands),
            strip_units: said.strip_units || self.strip_units,
            missing: list(&said.missing, self.missing),
            words: list(&said.words, self.words),
            time_column: list(&said.time_column, self.time_column),
            time_format: said.time_format.clone().or(self.time_format),
            time_zone: said.time_zone.clone().or(self.time_zone),
            short_rows: said.short_rows || self.short_rows,
            skip_bad: if said.skip_bad > 0 {
                said.skip_bad
            } else {
                self.skip_bad
            },
        }
    }

    /// Checks that the settings go together.
    ///
    /// # Errors
    /// If a mark has more than one byte, two marks are the same, or the delimiter or the zone is unknown.
    pub fn checked(mut self) -> Result<Self, Error> {
        if let Some('\u{a0}' | '\u{202f}' | '\u{2009}') = self.thousands {
            // All kinds of spaces are one mark.
            self.thousands = Some(' ');
        }
        if let Some(text) = &self.delimiter {
            let delimiter = Delimiter::parse(text)?;
            let is_used = |mark: Option<char>| {
                mark.is_some_and(|mark| delimiter == Delimiter::Byte(mark as u32 as u8) && mark.is_ascii())
            };
            if is_used(self.quote) || (is_used(self.decimal) && self.quote.is_none() && self.decimal != Some(',')) {
                return Err(Error::option("--delimiter", text, "another mark than that of decimals and quotes"));
            }
        }
        match self.decimal {
            None | Some('.' | ',') => {}
            Some(mark) => return Err(Error::option("--decimal", &mark.to_string(), "`.` or `,`")),
        }
        if let Some(mark) = self.thousands
            && (!mark.is_ascii() || mark.is_ascii_alphanumeric() || Some(mark) == self.decimal)
        {
            return Err(Error::option("--thousands", &mark.to_string(), "a mark other than that of decimals, as `,`"));
        }
        if let Some(label) = &self.encoding
            && encoding_rs::Encoding::for_label(label.as_bytes()).is_none()
        {
            return Err(Error::option("--encoding", label, "a label such as `utf-8`, `latin1` or `utf-16le`"));
        }
        if let Some(zone) = &self.time_zone
            && crate::written::zone(zone).is_none()
        {
            return Err(Error::option("--time-zone", zone, "a name, as Europe/Berlin, or an offset, as +01:00"));
        }
        Ok(self)
    }

    /// The options of the command line that say this dialect.
    pub fn as_options(&self) -> String {
        fn list(names: &[String]) -> String {
            names
                .iter()
                .map(|name| names::quoted(name))
                .collect::<Vec<_>>()
                .join(",")
        }
        let mut options = Vec::new();
        let mut text = |option: &str, value: Option<String>| {
            options.extend(value.map(|value| format!("{option} {}", names::in_shell(&value))));
        };
        text("--encoding", self.encoding.clone());
        text("--delimiter", self.delimiter.clone());
        text("--quote", self.quote.map(String::from));
        text("--comment", self.comment.clone());
        text("--skip", self.skip.filter(|skip| *skip > 0).map(|skip| skip.to_string()));
        text(
            "--skip-after-names",
            self.skip_after_names
                .filter(|skip| *skip > 0)
                .map(|skip| skip.to_string()),
        );
        text("--decimal", self.decimal.map(String::from));
        text("--thousands", self.thousands.map(String::from));
        text("--missing", (!self.missing.is_empty()).then(|| list(&self.missing)));
        text("--words", (!self.words.is_empty()).then(|| list(&self.words)));
        text("--time-column", (!self.time_column.is_empty()).then(|| list(&self.time_column)));
        text("--time-format", self.time_format.clone());
        text("--time-zone", self.time_zone.clone());
        text("--skip-bad", (self.skip_bad > 0).then(|| self.skip_bad.to_string()));
        for (is_said, flag) in [
            (self.no_header == Some(true), "--no-header"),
            (self.units_row == Some(true), "--units-row"),
            (self.strip_units, "--strip-units"),
            (self.short_rows, "--short-rows"),
        ] {
            options.extend(is_said.then(|| flag.to_owned()));
        }
        options.join(" ")
    }

    /// What is said of the cells of a column, or what its name says of them.
    pub(crate) fn meaning_of(&self, column: &crate::Column) -> Meaning {
        let is_it = |name: &String| *name == column.name || *name == column.own_name;
        if self.words.iter().any(is_it) {
            Meaning::Words
        } else if crate::codes::is_named(&column.own_name) {
            Meaning::Identifiers
        } else {
            Meaning::Open
        }
    }

    /// The marks in numbers.
    pub(crate) fn marks(&self) -> crate::number::Syntax {
        let byte = |mark: char| mark as u32 as u8;
        crate::number::Syntax {
            decimal: self.decimal.map_or(b'.', byte),
            thousands: self.thousands.map(byte),
        }
    }

    /// The spellings of gaps of a column, given with its name or for all columns.
    pub(crate) fn missing_of(&self, name: &str, own_name: &str) -> crate::missing::Spellings {
        crate::missing::Spellings::new(self.missing.iter().filter_map(|word| match word.rsplit_once('=') {
            None => Some(word.as_str()),
            Some((column, word)) => {
                let column = names::unquoted(column.trim());
                (column == name || column == own_name || column == "*").then_some(word)
            }
        }))
    }
}
