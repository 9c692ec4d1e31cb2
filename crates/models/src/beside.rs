//! Models in continuous time side by side.

use crate::Error;
use crate::continuous::ContinuousLinear;
use fewbits_numerics::error::refuse;
use nalgebra::{SMatrix, SVector};

impl<const D: usize> ContinuousLinear<D> {
    /// Two models side by side, independent of each other: the coordinates of `first`, then those of `second`. `D` is the sum of theirs.
    ///
    /// # Errors
    /// If `D` is another number.
    pub fn beside<const A: usize, const B: usize>(
        first: &ContinuousLinear<A>,
        second: &ContinuousLinear<B>,
    ) -> Result<Self, Error> {
        if A + B != D {
            return refuse("dimension", D, format!("{A} + {B}"));
        }
        let (mut drift, mut density) = (SMatrix::<f64, D, D>::zeros(), SMatrix::<f64, D, D>::zeros());
        let mut offset = SVector::<f64, D>::zeros();
        drift.view_mut((0, 0), (A, A)).copy_from(first.drift());
        drift.view_mut((A, A), (B, B)).copy_from(second.drift());
        density.view_mut((0, 0), (A, A)).copy_from(first.density());
        density.view_mut((A, A), (B, B)).copy_from(second.density());
        offset.rows_mut(0, A).copy_from(first.offset());
        offset.rows_mut(A, B).copy_from(second.offset());
        Self::new(drift, offset, density)
    }
}
