//! Probability densities on the line, as far as quantization needs them.

use crate::error::{Error, refuse};
use fewbits_numerics::error::{finite, positive};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::{Rule, gauss_legendre};

/// Cells of the grid on which the high-rate starting point is inverted.
const START_GRID: usize = 4000;
/// Cells over which a normal density changes by less than a factor of `exp(2)` take eight nodes, exact to rounding.
const NARROW: f64 = 1.0;

/// Mass of a cell `[a, b)`, and how far its centroid lies from its edges.
///
/// Distances rather than places: the midpoint equations of a quantizer need `(b - c_i) - (c_{i+1} - b)`, which loses no digit
/// in narrow cells when each distance is known on its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellMoments {
    /// Probability of the cell.
    pub mass: f64,
    /// Centroid minus `a`; infinite if `a` is.
    pub from_lower: f64,
    /// `b` minus centroid; infinite if `b` is.
    pub to_upper: f64,
}

/// A probability density on the line.
///
/// Every place `x`, `a`, `b` is measured **from [`centre`](Density::centre)**, so that nothing depends on how far from zero the
/// density lies. Edges may be infinite.
///
/// Laws: masses of adjoining cells add up and that of the line is 1; centroids are those of `pdf`; `squared_error` is the
/// integral of `(x - point)^2 pdf(x)`.
pub trait Density {
    /// The point from which the other functions measure: the mean, or close to it.
    fn centre(&self) -> f64;
    /// Density at `centre + x`.
    fn pdf(&self, x: f64) -> f64;
    /// Mass and centroid of the cell `[a, b)`; the middle stands for the centroid of an empty cell.
    fn cell(&self, a: f64, b: f64) -> CellMoments;
    /// Integral of `(x - point)^2 pdf(x)` over `[a, b)`: what reproducing the cell by `point` costs.
    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64;
    /// The standard deviation, if the density is normal about its centre: a kept table then is the design's start.
    fn normal_deviation(&self) -> Option<f64> {
        None
    }
    /// An interval outside which the cube root of the density is negligible.
    fn extent(&self) -> (f64, f64);

    /// Breakpoints of `levels` cells of equal mass under the cube root of the density: the companding solution, optimal for
    /// many levels (Panter and Dite 1951), from which a design starts.
    fn companding(&self, levels: usize) -> Vec<f64> {
        let (low, high) = self.extent();
        let width = (high - low) / START_GRID as f64;
        let mut cumulative = vec![0.0; START_GRID + 1];
        for i in 0..START_GRID {
            let middle = low + (i as f64 + 0.5) * width;
            cumulative[i + 1] = cumulative[i] + self.pdf(middle).max(0.0).cbrt();
        }
        let total = cumulative[START_GRID];
        (1..levels)
            .map(|l| {
                let target = total * l as f64 / levels as f64;
                let at = cumulative.partition_point(|c| *c < target).clamp(1, START_GRID);
                let (before, after) = (cumulative[at - 1], cumulative[at]);
                let inside = if after > before {
                    (target - before) / (after - before)
                } else {
                    0.5
                };
                low + width * (at as f64 - 1.0 + inside)
            })
            .collect()
    }
}

/// Normal density.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Normal {
    mean: f64,
    deviation: f64,
}

impl Normal {
    /// Mean 0, standard deviation 1.
    pub const STANDARD: Self = Self {
        mean: 0.0,
        deviation: 1.0,
    };

    /// Normal density with the given mean and standard deviation.
    ///
    /// # Errors
    /// If `mean` is not finite or `deviation` is not a positive number.
    pub fn with_deviation(mean: f64, deviation: f64) -> Result<Self, Error> {
        Ok(Self {
            mean: finite("mean", mean)?,
            deviation: positive("deviation", deviation)?,
        })
    }
}

impl Density for Normal {
    fn centre(&self) -> f64 {
        self.mean
    }

    #[inline]
    fn pdf(&self, x: f64) -> f64 {
        normal::pdf(x / self.deviation) / self.deviation
    }

    #[inline]
    fn cell(&self, a: f64, b: f64) -> CellMoments {
        let s = self.deviation;
        let standard = standard_cell(a / s, b / s);
        CellMoments {
            mass: standard.mass,
            from_lower: s * standard.from_lower,
            to_upper: s * standard.to_upper,
        }
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        let s = self.deviation;
        let (a, b, point) = (a / s, b / s, point / s);
        match (narrow(a, b), normal::truncated_moments(a, b)) {
            (Some((middle, half)), _) => {
                let density = |t: f64| (-t * (middle + 0.5 * t)).exp() * (middle + t - point) * (middle + t - point);
                s * s * normal::pdf(middle) * gauss_legendre::<8>().sum(-half, half, density)
            }
            (None, Ok(inside)) => {
                let off = inside.mean - point;
                s * s * normal::interval(a, b) * (inside.variance + off * off)
            }
            (None, Err(_)) => 0.0,
        }
    }

    fn normal_deviation(&self) -> Option<f64> {
        Some(self.deviation)
    }

    fn extent(&self) -> (f64, f64) {
        // The cube root has standard deviation sqrt(3).
        (-14.0 * self.deviation, 14.0 * self.deviation)
    }

    /// The cube root of a normal density is a normal density of three times the variance.
    fn companding(&self, levels: usize) -> Vec<f64> {
        let scale = 3f64.sqrt() * self.deviation;
        let mut edges = vec![0.0; levels - 1];
        for l in 1..levels.div_ceil(2) {
            let edge = scale * normal::quantile(l as f64 / levels as f64);
            edges[l - 1] = edge;
            edges[levels - 1 - l] = -edge;
        }
        edges
    }
}

