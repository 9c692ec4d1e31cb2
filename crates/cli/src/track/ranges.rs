//! Tracking of a position by distances to anchors.

use super::anchors::{Anchor, together};
use super::divisor::common_divisor;
use super::instant::Instant;
use super::mistakes::{FIRST_RANGES, limited, mended, mistake, proportion};
use super::odometry::Odometry;
use super::path;
use super::range_settings::{Strengths, settings};
use super::report::{first_cell, first_name, summarise};
use super::rows::Instants;
use super::sensors;
use super::told::take_told;
use crate::Ending;
use crate::arguments::RangesOptions;
use crate::error::Error;
use crate::files::is_regular;
use crate::numbers::short;
use crate::output::{Cell, Shape, Sheet};
use crate::plot::Thinned;
use crate::report::Report;
use fewbits_pf_mpa::{Mistake, RangeEstimate, RangeSettings, RangeTracker, Travel};
use serde::Serialize;

/// Most ranges longer than the anchors are apart by this factor, or shorter, have another unit.
const LONG: f64 = 8.0;
const SHORT: f64 = 0.05;
/// A track that is lost once in so many rows is lost often.
const OFTEN: u64 = 20;
/// Probability below which an anchor whose ranges travel as levels is told to contradict the others.
const SURELY: f64 = 0.1;

#[derive(Serialize)]
struct Summary {
    rows: u64,
    ranges: usize,
    bits: usize,
    bits_per_range: f64,
    /// Number of rows without an estimate, during acquisition of the position.
    searching: u64,
    /// Number of rows in which several places explain the ranges.
    ambiguous: u64,
    /// Number of rows in which bias and scale contradict what is supposed of them.
    doubtful: u64,
    /// Number of ranges that were left out because they are negative.
    negative: u64,
    /// Number of ranges that were left out because they are zero.
    zero: u64,
    losses: usize,
    anchors: Vec<AnchorSummary>,
    /// What the ranges suggest that no option says.
    hints: Vec<String>,
    /// The mistake of the tables that explains the ranges.
    #[serde(skip)]
    mistake: Option<Mistake>,
}

