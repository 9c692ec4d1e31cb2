//! Options of all tasks on tables: how a table is read, several files, bounds.

use crate::error::Error;
use crate::identity::Identity;
use crate::shard::Shard;
use clap::Args;
use std::path::PathBuf;

/// Reading of a table.
#[derive(Args, Clone, Default)]
pub(crate) struct TableOptions {
    /// Table of text (CSV and its relatives, or lines of JSON; also packed by gzip), or a Parquet file; `-` for standard input.
    pub(crate) file: String,
    /// Largest error of restored times: `exact` or as `±10ms`. Default: rows are numbered.
    #[arg(long, value_name = "exact|±10ms", allow_hyphen_values = true)]
    pub(crate) time: Option<String>,
    /// Column of times, or several that give it together, as Date,Time. Default with `--time`: the column whose cells or name say so.
    #[arg(long, value_name = "NAMES")]
    pub(crate) time_column: Option<String>,
    /// Columns of values, separated by commas; a name with commas in double quotes, the third column as #3. Default: all.
    #[arg(long, value_name = "NAMES")]
    pub(crate) columns: Vec<String>,
    /// Columns that are left out.
    #[arg(long, value_name = "NAMES")]
    pub(crate) without: Option<String>,
    /// Each row is one reading: the column with the name of its sensor or anchor. Sensors become columns. Values are in the other columns,
    /// or those of `--columns`.
    #[arg(long, value_name = "NAME")]
    pub(crate) by: Option<String>,
    #[command(flatten)]
    pub(crate) dialect: DialectOptions,
    /// Hashes the file as it is read.
    #[arg(skip)]
    pub(crate) identity: Identity,
}

impl TableOptions {
    /// The columns that are left out.
    pub(crate) fn without(&self) -> Vec<String> {
        self.without
            .as_deref()
            .map(fewbits_table::names::split)
            .unwrap_or_default()
    }
}

/// How a table is written. What is not said is detected; `fewbits look` shows it.
#[derive(Args, Clone, Default)]
#[command(next_help_heading = "How the table is written (default: detected, see `fewbits look`)")]
pub(crate) struct DialectOptions {
    /// File with these settings as TOML, as `fewbits look --toml` writes it.
    #[arg(long, value_name = "FILE.toml")]
    pub(crate) dialect: Option<PathBuf>,
    /// What separates cells: a character, `tab`, or `spaces` for runs of them.
    #[arg(long, value_name = "MARK")]
    pub(crate) delimiter: Option<String>,
    /// Mark around cells that contain the delimiter.
    #[arg(long, value_name = "MARK")]
    pub(crate) quote: Option<char>,
    /// Lines that begin with this text are comments; an empty text means that there are none.
    #[arg(long, value_name = "TEXT")]
    pub(crate) comment: Option<String>,
    /// Lines before the line of names, comments not counted.
    #[arg(long, value_name = "LINES")]
    pub(crate) skip: Option<u64>,
    /// There is no line of names: columns are column_1, column_2 and so on.
    #[arg(long)]
    pub(crate) no_header: bool,
    /// The line behind the names has units.
    #[arg(long)]
    pub(crate) units_row: bool,
    /// Lines behind the names (and units) that are no rows.
    #[arg(long, value_name = "LINES")]
    pub(crate) skip_after_names: Option<u64>,
    /// Mark before decimals: `.` or `,`.
    #[arg(long, value_name = "MARK")]
    pub(crate) decimal: Option<char>,
    /// Mark between groups of three digits.
    #[arg(long, value_name = "MARK")]
    pub(crate) thousands: Option<char>,
    /// Cut units off behind numbers, as in `19.75 °C` and `40%`.
    #[arg(long)]
    pub(crate) strip_units: bool,
    /// Spellings of gaps besides the usual ones, as `-9999,ERR`; of one column as `wind=999`.
    #[arg(long, value_name = "TEXTS", allow_hyphen_values = true)]
    pub(crate) missing: Option<String>,
    /// Columns whose cells are words though they could be numbers or times, as `007`, `1e5` and `1.10`: up to 256 different ones.
    #[arg(long, value_name = "NAMES")]
    pub(crate) words: Option<String>,
    /// How times are written: as '%d.%m.%Y %H:%M:%S', the order `dmy`, `mdy` or `ymd`, the unit of numbers `s`, `ms`, `us`, `ns`,
    /// `min`, `h` or `d`, or `excel`, `matlab`, `mjd`, `jd`, `labview` for numbers of days or seconds as of these, or `be` for
    /// dates with years of the Buddhist era.
    #[arg(long, value_name = "FORMAT")]
    pub(crate) time_format: Option<String>,
    /// Zone of times without an offset, as Europe/Berlin or +01:00. Default: they are kept as local times.
    #[arg(long, value_name = "ZONE", allow_hyphen_values = true)]
    pub(crate) time_zone: Option<String>,
    /// Take the cells that short rows lack as gaps.
    #[arg(long)]
    pub(crate) short_rows: bool,
    /// Leave out up to so many lines that cannot be read; they are counted and named.
    #[arg(long, value_name = "LINES", default_value_t = 0, hide_default_value = true)]
    pub(crate) skip_bad: u64,
    /// Encoding of the text, as latin1 or utf-16le. Default: UTF-8, or what the first bytes say.
    #[arg(long, value_name = "LABEL")]
    pub(crate) encoding: Option<String>,
}

