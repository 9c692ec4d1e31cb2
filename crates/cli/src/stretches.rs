//! `fewbits cat --every`: means, minima and maxima over stretches of time.

use crate::arguments::CatOptions;
use crate::error::Error;
use crate::output::{Cell, Shape, Sheet};
use crate::recording::same_unit;
use crate::say::say;
use crate::unpack::{selection, warn_of_end};
use crate::{Ending, clock, recording};
use fewbits_recipes::words;
use fewbits_record::{Aggregate, Schema, Stretch, TimeBase, TimeFormat, WholeAggregate};
use std::collections::BTreeMap;
use std::path::Path;

/// What is written of each column.
struct Kind {
    name: &'static str,
    cell: fn(&Aggregate) -> Cell,
    whole: fn(&WholeAggregate) -> Cell,
}

/// A whole number, or a gap.
fn whole(number: Option<i64>) -> Cell {
    number.map_or(Cell::Number(None), Cell::Whole)
}

const KINDS: [Kind; 4] = [
    Kind {
        name: "mean",
        cell: |all| Cell::Number(all.mean()),
        whole: |all| Cell::Number(all.mean()),
    },
    Kind {
        name: "min",
        cell: |all| Cell::Number(all.ends().map(|ends| ends.0)),
        whole: |all| whole(all.ends().map(|ends| ends.0)),
    },
    Kind {
        name: "max",
        cell: |all| Cell::Number(all.ends().map(|ends| ends.1)),
        whole: |all| whole(all.ends().map(|ends| ends.1)),
    },
    Kind {
        name: "count",
        cell: |all| whole(i64::try_from(all.count()).ok()),
        whole: |all| whole(i64::try_from(all.count()).ok()),
    },
];

/// The length of a stretch in ticks.
fn length(text: &str, time: TimeBase) -> Result<u64, Error> {
    let TimeBase::Clock { decimals, .. } = time else {
        let rows = text.parse::<u64>().ok().filter(|rows| *rows > 0);
        return rows
            .ok_or_else(|| Error::option("--every", text, "a number of rows, since this recording has no times"));
    };
    let refused = |expected| Error::option("--every", text, expected);
    // Their lengths would be those of a mean month or year.
    const MEAN: [&str; 8] = ["M", "month", "months", "y", "yr", "yrs", "year", "years"];
    if text
        .split(|c: char| !c.is_alphabetic())
        .any(|unit| MEAN.contains(&unit))
    {
        return Err(refused("a time of one length, as 1d or 30d: months and years have several"));
    }
    let time = humantime::parse_duration(text).map_err(|_| refused("a time, as 1h"))?;
    let ticks = time
        .as_nanos()
        .checked_mul(10_u128.pow(decimals.into()))
        .filter(|ticks| *ticks > 0);
    let ticks = ticks.ok_or_else(|| refused("a time above 0"))?;
    match (ticks % 1_000_000_000, u64::try_from(ticks / 1_000_000_000)) {
        (0, Ok(ticks)) if i64::try_from(ticks).is_ok() => Ok(ticks),
        _ => Err(refused("a time that is a whole number of the recording's ticks")),
    }
}

/// The kind of the times, and the decimals of their ticks.
fn parts(time: TimeBase) -> (Option<TimeFormat>, u8) {
    match time {
        TimeBase::Clock { decimals, format, .. } => (Some(format), decimals),
        _ => (None, 0),
    }
}

/// The columns whose numbers are values: those of words have none.
fn columns(options: &CatOptions, schema: &Schema, names: Vec<String>) -> Result<Vec<String>, Error> {
    let is_words = |name: &String| {
        let column = schema.position(name).map(|i| &schema.columns()[i]);
        column.is_ok_and(|column| words::of(column.unit()).is_some())
    };
    if !options.columns.is_empty()
        && let Some(name) = names.iter().find(|name| is_words(name))
    {
        return Err(Error::option("--columns", name, "columns of numbers with --every"));
    }
    Ok(names.into_iter().filter(|name| !is_words(name)).collect())
}