#[derive(Serialize)]
struct AnchorSummary {
    name: String,
    ranges: usize,
    /// Probability at the end that its ranges depend on the distance.
    works: f64,
    /// Mean product of its successive residuals in their deviations, if it is far above zero: its place, or the law of its ranges, is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    lasting: Option<f64>,
    /// The bias that it has alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    own_bias: Option<f64>,
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
pub(super) fn run(options: &RangesOptions, anchors: &[Anchor], mut instants: Instants) -> Result<Ending, Error> {
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
    let is_stray = |name: &&String| known(name).is_none() && odometry.axis(name).is_none();
    if let Some(name) = instants.names.iter().find(is_stray) {
        return Err(unknown(instants.file(), name, file));
    }
    let axes = tracker.coordinates();
    let names = std::iter::once(first_name(&instants).to_owned())
        .chain(columns(axes))
        .collect();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::of(options.json), names)?;
    let mut summary = Summary {
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
    let (mut long, mut small) = (0, 0);
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
            let pushed = tracker.push(instant.seconds, name, range);
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
        summary.rows += 1;
        summary.ranges += ranges;
        match &found {
            Some(found) => {
                noise = found.noise;
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
        sheet.write(std::iter::once(first).chain(cells(found.as_ref(), axes)).chain(last))?;
        if instants.is_live() {
            sheet.flush()?;
        }
    }
    sheet.finish()?;
    (summary.bits, summary.losses) = (tracker.bits(), tracker.losses());
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
    summary.hints.extend(limited(&first));
    if !is_regular(&options.table.file) {
        summary.hints.extend(proportion(anchors, settings, &first));
    }
    // A level says little: chance alone contradicts for a while.
    let least = if travel == Travel::Full { 0.5 } else { SURELY };
    let is_wrong = |one: &AnchorSummary| one.works < least || one.own_bias.is_some() || one.lasting.is_some();
    let is_suspect =
        summary.losses > 0 || OFTEN * summary.doubtful > summary.rows || summary.anchors.iter().any(is_wrong);
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
    let lines = lines(&summary, &tracker, settings, least);
    summarise(&summary, &lines, options.json)?;
    Ok(Ending::Good)
}

/// The distance of the two anchors that are farthest from each other.
fn farthest(anchors: &[Anchor]) -> f64 {
    let pairs = anchors
        .iter()
        .flat_map(|(_, one)| anchors.iter().map(move |(_, other)| (one - other).norm()));
    pairs.fold(0.0, f64::max)
}

fn lines(summary: &Summary, tracker: &RangeTracker, settings: RangeSettings, least: f64) -> Vec<String> {
    let silence = settings.silence;
    let mut lines = vec![
        format!("{} rows, {} ranges of {:.2} bits on average", summary.rows, summary.ranges, summary.bits_per_range),
        format!("{} rows without a place, track lost {} times", summary.searching, summary.losses),
    ];
    // Values that are no distances say nothing of anchors.
    let has_ranges = summary.ranges > 0 || summary.negative == 0;
    if summary.zero > 0 {
        lines.push(format!("{} ranges of 0 were left out, as radios write it for no range", summary.zero));
    }
    if summary.searching == summary.rows && has_ranges {
        lines.push(format!("a place needs ranges of {} anchors within {silence} s: a larger --silence, or, if times are no seconds, --time-format with their unit",
            tracker.needed()
        ));
    }
    if summary.ambiguous > 0 {
        lines.push(format!(
            "{} rows with several places that explain the ranges: the band holds them",
            summary.ambiguous
        ));
    }
    if !has_ranges {
        lines.push(format!(
            "all {} values are negative: they are no distances. Signal strengths in dBm need --rssi; differences of ranges need --unknown-clock",
            summary.negative
        ));
    } else if summary.negative > 0 {
        lines.push(format!(
            "{} negative ranges were left out: they are no distances; differences of ranges need --unknown-clock",
            summary.negative
        ));
    }
    if summary.doubtful > summary.rows / OFTEN {
        lines.push(format!(
            "{} rows are doubtful: bias and scale are larger than --bias and --scale allow, as if an anchor's ranges or place were wrong; --bias 0 --scale 0 for calibrated ranges shows which",
            summary.doubtful
        ));
    }
    lines.extend(summary.hints.iter().cloned());
    // A wrong height lengthens the ranges of the nearest anchors, and their errors last.
    let is_height = matches!(summary.mistake, Some(Mistake::Height(_) | Mistake::HeightChanges { .. }));
    for anchor in &summary.anchors {
        if anchor.ranges == 0 && !has_ranges {
            continue;
        }
        if anchor.ranges == 0 {
            lines.push(format!("no range from anchor {}", anchor.name));
        } else if anchor.works < least {
            lines.push(format!("anchor {} contradicts the others and is not used", anchor.name));
        } else if let Some(bias) = anchor.own_bias.filter(|_| !is_height) {
            let off = if bias > 0.0 { "long" } else { "short" };
            let size = if settings.proportional {
                format!("{} %", short(100.0 * bias.abs().exp_m1()))
            } else {
                short(bias.abs())
            };
            lines.push(format!(
                "ranges of anchor {} are {size} too {off}, as if it stood elsewhere or were behind a wall: they are used less that",
                anchor.name
            ));
        }
    }
    let lasting: Vec<(&str, f64)> = summary
        .anchors
        .iter()
        .filter_map(|one| Some((one.name.as_str(), one.lasting?)))
        .collect();
    if !lasting.is_empty() && !is_height {
        let most = lasting.iter().fold(0.0_f64, |most, (_, product)| most.max(*product));
        let names: Vec<&str> = lasting.iter().map(|(name, _)| *name).collect();
        lines.push(format!(
            "errors of anchors {} last from range to range (mean product of neighbours up to {most:.2} of their variance), so bands are too narrow: an anchor stands elsewhere than its table says, or walls lengthen ranges",
            names.join(", ")
        ));
    }
    lines
}

fn refused_row(instants: &Instants, instant: &Instant, source: fewbits_pf_mpa::Error) -> Error {
    Error::Row {
        file: instants.file().to_owned(),
        row: instant.row,
        source: Box::new(source),
    }
}

fn unknown(table: &str, name: &str, anchors: &str) -> Error {
    let mend = "add it there, choose columns with --columns, or name the column of anchors with --by";
    Error::content(table, format_args!("`{name}` is no anchor of {anchors}: {mend}"))
}