impl DialectOptions {
    /// The settings that are said, by options or in the file of `--dialect`.
    pub(crate) fn said(&self) -> Result<fewbits_table::Dialect, Error> {
        let stored = match &self.dialect {
            None => fewbits_table::Dialect::default(),
            Some(path) => {
                let file = path.display().to_string();
                let text = std::fs::read_to_string(path).map_err(Error::io(&file, "read"))?;
                fewbits_table::Dialect::from_toml(&text).map_err(Error::of_table(&file))?
            }
        };
        let flag = |is_said: bool| is_said.then_some(true);
        let said = fewbits_table::Dialect {
            format: None,
            encoding: self.encoding.clone(),
            delimiter: self.delimiter.clone(),
            quote: self.quote,
            comment: self.comment.clone(),
            skip: self.skip,
            no_header: flag(self.no_header),
            units_row: flag(self.units_row),
            skip_after_names: self.skip_after_names,
            decimal: self.decimal,
            thousands: self.thousands,
            strip_units: self.strip_units,
            missing: self
                .missing
                .as_deref()
                .map(fewbits_table::names::split)
                .unwrap_or_default(),
            words: self
                .words
                .as_deref()
                .map(fewbits_table::names::split)
                .unwrap_or_default(),
            time_column: Vec::new(),
            time_format: self.time_format.clone(),
            time_zone: self.time_zone.clone(),
            short_rows: self.short_rows,
            skip_bad: self.skip_bad,
        };
        Ok(stored.overruled_by(&said))
    }
}

/// Several files for one task.
#[derive(Args, Clone)]
pub(crate) struct ManyOptions {
    /// More files. `--output` is then a folder, and every file has one line of summary. Wildcards (`*`, `?`, `[...]`) are expanded.
    #[arg(value_name = "MORE")]
    pub(crate) more: Vec<String>,
    /// Number of files that are worked on at once. Default: one per core.
    #[arg(long, value_name = "NUMBER")]
    pub(crate) jobs: Option<std::num::NonZeroUsize>,
    /// Take only one of several equal shares of the files, as `2/3`, so that several machines can share the work.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
}

/// Error bounds of the columns.
#[derive(Args, Clone)]
pub(crate) struct BoundOptions {
    /// Bounds as `column=bound,...`, `*` for all others: `±0.1`, `1%` of the range, `rel:1%±0.001` (1 % of each
    /// value, or 0.001 where that is more), `decimals:3`, `lossless`; a circle as `±2@360`.
    /// A bound without a column stands first. Numbers have a point. Columns without a bound are lossless.
    #[arg(long, value_name = "BOUNDS", allow_hyphen_values = true, default_value = "")]
    pub(crate) bound: String,
    /// Number of rows per block. A damaged block loses its rows only.
    #[arg(long, visible_alias = "independent", default_value_t = fewbits_record::ROWS_PER_BLOCK, value_name = "ROWS")]
    pub(crate) rows_per_block: usize,
}
