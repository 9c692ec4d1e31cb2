//! Releases whose rate changes with time.

use super::integrate::over_ages;
use crate::Error;
use fewbits_numerics::error::{all_finite, positive, refuse};

/// A release rate that is constant between given instants, and zero before the first and after the last.
///
/// ```
/// use fewbits_models::diffusion::{Air, Ground, Release};
/// use nalgebra::Vector3;
/// let air = Air::new(40.0, Vector3::zeros(), Ground::Impermeable)?;
/// let ten_seconds = Release::during(0.0, 10.0, 1.0)?;
/// let (sensor, source) = (Vector3::new(63.0, 38.0, 0.0), Vector3::new(73.0, 38.0, 0.0));
/// let c = ten_seconds.concentration(25.0, |age| air.concentration(&sensor, &source, age));
/// assert!((c - 1.998_718_747_649_94e-5).abs() < 1e-18);
/// # Ok::<(), fewbits_models::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Release {
    /// Instants of change, s, increasing; the last may be infinite.
    edges: Vec<f64>,
    /// Rates between them, kg/s.
    rates: Vec<f64>,
}

impl Release {
    /// A constant rate (kg/s) between the instants `start` and `end` (s).
    ///
    /// # Errors
    /// As [`Release::piecewise`].
    pub fn during(start: f64, end: f64, rate: f64) -> Result<Self, Error> {
        Self::piecewise(vec![start, end], vec![rate])
    }

    /// Rates (kg/s) between increasing instants (s): one edge more than rates. The last edge may be infinite.
    ///
    /// # Errors
    /// If the lengths do not fit, an edge is not finite or not above the one before, or a rate is negative or not finite.
    pub fn piecewise(edges: Vec<f64>, rates: Vec<f64>) -> Result<Self, Error> {
        if rates.is_empty() || edges.len() != rates.len() + 1 {
            let expected = format!("{} numbers, one more than rates (at least 2)", rates.len() + 1);
            return refuse("edges", format!("{} numbers", edges.len()), expected);
        }
        let increasing = edges.windows(2).all(|pair| pair[0] < pair[1]) && edges[0].is_finite();
        if !increasing {
            return refuse("edges", format!("{edges:?}"), "increasing instants");
        }
        all_finite("rates", &rates)?;
        if let Some(rate) = rates.iter().find(|rate| **rate < 0.0) {
            return refuse("rates", rate, "rates of 0 or above");
        }
        Ok(Self { edges, rates })
    }

    /// Concentration (kg/m^3) at `time` (s). `per_unit_rate(age)` is the concentration per unit rate of a source that has released for
    /// `age` seconds.
    pub fn concentration(&self, time: f64, per_unit_rate: impl Fn(f64) -> f64) -> f64 {
        // Superposition: a rate between two instants is one that began at the first less one that began at the second.
        let since = |edge: f64| if time > edge { per_unit_rate(time - edge) } else { 0.0 };
        let boxes = self.rates.iter().zip(self.edges.windows(2));
        boxes
            .map(|(rate, edge)| rate * (since(edge[0]) - since(edge[1])))
            .sum::<f64>()
            .max(0.0)
    }

    /// Concentration (kg/m^3) at `time` (s) of any rate `mu(t)` (kg/s) that began at `start`. `impulse(age)` is the impulse response.
    /// Diffusivity and distance bound the ages at which it is not negligible. Quadrature in `age^(-1/2)`; relative accuracy about 1e-12 if
    /// the rate is smooth.
    ///
    /// # Errors
    /// If `diffusivity` or `distance` is not a positive number.
    pub fn varying(
        rate: impl Fn(f64) -> f64,
        start: f64,
        time: f64,
        (diffusivity, distance): (f64, f64),
        impulse: impl Fn(f64) -> f64,
    ) -> Result<f64, Error> {
        positive("diffusivity", diffusivity)?;
        positive("distance", distance)?;
        if time <= start {
            return Ok(0.0);
        }
        Ok(over_ages(diffusivity, distance, time - start, |age| rate(time - age) * impulse(age)))
    }
}
