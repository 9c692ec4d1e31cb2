//! A place by distances to anchors at known places.
//!
//! | file | what it holds |
//! |---|---|
//! | `settings` | what is known of ranges and target, the law of signal strengths |
//! | `told` | what the first ranges tell: height, and errors that grow |
//! | `accuracies`, `odometry` | accuracies that rows state, what the target moved |
//! | `mistakes`, `divisor` | mistakes of the tables, steps of rounding |
//! | `summary` | what is said of a track |

mod accuracies;
mod divisor;
mod mistakes;
mod odometry;
pub(crate) mod settings;
pub(crate) mod summary;
mod told;

use crate::error::{Error, Failure};
use crate::rows::instant::Instant;
use crate::rows::{Instants, Rows};
use crate::text::short;
use accuracies::Accuracies;
use divisor::common_divisor;
use fewbits_pf_mpa::{Height, Mistake, RangeEstimate, RangeSettings, RangeTracker, Travel};
use mistakes::{FIRST_RANGES, limited, mended, mistake, proportion};
use nalgebra::Vector3;
use odometry::Odometry;
use settings::{Anchor, RangesOptions, settings};
use summary::{AnchorSummary, OFTEN, RangesSummary, lines};
use told::take_told;

/// Most ranges longer than the anchors are apart by this factor, or shorter, have another unit.
const LONG: f64 = 8.0;
const SHORT: f64 = 0.05;
/// A target is far from the middle of the anchors from so many times their largest distance on.
const FAR: f64 = 3.0;
/// Probability below which an anchor whose ranges travel as levels is told to contradict the others.
const SURELY: f64 = 0.1;
/// Rows from which the accuracy is taken that stands for the estimated noise.
const FIRST_ROWS: usize = 600;

/// What to say of two anchors at one place.
fn together(anchors: &[Anchor]) -> Option<String> {
    let (i, (name, place)) = anchors
        .iter()
        .enumerate()
        .find(|(i, (_, place))| anchors[..*i].iter().any(|(_, other)| other == place))?;
    let (other, _) = anchors[..i].iter().find(|(_, other)| other == place)?;
    Some(format!("anchors {other} and {name} stand at one place: is one of the two lines a copy?"))
}

/// The distance of the two anchors that are farthest from each other.
fn farthest(anchors: &[Anchor]) -> f64 {
    let pairs = anchors
        .iter()
        .flat_map(|(_, one)| anchors.iter().map(move |(_, other)| (one - other).norm()));
    pairs.fold(0.0, f64::max)
}

/// The accuracies that the first rows state.
fn stated<R: Rows>(options: &RangesOptions, rows: &mut Instants<R>) -> Result<Vec<f64>, Error> {
    if !options.has_accuracies || !options.looks_ahead {
        return Ok(Vec::new());
    }
    let stated = rows.peek(FIRST_ROWS)?.iter().flat_map(|row| &row.qualifiers);
    Ok(stated.filter_map(|one| one.accuracy).collect())
}

/// What is known of a place after a row.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RangesRow {
    /// The place with its bands, unless it is searched.
    pub estimate: Option<RangeEstimate>,
    /// Number of ranges that were used.
    pub ranges: usize,
    /// `lost`, `several places`, `doubtful` or `searching`; empty if nothing happened.
    pub event: &'static str,
}

/// Sizes that are counted over all ranges.
#[derive(Debug, Clone, Copy)]
struct Counts {
    /// Ranges far longer than the anchors are apart, and far shorter; to other targets.
    long: usize,
    small: usize,
    between: u64,
    /// Rows in which the target is far from the anchors.
    far: u64,
    /// Step of which all ranges are multiples.
    rounding: f64,
    /// The last noise.
    noise: f64,
}

/// A place from ranges to anchors, row by row.
///
/// What no option states is estimated with the place: noise, speed, biases, the height. Anchors that contradict the others are left out, and
/// [`finish`](Self::finish) says so.
pub struct RangesTracker {
    options: RangesOptions,
    anchors: Vec<Anchor>,
    settings: RangeSettings,
    tracker: RangeTracker,
    odometry: Odometry,
    accuracies: Accuracies,
    summary: RangesSummary,
    counts: Counts,
    /// Time, anchor and range of the first ranges.
    first: Vec<(f64, usize, f64)>,
    apart: f64,
    middle: Vector3<f64>,
}

/// A range of a row: its anchor, its size, and its noise as a share of the estimated one.
type Range = (usize, f64, f64);

