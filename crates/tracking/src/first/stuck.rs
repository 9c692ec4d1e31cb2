//! Sensors that repeat one value to its last digit, though their values hardly ever did so before, and sensors that repeat another one.

use crate::first::units::Units;
use crate::rows::instant::Instant;
use crate::text;
use fewbits_numerics::Runs;
use fewbits_table::names::as_argument;
use std::borrow::Cow;
use std::collections::BTreeMap;

/// Equal values in a row from which a sensor is told to be stuck, and others before it, at least.
const LONG: u32 = 30;
/// Share of values before it that may equal the one before them.
const SELDOM: f64 = 0.05;
/// Share of a sensor's new values that another one has in the same row, from which one of them is told to be a copy.
const ALIKE: f64 = 0.95;
/// Of more sensors no pairs are compared.
const MAX_COMPARED: usize = 32;

#[derive(Debug, Clone, Default)]
struct Repeats {
    runs: Runs,
    /// The value of the longest run of one that is stuck, and its length.
    stuck: Option<(f64, u32)>,
    /// The smallest and the largest value, for each: the present one, and the next one to it.
    ends: Option<[(f64, f64); 2]>,
    units: Units,
}

impl Repeats {
    fn add(&mut self, value: f64) {
        self.runs.add(value);
        self.widen(value);
        self.units.add(value);
        let run = self.runs.repetitions.saturating_add(1);
        let is_longest = self.stuck.is_none_or(|(_, longest)| run > longest);
        if run >= LONG && self.is_seldom() && is_longest {
            self.stuck = Some((value, run));
        }
    }

    /// Takes a value into the ends of the range.
    fn widen(&mut self, value: f64) {
        let [low, high] = self
            .ends
            .get_or_insert([(value, f64::INFINITY), (value, f64::NEG_INFINITY)]);
        if value < low.0 {
            *low = (value, low.0);
        } else if value > low.0 {
            low.1 = low.1.min(value);
        }
        if value > high.0 {
            *high = (value, high.0);
        } else if value < high.0 {
            high.1 = high.1.max(value);
        }
    }

    /// Whether a value is farther from all others than they are from each other, as a number that stands for gaps is.
    fn is_apart(&self, value: f64) -> bool {
        self.ends.is_some_and(|[(lowest, low), (highest, high)]| {
            (value == lowest && low - lowest > highest - low) || (value == highest && highest - high > high - lowest)
        })
    }

    /// Whether values hardly ever repeat.
    fn is_seldom(&self) -> bool {
        let Runs { pairs, equal, .. } = self.runs;
        pairs >= LONG && f64::from(equal) <= SELDOM * f64::from(pairs)
    }
}

/// Of the rows in which one sensor has another value than before, and a second sensor any: those in which both are equal.
#[derive(Debug, Clone, Copy, Default)]
struct Pair {
    rows: u32,
    equal: u32,
}

/// Looks in all rows for sensors that are stuck, and for copies.
#[derive(Debug, Default)]
pub(crate) struct Stuck {
    repeats: Vec<Repeats>,
    /// By the sensor that changes, and the other one behind it.
    pairs: BTreeMap<(usize, usize), Pair>,
}

impl Stuck {
    pub(crate) fn add(&mut self, instant: &Instant) {
        let values: Vec<(usize, f64)> = instant.values().collect();
        for (at, (sensor, value)) in values.iter().enumerate() {
            if self.repeats.len() <= *sensor {
                self.repeats.resize(sensor + 1, Repeats::default());
            }
            let runs = &self.repeats[*sensor].runs;
            let is_new = runs.last.is_some_and(|last| last != *value);
            if is_new && values.len() <= MAX_COMPARED {
                for (other, its) in values[at + 1..].iter().filter(|(other, _)| other != sensor) {
                    let pair = self.pairs.entry((*sensor, *other)).or_default();
                    pair.rows += 1;
                    pair.equal += u32::from(its == value);
                }
            }
            self.repeats[*sensor].add(*value);
        }
    }

    /// A line for each sensor that is stuck, or repeats another one.
    pub(crate) fn hints(&self, names: &[String]) -> Vec<String> {
        let stuck = |(repeats, name): (&Repeats, &String)| {
            let (value, run) = repeats.stuck?;
            let name = text::name(name);
            let mend = if repeats.is_apart(value) {
                format!("that may mean a gap, as --missing '{name}={value}' says")
            } else {
                format!("it may be stuck; --without {} leaves it out", as_argument([&name]))
            };
            Some(format!(
                "{name} is {value} in {run} values in a row, which its values hardly ever repeat otherwise: {mend}"
            ))
        };
        let copy = |((one, other), pair): (&(usize, usize), &Pair)| {
            let is_alike = pair.rows >= LONG && f64::from(pair.equal) >= ALIKE * f64::from(pair.rows);
            let is_copy = is_alike && self.repeats[*one].is_seldom();
            let (one, other) = (text::name(&names[*one]), text::name(&names[*other]));
            is_copy.then(|| {
                format!(
                    "{other} has the value of {one} in {} of {} rows with a new one: a copy is no second measurement; \
                     --without {} leaves it out",
                    pair.equal,
                    pair.rows,
                    as_argument([&other])
                )
            })
        };
        let stuck = self.repeats.iter().zip(names).filter_map(stuck);
        let units = self.repeats.iter().zip(names);
        let units = units.filter_map(|(repeats, name)| repeats.units.hint(&text::name(name)));
        stuck.chain(units).chain(self.pairs.iter().filter_map(copy)).collect()
    }
}

/// Rows without the values of sensors that are stuck: they say nothing of noise and of what sensors have in common. Other rows as they are.
pub(crate) fn without_stuck(rows: &[Instant]) -> Cow<'_, [Instant]> {
    let mut all: Vec<Vec<(usize, f64)>> = Vec::new();
    for (row, instant) in rows.iter().enumerate() {
        for (sensor, value) in instant.values() {
            if all.len() <= sensor {
                all.resize(sensor + 1, Vec::new());
            }
            all[sensor].push((row, value));
        }
    }
    let mut found = Cow::Borrowed(rows);
    for (sensor, values) in all.iter().enumerate() {
        let runs = || values.chunk_by(|one, other| one.1 == other.1);
        let is_long = |run: &&[(usize, f64)]| run.len() >= LONG as usize;
        let long: usize = runs().filter(is_long).map(<[_]>::len).sum();
        let repeated: usize = runs().filter(|run| !is_long(run)).map(|run| run.len() - 1).sum();
        let others = values.len() - long;
        if long == 0 || others < LONG as usize || repeated as f64 > SELDOM * others as f64 {
            continue;
        }
        for (row, _) in runs().filter(is_long).flatten() {
            let cells = found.to_mut()[*row].reports.iter_mut();
            cells.filter(|cell| cell.0 == sensor).for_each(|cell| cell.1 = None);
        }
    }
    found
}
