//! What the first rows of a table suggest that no option says.

use crate::first::values::{held_values, values as first_values, values_of};
use crate::level::options::{Known, LevelOptions};
use crate::rows::instant::Instant;
use crate::rows::transform::Transform;
use crate::text::short;
use fewbits_filters::calibration::{median, offsets};
use fewbits_numerics::Runs;

/// Periods of angles and their like.
const PERIODS: [f64; 4] = [360.0, std::f64::consts::TAU, 400.0, 24.0];
/// Those of angles, which are taken for such without being said, and how much larger steps across the ends may be than others.
const CIRCLES: [f64; 2] = [360.0, std::f64::consts::TAU];
const AS_SMALL: f64 = 5.0;
/// Values come so near both ends of the circle, as a share of it.
const AT_ENDS: f64 = 0.03;
/// Two values this share of a period apart are near each other on the circle.
const NEARLY: f64 = 0.8;
/// Values between which silence is looked at, at least, and share of empty cells.
const FEWEST: usize = 3;
/// Values that are all 0 or 1, at least, of which is told that they may be bits.
const FEWEST_BITS: usize = 30;
/// The same of a table of single reports, in which silence is not seen.
const FEWEST_ROWS: usize = 10;
const EMPTY: f64 = 0.5;
/// The longest interval between values in shortest ones, where values come when they have changed.
const IRREGULAR: f64 = 3.0;
/// Values of a sensor from which it is told whether its noise grows, at most.
const MOST_VALUES: usize = 2000;
/// Repetitions of one value that are looked at, at most.
const MOST_REPEATED: u32 = 10;
/// Stretches of values that are compared, and how many times as much values of one scatter as those of another.
const STRETCHES: usize = 8;
const UNSTEADY: f64 = 4.0;
/// An offset is told if it is this many of the sensor's deviations.
const LARGE: f64 = 1.0;

/// What is known of rows beside their cells.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen {
    /// A slope explains the first rows far better.
    pub(crate) has_slope: bool,
    /// Each row is a report by itself.
    pub(crate) is_single: bool,
    /// Measurements that were not sent are instants of their own.
    pub(crate) has_samples: bool,
}

/// Hints, a line each. `noises` and `offsets`: of each sensor.
pub(crate) fn hints(
    options: &LevelOptions,
    first: &[Instant],
    names: &[String],
    (noises, aligned): (&[f64], &[f64]),
    seen: Seen,
) -> Vec<String> {
    let mut lines = Vec::new();
    if options.reports {
        return lines;
    }
    for (sensor, name) in names.iter().enumerate() {
        let own = |instant: &Instant| -> Vec<(f64, Option<f64>)> {
            let own = instant.reports.iter().filter(|(other, _)| *other == sensor);
            own.map(|(_, cell)| (instant.seconds, cell.filter(|cell| cell.is_finite())))
                .collect()
        };
        let timed: Vec<(f64, Option<f64>)> = first.iter().flat_map(own).collect();
        let cells: Vec<Option<f64>> = timed.iter().map(|one| one.1).collect();
        let values: Vec<f64> = cells.iter().copied().flatten().collect();
        let steps: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        let is_bit = |value: &f64| *value == 0.0 || *value == 1.0;
        if values.len() >= FEWEST_BITS && values.iter().all(is_bit) && values.contains(&0.0) && values.contains(&1.0) {
            lines.push(format!(
                "{name} is 0 or 1 throughout: if it tells whether the level is above a threshold, say --reports --send bit and --threshold or \
                 --threshold-column; without it these estimates are of another thing"
            ));
        }
        let silent = (cells.len() - values.len()) as f64;
        // Rows without an empty cell show silence by their times only.
        let is_dense = seen.is_single || silent == 0.0;
        let least = steps.iter().fold(f64::INFINITY, |least, step| least.min(*step));
        let typical = median(steps.clone());
        if options.silent_within.is_none()
            && values.len() >= if is_dense { FEWEST_ROWS } else { FEWEST }
            && (is_dense || silent > EMPTY * cells.len() as f64)
            && is_irregular(&timed)
            && least > 0.5 * typical
        {
            lines.push(format!(
                "{name} has values in {1} of {2} cells, each at least {0} from the one before: if it sends on change, say \
                 --silent-within {0}; without it the bands are wrong",
                short(least),
                values.len(),
                cells.len()
            ));
        }
    }
    let unsampled = options.silent_within.filter(|_| !seen.has_samples);
    lines.extend(unsampled.and_then(|said| unheard(said, first)));
    if options.align.is_none() && options.period == Known::Found {
        lines.extend(apart(first, names, options.silent_within));
    }
    let large = |(sensor, offset): (usize, &f64)| offset.abs() > LARGE * noises[sensor];
    if names.len() == 2 && aligned.iter().enumerate().any(large) {
        let apart = (aligned[0] - aligned[1]).abs();
        lines.push(format!(
            "the two sensors are {} apart, and nothing says which is right: the level is taken to be in the middle, and may be {} off",
            short(apart),
            short(0.5 * apart)
        ));
    }
    if seen.has_slope {
        let what = match options.model {
            None => "which is followed: --model velocity shows it, --model walk leaves it out",
            Some(_) => "--model velocity explains them far better",
        };
        lines.push(format!("the first rows have a slope: {what}"));
    }
    lines
}

