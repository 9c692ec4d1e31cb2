//! Tracking of a position in the plane by distances to anchors.

use super::report::{BAND, first_cell, first_name, summarise};
use super::rows::Instants;
use super::sensors;
use crate::Ending;
use crate::arguments::{TableOptions, TrackOptions};
use crate::error::Error;
use crate::input::Table;
use crate::output::{Cell, Shape, Sheet};
use crate::plot::{Layer, Picture, Thinned};
use crate::report::Report;
use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use fewbits_record::TimeBase;
use nalgebra::Vector2;
use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;
use serde::Serialize;

/// Name and place of an anchor.
type Anchor = (String, Vector2<f64>);

#[derive(Serialize)]
struct Summary {
    rows: u64,
    ranges: usize,
    bits: usize,
    bits_per_range: f64,
    /// Number of rows without an estimate, during acquisition of the position.
    searching: u64,
    losses: usize,
    anchors: Vec<AnchorSummary>,
}

#[derive(Serialize)]
struct AnchorSummary {
    name: String,
    ranges: usize,
}

/// Reads names and places: the first column, and `x` and `y` or the second and third.
fn read_anchors(file: &str) -> Result<Vec<Anchor>, Error> {
    let options = |columns: Vec<String>| TableOptions {
        file: file.to_owned(),
        columns,
        ..TableOptions::default()
    };
    let names = Table::open(&options(Vec::new()))?.names;
    let [name, x, y] = names.as_slice() else {
        let problem = format!("columns {}: three are expected, name, x and y", names.join(", "));
        return Err(Error::content(file, problem));
    };
    let mut table = Table::open(&options(vec![x.clone(), y.clone()]))?.with_labels(name)?;
    table.require_numbers()?;
    let mut anchors: Vec<Anchor> = Vec::new();
    while let Some((_, cells)) = table.next(TimeBase::Numbered)? {
        let (label, row) = (table.label().to_owned(), table.row());
        let problem = match cells.as_slice() {
            _ if anchors.iter().any(|(known, _)| *known == label) => format!("anchor `{label}` stands here twice"),
            [Some(x), Some(y)] if x.is_finite() && y.is_finite() => {
                anchors.push((label, Vector2::new(*x, *y)));
                continue;
            }
            _ => format!("anchor `{label}` has no place: write x and y"),
        };
        return Err(Error::content(file, format_args!("row {row}: {problem}")));
    }
    Ok(anchors)
}

