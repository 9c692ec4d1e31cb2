//! The covariance of a density estimate's kernel: rules, shapes and shrinkage.

use crate::Error;
use crate::particles::Particles;
use fewbits_core::Belief;
use fewbits_numerics::error::{non_negative, positive, refuse};
use nalgebra::SMatrix;
use serde::{Deserialize, Serialize};

/// The kernel's width in standard deviations of the sample, as a function of its size `n` and the dimension `d`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub enum BandwidthRule {
    /// `(4 / ((d + 2) n))^(1 / (d + 4))`: best in mean integrated squared error if the density is Gaussian (Silverman 1986, 4.14).
    Silverman,
    /// `n^(-1 / (d + 4))` (Scott 1992).
    Scott,
    /// `n^-exponent`. The variance factor `N^(-1/6)` of Chapter 3 of the message-passing thesis is exponent `1/12`.
    Power {
        /// The exponent, 0 or above.
        exponent: f64,
    },
}

/// Which sample size `n` a rule is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum SampleSize {
    /// The number of particles.
    Count,
    /// The effective sample size `1 / sum w^2`.
    Effective,
}

/// The kernel's shape.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Shape {
    /// Diagonal, from the weighted standard deviation of each axis.
    Diagonal,
    /// Proportional to the weighted covariance. All error measures are then invariant under linear maps of the state.
    Full,
}

/// A bandwidth rule: kernel covariance `H = (factor h)^2 C`, with `C` the weighted covariance of the particles or its diagonal.
///
/// ```
/// use fewbits_densities::{Bandwidth, Particles};
/// let sample = Particles::uniform([vec![-1.0, 1.0, -1.0, 1.0], vec![3.0, 3.0, 1.0, 1.0]])?;
/// let kernel = Bandwidth::default().kernel(&sample)?;
/// // In two dimensions Silverman's rule is n^(-1/6) standard deviations.
/// assert!((kernel[(0, 0)] - 4.0_f64.powf(-1.0 / 3.0)).abs() < 1e-15);
/// # Ok::<(), fewbits_densities::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bandwidth {
    /// The rule.
    pub rule: BandwidthRule,
    /// Which sample size it is given.
    pub size: SampleSize,
    /// The kernel's shape.
    pub shape: Shape,
    /// Multiple of the rule's standard deviation, above 0.
    pub factor: f64,
    /// Smallest standard deviation of the kernel along each axis, in units of the state. It lets coincident particles have a kernel.
    /// With 0, particles that all coincide give an error.
    pub floor: f64,
}

impl Default for Bandwidth {
    /// Silverman's rule with the number of particles, diagonal, factor 1, no floor.
    fn default() -> Self {
        Self {
            rule: BandwidthRule::Silverman,
            size: SampleSize::Count,
            shape: Shape::Diagonal,
            factor: 1.0,
            floor: 0.0,
        }
    }
}

/// Kernel variances below this multiple of the largest one are raised to it, so that an axis without spread gives no singular kernel.
const RELATIVE_FLOOR: f64 = 1e-12;

impl Bandwidth {
    /// Standard deviation of the kernel for a sample of standard deviation 1: `factor h(n, d)`.
    ///
    /// # Errors
    /// If the factor is not above 0, the exponent is negative, or `n` is not above 0.
    pub fn width<const D: usize>(&self, n: f64) -> Result<f64, Error> {
        positive("factor", self.factor)?;
        positive("n", n)?;
        let d = D as f64;
        let h = match self.rule {
            BandwidthRule::Silverman => (4.0 / ((d + 2.0) * n)).powf(1.0 / (d + 4.0)),
            BandwidthRule::Scott => n.powf(-1.0 / (d + 4.0)),
            BandwidthRule::Power { exponent } => n.powf(-non_negative("exponent", exponent)?),
        };
        Ok(self.factor * h)
    }

    fn size_of<const D: usize>(&self, particles: &Particles<D>) -> f64 {
        match self.size {
            SampleSize::Count => particles.len() as f64,
            SampleSize::Effective => particles.effective_sample_size(),
        }
    }

    /// The kernel covariance for these particles, with the sample size `n` that [`size`](Self::size) selects.
    ///
    /// # Errors
    /// As [`width`](Self::width); or if the particles coincide and there is no [`floor`](Self::floor).
    pub fn kernel<const D: usize>(&self, particles: &Particles<D>) -> Result<SMatrix<f64, D, D>, Error> {
        self.kernel_for(particles, self.size_of(particles))
    }

