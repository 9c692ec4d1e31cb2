//! Functions over whole slices in vector registers, and the scalar functions that they apply to each element.
//!
//! A particle filter evaluates the same likelihood at ten thousand points, so the cost per element of a slice matters. Design rule:
//! **every function exists once, as a scalar function without branches, calls or tables** ([`scalar`]). A sweep is a plain loop over this
//! function, compiled for each instruction set; the instruction set is chosen once per slice ([`vectorised`]). The compiler can turn
//! such a loop into vector code. Where a function has several cases, all are computed and one is kept. Single calls of
//! [`normal`](crate::normal) branch instead where that saves work. Scalar functions, sweeps of any length and machines of any register
//! width give **the same bits**: elementwise arithmetic does not depend on the width, no multiplication and addition are fused, and
//! reductions use a fixed number of lanes.
//!
//! | function | result | largest error in units of the last place |
//! |---|---|---|
//! | [`exp`], [`ln`] | in place | 1 (subnormal results 1.5) |
//! | [`cdf`], [`log_cdf`] | in place | 6 |
//! | [`interval`], [`log_interval`] | in place of the lower edges | 10, 8 |
//! | [`sum`], [`dot`], [`largest`], [`largest_number`], [`log_sum_exp`] | a number | that of a sum in eight lanes |
//! | [`StandardNormals`] | independent draws with exactly the normal distribution | |
//! | [`exp_minus`] | weights from log weights, with their sum and sum of squares | 1 each |
//!
//! The errors are measured against values with 40 digits in `tests/it/kernels.rs`, including tails, subnormal numbers, infinities and NaN.
//!
//! A likelihood of your own can be written in the same way:
//!
//! ```
//! use fewbits_numerics::kernels::{scalar, vectorised};
//! let (means, threshold, scale) = ([0.1, -2.0, 40.0], 0.5, 1.0 / 0.3);
//! let mut log_weights = [0.0; 3];
//! // The attribute guarantees that the loop is compiled for the instruction set that was dispatched to.
//! vectorised(#[inline(always)] || {
//!     for (log_weight, mean) in log_weights.iter_mut().zip(&means) {
//!         *log_weight += scalar::log_cdf((mean - threshold) * scale);
//!     }
//! });
//! assert_eq!(log_weights[1], fewbits_numerics::normal::log_cdf((-2.0 - 0.5) / 0.3));
//! ```

#[cfg(feature = "std")]
pub(crate) mod cell;
pub(crate) mod elementary;
#[cfg(feature = "std")]
mod normals;
#[cfg(feature = "std")]
mod power_of_half;
#[cfg(feature = "std")]
mod reduce;
#[cfg(feature = "std")]
pub(crate) mod tail;

#[cfg(feature = "std")]
pub use normals::StandardNormals;
#[cfg(feature = "std")]
pub use reduce::{
    ExpSums, LANES, dot, exp_minus, folded, largest, largest_number, log_sum_exp, sum, weighted_covariance,
};

/// The functions of the slices, for one element: no branches, no calls, always inlined. Use them in loops under [`vectorised`].
/// For single calls use [`normal`](crate::normal), which has functions of the same names and results.
pub mod scalar {
    #[cfg(feature = "std")]
    pub use super::cell::{WIDE, interval, log_interval};
    pub use super::elementary::{exp, ln};
    #[cfg(feature = "std")]
    pub use super::power_of_half::power_of_half;
    #[cfg(feature = "std")]
    pub use super::tail::{cdf, erfcx, log_cdf, pdf};
}

/// Runs `work`, compiled for the widest vector instructions of this machine, and returns its result.
///
/// `work` is a loop over slices that calls [`scalar`] functions; give the closure `#[inline(always)]`. Without the feature `std`
/// `work` is compiled for the target's own instructions.
#[inline(always)]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(feature = "std")]
    {
        pulp::Arch::new().dispatch(work)
    }
    #[cfg(not(feature = "std"))]
    {
        work()
    }
}

#[cfg(feature = "std")]
macro_rules! in_place {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        $(#[$doc])*
        pub fn $name(values: &mut [f64]) {
            vectorised(#[inline(always)] || {
                for value in values.iter_mut() {
                    *value = scalar::$name(*value);
                }
            });
        }
    )*};
}

#[cfg(feature = "std")]
in_place! {
    /// `exp(x)` of every element, in place.
    exp
    /// `ln(x)` of every element, in place.
    ln
    /// `Phi(x)` of every element, in place.
    cdf
    /// `ln Phi(x)` of every element, in place.
    log_cdf
}

#[cfg(feature = "std")]
macro_rules! over_cells {
    ($($(#[$doc:meta])* $name:ident)*) => {$(
        $(#[$doc])*
        pub fn $name(lower: &mut [f64], upper: &[f64]) {
            vectorised(#[inline(always)] || {
                for (lower, upper) in lower.iter_mut().zip(upper) {
                    *lower = cell::$name(*lower, *upper);
                }
            });
        }
    )*};
}

#[cfg(feature = "std")]
over_cells! {
    /// Replaces `lower_i` by `Phi(upper_i) - Phi(lower_i)`, as far as both slices go.
    interval
    /// As [`interval`], to the last bit. Precondition: no cell is narrower than [`scalar::WIDE`]; skips the series for narrow cells.
    interval_wide
    /// Replaces `lower_i` by `ln(Phi(upper_i) - Phi(lower_i))`, as far as both slices go.
    log_interval
    /// As [`log_interval`], to the last bit. Precondition: no cell is narrower than [`scalar::WIDE`]; skips the series for narrow cells.
    log_interval_wide
}
