//! Loops compiled for the vector instructions of this machine. The results have the same bits at every width.

/// What an expression gives, compiled as with [`vectorised`].
macro_rules! wide {
    ($work:expr) => {
        $crate::vectors::vectorised(
            #[inline(always)]
            || $work,
        )
    };
}

/// As [`wide`], with [`vectorised_narrow`].
macro_rules! narrow {
    ($work:expr) => {
        $crate::vectors::vectorised_narrow(
            #[inline(always)]
            || $work,
        )
    };
}
pub(crate) use {narrow, wide};

/// Runs `work`, compiled for the widest vector instructions of this machine. Give the closure `#[inline(always)]`.
#[inline(always)]
pub(crate) fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

/// As [`vectorised`], with registers of 256 bits at most: for loops over few numbers at a time, which wider registers slow down.
#[inline(always)]
pub(crate) fn vectorised_narrow<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(target_arch = "x86_64")]
    if let Some(narrow) = pulp::x86::V3::try_new() {
        return narrow.vectorize(work);
    }
    work()
}

/// The nearest whole number, of two the one farther from zero, as `f64::round`, in instructions that exist for vectors.
#[inline(always)]
pub(crate) fn rounded(x: f64) -> f64 {
    (x + 0.499_999_999_999_999_94_f64.copysign(x)).trunc()
}

/// In doubles of this size the last bit is a one.
pub(crate) const SHIFT: f64 = 1.5 * (1_u64 << 52) as f64;

/// An integer of at most `2^51` in size as a double, in instructions that exist for vectors.
#[inline(always)]
pub(crate) fn double(x: i64) -> f64 {
    f64::from_bits(SHIFT.to_bits().wrapping_add_signed(x)) - SHIFT
}