impl RangesTracker {
    /// A tracker for rows of ranges, one sensor for each anchor, by name. `anchors`: names and places; those of a plane have the height 0. Reads up
    /// to 600 rows ahead if the options allow it.
    ///
    /// # Errors
    /// If a row cannot be read, a sensor is no anchor, the height is needed, or the anchors or options are refused.
    pub fn new<R: Rows>(
        options: &RangesOptions,
        anchors: &[(String, Vector3<f64>)],
        rows: &mut Instants<R>,
    ) -> Result<Self, Error> {
        let mut settings = settings(options)?;
        let mut summary = RangesSummary::new(anchors);
        summary.hints = rows.source().found().to_vec();
        summary.hints.extend(together(anchors));
        summary.hints.extend(take_told(options, anchors, &mut settings, rows)?);
        let refused = |source: fewbits_pf_mpa::Error| Error::Refused {
            what: "the tracker of ranges is refused",
            source: source.into(),
        };
        let tracker = RangeTracker::new(anchors.iter().cloned(), options.travel, settings).map_err(refused)?;
        let columns = Some(rows.names()).filter(|_| !rows.options().single_reports);
        let tracker = Self {
            odometry: Odometry::new(&options.odometry, anchors, columns)?,
            accuracies: Accuracies::of(stated(options, rows)?),
            apart: farthest(anchors),
            middle: anchors.iter().map(|(_, place)| place).sum::<Vector3<f64>>() / anchors.len() as f64,
            options: options.clone(),
            anchors: anchors.to_vec(),
            settings,
            tracker,
            summary,
            counts: Counts {
                long: 0,
                small: 0,
                between: 0,
                far: 0,
                rounding: 0.0,
                noise: f64::INFINITY,
            },
            first: Vec::new(),
        };
        let is_stray = |name: &&String| {
            tracker.known(name).is_none()
                && tracker.odometry.axis(name).is_none()
                && !tracker.options.others.contains(name)
        };
        match rows.names().iter().find(is_stray) {
            Some(name) => Err(Error::Unknown { name: name.clone() }),
            None => Ok(tracker),
        }
    }

    /// Number of coordinates that are estimated: 2 or 3.
    pub fn coordinates(&self) -> usize {
        self.tracker.coordinates()
    }

    fn known(&self, name: &str) -> Option<usize> {
        self.anchors.iter().position(|(known, _)| known == name)
    }

    /// The ranges of a row. Counts those that are left out.
    fn ranges(&mut self, names: &[String], instant: &Instant) -> Result<Vec<Range>, Error> {
        let (mut ranges, mut accuracies) = (Vec::with_capacity(instant.reports.len()), self.accuracies);
        let (mut between, mut zero, mut negative) = (0, 0, 0);
        for (i, (sensor, range)) in instant.reports.iter().enumerate() {
            let qualifier = instant.qualifiers.get(i).copied().unwrap_or_default();
            let Some(range) = range.filter(|range| range.is_finite() && qualifier.limit.is_none()) else {
                continue;
            };
            let name = names.get(*sensor).map_or("", String::as_str);
            if self.odometry.axis(name).is_some() {
                continue;
            }
            let Some(anchor) = self.known(name) else {
                if self.options.others.iter().any(|other| other == name) {
                    between += 1;
                    continue;
                }
                return Err(Error::Unknown { name: name.to_owned() });
            };
            if range == 0.0 && !self.options.unknown_clock {
                zero += 1;
                continue;
            }
            let range = self
                .options
                .strengths
                .map_or(range, |strengths| strengths.distance(range));
            if range < 0.0 && !self.options.unknown_clock {
                negative += 1;
                continue;
            }
            ranges.push((anchor, range, accuracies.share(qualifier.accuracy)));
        }
        self.accuracies = accuracies;
        self.counts.between += between;
        self.summary.zero += zero;
        self.summary.negative += negative;
        Ok(ranges)
    }

    /// Processes an instant, in the order of time. `names`: of the sensors so far, [`Instants::names`].
    ///
    /// # Errors
    /// If a report is of no anchor: the tracker is then as it was. If the time is before that of the last row, or not finite.
    pub fn step(&mut self, names: &[String], instant: &Instant) -> Result<RangesRow, Error> {
        let refused = |source: fewbits_pf_mpa::Error| Error::row(instant.row)(Failure::from(source));
        let (mut found, mut event) = (None, "");
        let ranges = self.ranges(names, instant)?;
        if let Some(by) = self.odometry.moved(instant, names) {
            found = self.tracker.moved(instant.seconds, &by).map_err(refused)?;
        }
        for (anchor, range, share) in &ranges {
            let (anchor, range) = (*anchor, *range);
            let name = &self.anchors[anchor].0;
            let pushed = match *share {
                1.0 => self.tracker.push(instant.seconds, name, range),
                share => self.tracker.push_with_noise(instant.seconds, name, range, share),
            };
            let estimate = pushed.map_err(refused)?;
            if estimate.as_ref().is_some_and(|estimate| estimate.lost) {
                event = "lost";
            }
            // The last estimate of an instant has used all of its ranges.
            found = estimate.or(found);
            self.summary.anchors[anchor].ranges += 1;
            self.counts.long += usize::from(range > LONG * self.apart);
            self.counts.small += usize::from(range < SHORT * self.apart);
            self.counts.rounding = common_divisor(self.counts.rounding, range);
            if self.first.len() < FIRST_RANGES {
                self.first.push((instant.seconds, anchor, range));
            }
        }
        if found.is_none() && ranges.is_empty() {
            // The place that is expected then.
            let moved = self.tracker.moved(instant.seconds, &Vector3::zeros());
            found = moved.map_err(refused)?;
        }
        let summary = &mut self.summary;
        summary.rows += 1;
        summary.ranges += ranges.len();
        match &found {
            Some(found) => {
                self.counts.noise = found.noise;
                self.counts.far += u64::from((found.position - self.middle).norm() > FAR * self.apart);
                if found.places > 1 {
                    summary.ambiguous += 1;
                    if event.is_empty() {
                        event = "several places";
                    }
                }
                if found.is_doubtful {
                    summary.doubtful += 1;
                    if event.is_empty() {
                        event = "doubtful";
                    }
                }
            }
            None => {
                summary.searching += 1;
                event = "searching";
            }
        }
        Ok(RangesRow {
            estimate: found,
            ranges: ranges.len(),
            event,
        })
    }

