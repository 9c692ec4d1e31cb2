//! Thresholds as codes of an analogue-to-digital converter.

use super::participant::WordedCells;
use super::solution::Solution;
use crate::error::{Error, refuse};
use fewbits_numerics::error::{entries, finite};
use std::ops::RangeInclusive;

/// Largest number of bits of a converter.
const MAX_CONVERTER_BITS: u32 = 24;

/// A converter with evenly spaced codes: code `k` stands for the samples from `low + k step` up to the next code. Samples outside
/// the range get the first or last code.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Adc {
    bits: u32,
    low: f64,
    high: f64,
}

impl Adc {
    /// A converter of `bits` bits over a range, in the unit of the unknown.
    ///
    /// # Errors
    /// If `bits` is not in `1..=24`, or the range is empty or not finite.
    pub fn new(bits: u32, range: RangeInclusive<f64>) -> Result<Self, Error> {
        if !(1..=MAX_CONVERTER_BITS).contains(&bits) {
            return refuse("bits", bits, format!("1 to {MAX_CONVERTER_BITS} bits"));
        }
        let (low, high) = (finite("low", *range.start())?, finite("high", *range.end())?);
        if low >= high || !(high - low).is_finite() {
            return refuse("high", high, format!("a number above low = {low}"));
        }
        Ok(Self { bits, low, high })
    }

    /// Width of the interval of a code, in the unit of the unknown.
    pub(crate) fn step(&self) -> f64 {
        (self.high - self.low) / f64::from(1u32 << self.bits)
    }

    /// The code of a sample; NaN is code 0.
    pub fn code(&self, sample: f64) -> u32 {
        let largest = (1u32 << self.bits) - 1;
        // The conversion saturates.
        (((sample - self.low) / self.step()).floor() as u32).min(largest)
    }

    /// The smallest sample with this code, for a code above 0.
    pub(crate) fn threshold(&self, code: u32) -> f64 {
        self.low + f64::from(code) * self.step()
    }

    /// The code whose lower edge is nearest to a breakpoint.
    fn nearest(&self, breakpoint: f64) -> u32 {
        let largest = (1u32 << self.bits) - 1;
        // Code 0 has no lower edge: every sample reaches it.
        (((breakpoint - self.low) / self.step()).round() as u32).clamp(1, largest)
    }
}

/// A design whose breakpoints are edges of converter codes.
#[derive(Debug, Clone, PartialEq)]
pub struct Rounded {
    /// The converter of each sensor.
    pub adcs: Vec<Adc>,
    /// Thresholds of each sensor, as codes: the cell of a sample is the number of thresholds that its code reaches.
    pub thresholds: Vec<Vec<u32>>,
    /// The design with these breakpoints, its value and its decoder. Its certificate is
    /// [`Certificate::Unproved`](crate::Certificate::Unproved).
    pub solution: Solution,
}

impl Rounded {
    /// The word of a sensor for a code, or `None` if there is no such sensor.
    pub fn encode(&self, sensor: usize, code: u32) -> Option<usize> {
        let cell = fewbits_node::cell_of(self.thresholds.get(sensor)?, code).ok()?;
        self.solution.sensors().get(sensor)?.words.get(cell).copied()
    }
}

impl Solution {
    /// The design with every breakpoint moved to the nearest edge of a code, with one converter per sensor. Breakpoints that meet
    /// become one, and the cell between them is removed.
    ///
    /// The value of the result is exact, since it is computed for the cells of the codes.
    ///
    /// # Errors
    /// If there is not one converter per sensor.
    pub fn rounded(&self, adcs: &[Adc]) -> Result<Rounded, Error> {
        entries("adcs", adcs.len(), self.sensors().len())?;
        let (mut thresholds, mut cells) = (Vec::new(), Vec::new());
        for (sensor, adc) in self.sensors().iter().zip(adcs) {
            let (mut codes, mut words): (Vec<u32>, Vec<usize>) = (Vec::new(), vec![sensor.words[0]]);
            for (breakpoint, word) in sensor.breakpoints.iter().zip(&sensor.words[1..]) {
                let code = adc.nearest(*breakpoint);
                if codes.last() == Some(&code) {
                    // The previous cell has no code left, so it gets the next word.
                    words.pop();
                } else {
                    codes.push(code);
                }
                words.push(*word);
            }
            cells.push(WordedCells {
                breakpoints: codes.iter().map(|code| adc.threshold(*code)).collect(),
                words,
            });
            thresholds.push(codes);
        }
        Ok(Rounded {
            adcs: adcs.to_vec(),
            thresholds,
            solution: self.with_cells(cells)?,
        })
    }
}
