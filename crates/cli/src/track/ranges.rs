//! Tracking of a position by distances to anchors.

use super::accuracies::Accuracies;
use super::anchors::{Anchor, together};
use super::divisor::common_divisor;
use super::instant::Instant;
use super::mistakes::{FIRST_RANGES, limited, mended, mistake, proportion};
use super::odometry::Odometry;
use super::path;
use super::range_settings::{Strengths, settings};
use super::range_summary::{AnchorSummary, OFTEN, Summary, lines};
use super::report::{first_cell, first_name, summarise};
use super::rows::Instants;
use super::sensors;
use super::target::Target;
use super::told::take_told;
use crate::arguments::RangesOptions;
use crate::error::Error;
use crate::files::is_regular;
use crate::numbers::short;
use crate::output::{Cell, Shape, Sheet};
use crate::plot::Thinned;
use crate::report::Report;
use fewbits_pf_mpa::{RangeEstimate, RangeTracker, Travel};
use nalgebra::Vector3;

/// Most ranges longer than the anchors are apart by this factor, or shorter, have another unit.
const LONG: f64 = 8.0;
const SHORT: f64 = 0.05;
/// A target is far from the middle of the anchors from so many times their largest distance on.
const FAR: f64 = 3.0;
/// Probability below which an anchor whose ranges travel as levels is told to contradict the others.
const SURELY: f64 = 0.1;
/// Rows from which the accuracy is taken that stands for the estimated noise.
const FIRST_ROWS: usize = 600;

