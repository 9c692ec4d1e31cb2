//! A search over numbers that are known or to be found, along one or several at a time.

use crate::Error;
use fewbits_numerics::error::{finite, positive};

/// Reach of the search about the start, in `ln`.
const REACH: f64 = 9.0;
/// How far the first scan of the change reaches.
const SCANNED: i32 = 6;
/// A number is raised by these steps while the likelihood, which is as high (within so many nats) so far below, loses little.
const FAR_BELOW: f64 = 2.0;
const AS_HIGH: f64 = 0.2;
const RAISED: f64 = 0.25;
const LITTLE: f64 = 1.0;
/// Steps of the mean over a number, in `ln`, and how many to either side.
const SETTLED: f64 = 0.125;
const FAR: i32 = 16;
/// After so many terms in a row below this share of the sum, those that are farther out are left out.
const ENOUGH: u32 = 2;
const NEGLIGIBLE: f64 = 1e-9;

/// A standard deviation or a factor: known, or to be found from a first guess.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Number {
    /// It is held fixed.
    Known(f64),
    /// It is found.
    Unknown {
        /// First guess.
        guess: f64,
        /// Smallest number that is considered, for instance because values are rounded.
        least: f64,
    },
}

impl Number {
    pub(super) fn check(&self, name: &'static str) -> Result<(), Error> {
        match self {
            Self::Known(number) => positive(name, *number)?,
            Self::Unknown { guess, least } => {
                finite(name, *least)?;
                positive(name, *guess)?
            }
        };
        Ok(())
    }

    pub(super) fn start(&self) -> f64 {
        match self {
            Self::Known(number) => *number,
            Self::Unknown { guess, least } => guess.max(*least),
        }
    }

    /// The number at `ln` this far from the start; `None` if it is out of reach.
    pub(super) fn at(&self, shift: f64) -> Option<f64> {
        match self {
            Self::Known(number) => Some(*number),
            Self::Unknown { least, .. } => {
                let number = self.start() * shift.exp();
                (shift.abs() <= REACH && number >= *least).then_some(number)
            }
        }
    }

    pub(super) fn is_unknown(&self) -> bool {
        matches!(self, Self::Unknown { .. })
    }
}

/// A search along groups of numbers that move together, in `ln`.
pub(super) struct Search<'a, L> {
    pub change: Number,
    pub noises: &'a [Number],
    /// Of the change, then of each noise.
    pub shifts: Vec<f64>,
    pub best: f64,
    pub log_likelihood: L,
}

impl<L: Fn(f64, &[f64]) -> f64> Search<'_, L> {
    pub(super) fn at(&self, shifts: &[f64]) -> f64 {
        let noises: Option<Vec<f64>> = self
            .noises
            .iter()
            .zip(&shifts[1..])
            .map(|(one, shift)| one.at(*shift))
            .collect();
        match (self.change.at(shifts[0]), noises) {
            (Some(change), Some(noises)) => (self.log_likelihood)(change, &noises),
            _ => f64::NEG_INFINITY,
        }
    }

    /// Replaces a number by the root of the mean of its square under its likelihood, the other numbers held, all numbers being equally likely before
    /// (not their logarithms): what may as well be smaller or larger makes bands too narrow more than too wide. Where the likelihood is as high
    /// far below, it says nothing but an upper end, and the largest number that is not improbable is taken.
    pub(super) fn settle(&mut self, axis: usize) {
        let moved = |by: f64| {
            let mut other = self.shifts.clone();
            other[axis] += by;
            other
        };
        let number = if axis == 0 {
            &self.change
        } else {
            &self.noises[axis - 1]
        };
        // Not below the least number that is considered.
        let room = match number {
            Number::Unknown { least, .. } if *least > 0.0 => self.shifts[axis] - (least / number.start()).ln(),
            _ => FAR_BELOW,
        };
        // Nor out of the reach of the search, where it ends if the number hardly matters.
        let down = FAR_BELOW.min(room).min(REACH + self.shifts[axis]);
        let here = self.at(&self.shifts);
        // At the least number it is as small as it may be.
        let is_flat = down < RAISED || self.at(&moved(-down)) >= here - AS_HIGH * down / FAR_BELOW;
        if !is_flat {
            let (mut sum, mut squares) = (1.0, 1.0);
            for sign in [-1.0, 1.0] {
                let mut negligible = 0;
                for k in 1..=FAR {
                    let by = sign * SETTLED * f64::from(k);
                    let weight = (self.at(&moved(by)) - here + by).exp();
                    let square = weight * (2.0 * by).exp();
                    sum += weight;
                    squares += square;
                    negligible = if weight.max(square) < NEGLIGIBLE * squares {
                        negligible + 1
                    } else {
                        0
                    };
                    if negligible == ENOUGH {
                        break;
                    }
                }
            }
            let by = 0.5 * (squares / sum).ln();
            if by.is_finite() && self.at(&moved(by)).is_finite() {
                self.shifts[axis] += by;
            }
            return;
        }
        // From the least number of the search to the largest it is twice its reach.
        let largest = REACH - self.shifts[axis];
        let mut by = 0.0;
        while by + RAISED <= largest && self.at(&moved(by + RAISED)) > here - LITTLE {
            by += RAISED;
        }
        // What no reading depends on stays as it is.
        if by + RAISED <= largest {
            self.shifts[axis] += by;
        }
    }

    /// Begins at the best of some changes that are factors of e apart.
    pub(super) fn scan(&mut self) {
        let start = self.shifts.clone();
        for k in -SCANNED..=SCANNED {
            let mut other = start.clone();
            other[0] += f64::from(k);
            let found = self.at(&other);
            if found > self.best {
                (self.best, self.shifts) = (found, other);
            }
        }
    }

    /// Moves along each group, with smaller and smaller steps.
    pub(super) fn improve(&mut self, groups: &[Vec<usize>], steps: &[f64]) {
        for step in steps {
            loop {
                let before = self.best;
                for group in groups.iter().filter(|group| !group.is_empty()) {
                    for sign in [-step, *step] {
                        let mut other = self.shifts.clone();
                        group.iter().for_each(|axis| other[*axis] += sign);
                        let found = self.at(&other);
                        if found > self.best {
                            (self.best, self.shifts) = (found, other);
                        }
                    }
                }
                let has_risen = self.best > before;
                if !has_risen {
                    break;
                }
            }
        }
    }
}
