//! Bounds of the error after several hand-overs, from the losses of each.

use crate::mixture_codec::divergence::{Divergence, kl_from_dr, l1_from_dr};
use fewbits_numerics::LogSum;

/// The sum in the exponent of the amplification `A_i = 2 sum_{j<i}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amplification {
    /// The sum of ML, as printed.
    Ml,
    /// The sum of DR, which is never larger.
    Dr,
}

/// Bounds of the accumulated error. Those with an amplification grow exponentially and are given as natural logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// `ML <= 2 sum ml_i` (12, printed). Holds for every data sequence.
    pub ml_printed: f64,
    /// `ML <= 2 sum dr_i`, never larger than the printed bound. Holds for every data sequence.
    pub ml_from_dr: f64,
    /// `ln sum exp(A_i) kl_i`, printed as a bound of the expected KL. **False**: the inequality behind it fails for a coin.
    pub ln_kl_printed: f64,
    /// `ln sum (exp(A_i) kl_i + 2 sinh(A_i) l1_i)`, the corrected bound of the expected KL.
    pub ln_kl_corrected: f64,
    /// `ln sum 2 exp(A_i) l1_i`, the printed bound of the expected L1 (with time subscripts corrected).
    pub ln_l1_printed: f64,
    /// The same with factor 1 for the last hand-over, after which there was no data, and at most `ln 2`.
    pub ln_l1_tight: f64,
    /// `KL <= phi(2 sum dr_i)`. Holds for every data sequence.
    pub kl_from_dr: f64,
    /// `L1 <= 2 tanh(sum dr_i / 2)`. Holds for every data sequence.
    pub l1_from_dr: f64,
}

/// The bounds after the last of a sequence of hand-overs. `steps` has, for each hand-over in order, the errors of the mixture that was sent
/// against the estimate that it replaces. Without hand-overs all bounds are zero (logarithms `-inf`).
///
/// In density `p_t^i` the first `i` hand-overs were lossy and all later ones exact; `p_t^0` is exact, `p_t^t` is the actual belief.
/// Every bound is on the distance from `p_t^0` to `p_t^t` after the last hand-over.
///
/// With exact errors the bounds are exact. With plug-in errors every bound is an estimate only: ML and DR are suprema over all
/// of space, which are infinite between an estimate and a wider mixture.
pub fn bounds(steps: &[Divergence], by: Amplification) -> Bounds {
    let (mut ml, mut dr, mut exponent) = (0.0, 0.0, 0.0);
    let (mut kl_printed, mut kl_corrected) = (LogSum::default(), LogSum::default());
    let (mut l1_printed, mut l1_tight) = (LogSum::default(), LogSum::default());
    for (i, step) in steps.iter().enumerate() {
        let last = i + 1 == steps.len();
        kl_printed.add(exponent + step.kl.ln());
        kl_corrected.add(exponent + step.kl.ln());
        // 2 sinh A = e^A (1 - e^{-2A})
        kl_corrected.add(exponent + (-(-2.0 * exponent).exp_m1() * step.l1).ln());
        l1_printed.add(exponent + (2.0 * step.l1).ln());
        l1_tight.add(exponent + (if last { step.l1 } else { 2.0 * step.l1 }).ln());
        // The amplification of a hand-over sums the errors of those before it, so it is updated last.
        ml += step.ml;
        dr += step.dr;
        exponent = 2.0
            * match by {
                Amplification::Ml => ml,
                Amplification::Dr => dr,
            };
    }
    Bounds {
        ml_printed: 2.0 * ml,
        ml_from_dr: 2.0 * dr,
        ln_kl_printed: kl_printed.value(),
        ln_kl_corrected: kl_corrected.value(),
        ln_l1_printed: l1_printed.value(),
        ln_l1_tight: l1_tight.value().min(std::f64::consts::LN_2),
        kl_from_dr: kl_from_dr(dr),
        l1_from_dr: l1_from_dr(dr),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_by_hand() {
        let step = |ml, dr, kl, l1| Divergence { ml, dr, kl, l1 };
        let steps = [step(0.3, 0.2, 0.01, 0.1), step(0.4, 0.25, 0.02, 0.15)];
        let b = bounds(&steps, Amplification::Ml);
        let a: f64 = 0.6;
        assert!((b.ml_printed - 1.4).abs() < 1e-15 && (b.ml_from_dr - 0.9).abs() < 1e-15);
        assert!((b.ln_kl_printed.exp() - (0.01 + a.exp() * 0.02)).abs() < 1e-14);
        assert!((b.ln_kl_corrected.exp() - (0.01 + a.exp() * 0.02 + 2.0 * a.sinh() * 0.15)).abs() < 1e-14);
        assert!((b.ln_l1_printed.exp() - (0.2 + 2.0 * a.exp() * 0.15)).abs() < 1e-14);
        assert!((b.ln_l1_tight.exp() - (0.2 + a.exp() * 0.15)).abs() < 1e-14);
        assert!(bounds(&steps, Amplification::Dr).ln_kl_corrected < b.ln_kl_corrected);
    }

    #[test]
    fn hundreds_of_steps_do_not_overflow_and_none_is_nothing() {
        let step = Divergence {
            ml: 4.0,
            dr: 2.0,
            kl: 0.1,
            l1: 0.2,
        };
        let b = bounds(&[step; 500], Amplification::Ml);
        assert!(b.ln_kl_printed > 3000.0 && b.ln_kl_corrected.is_finite() && b.l1_from_dr <= 2.0);
        let none = bounds(&[], Amplification::Ml);
        assert_eq!((none.ml_printed, none.kl_from_dr, none.ln_kl_printed), (0.0, 0.0, f64::NEG_INFINITY));
    }
}