    /// The kernel covariance for these particles and a given sample size `n`, for instance that before some particles were dropped.
    ///
    /// # Errors
    /// As [`kernel`](Self::kernel).
    pub fn kernel_for<const D: usize>(&self, particles: &Particles<D>, n: f64) -> Result<SMatrix<f64, D, D>, Error> {
        let width = self.width::<D>(n)?;
        non_negative("floor", self.floor)?;
        let covariance = particles.covariance();
        let mut kernel = match self.shape {
            Shape::Diagonal => SMatrix::from_diagonal(&covariance.diagonal()),
            Shape::Full => covariance,
        } * (width * width);
        let largest = kernel.diagonal().max();
        let floor = (self.floor * self.floor).max(RELATIVE_FLOOR * largest);
        if floor == 0.0 {
            let expected = "particles that do not all coincide, or a bandwidth with a floor";
            return refuse("particles", "a sample without spread", expected);
        }
        for k in 0..D {
            // Adding to a diagonal entry keeps a matrix positive semidefinite.
            kernel[(k, k)] = match self.shape {
                Shape::Diagonal => kernel[(k, k)].max(floor),
                Shape::Full if self.floor > 0.0 || covariance[(k, k)] == 0.0 => kernel[(k, k)] + floor,
                Shape::Full => kernel[(k, k)],
            };
        }
        Ok(kernel)
    }

