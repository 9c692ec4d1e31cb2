//! Vectorised kernels.
//!
//! A particle filter evaluates the same likelihood at ten thousand points, so what counts is the cost per element of a whole
//! slice. The central choice: **every function exists once, as a scalar function without branches, calls or tables**
//! ([`scalar`]), and a sweep is a plain loop over it, compiled for each instruction set and dispatched once per slice
//! ([`vectorised`]). The compiler turns the loop into vector code because nothing in it forbids that; selects take the place
//! of branches, so both sides of a case distinction are computed and one is kept; single calls of [`normal`](crate::normal) branch
//! where that saves work. The gain: scalar functions, sweeps of any length and machines of any width give **the same bits**, since
//! elementwise arithmetic is the same in a vector register, nothing is contracted to fused multiply-adds, and reductions run in
//! a fixed number of lanes.
//!
//! | kernel | result | bound in units of the last place |
//! |---|---|---|
//! | [`exp`], [`ln`] | in place | 1 (subnormal results 1.5) |
//! | [`cdf`], [`log_cdf`] | in place | 6 |
//! | [`interval`], [`log_interval`] | in place of the lower edges | 10, 8 |
//! | [`sum`], [`dot`], [`largest`], [`largest_number`], [`log_sum_exp`] | a number | as a sum in eight lanes |
//! | [`StandardNormals`] | independent draws, exact in law | |
//! | [`exp_minus`] | weights from log weights, with their sum and sum of squares | 1 each |
//!
//! The bounds are measured against values with 40 digits, in `tests/it/kernels.rs`: tails, subnormal numbers, infinities and
//! NaN included.
//!
//! A factor writes its own sweep the same way:
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

/// The functions of the slices one element at a time: no branches, no calls, always inlined. For loops under [`vectorised`];
/// elsewhere [`normal`](crate::normal) has the same functions under the same names.
pub mod scalar {
    #[cfg(feature = "std")]
    pub use super::cell::{WIDE, interval, interval_wide, log_interval, log_interval_wide};
    pub use super::elementary::{exp, ln};
    #[cfg(feature = "std")]
    pub use super::power_of_half::power_of_half;
    #[cfg(feature = "std")]
    pub use super::tail::{cdf, erfcx, inverse_mills, log_cdf, pdf};
}

/// Runs `work` compiled for the widest vector instructions of this machine.
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

/// As [`vectorised`], with registers of 256 bits at most: for loops over few numbers at a time, which wider registers slow down.
#[inline(always)]
pub fn vectorised_narrow<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    if let Some(narrow) = pulp::x86::V3::try_new() {
        return narrow.vectorize(work);
    }
    work()
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
                    *lower = scalar::$name(*lower, *upper);
                }
            });
        }
    )*};
}

#[cfg(feature = "std")]
over_cells! {
    /// `Phi(upper_i) - Phi(lower_i)` over the shorter of the two, written over the lower edges.
    interval
    /// The same results to the bit. Precondition: no cell is narrower than [`scalar::WIDE`]; skips the series for narrow cells.
    interval_wide
    /// `ln(Phi(upper_i) - Phi(lower_i))` over the shorter of the two, written over the lower edges.
    log_interval
    /// The same results to the bit. Precondition: no cell is narrower than [`scalar::WIDE`]; skips the series for narrow cells.
    log_interval_wide
}
