//! The scalar that the sensors measure.

use crate::Error;
use fewbits_numerics::error::{finite, positive, refuse};
use fewbits_numerics::normal::pdf;
use fewbits_numerics::quadrature::Rule;
use fewbits_quantizer_design::Prior;

/// A Gaussian source is integrated over this many standard deviations to either side; the rest is below `1e-18`.
const GAUSSIAN_REACH: f64 = 9.0;

/// A zero-mean scalar source `X`, symmetric about zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Source {
    kind: Kind,
}

impl TryFrom<&Source> for Prior {
    type Error = Error;

    /// The same distribution, as the prior of a joint design.
    fn try_from(source: &Source) -> Result<Self, Error> {
        match source.kind {
            Kind::Uniform { half_width } => Self::uniform(-half_width, half_width),
            Kind::Gaussian { deviation } => Self::normal(0.0, deviation),
        }
    }
}

/// Distribution of a [`Source`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// Uniform on `[-half_width, half_width]`.
    Uniform {
        /// Half of its width.
        half_width: f64,
    },
    /// Zero-mean Gaussian.
    Gaussian {
        /// Its standard deviation.
        deviation: f64,
    },
}

/// Returns a number above zero whose square does not underflow or overflow; otherwise an error.
fn squared(argument: &'static str, value: f64) -> Result<f64, Error> {
    positive(argument, value)?;
    Ok(fewbits_numerics::error::within(argument, value, 1e-150, 1e150)?)
}

impl Source {
    /// Uniform on `[-half_width, half_width]`.
    ///
    /// # Errors
    /// If `half_width` is not a finite number above zero, or its square overflows or underflows.
    pub fn uniform(half_width: f64) -> Result<Self, Error> {
        let half_width = squared("half_width", half_width)?;
        Ok(Self {
            kind: Kind::Uniform { half_width },
        })
    }

    /// `N(0, deviation^2)`.
    ///
    /// # Errors
    /// If `deviation` is not a finite number above zero, or its square overflows or underflows.
    pub fn gaussian_with_deviation(deviation: f64) -> Result<Self, Error> {
        let deviation = squared("deviation", deviation)?;
        Ok(Self {
            kind: Kind::Gaussian { deviation },
        })
    }

    #[doc(hidden)]
    pub fn kind(&self) -> Kind {
        self.kind
    }

    /// Length scale of the source: `V`, or the standard deviation.
    pub fn scale(&self) -> f64 {
        match self.kind {
            Kind::Uniform { half_width } => half_width,
            Kind::Gaussian { deviation } => deviation,
        }
    }

    /// Variance: `V^2/3` for the uniform source.
    pub fn variance(&self) -> f64 {
        match self.kind {
            Kind::Uniform { half_width } => half_width * half_width / 3.0,
            Kind::Gaussian { deviation } => deviation * deviation,
        }
    }

    /// Density at `x`.
    pub fn density(&self, x: f64) -> f64 {
        match self.kind {
            Kind::Uniform { half_width } if x.abs() <= half_width => 0.5 / half_width,
            Kind::Uniform { .. } => 0.0,
            Kind::Gaussian { deviation } => pdf(x / deviation) / deviation,
        }
    }

    /// Half the width of the interval on which the source is integrated: `V`, or nine standard deviations.
    pub fn reach(&self) -> f64 {
        match self.kind {
            Kind::Uniform { half_width } => half_width,
            Kind::Gaussian { deviation } => GAUSSIAN_REACH * deviation,
        }
    }

    /// Standard deviation of the sensor noise at a signal-to-noise ratio `10 log10(Var X / noise variance)` in dB.
    ///
    /// # Errors
    /// If `snr_db` is not finite or so extreme that the result is not a positive finite number.
    pub fn noise_deviation(&self, snr_db: f64) -> Result<f64, Error> {
        let snr_db = finite("snr_db", snr_db)?;
        Ok(positive("noise_deviation", (self.variance() / 10f64.powf(snr_db / 10.0)).sqrt())?)
    }

    /// Largest width of a quadrature panel: half of `V`, or one and a half standard deviations of the source.
    fn widest_panel(&self) -> f64 {
        match self.kind {
            Kind::Uniform { half_width } => 0.5 * half_width,
            Kind::Gaussian { deviation } => 1.5 * deviation,
        }
    }

