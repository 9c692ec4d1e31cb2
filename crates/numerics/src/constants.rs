//! Constants of the normal distribution.

/// `1 / sqrt(2 pi)`.
#[cfg(feature = "std")]
pub const INV_SQRT_2PI: f64 = 0.398_942_280_401_432_7;
/// `ln sqrt(2 pi)`.
#[cfg(feature = "std")]
pub const LN_SQRT_2PI: f64 = 0.918_938_533_204_672_7;