/// Middle and half width of a cell that [`NARROW`] describes.
#[inline]
fn narrow(a: f64, b: f64) -> Option<(f64, f64)> {
    let (middle, half) = (0.5 * (a + b), 0.5 * (b - a));
    (half * (middle.abs() + half) < NARROW).then_some((middle, half))
}

/// A cell of the standard normal density.
fn standard_cell(a: f64, b: f64) -> CellMoments {
    if let Some((middle, half)) = narrow(a, b) {
        let rule: &Rule = gauss_legendre::<8>();
        let (mut mass, mut first) = (0.0, 0.0);
        for (t, w) in rule.on(-half, half) {
            let p = w * (-t * (middle + 0.5 * t)).exp();
            mass += p;
            first += p * t;
        }
        let offset = first / mass;
        return CellMoments {
            mass: normal::pdf(middle) * mass,
            from_lower: half + offset,
            to_upper: half - offset,
        };
    }
    let mass = normal::interval(a, b);
    if b == f64::INFINITY {
        let from_lower = normal::inverse_mills(-a) - a;
        return CellMoments {
            mass,
            from_lower,
            to_upper: f64::INFINITY,
        };
    }
    if a == f64::NEG_INFINITY {
        let to_upper = normal::inverse_mills(b) + b;
        return CellMoments {
            mass,
            from_lower: f64::INFINITY,
            to_upper,
        };
    }
    match normal::truncated_moments(a, b) {
        Ok(inside) => CellMoments {
            mass,
            from_lower: inside.mean - a,
            to_upper: b - inside.mean,
        },
        Err(_) => halved(mass, a, b),
    }
}

/// A cell whose centroid is taken to be its middle.
fn halved(mass: f64, a: f64, b: f64) -> CellMoments {
    CellMoments {
        mass,
        from_lower: 0.5 * (b - a),
        to_upper: 0.5 * (b - a),
    }
}

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

    fn half(&self) -> f64 {
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
        0.5 * width / half * (width * width / 12.0 + off * off)
    }

    fn extent(&self) -> (f64, f64) {
        (-self.half(), self.half())
    }
}

/// Any smooth density given as a function, integrated by Gauss-Legendre panels.
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
    /// The density proportional to `density` on `[low, high]`; what lies outside is cut off and the rest normalised.
    ///
    /// `panels` is the number of 20-point Gauss-Legendre panels that resolve it (1 to 10000).
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
        let inside = if mass > 0.0 {
            self.integral(low, high, |x| x - low) / mass
        } else {
            0.5 * (high - low)
        };
        CellMoments {
            mass,
            from_lower: inside + (low - a),
            to_upper: (high - low - inside) + (b - high),
        }
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        self.integral(a, b, |x| (x - point) * (x - point))
    }

    fn extent(&self) -> (f64, f64) {
        (self.low, self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laws(density: &impl Density, cuts: &[f64]) {
        let edges: Vec<f64> = [f64::NEG_INFINITY]
            .into_iter()
            .chain(cuts.iter().copied())
            .chain([f64::INFINITY])
            .collect();
        let mass: f64 = edges.windows(2).map(|w| density.cell(w[0], w[1]).mass).sum();
        assert!((mass - 1.0).abs() < 1e-14);
        let (low, high) = density.extent();
        for w in edges.windows(2) {
            let (a, b) = (w[0].max(low), w[1].min(high));
            let numeric = |f: &dyn Fn(f64) -> f64| {
                gauss_legendre::<64>().composite(a, b, 40, |x| f(x) * density.pdf(x))
            };
            let cell = density.cell(w[0], w[1]);
            let centroid = if w[0].is_finite() { w[0] + cell.from_lower } else { w[1] - cell.to_upper };
            assert!((numeric(&|_| 1.0) - cell.mass).abs() < 1e-13);
            assert!((numeric(&|x| x) / cell.mass - centroid).abs() < 1e-11 * (high - low));
            let cost = density.squared_error(w[0], w[1], 0.3);
            assert!((numeric(&|x| (x - 0.3) * (x - 0.3)) - cost).abs() < 1e-12 * (1.0 + cost));
            if w[0].is_finite() && w[1].is_finite() {
                assert!((cell.from_lower + cell.to_upper - (w[1] - w[0])).abs() < 1e-14 * (high - low));
            }
        }
    }

    #[test]
    fn densities_obey_their_laws() {
        laws(&Normal::STANDARD, &[-2.0, -0.4, 0.1, 0.9, 4.0]);
        laws(&Normal::with_deviation(1e8, 2.5).unwrap(), &[-9.0, -0.1, 0.0, 3.0]);
        laws(&Uniform::new(-1.0, 3.0).unwrap(), &[-1.5, -0.3, 0.2, 1.9]);
        laws(&SmoothDensity::new(|x: f64| (-x).exp(), 0.0, 30.0, 60).unwrap(), &[-14.0, -12.0, 3.0]);
    }

    #[test]
    fn bad_arguments_are_named() {
        assert!(Uniform::new(1.0, 1.0).is_err());
        assert!(Normal::with_deviation(0.0, 0.0).is_err());
        assert!(SmoothDensity::new(|_| 0.0, 0.0, 1.0, 1).is_err());
        assert!(SmoothDensity::new(|_| f64::NAN, 0.0, 1.0, 1).is_err());
    }
}
