//! Values that are written in another unit from one of them on: level and scatter change by the factor between two units.

use fewbits_filters::calibration::median;
use std::collections::VecDeque;

/// Values before the change, and behind it.
const HALF: usize = 12;
/// Least jump, in scatters of both sides.
const JUMP: f64 = 10.0;
/// Factor and zero of one unit in another, and their names.
const UNITS: [(f64, f64, &str); 9] = [
    (10.0, 0.0, "a unit and its tenth"),
    (100.0, 0.0, "a unit and its hundredth"),
    (1000.0, 0.0, "a unit and its thousandth"),
    (1.8, 32.0, "degrees Celsius and Fahrenheit"),
    (3.6, 0.0, "m/s and km/h"),
    (60.0, 0.0, "minutes and seconds"),
    (3600.0, 0.0, "hours and seconds"),
    (1.0 / 0.3048, 0.0, "metres and feet"),
    (1.0, 273.15, "degrees Celsius and kelvin"),
];
/// A unit changes so often at most: there and back.
const MOST_JUMPS: usize = 2;
/// Levels agree within this share of both scatters.
const NEAR: f64 = 0.6;
/// Scatters agree within this factor.
const ALIKE: f64 = 1.5;

/// The last values of a sensor.
#[derive(Debug, Clone, Default)]
pub(crate) struct Units {
    recent: VecDeque<f64>,
    count: usize,
    jumps: usize,
    /// Number of the first value in another unit, and which.
    found: Option<(usize, &'static str)>,
}

impl Units {
    pub(crate) fn add(&mut self, value: f64) {
        self.count += 1;
        self.recent.push_back(value);
        if self.recent.len() > 2 * HALF {
            self.recent.pop_front();
        }
        if self.recent.len() < 2 * HALF || self.jumps > MOST_JUMPS {
            return;
        }
        let (before, behind) = (self.recent[HALF - 1], self.recent[HALF]);
        if before == behind {
            return;
        }
        let part = |range: std::ops::Range<usize>| self.recent.range(range).copied().collect();
        let Some(jump) = Jump::of(part(0..HALF), part(HALF..2 * HALF)) else {
            return;
        };
        self.jumps += 1;
        if self.found.is_none() {
            self.found = jump.unit().map(|text| (self.count - HALF + 1, text));
        }
    }

    /// What is said of a sensor.
    pub(crate) fn hint(&self, name: &str) -> Option<String> {
        // A level that jumps more often does so by what is between two units now and then.
        let (first, text) = self.found.filter(|_| self.jumps <= MOST_JUMPS)?;
        Some(format!(
            "{name} and its scatter change at its value {first} by what is between {text}: if its unit changes there, these estimates do too; take both \
             parts by themselves, or convert one"
        ))
    }
}

/// Medians of the values on both sides of a jump, and of their steps.
struct Jump {
    levels: [f64; 2],
    steps: [f64; 2],
}

impl Jump {
    fn of(before: Vec<f64>, behind: Vec<f64>) -> Option<Self> {
        let steps = |values: &[f64]| -> Vec<f64> { values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect() };
        let both = [steps(&before), steps(&behind)];
        let largest = both.iter().flatten().fold(0.0, |largest: f64, step| largest.max(*step));
        let (steps, levels) = (both.map(median), [before, behind].map(median));
        let jump = (levels[1] - levels[0]).abs();
        let is_one = jump > 0.0 && jump >= JUMP * (steps[0] + steps[1]) && largest <= 0.25 * jump;
        is_one.then_some(Self { levels, steps })
    }

    /// The unit that one side has of the other.
    fn unit(&self) -> Option<&'static str> {
        let ([from, to], [one, other]) = (self.levels, self.steps);
        let of = |(from, one): (f64, f64), (to, other): (f64, f64)| {
            let is_it = |(factor, zero, _): &&(f64, f64, &str)| {
                let scatter = other / (factor * one);
                (to - (factor * from + zero)).abs() < NEAR * (factor * one + other)
                    && (1.0 / ALIKE..ALIKE).contains(&scatter)
            };
            UNITS.iter().find(is_it).map(|(_, _, text)| *text)
        };
        if one <= 0.0 && other <= 0.0 {
            return None;
        }
        of((from, one), (to, other)).or_else(|| of((to, other), (from, one)))
    }
}