/// Runs the task.
pub(crate) fn run(options: &CatOptions, every: &str) -> Result<Ending, Error> {
    let mut ending = Ending::Good;
    let mut found: BTreeMap<i64, Stretch> = BTreeMap::new();
    let mut head: Option<(Vec<String>, String)> = None;
    let mut playbacks = Vec::new();
    for file in &options.files {
        playbacks.push(recording::open(Path::new(file))?);
    }
    let times: Vec<TimeBase> = playbacks.iter().map(|playback| playback.schema().time()).collect();
    let (format, decimals): (Vec<_>, Vec<_>) = times.iter().map(|time| parts(*time)).unzip();
    if let Some(i) = (0..format.len()).find(|i| format[*i] != format[0]) {
        return Err(Error::content(&options.files[i], format!("has other times than {}", options.files[0])));
    }
    // Times of several recordings are those of the finest ticks.
    let Some((finest, time)) = decimals.iter().zip(&times).max_by_key(|(decimals, _)| **decimals) else {
        return Ok(ending);
    };
    // Whether each column has whole numbers of 64 bits, in the first recording.
    let mut wholes: Option<Vec<bool>> = None;
    let mut first_schema: Option<Schema> = None;
    for ((file, mut playback), decimals) in options.files.iter().zip(playbacks).zip(&decimals) {
        let scale = 10_i64.saturating_pow(u32::from(finest - decimals));
        let schema = playback.schema().clone();
        let selection = selection(options, &schema, file)?;
        let names = match &head {
            None => columns(options, &schema, selection.names)?,
            Some((names, _)) => names.clone(),
        };
        let every = length(every, schema.time())?;
        head.get_or_insert_with(|| (names.clone(), schema.time_name().to_owned()));
        let first = first_schema.get_or_insert_with(|| schema.clone());
        for name in &names {
            if let (Ok(i), Ok(own)) = (first.position(name), schema.position(name)) {
                same_unit(&first.columns()[i], schema.columns()[own].unit(), &options.files[0])
                    .map_err(|problem| Error::content(file, problem))?;
            }
        }
        let wanted: Vec<&str> = names.iter().map(String::as_str).collect();
        playback.columns(&wanted).map_err(Error::recording(file))?;
        let is_whole = |name: &String| {
            schema
                .position(name)
                .is_ok_and(|i| schema.columns()[i].integers().is_some())
        };
        let own: Vec<bool> = names.iter().map(is_whole).collect();
        let first = wholes.get_or_insert_with(|| own.clone());
        if let Some(i) = (0..own.len()).find(|i| own[*i] != first[*i]) {
            let name = crate::say::name(&names[i]);
            let problem = format!(
                "column `{name}` has whole numbers of 64 bits in this recording or in {}, and doubles in the other: read each by itself",
                options.files[0]
            );
            return Err(Error::content(file, problem));
        }
        if !playback.is_finished() {
            warn_of_end(file);
            ending = Ending::Failed;
        }
        let damaged = |error: &fewbits_record::Error| {
            say!("warning: {file}: {error}; the rest is read");
            ending = Ending::Failed;
        };
        let stretches = playback.aggregates(every, selection.ticks, damaged);
        for stretch in stretches.map_err(Error::recording(file))? {
            match found.entry(stretch.tick.saturating_mul(scale)) {
                std::collections::btree_map::Entry::Vacant(entry) => {
                    entry.insert(stretch);
                }
                std::collections::btree_map::Entry::Occupied(mut entry) => {
                    let all = entry.get_mut();
                    all.rows += stretch.rows;
                    let pairs = all.columns.iter_mut().zip(&stretch.columns);
                    pairs.for_each(|(sum, more)| sum.merge(more));
                    let pairs = all.wholes.iter_mut().zip(&stretch.wholes);
                    pairs.for_each(|pair| {
                        if let (Some(sum), Some(more)) = pair {
                            sum.merge(more);
                        }
                    });
                }
            }
        }
    }
    let Some((names, time_name)) = head else {
        return Ok(ending);
    };
    let asked = [options.mean, options.min, options.max, options.count];
    let none = !asked.contains(&true);
    let kinds: Vec<&Kind> = KINDS
        .iter()
        .zip(asked)
        .filter(|(kind, asked)| *asked || (none && kind.name == "mean"))
        .map(|(kind, _)| kind)
        .collect();
    let first = if *time == TimeBase::Numbered {
        "row"
    } else {
        time_name.as_str()
    };
    let of_column = |name: &String| {
        kinds
            .iter()
            .map(|kind| format!("{name} {}", kind.name))
            .collect::<Vec<_>>()
    };
    let heads = std::iter::once(first.to_owned())
        .chain(names.iter().flat_map(of_column))
        .collect();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), heads)?;
    for (tick, stretch) in &found {
        let tick = match *time {
            TimeBase::Numbered => Cell::Whole(*tick),
            time => Cell::Text(clock::shown(*tick, time)),
        };
        let pairs = stretch.columns.iter().zip(&stretch.wholes);
        let cells = pairs.flat_map(|(all, whole)| {
            kinds.iter().map(move |kind| match whole {
                Some(whole) => (kind.whole)(whole),
                None => (kind.cell)(all),
            })
        });
        sheet.write(std::iter::once(tick).chain(cells))?;
    }
    sheet.finish()?;
    Ok(ending)
}