    /// What was found over all rows. `rows`: those that the tracker was fed.
    ///
    /// # Errors
    /// If there was none.
    pub fn finish<R: Rows>(self, rows: &Instants<R>) -> Result<RangesSummary, Error> {
        let Self {
            options,
            anchors,
            settings,
            tracker,
            accuracies,
            mut summary,
            counts,
            first,
            apart,
            ..
        } = self;
        (summary.bits, summary.losses) = (tracker.bits(), tracker.losses());
        summary.walking_biases = tracker.walking_biases();
        summary.bits_per_range = summary.bits as f64 / (summary.ranges as f64).max(1.0);
        for anchor in &mut summary.anchors {
            let name = &anchor.name;
            let refused = |source: fewbits_pf_mpa::Error| Error::Refused {
                what: "an anchor is refused",
                source: source.into(),
            };
            let asked = tracker
                .works(name)
                .and_then(|works| Ok((works, tracker.own_bias(name)?, tracker.lasting_residuals(name)?)));
            (anchor.works, anchor.own_bias, anchor.lasting) = asked.map_err(refused)?;
        }
        if summary.rows == 0 {
            return Err(Error::Empty);
        }
        if summary.losses as u64 > summary.rows / OFTEN && !options.unknown_clock {
            summary.hints.push(
                "the track is lost often: if the ranges of one time share an unknown offset, say --unknown-clock; otherwise --speed, --noise or --outliers"
                    .to_owned(),
            );
        }
        // A target cannot be near all anchors.
        if !options.unknown_clock
            && (2 * counts.long > summary.ranges || 20 * counts.small > 19 * summary.ranges)
            && summary.ranges > 0
        {
            let (than, apart) = (
                if 2 * counts.long > summary.ranges {
                    "longer"
                } else {
                    "shorter"
                },
                short(apart),
            );
            summary.hints.push(format!(
                "most ranges are many times {than} than the anchors are apart, {apart}: bring both to one unit, and take a constant delay off the ranges"
            ));
        }
        summary.hints.extend(rows.told());
        summary.hints.extend(accuracies.hint(counts.noise));
        if counts.between > 0 {
            summary
                .hints
                .push(format!("{} ranges to other targets were left out", counts.between));
        }
        if 2 * counts.far > summary.rows && options.bias.is_none() {
            summary.hints.push(
                "the target is far from the anchors beside what these are apart, where ranges hardly tell bias and scale from the place: state both, as \
                 --bias 0 --scale 0 for calibrated ranges"
                    .to_owned(),
            );
        }
        summary.hints.extend(limited(&first));
        if !options.looks_ahead {
            summary.hints.extend(proportion(&anchors, settings, &first));
        }
        // A level says little: chance alone contradicts for a while.
        let least = if options.travel == Travel::Full { 0.5 } else { SURELY };
        let is_wrong = |one: &AnchorSummary| one.works < least || one.own_bias.is_some() || one.lasting.is_some();
        let is_suspect = summary.losses > 0
            || OFTEN * summary.doubtful > summary.rows
            || summary.anchors.iter().any(is_wrong)
            || summary.walking_biases.is_some();
        if is_suspect {
            // A height that was found from ranges of wrong tables would hide what is wrong with them.
            let is_flat = anchors.iter().all(|(_, place)| place.z == anchors[0].1.z);
            let is_found = options.height.is_none() && is_flat && matches!(settings.height, Height::Known(_));
            let stated = RangeSettings {
                height: if is_found { Height::Unsaid } else { settings.height },
                ..settings
            };
            let is_taken = |mistake: &Mistake| is_found && matches!(mistake, Mistake::Height(_));
            summary.mistake = mistake(&anchors, stated, &first).filter(|mistake| !is_taken(mistake));
            summary.hints.extend(summary.mistake.as_ref().and_then(mended));
        }
        let own = counts.rounding / 12.0_f64.sqrt();
        if own > counts.noise && options.anchor_bias.is_none() && !settings.proportional {
            let (step, own) = (short(counts.rounding), short(own));
            summary.hints.push(format!(
                "ranges are multiples of {step}: if they are rounded, their errors last while the target rests, and --anchor-bias {own} makes the band hold them"
            ));
        }
        if rows.copies() > 0 {
            summary
                .hints
                .push(format!("{} copies of reports were dropped", rows.copies()));
        }
        summary.lines = lines(&summary, &tracker, settings, least);
        Ok(summary)
    }
}
