//! A density given as a function.

use super::{CellMoments, Density, Uniform};
use crate::error::{Error, refuse};
use fewbits_numerics::quadrature::gauss_legendre;

/// A smooth density given as a function, integrated by Gauss-Legendre panels.
#[derive(Debug, Clone)]
pub struct SmoothDensity<F> {
    density: F,
    centre: f64,
    low: f64,
    high: f64,
    panel: f64,
    scale: f64,
}

impl<F: Fn(f64) -> f64> SmoothDensity<F> {
    /// The density proportional to `density` on `[low, high]` and zero outside.
    ///
    /// `panels` (1 to 10000) is the number of 20-point Gauss-Legendre panels; they must resolve the function.
    ///
    /// # Errors
    /// If the interval is empty or not finite, `panels` is out of range, or the integral is not positive and finite.
    pub fn new(density: F, low: f64, high: f64, panels: usize) -> Result<Self, Error> {
        let interval = Uniform::new(low, high)?;
        if !(1..=10_000).contains(&panels) {
            return refuse("panels", panels, "a number of panels from 1 to 10000");
        }
        let half = interval.half();
        let mut this = Self {
            density,
            centre: interval.centre(),
            low: -half,
            high: half,
            panel: 2.0 * half / panels as f64,
            scale: 1.0,
        };
        let total = this.integral(-half, half, |_| 1.0);
        if !(total.is_finite() && total > 0.0) {
            return refuse("density", format!("a function of integral {total}"), "a positive finite integral");
        }
        this.scale = 1.0 / total;
        Ok(this)
    }

    fn integral(&self, a: f64, b: f64, weight: impl Fn(f64) -> f64) -> f64 {
        let (a, b) = (a.clamp(self.low, self.high), b.clamp(self.low, self.high));
        if a >= b {
            return 0.0;
        }
        // Panels no longer than those of the whole interval, which resolve the function.
        let panels = ((b - a) / self.panel).ceil() as usize;
        let f = |x: f64| weight(x) * (self.density)(self.centre + x);
        self.scale * gauss_legendre::<20>().composite(a, b, panels, f)
    }
}

impl<F: Fn(f64) -> f64> Density for SmoothDensity<F> {
    fn centre(&self) -> f64 {
        self.centre
    }

    fn pdf(&self, x: f64) -> f64 {
        if (self.low..=self.high).contains(&x) {
            self.scale * (self.density)(self.centre + x)
        } else {
            0.0
        }
    }

    fn cell(&self, a: f64, b: f64) -> CellMoments {
        let (low, high) = (a.clamp(self.low, self.high), b.clamp(self.low, self.high));
        let mass = self.integral(low, high, |_| 1.0);
        CellMoments::clipped((a, b), (low, high), mass, self.integral(low, high, |x| x - low))
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        let extent = self.low.abs().max(self.high.abs()).max(point.abs());
        if extent < f64::MAX.sqrt() / 4.0 {
            return self.integral(a, b, |x| (x - point) * (x - point));
        }
        // Squares are beyond all numbers, and their share may not be.
        let share = self.integral(a, b, |x| (x / extent - point / extent).powi(2));
        (share.sqrt() * extent).powi(2)
    }

    fn extent(&self) -> (f64, f64) {
        (self.low, self.high)
    }
}