/// What a sensor's noise grows with, if it does. `has_changed`: it is known that it changes.
pub(crate) fn growth(values: &[f64], name: &str, has_changed: bool) -> Option<String> {
    let transform = Transform::suggested(values).filter(|transform| {
        let transformed: Vec<f64> = values.iter().map(|value| transform.of(*value)).collect();
        unsteady(&transformed, name, false).is_none()
    });
    transform.map_or_else(|| unsteady(values, name, has_changed), |transform| Some(transform.hint(name)))
}

/// Stretches in which values scatter far more than in others. Second differences hardly depend on a level that moves slowly.
fn unsteady(values: &[f64], name: &str, has_changed: bool) -> Option<String> {
    let length = values.len() / STRETCHES;
    if length < FEWEST_BITS {
        return None;
    }
    let scatter = |values: &[f64]| {
        median(
            values
                .windows(3)
                .map(|one| (one[0] - 2.0 * one[1] + one[2]).abs())
                .collect(),
        )
    };
    let stretches = values.chunks_exact(length).map(scatter).enumerate();
    let mut all: Vec<(usize, f64)> = stretches.collect();
    all.sort_by(|one, other| one.1.total_cmp(&other.1));
    let (least, most) = (all.first()?, all.last()?);
    (least.1 > 0.0 && most.1 > UNSTEADY * least.1).then(|| {
        let from = |stretch: usize| stretch * length + 1;
        format!(
            "{name} scatters {} times as much from its value {} on as from its value {}: {}",
            short((most.1 / least.1).round()),
            from(most.0),
            from(least.0),
            if has_changed {
                "its noise is followed"
            } else {
                "one noise and one change fit not both, and bands are too narrow or too wide; take parts by themselves, or say what each value's noise \
                 is (--accuracy-column)"
            }
        )
    })
}

/// Silence that is said to mean something, in a table that has none.
fn unheard(said: f64, first: &[Instant]) -> Option<String> {
    let is_empty = first
        .iter()
        .any(|instant| instant.reports.iter().any(|(_, cell)| cell.is_none()));
    (!is_empty && first.len() >= FEWEST_ROWS).then(|| {
        format!(
            "--silent-within {said} says nothing here, since the first rows have no silence: if rows are reports only, say how often the sensor \
             measures, as --silent-within {said}/60s"
        )
    })
}

/// Sensors of constant offset from the others. `width`: that of silence.
fn apart(first: &[Instant], names: &[String], width: Option<f64>) -> Option<String> {
    let values = width.map_or_else(|| first_values(first, &[]), |_| held_values(first));
    let found = offsets(&values, names.len(), None);
    let is_apart = |sensor: &usize| {
        let values = values_of(first, *sensor);
        let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
        // Of the difference of two values, by its median; of a value that is held, by the width.
        let deviation = width.map_or_else(|| median(steps) / (0.6745 * std::f64::consts::SQRT_2), |width| 0.5 * width);
        values.len() >= FEWEST_ROWS && found[*sensor].abs() > LARGE * deviation
    };
    let apart: Vec<String> = (0..names.len())
        .filter(is_apart)
        .map(|sensor| format!("{} by {}", names[sensor], short(found[sensor])))
        .collect();
    (!apart.is_empty()).then(|| {
        format!(
            "constant offsets from the others: {}: --align {} takes them off; without it they count as noise; if columns measure different \
             things, choose with --columns",
            apart.join(", "),
            first.len()
        )
    })
}

/// Whether the intervals between values differ by so much that values come when they have changed.
fn is_irregular(timed: &[(f64, Option<f64>)]) -> bool {
    let times: Vec<f64> = timed.iter().filter(|one| one.1.is_some()).map(|one| one.0).collect();
    let intervals = || times.windows(2).map(|pair| pair[1] - pair[0]);
    let (short, long) = (intervals().fold(f64::INFINITY, f64::min), intervals().fold(0.0, f64::max));
    long > IRREGULAR * short
}