/// The accuracies that the first rows of a file state.
fn stated(instants: &mut Instants, file: &str) -> Result<Vec<f64>, Error> {
    if instants.roles.any_accuracy().is_none() || !is_regular(file) {
        return Ok(Vec::new());
    }
    let stated = instants.peek(FIRST_ROWS)?.iter().flat_map(|row| &row.qualifiers);
    Ok(stated.filter_map(|one| one.accuracy).collect())
}

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
    let file = &options.anchors;
    let travel = match sensors::parse(&options.send)? {
        Report::Value | Report::Censored { .. } => Travel::Full,
        Report::Sign => Travel::Bits(1),
        Report::Word { bits } => Travel::Bits(bits),
    };
    let refused = Error::refused("the tracker of ranges is refused");
    let mut settings = settings(options)?;
    let mut hints = instants.roles.told.clone();
    let strengths = Strengths::of(options)?;
    hints.extend(together(anchors));
    hints.extend(take_told(options, anchors, &mut settings, &mut instants)?);
    let mut tracker = RangeTracker::new(anchors.iter().cloned(), travel, settings).map_err(refused)?;
    let known = |name: &str| anchors.iter().position(|(known, _)| known == name);
    let odometry = Odometry::new(options, anchors, &instants)?;
    let is_target = |name: &String| target.is_some_and(|target| target.all.contains(name));
    let is_stray = |name: &&String| known(name).is_none() && odometry.axis(name).is_none() && !is_target(name);
    if let Some(name) = instants.names.iter().find(is_stray) {
        return Err(unknown(instants.file(), name, file));
    }
    let axes = tracker.coordinates();
    let mut accuracies = Accuracies::of(stated(&mut instants, &options.table.file)?);
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(target.map(|_| "target".to_owned()))
        .chain(columns(axes))
        .collect();
    let sheet = match output {
        Some(sheet) => sheet,
        None => output.insert(Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?),
    };
    let mut summary = Summary {
        target: target.map(|target| target.name.clone()),
        rows: 0,
        ranges: 0,
        bits: 0,
        bits_per_range: 0.0,
        searching: 0,
        ambiguous: 0,
        doubtful: 0,
        negative: 0,
        zero: 0,
        losses: 0,
        hints: Vec::new(),
        mistake: None,
        walking_biases: None,
        anchors: anchors
            .iter()
            .map(|(name, _)| AnchorSummary {
                name: name.clone(),
                ranges: 0,
                works: 1.0,
                own_bias: None,
                lasting: None,
            })
            .collect(),
    };
    let mut places = Thinned::new();
    let apart = farthest(anchors);
    let middle = anchors.iter().map(|(_, place)| place).sum::<Vector3<f64>>() / anchors.len() as f64;
    let (mut long, mut small, mut between, mut far) = (0, 0, 0_u64, 0);
    let mut first: Vec<(f64, usize, f64)> = Vec::new();
    let (mut rounding, mut noise) = (0.0, f64::INFINITY);
    while let Some(instant) = instants.next()? {
        let (mut found, mut ranges, mut events) = (None, 0, "");
        if let Some(by) = odometry.moved(&instant, &instants.names) {
            let moved = tracker.moved(instant.seconds, &by);
            found = moved.map_err(|source| refused_row(&instants, &instant, source))?;
        }
        for (i, (sensor, range)) in instant.reports.iter().enumerate() {
            let is_limit = instant.qualifiers.get(i).is_some_and(|one| one.limit.is_some());
            let Some(range) = range.filter(|range| range.is_finite() && !is_limit) else {
                continue;
            };
            let name = &instants.names[*sensor];
            if odometry.axis(name).is_some() {
                continue;
            }
            let Some(anchor) = known(name) else {
                if is_target(name) {
                    between += 1;
                    continue;
                }
                return Err(unknown(instants.file(), name, file));
            };
            if range == 0.0 && !options.unknown_clock {
                summary.zero += 1;
                continue;
            }
            let range = strengths.map_or(range, |strengths| strengths.distance(range));
            if range < 0.0 && !options.unknown_clock {
                summary.negative += 1;
                continue;
            }
            let pushed = match accuracies.share(instant.qualifiers.get(i).and_then(|one| one.accuracy)) {
                1.0 => tracker.push(instant.seconds, name, range),
                share => tracker.push_with_noise(instant.seconds, name, range, share),
            };
            let estimate = pushed.map_err(|source| refused_row(&instants, &instant, source))?;
            if estimate.as_ref().is_some_and(|estimate| estimate.lost) {
                events = "lost";
            }
            // The last estimate of an instant has used all of its ranges.
            found = estimate.or(found);
            summary.anchors[anchor].ranges += 1;
            long += usize::from(range > LONG * apart);
            small += usize::from(range < SHORT * apart);
            rounding = common_divisor(rounding, range);
            if first.len() < FIRST_RANGES {
                first.push((instant.seconds, anchor, range));
            }
            ranges += 1;
        }
        if found.is_none() && ranges == 0 {
            // The place that is expected then.
            let moved = tracker.moved(instant.seconds, &Vector3::zeros());
            found = moved.map_err(|source| refused_row(&instants, &instant, source))?;
        }
        summary.rows += 1;
        summary.ranges += ranges;
        match &found {
            Some(found) => {
                noise = found.noise;
                far += u64::from((found.position - middle).norm() > FAR * apart);
                let deviations = [0, 1].map(|i| found.covariance[(i, i)].sqrt());
                places.push((found.position.xy(), deviations));
                if found.places > 1 {
                    summary.ambiguous += 1;
                    if events.is_empty() {
                        events = "several places";
                    }
                }
                if found.is_doubtful {
                    summary.doubtful += 1;
                    if events.is_empty() {
                        events = "doubtful";
                    }
                }
            }
            None => {
                summary.searching += 1;
                events = "searching";
            }
        }
        let first = first_cell(&instants, instant.time);
        let last = [Cell::Whole(ranges as i64), Cell::Text(events.to_owned())];
        let label = target.map(|target| Cell::Text(target.name.clone()));
        let cells = cells(found.as_ref(), axes);
        sheet.write(std::iter::once(first).chain(label).chain(cells).chain(last))?;
        if instants.is_live() {
            sheet.flush()?;
        }
    }
    if target.is_none() {
        output.take().map_or(Ok(()), Sheet::finish)?;
    }
    (summary.bits, summary.losses) = (tracker.bits(), tracker.losses());
    summary.walking_biases = tracker.walking_biases();
    summary.bits_per_range = summary.bits as f64 / (summary.ranges as f64).max(1.0);
    for anchor in &mut summary.anchors {
        let (name, refused) = (&anchor.name, Error::refused("an anchor is refused"));
        let asked = tracker
            .works(name)
            .and_then(|works| Ok((works, tracker.own_bias(name)?, tracker.lasting_residuals(name)?)));
        (anchor.works, anchor.own_bias, anchor.lasting) = asked.map_err(refused)?;
    }
    if summary.rows == 0 {
        return Err(Error::empty(instants.file(), "rows"));
    }
    if let Some(file) = &options.plot {
        path::picture(anchors, places.points(), summary.ranges, summary.bits_per_range).save(file)?;
    }
    summary.hints = hints;
    if summary.losses as u64 > summary.rows / OFTEN && !options.unknown_clock {
        summary.hints.push(
            "the track is lost often: if the ranges of one time share an unknown offset, say --unknown-clock; otherwise --speed, --noise or --outliers"
                .to_owned(),
        );
    }
    // A target cannot be near all anchors.
    if !options.unknown_clock && (2 * long > summary.ranges || 20 * small > 19 * summary.ranges) && summary.ranges > 0 {
        let (than, apart) = (if 2 * long > summary.ranges { "longer" } else { "shorter" }, short(apart));
        summary.hints.push(format!(
            "most ranges are many times {than} than the anchors are apart, {apart}: bring both to one unit, and take a constant delay off the ranges"
        ));
    }
    summary.hints.extend(instants.strange_accuracies());
    summary.hints.extend(accuracies.hint(noise));
    if between > 0 {
        summary
            .hints
            .push(format!("{between} ranges to other targets were left out"));
    }
    if 2 * far > summary.rows && options.bias.is_none() {
        summary.hints.push(
            "the target is far from the anchors beside what these are apart, where ranges hardly tell bias and scale from the place: state both, as \
             --bias 0 --scale 0 for calibrated ranges"
                .to_owned(),
        );
    }
    summary.hints.extend(limited(&first));
    if !is_regular(&options.table.file) {
        summary.hints.extend(proportion(anchors, settings, &first));
    }
    // A level says little: chance alone contradicts for a while.
    let least = if travel == Travel::Full { 0.5 } else { SURELY };
    let is_wrong = |one: &AnchorSummary| one.works < least || one.own_bias.is_some() || one.lasting.is_some();
    let is_suspect = summary.losses > 0
        || OFTEN * summary.doubtful > summary.rows
        || summary.anchors.iter().any(is_wrong)
        || summary.walking_biases.is_some();
    if is_suspect {
        summary.mistake = mistake(anchors, settings, &first);
        summary.hints.extend(summary.mistake.as_ref().and_then(mended));
    }
    let own = rounding / 12.0_f64.sqrt();
    if own > noise && options.anchor_bias.is_none() && !settings.proportional {
        let (step, own) = (short(rounding), short(own));
        summary.hints.push(format!(
            "ranges are multiples of {step}: if they are rounded, their errors last while the target rests, and --anchor-bias {own} makes the band hold them"
        ));
    }
    if instants.copies > 0 {
        summary
            .hints
            .push(format!("{} copies of reports were dropped", instants.copies));
    }
    let mut lines = lines(&summary, &tracker, settings, least);
    if let Some(target) = target {
        lines
            .iter_mut()
            .for_each(|line| *line = format!("{}: {line}", target.name));
    }
    summarise(&summary, &lines, options.json)
}

/// The distance of the two anchors that are farthest from each other.
fn farthest(anchors: &[Anchor]) -> f64 {
    let pairs = anchors
        .iter()
        .flat_map(|(_, one)| anchors.iter().map(move |(_, other)| (one - other).norm()));
    pairs.fold(0.0, f64::max)
}

fn refused_row(instants: &Instants, instant: &Instant, source: fewbits_pf_mpa::Error) -> Error {
    Error::Row {
        file: instants.file().to_owned(),
        row: instant.row,
        source: Box::new(source),
    }
}

fn unknown(table: &str, name: &str, anchors: &str) -> Error {
    let mend = "add it there, choose columns with --columns or --odometry, or name the column of anchors with --by";
    Error::content(table, format_args!("`{name}` is no anchor of {anchors}: {mend}"))
}
