//! The box that contains the source.

use fewbits_densities::Component;

/// Half width, in standard deviations, of the box that is taken to contain a Gaussian.
const ENDS: f64 = 6.5;

/// Box that contains the source, m. The first cells cover it; later cells are limited to it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SearchBox {
    /// Lower corner.
    pub lower: [f64; 2],
    /// Upper corner.
    pub upper: [f64; 2],
}

impl SearchBox {
    /// The intersection with another box. If it is empty, the corner of the other box that is nearest.
    pub(crate) fn within(&self, other: &Self) -> Self {
        let lower: [f64; 2] = std::array::from_fn(|d| self.lower[d].max(other.lower[d]));
        let upper: [f64; 2] = std::array::from_fn(|d| self.upper[d].min(other.upper[d]));
        if lower[0] < upper[0] && lower[1] < upper[1] {
            Self { lower, upper }
        } else {
            *other
        }
    }
}

/// The box of the first two coordinates of all Gaussians.
pub(crate) fn bounds<const D: usize>(parts: &[Component<D>]) -> SearchBox {
    let mut hull = SearchBox {
        lower: [f64::INFINITY; 2],
        upper: [f64::NEG_INFINITY; 2],
    };
    for part in parts {
        for d in 0..2 {
            let reach = ENDS * part.covariance()[(d, d)].sqrt();
            hull.lower[d] = hull.lower[d].min(part.mean()[d] - reach);
            hull.upper[d] = hull.upper[d].max(part.mean()[d] + reach);
        }
    }
    hull
}
