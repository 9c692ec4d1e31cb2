//! The exact filter of several numbers on a lattice.

use crate::Error;
use fewbits_densities::{Lattice, UniformGrid};
use fewbits_numerics::error::{entries, refuse};
use fewbits_numerics::normal::INV_SQRT_2PI;

/// Parts of the kernel at more standard deviations than this are below rounding.
const REACH: f64 = 8.6;

/// The step of a density on a [`Lattice`] by dynamics with Gaussian noise that is independent along the axes, for any mean and any deviations
/// that the lattice resolves: as [`PointMassFilter`](crate::PointMassFilter), for several numbers.
///
/// ```text
/// predict:  p(x) <- h sum_y p(y) prod_i N(x_i; mean_i(y), deviation_i(y))
/// ```
///
/// A step takes time in proportion to the nodes times the nodes that one of them reaches.
///
/// ```
/// use fewbits_filters::{Lattice, LatticeKernel, UniformGrid};
/// let axes = vec![UniformGrid::new(-12.0, 12.0, 0.25)?; 2];
/// let start = Lattice::normal(axes, &[1.0, 0.0], &[1.0, 0.5])?;
/// let (x, y) = (start.positions(0), start.positions(1));
/// let mean = [x.iter().zip(&y).map(|(x, y)| x + y).collect(), y.clone()];       // place and speed
/// let deviation = [vec![0.5; x.len()], vec![0.3; x.len()]];
/// let next = LatticeKernel::new(mean, deviation, &start)?.predict(&start)?;
/// let [(place, variance), _] = next.moments()[..] else { panic!() };
/// assert!((place - 1.0).abs() < 1e-9 && (variance - (1.0 + 0.25 + 0.25)).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LatticeKernel {
    means: Vec<Vec<f64>>,
    deviations: Vec<Vec<f64>>,
}

impl LatticeKernel {
    /// The dynamics by the mean and the deviation of the next state from every node: one vector per axis, in the order of the nodes.
    ///
    /// # Errors
    /// If there is not one vector per axis and one number per node, a mean is not finite, or a deviation is below the spacing of its axis or
    /// not finite.
    pub fn new(
        means: impl Into<Vec<Vec<f64>>>,
        deviations: impl Into<Vec<Vec<f64>>>,
        lattice: &Lattice,
    ) -> Result<Self, Error> {
        let (means, deviations) = (means.into(), deviations.into());
        let (axes, nodes) = (lattice.axes(), lattice.density().len());
        entries("means", means.len(), axes.len())?;
        entries("deviations", deviations.len(), axes.len())?;
        for ((means, deviations), axis) in means.iter().zip(&deviations).zip(axes) {
            entries("means", means.len(), nodes)?;
            entries("deviations", deviations.len(), nodes)?;
            if let Some(mean) = means.iter().find(|mean| !mean.is_finite()) {
                return refuse("means", mean, "finite numbers");
            }
            let spacing = axis.spacing();
            if let Some(bad) = deviations.iter().find(|s| !(s.is_finite() && **s >= spacing)) {
                return refuse(
                    "deviations",
                    bad,
                    format!("at least {spacing}, the distance between nodes on this axis"),
                );
            }
        }
        Ok(Self { means, deviations })
    }

    /// Time update. Mass that leaves the lattice is lost; the rest is normalised.
    ///
    /// # Errors
    /// If the belief has other nodes than the lattice of the filter; [`Error::Impossible`] if no mass remains.
    pub fn predict(&self, belief: &Lattice) -> Result<Lattice, Error> {
        let axes = belief.axes();
        entries("belief", axes.len(), self.means.len())?;
        let nodes = belief.density().len();
        entries("belief", nodes, self.means.first().map_or(0, Vec::len))?;
        let mut next = vec![0.0; nodes];
        // Weights of the nodes that the present one reaches, along each axis, and the first of them.
        let mut reached: Vec<(usize, Vec<f64>)> = vec![(0, Vec::new()); axes.len()];
        for (node, mass) in belief.density().iter().enumerate().filter(|(_, mass)| **mass > 0.0) {
            for (i, (first, weights)) in reached.iter_mut().enumerate() {
                let (mean, deviation) = (self.means[i][node], self.deviations[i][node]);
                let range = axes[i].indices_within(mean - REACH * deviation, mean + REACH * deviation);
                *first = range.start;
                weights.clear();
                weights.extend(range.map(|k| {
                    let z = (axes[i].node(k) - mean) / deviation;
                    axes[i].spacing() * INV_SQRT_2PI / deviation * (-0.5 * z * z).exp()
                }));
            }
            spread(&mut next, *mass, &reached, axes);
        }
        belief.with_density(next)
    }
}

/// Adds `mass` times the product of the weights to the nodes that are reached, axis by axis.
fn spread(next: &mut [f64], mass: f64, reached: &[(usize, Vec<f64>)], axes: &[UniformGrid]) {
    let (Some(((first, weights), reached)), Some((axis, axes))) = (reached.split_first(), axes.split_first()) else {
        return;
    };
    if axes.is_empty() {
        for (p, weight) in next[*first..].iter_mut().zip(weights) {
            *p += mass * weight;
        }
        return;
    }
    let block = next.len() / axis.points();
    for (part, weight) in next.chunks_exact_mut(block).skip(*first).zip(weights) {
        spread(part, mass * weight, reached, axes);
    }
}
