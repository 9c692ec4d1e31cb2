//! What the losses of all hand-overs say about the error at the end.

use fewbits_densities::{KernelEstimate, Mixture};
use fewbits_mixture_codec::divergence::{kl_from_dr, l1_from_dr};
use fewbits_mixture_codec::{PlugIn, plug_in};
use fewbits_numerics::LogSum;

/// Errors of one hand-over: of the mixture that was sent against the estimate it stands for.
///
/// If they are exact, so are the bounds. Plug-in errors make every bound an estimate of itself: ML and DR are suprema over all
/// of space, and between an estimate and a wider mixture they are infinite there.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct StepError {
    /// `sup abs(ln p/q)`.
    pub ml: f64,
    /// Half the range of `ln p/q`.
    pub dr: f64,
    /// `int p ln p/q` in nats, 0 or above.
    pub kl: f64,
    /// `int abs(p - q)`.
    pub l1: f64,
}

impl From<PlugIn> for StepError {
    fn from(error: PlugIn) -> Self {
        Self {
            ml: error.ml_plugin,
            dr: error.dr_plugin,
            kl: error.kl_plugin.max(0.0),
            l1: error.l1_plugin,
        }
    }
}

impl StepError {
    /// Plug-in errors of a mixture against the estimate it stands for.
    pub fn plug_in<const D: usize>(estimate: &KernelEstimate<D>, sent: &Mixture<D>) -> Self {
        plug_in::plug_in(estimate, sent).into()
    }
}

/// Which sum stands in the exponent of the amplification `A_i = 2 sum_{j<i}`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Amplification {
    /// Of ML, as printed.
    Ml,
    /// Of DR, never larger.
    Dr,
}

/// The hand-overs so far, first to last.
///
/// Density `p_t^i`: the first `i` hand-overs were lossy, all after them exact; `p_t^0` is exact, `p_t^t` what is really known.
/// Every bound is on the distance from `p_t^0` to `p_t^t` after the last hand-over.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Accounting {
    steps: Vec<StepError>,
}

/// Bounds on the accumulated error. Those with an amplification grow exponentially and are given as natural logarithms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// `ML <= 2 sum ml_i` (12, printed). For every data sequence.
    pub ml_printed: f64,
    /// `ML <= 2 sum dr_i`: never worse. For every data sequence.
    pub ml_from_dr: f64,
    /// `ln sum exp(A_i) kl_i`, as printed for the expected KL. **False**: the accumulation it rests on fails on a coin.
    pub ln_kl_printed: f64,
    /// `ln sum (exp(A_i) kl_i + 2 sinh(A_i) l1_i)`, the corrected bound of the expected KL.
    pub ln_kl_corrected: f64,
    /// `ln sum 2 exp(A_i) l1_i`, printed for the expected L1 (time subscripts corrected).
    pub ln_l1_printed: f64,
    /// The same with factor 1 for the last hand-over, after which no data came, and never above `ln 2`.
    pub ln_l1_tight: f64,
    /// `KL <= phi(2 sum dr_i)`. For every data sequence.
    pub kl_from_dr: f64,
    /// `L1 <= 2 tanh(sum dr_i / 2)`. For every data sequence.
    pub l1_from_dr: f64,
}

impl Accounting {
    /// No hand-over yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a hand-over.
    pub fn push(&mut self, error: StepError) {
        self.steps.push(error);
    }

    /// The hand-overs.
    pub fn steps(&self) -> &[StepError] {
        &self.steps
    }

    /// The bounds after the last hand-over; all zero (logarithms `-inf`) before the first.
    pub fn bounds(&self, by: Amplification) -> Bounds {
        let (mut ml, mut dr, mut exponent) = (0.0, 0.0, 0.0);
        let (mut kl_printed, mut kl_corrected) = (LogSum::default(), LogSum::default());
        let (mut l1_printed, mut l1_tight) = (LogSum::default(), LogSum::default());
        for (i, step) in self.steps.iter().enumerate() {
            let last = i + 1 == self.steps.len();
            kl_printed.add(exponent + step.kl.ln());
            kl_corrected.add(exponent + step.kl.ln());
            // 2 sinh A = e^A (1 - e^{-2A})
            kl_corrected.add(exponent + (-(-2.0 * exponent).exp_m1() * step.l1).ln());
            l1_printed.add(exponent + (2.0 * step.l1).ln());
            l1_tight.add(exponent + (if last { step.l1 } else { 2.0 * step.l1 }).ln());
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
}

impl FromIterator<StepError> for Accounting {
    fn from_iter<I: IntoIterator<Item = StepError>>(steps: I) -> Self {
        Self {
            steps: steps.into_iter().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_steps_by_hand() {
        let step = |ml, dr, kl, l1| StepError { ml, dr, kl, l1 };
        let account: Accounting = [step(0.3, 0.2, 0.01, 0.1), step(0.4, 0.25, 0.02, 0.15)]
            .into_iter()
            .collect();
        let b = account.bounds(Amplification::Ml);
        let a: f64 = 0.6;
        assert!((b.ml_printed - 1.4).abs() < 1e-15 && (b.ml_from_dr - 0.9).abs() < 1e-15);
        assert!((b.ln_kl_printed.exp() - (0.01 + a.exp() * 0.02)).abs() < 1e-14);
        assert!((b.ln_kl_corrected.exp() - (0.01 + a.exp() * 0.02 + 2.0 * a.sinh() * 0.15)).abs() < 1e-14);
        assert!((b.ln_l1_printed.exp() - (0.2 + 2.0 * a.exp() * 0.15)).abs() < 1e-14);
        assert!((b.ln_l1_tight.exp() - (0.2 + a.exp() * 0.15)).abs() < 1e-14);
        assert!(account.bounds(Amplification::Dr).ln_kl_corrected < b.ln_kl_corrected);
    }

    #[test]
    fn hundreds_of_steps_do_not_overflow_and_none_is_nothing() {
        let account: Accounting = (0..500)
            .map(|_| StepError {
                ml: 4.0,
                dr: 2.0,
                kl: 0.1,
                l1: 0.2,
            })
            .collect();
        let b = account.bounds(Amplification::Ml);
        assert!(b.ln_kl_printed > 3000.0 && b.ln_kl_corrected.is_finite() && b.l1_from_dr <= 2.0);
        let none = Accounting::new().bounds(Amplification::Ml);
        assert_eq!((none.ml_printed, none.kl_from_dr, none.ln_kl_printed), (0.0, 0.0, f64::NEG_INFINITY));
    }
}