/// Values of a sensor of which the period is asked.
#[derive(Debug, Clone, Copy)]
struct Turns {
    last: f64,
    low: f64,
    high: f64,
    count: usize,
    /// Steps by nearly each period.
    crossings: [usize; PERIODS.len()],
}

impl Turns {
    fn new(value: f64) -> Self {
        Self {
            last: value,
            low: value,
            high: value,
            count: 0,
            crossings: [0; PERIODS.len()],
        }
    }

    fn add(&mut self, value: f64) {
        let step = (value - self.last).abs();
        self.last = value;
        (self.low, self.high) = (self.low.min(value), self.high.max(value));
        self.count += 1;
        for (crossings, period) in self.crossings.iter_mut().zip(PERIODS) {
            *crossings += usize::from(step > NEARLY * period);
        }
    }

    /// The period whose ends the values cross, if there is one.
    fn period(&self) -> Option<f64> {
        let is_crossed = |(period, crossings): &(f64, usize)| {
            let is_inside =
                self.low >= 0.0 && self.high <= *period || self.low >= -0.5 * period && self.high <= 0.5 * period;
            is_inside && *crossings >= 2 && 5 * crossings < 3 * self.count
        };
        let found = PERIODS.into_iter().zip(self.crossings).find(is_crossed);
        found.map(|(period, _)| period)
    }

    fn of(values: &[f64]) -> Option<Self> {
        let mut all = values.iter();
        let mut turns = Self::new(*all.next()?);
        all.for_each(|value| turns.add(*value));
        Some(turns)
    }
}

/// Looks in all rows for values that cross the ends of a period, and in many for a noise that grows.
pub(crate) struct Turning {
    asks_period: bool,
    asks_growth: bool,
    sensors: Vec<Option<Turns>>,
    values: Vec<Vec<f64>>,
    runs: Vec<Runs>,
}

impl Turning {
    /// `period`: that of the level, if it is an angle.
    pub(crate) fn new(options: &LevelOptions, has_transform: bool, period: Option<f64>) -> Self {
        let is_plain = !options.reports && !has_transform && period.is_none();
        Self {
            asks_period: is_plain && options.period == Known::Found,
            asks_growth: is_plain && !options.has_accuracies && options.silent_within.is_none(),
            sensors: Vec::new(),
            values: Vec::new(),
            runs: Vec::new(),
        }
    }

    pub(crate) fn add(&mut self, instant: &Instant) {
        for (sensor, value) in instant.values() {
            let sensor = &sensor;
            if self.sensors.len() <= *sensor {
                self.sensors.resize(sensor + 1, None);
                self.values.resize(sensor + 1, Vec::new());
                self.runs.resize(sensor + 1, Runs::default());
            }
            self.runs[*sensor].add(value);
            if self.asks_period {
                self.sensors[*sensor].get_or_insert(Turns::new(value)).add(value);
            }
            // Values of a sensor that is stuck have no noise.
            let is_stuck = self.runs[*sensor].repetitions > MOST_REPEATED;
            if self.asks_growth && !is_stuck && self.values[*sensor].len() < MOST_VALUES {
                self.values[*sensor].push(value);
            }
        }
    }

    /// A line for each sensor that turns, and for each of which the noise grows.
    /// `has_changed`: whether it is known that the noise of a sensor changes.
    pub(crate) fn hints(&self, names: &[String], has_changed: impl Fn(usize) -> bool) -> Vec<String> {
        let of = |(turns, name): (&Option<Turns>, &String)| {
            let period = turns.as_ref()?.period()?;
            Some(format!(
                "{name} jumps by nearly {period} and back: if it is an angle, say --period {period}; without it these estimates are wrong"
            ))
        };
        let turning = self.sensors.iter().zip(names).filter_map(of);
        let growing = self
            .values
            .iter()
            .zip(names)
            .enumerate()
            .filter_map(|(sensor, (values, name))| growth(values, name, has_changed(sensor)));
        turning.chain(growing).collect()
    }
}

/// The period of values that go on around a circle: their steps across its ends are as small as others, once a whole turn is taken off.
pub(crate) fn circle(values: &[f64]) -> Option<f64> {
    let turns = Turns::of(values)?;
    let period = turns.period().filter(|period| CIRCLES.contains(period))?;
    if turns.high - turns.low < (1.0 - 2.0 * AT_ENDS) * period {
        return None;
    }
    let (mut across, mut others) = (Vec::new(), Vec::new());
    for pair in values.windows(2) {
        let step = (pair[1] - pair[0]).abs();
        if step > NEARLY * period {
            across.push(period - step);
        } else {
            others.push(step);
        }
    }
    (median(across) <= AS_SMALL * median(others)).then_some(period)
}
