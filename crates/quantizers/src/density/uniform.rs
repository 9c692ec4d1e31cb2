//! The uniform density.

use super::{CellMoments, Density};
use crate::error::{Error, refuse};
use fewbits_numerics::error::finite;

/// Uniform density on an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Uniform {
    low: f64,
    high: f64,
}

impl Uniform {
    /// Uniform on `[low, high]`.
    ///
    /// # Errors
    /// If an end is not finite or `low >= high`.
    pub fn new(low: f64, high: f64) -> Result<Self, Error> {
        finite("low", low)?;
        finite("high", high)?;
        if low >= high {
            return refuse("high", high, format!("a number above low = {low}"));
        }
        Ok(Self { low, high })
    }

    pub(super) fn half(&self) -> f64 {
        0.5 * self.high - 0.5 * self.low
    }
}

impl Density for Uniform {
    fn centre(&self) -> f64 {
        0.5 * self.low + 0.5 * self.high
    }

    fn pdf(&self, x: f64) -> f64 {
        if x.abs() <= self.half() { 0.5 / self.half() } else { 0.0 }
    }

    fn cell(&self, a: f64, b: f64) -> CellMoments {
        let half = self.half();
        let (low, high) = (a.clamp(-half, half), b.clamp(-half, half));
        let centroid = 0.5 * (low + high);
        CellMoments {
            mass: 0.5 * (high - low).max(0.0) / half,
            from_lower: centroid - a,
            to_upper: b - centroid,
        }
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        let half = self.half();
        let (low, high) = (a.clamp(-half, half), b.clamp(-half, half));
        let (width, off) = ((high - low).max(0.0), 0.5 * (low + high) - point);
        let share = 0.5 * width / half;
        if width * width + off * off < f64::INFINITY {
            return share * (width * width / 12.0 + off * off);
        }
        // The squares are beyond all numbers, and their share may not be.
        (share.sqrt() * (width / 12.0_f64.sqrt()).hypot(off)).powi(2)
    }

    fn extent(&self) -> (f64, f64) {
        (-self.half(), self.half())
    }
}