    /// Liu and West's shrinkage: moves the particles towards their mean so that, with the kernel added, the estimate has the variances of
    /// the sample (or its covariance, if the kernel has full shape). Without it every estimate is wider than its sample, and the estimates
    /// of a filter widen at each step.
    ///
    /// Per axis `x <- m + sqrt(1 - H_kk / C_kk) (x - m)`. If `H_kk >= C_kk`, all particles have the mean as that coordinate.
    pub fn shrunk<const D: usize>(&self, particles: &Particles<D>, kernel: &SMatrix<f64, D, D>) -> Particles<D> {
        let mean = particles.mean();
        let covariance = particles.covariance_about(&mean);
        let mut shrunk = particles.clone();
        for (k, column) in shrunk.columns_mut().into_iter().enumerate() {
            let share = if covariance[(k, k)] > 0.0 {
                kernel[(k, k)] / covariance[(k, k)]
            } else {
                1.0
            };
            let scale = (1.0 - share).max(0.0).sqrt();
            column.iter_mut().for_each(|x| *x = mean[k] + scale * (*x - mean[k]));
        }
        shrunk
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn sample(scale: f64) -> Particles<2> {
        let x: Vec<f64> = (0..50).map(|i| scale * (i as f64 * 0.7).sin()).collect();
        let y: Vec<f64> = (0..50)
            .map(|i| scale * (0.3 * (i as f64 * 0.7).sin() + (i as f64 * 1.9).cos()))
            .collect();
        let logs: Vec<f64> = (0..50).map(|i| (i as f64 * 0.37).sin()).collect();
        Particles::new([x, y], &logs).unwrap()
    }

    #[test]
    fn shrinkage_keeps_the_variances_of_the_sample() {
        for shape in [Shape::Diagonal, Shape::Full] {
            let rule = Bandwidth {
                shape,
                ..Bandwidth::default()
            };
            let p = sample(1.0);
            let h = rule.kernel(&p).unwrap();
            let total = rule.shrunk(&p, &h).covariance() + h;
            let gap = total - p.covariance();
            assert!(gap.diagonal().amax() < 1e-14);
            assert!(shape == Shape::Diagonal || gap.amax() < 1e-14);
        }
    }

    #[test]
    fn kernels_scale_with_the_unit() {
        let rule = Bandwidth {
            size: SampleSize::Effective,
            ..Bandwidth::default()
        };
        let reference = rule.kernel(&sample(1.0)).unwrap();
        for scale in [1e-4, 1e4] {
            let kernel = rule.kernel(&sample(scale)).unwrap() / (scale * scale);
            assert!((kernel - reference).amax() < 1e-12);
        }
    }

    #[test]
    fn coincident_particles_need_a_floor() {
        let p = Particles::uniform([vec![2.0; 4], vec![-1.0; 4]]).unwrap();
        assert!(Bandwidth::default().kernel(&p).is_err());
        let kernel = Bandwidth {
            floor: 0.1,
            ..Bandwidth::default()
        }
        .kernel(&p)
        .unwrap();
        assert!((kernel[(0, 0)] - 0.01).abs() < 1e-15);
        let line = Particles::uniform([vec![2.0, 3.0], vec![-1.0, -1.0]]).unwrap();
        assert!(Bandwidth::default().kernel(&line).unwrap()[(1, 1)] > 0.0);
    }

    #[test]
    fn rules_are_the_published_ones() {
        let with = |rule| Bandwidth {
            rule,
            factor: 1.3,
            ..Bandwidth::default()
        };
        // Silverman's constants: 1.06 in one dimension, 0.97 in three.
        let silverman = with(BandwidthRule::Silverman);
        assert!(
            (silverman.width::<1>(200.0).unwrap() / (1.3 * 1.059_223_841_048_812 * 200.0_f64.powf(-0.2)) - 1.0).abs()
                < 1e-14
        );
        assert!(
            (silverman.width::<3>(200.0).unwrap() / (1.3 * 0.968_625_085_926_997 * 200.0_f64.powf(-1.0 / 7.0)) - 1.0)
                .abs()
                < 1e-12
        );
        assert!((with(BandwidthRule::Scott).width::<3>(128.0).unwrap() - 1.3 * 0.5).abs() < 1e-14);
        assert!((with(BandwidthRule::Power { exponent: 0.25 }).width::<3>(81.0).unwrap() - 1.3 / 3.0).abs() < 1e-14);
        assert!(
            with(BandwidthRule::Power { exponent: -0.1 }).width::<3>(81.0).is_err()
                && silverman.width::<1>(0.0).is_err()
        );
        assert!(
            (with(BandwidthRule::Scott).width::<2>(500.0).unwrap() - silverman.width::<2>(500.0).unwrap()).abs()
                < 1e-15
        );
        let none = Bandwidth {
            factor: 0.0,
            ..silverman
        };
        assert!(none.width::<2>(5.0).is_err());
        let p = sample(1.0);
        let full = Bandwidth {
            shape: Shape::Full,
            size: SampleSize::Effective,
            ..silverman
        };
        let width = full.width::<2>(p.effective_sample_size()).unwrap();
        assert!((full.kernel(&p).unwrap() - p.covariance() * (width * width)).amax() < 1e-15);
        assert!(
            (full.kernel_for(&p, 9.0).unwrap() - p.covariance() * (1.3_f64.powi(2) * 9.0_f64.powf(-1.0 / 3.0))).amax()
                < 1e-14
        );
        let diagonal = silverman.kernel(&p).unwrap();
        assert!(
            diagonal[(0, 1)] == 0.0
                && (diagonal[(1, 1)] / p.covariance()[(1, 1)] - 1.69 * 50.0_f64.powf(-1.0 / 3.0)).abs() < 1e-14
        );
    }

    #[test]
    fn floors_are_standard_deviations() {
        let p = sample(1.0);
        let raised = |shape, floor| {
            Bandwidth {
                shape,
                floor,
                ..Bandwidth::default()
            }
            .kernel(&p)
        };
        let (plain, full) = (raised(Shape::Diagonal, 0.0).unwrap(), raised(Shape::Full, 0.0).unwrap());
        let (least, most) = (plain[(0, 0)].min(plain[(1, 1)]), plain[(0, 0)].max(plain[(1, 1)]));
        let between = 0.5 * (least + most);
        let kernel = raised(Shape::Diagonal, between.sqrt()).unwrap();
        assert!((kernel.min() - 0.0).abs() < 1e-15 && (kernel[(0, 0)].min(kernel[(1, 1)]) - between).abs() < 1e-15);
        assert_eq!(kernel[(0, 0)].max(kernel[(1, 1)]), most);
        assert!((raised(Shape::Full, 0.3).unwrap() - full - SMatrix::identity() * 0.09).amax() < 1e-15);
        assert!(raised(Shape::Full, -0.3).is_err());
        // An axis without spread gets a millionth of the others' deviation.
        let line = Particles::uniform([vec![2.0, 3.0], vec![-1.0, -1.0]]).unwrap();
        for shape in [Shape::Diagonal, Shape::Full] {
            let rule = Bandwidth {
                shape,
                ..Bandwidth::default()
            };
            let kernel = rule.kernel(&line).unwrap();
            assert!((kernel[(1, 1)] / kernel[(0, 0)] / 1e-12 - 1.0).abs() < 1e-12 && kernel[(0, 1)] == 0.0);
            // Narrower than its kernel an axis collapses to its mean.
            let shrunk = rule.shrunk(&line, &SMatrix::from_diagonal(&nalgebra::Vector2::new(0.16, 1.0)));
            assert!(
                (shrunk.columns()[0][1] - 2.5 - 0.5 * 0.36_f64.sqrt()).abs() < 1e-15
                    && shrunk.columns()[1] == [-1.0, -1.0]
            );
        }
    }
}
