//! The task `ranges`: a sheet of places by distances to anchors, row by row.

use super::anchors::Anchor;
use super::path;
use super::range_options::{odometry, ranges_options};
use super::report::{first_cell, first_name, summarise};
use super::rows::Instants;
use super::target::Target;
use crate::error::Error;
use crate::output::{Cell, Shape, Sheet};
use crate::plot::Thinned;
use crate::ranges_options::RangesOptions;
use fewbits_pf_mpa::RangeEstimate;
use fewbits_tracking::{Error as Refusal, RangesTracker, Rows};

/// Names of the columns behind the first.
fn columns(axes: usize) -> Vec<String> {
    let axes = &["x", "y", "z"][..axes];
    let bands = axes
        .iter()
        .flat_map(|axis| [format!("{axis}_low"), format!("{axis}_high")]);
    let rest = ["bias", "scale", "noise", "speed", "places", "ranges", "events"];
    axes.iter()
        .map(|axis| (*axis).to_owned())
        .chain(bands)
        .chain(rest.map(str::to_owned))
        .collect()
}

/// Cells of an estimate, without the last two columns.
fn cells(found: Option<&RangeEstimate>, axes: usize) -> Vec<Cell> {
    let Some(found) = found else {
        return vec![Cell::Number(None); 3 * axes + 5];
    };
    let numbers = (0..axes)
        .map(|i| found.position[i])
        .chain(found.bands[..axes].iter().flat_map(|(low, high)| [*low, *high]))
        .chain([found.bias, found.scale, found.noise, found.speed]);
    let mut cells: Vec<Cell> = numbers.map(|number| Cell::Number(Some(number))).collect();
    cells.push(Cell::Whole(found.places as i64));
    cells
}

/// Runs the task.
///
/// `target`: one of several whose rows go into one sheet.
pub(super) fn run(
    options: &RangesOptions,
    anchors: &[Anchor],
    mut instants: Instants,
    target: Option<&Target>,
    output: &mut Option<Sheet>,
) -> Result<(), Error> {
    let table = instants.source().file().to_owned();
    let failed = Error::tracking(&table);
    let refused = |fault| match fault {
        Refusal::Unknown { name } => unknown(&table, &name, &options.anchors),
        fault => failed(fault),
    };
    let asked = ranges_options(options, &instants, target)?;
    odometry(options, anchors, &instants)?;
    let mut tracker = RangesTracker::new(&asked, anchors, &mut instants).map_err(refused)?;
    let axes = tracker.coordinates();
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(target.map(|_| "target".to_owned()))
        .chain(columns(axes))
        .collect();
    let sheet = match output {
        Some(sheet) => sheet,
        None => output.insert(Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?),
    };
    let mut places = Thinned::new();
    while let Some(instant) = instants.next().map_err(&failed)? {
        let row = tracker.step(instants.names(), &instant).map_err(refused)?;
        if let Some(found) = &row.estimate {
            let deviations = [0, 1].map(|i| found.covariance[(i, i)].sqrt());
            places.push((found.position.xy(), deviations));
        }
        let first = first_cell(&instants, instant.time);
        let last = [Cell::Whole(row.ranges as i64), Cell::Text(row.event.to_owned())];
        let label = target.map(|target| Cell::Text(target.name.clone()));
        let cells = cells(row.estimate.as_ref(), axes);
        sheet.write(std::iter::once(first).chain(label).chain(cells).chain(last))?;
        if instants.source().is_live() {
            sheet.flush()?;
        }
    }
    if target.is_none() {
        output.take().map_or(Ok(()), Sheet::finish)?;
    }
    let mut summary = tracker.finish(&instants).map_err(refused)?;
    if let Some(file) = &options.plot {
        path::picture(anchors, places.points(), summary.ranges, summary.bits_per_range).save(file)?;
    }
    let mut lines = std::mem::take(&mut summary.lines);
    if let Some(target) = target {
        summary.target = Some(target.name.clone());
        lines
            .iter_mut()
            .for_each(|line| *line = format!("{}: {line}", target.name));
    }
    summarise(&summary, &lines, options.json)
}

fn unknown(table: &str, name: &str, anchors: &str) -> Error {
    let mend = "add it there, choose columns with --columns or --odometry, or name the column of anchors with --by";
    Error::content(table, format_args!("`{name}` is no anchor of {anchors}: {mend}"))
}