    /// An error if the noise is too small for an even grid of nodes.
    #[doc(hidden)]
    pub fn resolvable(&self, noise_deviation: f64) -> Result<f64, Error> {
        let noise_deviation = positive("noise_deviation", noise_deviation)?;
        let least = FINEST * self.reach();
        if noise_deviation >= least {
            return Ok(noise_deviation);
        }
        refuse("noise_deviation", noise_deviation, format!("at least {least}, 1e-4 of the source's reach"))
    }
}

/// The smallest noise, as a fraction of the support, that an even grid of nodes resolves.
const FINEST: f64 = 1e-4;
/// Beyond this many noise standard deviations from a threshold the bit is certain to `1e-50`.
const ZONE: f64 = 15.0;

/// A threshold of a sensor, with its noise. Integrands vary only within some noise deviations of a threshold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Position on the measurement axis.
    pub position: f64,
    /// Standard deviation of the noise of its sensor.
    pub noise_deviation: f64,
}

impl Threshold {
    /// The breakpoints of a quantizer whose measurement has this noise.
    pub fn of(breakpoints: &[f64], noise_deviation: f64) -> impl Iterator<Item = Self> + '_ {
        breakpoints.iter().map(move |&position| Self {
            position,
            noise_deviation,
        })
    }
}

/// A quadrature rule that includes the source density: `E[f(X)] = sum w f(x)` over points `x` and weights `w`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Nodes {
    /// Points, increasing.
    pub points: Vec<f64>,
    /// Weights, which include the source's density.
    pub weights: Vec<f64>,
}

impl Nodes {
    /// Nodes on `[from, to]`, dense near thresholds and sparse where all bits are certain.
    ///
    /// Panels near a threshold have a width of `share` times its noise deviation. The number of nodes therefore depends on the number of
    /// thresholds, not on the noise.
    pub fn adapted(source: &Source, from: f64, to: f64, thresholds: &[Threshold], share: f64, rule: &Rule) -> Self {
        let mut nodes = Self::default();
        let widest = source.widest_panel();
        let mut x = from;
        while x < to {
            // The widest panel that no threshold forbids.
            let mut step = widest.min(to - x);
            for &Threshold {
                position: threshold,
                noise_deviation: noise,
            } in thresholds
            {
                let ahead = threshold - ZONE * noise - x;
                if ahead > 0.0 {
                    // A panel that is fine enough for the zone of a threshold may extend beyond it.
                    step = step.min(ahead.max(share * noise));
                } else if x < threshold + ZONE * noise {
                    step = step.min(share * noise);
                }
            }
            // Rounding must not stop the loop or leave a panel of almost no width.
            let end = if x + step >= to - 1e-12 * widest {
                to
            } else {
                (x + step).max(x + 1e-13 * widest)
            };
            nodes.points.extend(rule.on(x, end).map(|(x, _)| x));
            nodes
                .weights
                .extend(rule.on(x, end).map(|(x, w)| w * source.density(x)));
            x = end;
        }
        nodes
    }

    /// `sum w f(x)`.
    pub fn expectation(&self, f: impl Fn(f64) -> f64) -> f64 {
        self.points.iter().zip(&self.weights).map(|(&x, &w)| w * f(x)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use fewbits_numerics::normal::cdf;
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn adapted_nodes_do_not_grow_as_the_noise_vanishes() {
        let source = Source::uniform(1.0).unwrap();
        let mut last = 0;
        for noise in [0.3, 1e-3, 1e-6, 1e-9] {
            let thresholds: Vec<Threshold> = Threshold::of(&[-0.5, 0.25], noise).collect();
            let nodes = Nodes::adapted(&source, -1.0, 1.0, &thresholds, 2.0, gauss_legendre::<12>());
            assert_relative_eq!(nodes.expectation(|x| x * x), source.variance(), max_relative = 1e-13);
            let p = nodes.expectation(|x| cdf((x - 0.25) / noise));
            let integral = |u: f64| u * cdf(u) + pdf(u);
            let exact = 0.5 * noise * (integral(0.75 / noise) - integral(-1.25 / noise));
            assert_relative_eq!(p, exact, max_relative = 1e-12);
            last = nodes.points.len();
        }
        assert!(last < 600, "{last}");
    }

    #[test]
    fn scales_are_checked() {
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(Source::uniform(bad).is_err());
            assert!(Source::gaussian_with_deviation(bad).is_err());
        }
        let source = Source::uniform(1.0).unwrap();
        assert!(source.noise_deviation(f64::NAN).is_err());
        assert!(source.noise_deviation(1e6).is_err());
    }
}
