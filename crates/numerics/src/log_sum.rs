//! The logarithm of a sum of exponentials whose terms arrive one after the other.

/// `ln sum exp(term)`, without overflow. For terms in a slice see [`log_sum_exp`](crate::kernels::log_sum_exp).
///
/// ```
/// let sum: fewbits_numerics::LogSum = [1000.0, 1000.0, f64::NEG_INFINITY].into_iter().collect();
/// assert_eq!(sum.value(), 1000.0 + 2.0_f64.ln());
/// ```
#[derive(Debug, Clone, Copy)]
pub struct LogSum {
    largest: f64,
    /// Sum of all terms, divided by the exponential of the largest.
    scaled: f64,
}

impl Default for LogSum {
    fn default() -> Self {
        Self {
            largest: f64::NEG_INFINITY,
            scaled: 0.0,
        }
    }
}

impl LogSum {
    /// Adds `exp(term)`. Minus infinity adds nothing; NaN is taken as minus infinity; infinity makes the sum infinite.
    #[inline]
    pub fn add(&mut self, term: f64) {
        self.add_with_share(term);
    }

    /// Adds `exp(term)` and returns `exp(term) / sum`, where `sum` includes this term; 0 if nothing was added.
    #[inline]
    pub fn add_with_share(&mut self, term: f64) -> f64 {
        if term > self.largest {
            // The sum so far is now relative to the new largest term.
            self.scaled = self.scaled * (self.largest - term).exp() + 1.0;
            self.largest = term;
            1.0 / self.scaled
        } else if term > f64::NEG_INFINITY && self.largest < f64::INFINITY {
            let added = (term - self.largest).exp();
            self.scaled += added;
            added / self.scaled
        } else {
            0.0
        }
    }

    /// The logarithm of the sum; `-inf` before the first term.
    #[inline]
    pub fn value(&self) -> f64 {
        if self.largest.is_finite() {
            self.largest + self.scaled.ln()
        } else {
            self.largest
        }
    }
}

impl FromIterator<f64> for LogSum {
    fn from_iter<I: IntoIterator<Item = f64>>(terms: I) -> Self {
        let mut sum = Self::default();
        terms.into_iter().for_each(|term| sum.add(term));
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::LogSum;

    /// Terms whose exponentials are no numbers, in either order.
    #[test]
    fn terms_of_any_size_are_summed_with_their_shares() {
        for (terms, last) in [
            ([1000.0, 999.0, -1000.0], 0.0),
            ([-1000.0, 999.0, 1000.0], 1.0 / (1.0 + (-1.0_f64).exp())),
            ([999.0, 1000.0, f64::NEG_INFINITY], 0.0),
        ] {
            let mut sum = LogSum::default();
            let shares = terms.map(|term| sum.add_with_share(term));
            assert!((sum.value() - 1000.0 - (-1.0_f64).exp().ln_1p()).abs() < 1e-12);
            assert!((shares[2] - last).abs() < 1e-12 && shares[0] == 1.0);
        }
    }

    #[test]
    fn infinities_and_nan_do_not_spread() {
        let of = |terms: &[f64]| terms.iter().copied().collect::<LogSum>().value();
        assert_eq!(of(&[]), f64::NEG_INFINITY);
        assert_eq!(of(&[f64::NEG_INFINITY, f64::NAN]), f64::NEG_INFINITY);
        assert_eq!(of(&[0.0, f64::INFINITY, 3.0, f64::INFINITY]), f64::INFINITY);
        assert!((of(&[-1e4, -1e4 - 1.0, f64::NAN]) + 1e4 - (1.0 + (-1.0_f64).exp()).ln()).abs() < 1e-12);
    }
}