/// Runs the task.
pub(super) fn run(options: &TrackOptions, file: &str, mut instants: Instants) -> Result<Ending, Error> {
    let anchors = read_anchors(file)?;
    let travel = match sensors::parse(&options.send)? {
        Report::Value | Report::Censored { .. } => Travel::Full,
        Report::Sign => Travel::Bits(1),
        Report::Word { bits } => Travel::Bits(bits),
    };
    if options.reports {
        return Err(Error::option("--reports", "--model ranges", "measured ranges, which this command quantizes"));
    }
    let mut settings = RangeSettings {
        outliers: options.outliers,
        speed: options.speed,
        persistence: options.persistence,
        ..RangeSettings::default()
    };
    if !options.noise.is_empty() {
        const EXPECTED: &str = "one standard deviation for all anchors";
        let noise = options.noise.parse();
        settings.noise = noise.map_err(|_| Error::option("--noise", &options.noise, EXPECTED))?;
    }
    let mut tracker = RangeTracker::new(anchors.iter().cloned(), travel, settings)
        .map_err(Error::refused("the tracker of ranges is refused"))?;
    let known = |name: &str| anchors.iter().position(|(known, _)| known == name);
    if let Some(name) = instants.names.iter().find(|name| known(name).is_none()) {
        return Err(unknown(instants.file(), name, file));
    }
    let mut rng = Pcg64Mcg::seed_from_u64(0);
    let columns = [
        first_name(&instants),
        "x",
        "y",
        "x_low",
        "x_high",
        "y_low",
        "y_high",
        "bias",
        "scale",
        "noise",
        "speed",
        "ranges",
        "events",
    ];
    let names = columns.map(str::to_owned).to_vec();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?;
    let mut summary = Summary {
        rows: 0,
        ranges: 0,
        bits: 0,
        bits_per_range: 0.0,
        searching: 0,
        losses: 0,
        anchors: anchors
            .iter()
            .map(|(name, _)| AnchorSummary {
                name: name.clone(),
                ranges: 0,
            })
            .collect(),
    };
    let mut path = Thinned::new();
    while let Some(instant) = instants.next()? {
        let (mut found, mut ranges, mut events) = (None, 0, "");
        for (sensor, range) in &instant.reports {
            let Some(range) = range.filter(|range| range.is_finite()) else {
                continue;
            };
            let name = &instants.names[*sensor];
            let Some(anchor) = known(name) else {
                return Err(unknown(instants.file(), name, file));
            };
            let pushed = tracker.push(&mut rng, instant.seconds, name, range);
            let estimate = pushed.map_err(|source| Error::Row {
                file: instants.file().to_owned(),
                row: instant.row,
                source: Box::new(source),
            })?;
            if estimate.as_ref().is_some_and(|estimate| estimate.lost) {
                events = "lost";
            }
            // The last estimate of an instant has used all of its ranges.
            found = estimate.or(found);
            summary.anchors[anchor].ranges += 1;
            ranges += 1;
        }
        summary.rows += 1;
        summary.ranges += ranges;
        let cells: [Option<f64>; 10] = match &found {
            Some(found) => {
                let (p, d) = (found.position, [0, 1].map(|i| found.covariance[(i, i)].sqrt()));
                path.push((p, d));
                let band = |i: usize, sign: f64| Some(p[i] + sign * BAND * d[i]);
                [
                    Some(p[0]),
                    Some(p[1]),
                    band(0, -1.0),
                    band(0, 1.0),
                    band(1, -1.0),
                    band(1, 1.0),
                    Some(found.bias),
                    Some(found.scale),
                    Some(found.noise),
                    Some(found.speed),
                ]
            }
            None => {
                summary.searching += 1;
                events = "searching";
                [None; 10]
            }
        };
        let first = first_cell(&instants, instant.time);
        let last = [Cell::Whole(ranges as i64), Cell::Text(events.to_owned())];
        sheet.write(std::iter::once(first).chain(cells.map(Cell::Number)).chain(last))?;
    }
    sheet.finish()?;
    (summary.bits, summary.losses) = (tracker.bits(), tracker.losses());
    summary.bits_per_range = summary.bits as f64 / (summary.ranges as f64).max(1.0);
    if summary.rows == 0 {
        return Err(Error::empty(instants.file(), "rows"));
    }
    if let Some(file) = &options.plot {
        picture(&anchors, path.points(), &summary).save(file)?;
    }
    let lines = [
        format!("{} rows, {} ranges of {:.2} bits on average", summary.rows, summary.ranges, summary.bits_per_range),
        format!("{} rows without a place, track lost {} times", summary.searching, summary.losses),
    ];
    let silent = summary.anchors.iter().filter(|anchor| anchor.ranges == 0);
    let silent = silent.map(|anchor| format!("no range from anchor {}", anchor.name));
    let lines: Vec<String> = lines.into_iter().chain(silent).collect();
    summarise(&summary, &lines, options.json)?;
    Ok(Ending::Good)
}

fn unknown(table: &str, name: &str, anchors: &str) -> Error {
    let mend = "add it there, choose columns with --columns, or name the column of anchors with --by";
    Error::content(table, format_args!("`{name}` is no anchor of {anchors}: {mend}"))
}

/// Corners of a drawn ellipse's cross, and how many there are along a path.
const CROSSES: usize = 25;

fn picture(anchors: &[Anchor], path: &[(Vector2<f64>, [f64; 2])], summary: &Summary) -> Picture {
    let mut layers: Vec<Layer> = Vec::new();
    for (place, deviations) in path.iter().step_by((path.len() / CROSSES).max(1)) {
        for axis in 0..2 {
            let mut ends = [(place.x, place.y); 2];
            for (end, sign) in ends.iter_mut().zip([-1.0, 1.0]) {
                let step = sign * BAND * deviations[axis];
                *end = if axis == 0 {
                    (end.0 + step, end.1)
                } else {
                    (end.0, end.1 + step)
                };
            }
            layers.push(Layer::Line {
                points: ends.to_vec(),
                colour: 5,
                name: String::new(),
            });
        }
    }
    layers.push(Layer::Line {
        points: path.iter().map(|(place, _)| (place.x, place.y)).collect(),
        colour: 0,
        name: "path, crosses of 95 %".to_owned(),
    });
    layers.push(Layer::Dots {
        points: anchors.iter().map(|(_, place)| (place.x, place.y)).collect(),
        colour: 1,
        name: "anchors".to_owned(),
    });
    for (name, place) in anchors {
        layers.push(Layer::Label {
            at: (place.x, place.y),
            text: format!(" {name}\n"),
        });
    }
    Picture {
        title: format!("{} ranges of {:.2} bits", summary.ranges, summary.bits_per_range),
        x: "x".to_owned(),
        y: "y".to_owned(),
        is_log: false,
        is_map: true,
        layers,
    }
}
