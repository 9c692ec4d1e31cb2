//! Errors of this crate.

use fewbits_core::CodecError;

fewbits_numerics::errors! {
    /// What a density refuses.
    pub enum Error wraps {
        /// What a word of the core refused; [`fewbits_core::Error::Impossible`] where no probability is left.
        Core(#[from] fewbits_core::Error),
        /// A belief that does not fit its wire format, or bits that are no belief.
        Codec(#[from] CodecError),
    } and {
        /// A density is too thin for the cells allowed.
        #[error("the density needs {cells} cells or more: expected a density that fewer resolve")]
        Unresolved {
            /// Cells that the next refinement would take.
            cells: usize,
        },
        /// A density has no peak of the shape that an approximation needs.
        #[error("no Gaussian peak: {reason}")]
        NoPeak {
            /// What is wrong with the place where the search ended.
            reason: &'static str,
        },
    }
}

impl Error {
    /// No probability is left.
    pub(crate) const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}
