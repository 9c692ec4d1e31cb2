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
/// Levels agree within this share of both scatters.
const NEAR: f64 = 0.6;
/// Scatters agree within this factor.
const ALIKE: f64 = 1.5;

/// The last values of a sensor.
#[derive(Debug, Clone, Default)]
pub(super) struct Units {
    recent: VecDeque<f64>,
    count: usize,
    /// Number of the first value in another unit, and which.
    found: Option<(usize, &'static str)>,
}

impl Units {
    pub(super) fn add(&mut self, value: f64) {
        self.count += 1;
        self.recent.push_back(value);
        if self.recent.len() > 2 * HALF {
            self.recent.pop_front();
        }
        if self.recent.len() < 2 * HALF || self.found.is_some() {
            return;
        }
        let (before, behind) = (self.recent[HALF - 1], self.recent[HALF]);
        if before == behind {
            return;
        }
        let (one, other): (Vec<f64>, Vec<f64>) =
            (self.recent.range(..HALF).copied().collect(), self.recent.range(HALF..).copied().collect());
        let text = changed(&one, &other).or_else(|| changed(&other, &one));
        self.found = text.map(|text| (self.count - HALF + 1, text));
    }

    /// What is said of a sensor.
    pub(super) fn hint(&self, name: &str) -> Option<String> {
        let (first, text) = self.found?;
        Some(format!(
            "{name} and its scatter change at its value {first} by what is between {text}: if its unit changes there, these estimates do too; take both \
             parts by themselves, or convert one"
        ))
    }
}

/// The unit that `behind` has of `before`, if both are on either side of a jump.
fn changed(before: &[f64], behind: &[f64]) -> Option<&'static str> {
    let steps = |values: &[f64]| -> Vec<f64> { values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect() };
    let (one, other) = (steps(before), steps(behind));
    let largest = one
        .iter()
        .chain(&other)
        .fold(0.0, |largest: f64, step| largest.max(*step));
    let (one, other) = (median(one), median(other));
    let near = |values: &[f64]| median(values.to_vec());
    let (from, to) = (near(before), near(behind));
    let jump = (to - from).abs();
    if one <= 0.0 || jump < JUMP * (one + other) || largest > 0.25 * jump {
        return None;
    }
    let is_it = |(factor, zero, _): &&(f64, f64, &str)| {
        let scatter = other / (factor * one);
        (to - (factor * from + zero)).abs() < NEAR * (factor * one + other) && (1.0 / ALIKE..ALIKE).contains(&scatter)
    };
    UNITS.iter().find(is_it).map(|(_, _, text)| *text)
}
