//! Two half-lines of different diffusivity.

use fewbits_models::Error;
use fewbits_numerics::error::positive;
use std::f64::consts::PI;

/// The Green's function of one coordinate with one diffusivity above 0 and another below.
///
/// Concentration and flux are continuous at 0: a share `R = (sqrt k - sqrt k') / (sqrt k + sqrt k')` of what diffuses to the
/// boundary from the side of `k` returns as an image. Valid in one dimension only: in three the lateral spread differs between
/// the media as well.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TwoMedia {
    above: f64,
    below: f64,
}

impl TwoMedia {
    /// Diffusivities above and below 0, m^2/s.
    ///
    /// # Errors
    /// If one is not a positive number.
    pub fn new(above: f64, below: f64) -> Result<Self, Error> {
        Ok(Self {
            above: positive("above", above)?,
            below: positive("below", below)?,
        })
    }

    /// Concentration at `field`, `age` seconds after a unit mass was released at `source`, per metre.
    pub fn green(&self, field: f64, source: f64, age: f64) -> f64 {
        if age <= 0.0 {
            return 0.0;
        }
        // Seen from the side of the source.
        let (k, other, z, z0) = if source >= 0.0 {
            (self.above, self.below, field, source)
        } else {
            (self.below, self.above, -field, -source)
        };
        let roots = k.sqrt() + other.sqrt();
        if z >= 0.0 {
            let returned = (k.sqrt() - other.sqrt()) / roots;
            let spread = 4.0 * k * age;
            let (near, far) = (z - z0, z + z0);
            ((-near * near / spread).exp() + returned * (-far * far / spread).exp()) / (PI * spread).sqrt()
        } else {
            let path = z0 / k.sqrt() - z / other.sqrt();
            (-path * path / (4.0 * age)).exp() / ((PI * age).sqrt() * roots)
        }
    }
}
