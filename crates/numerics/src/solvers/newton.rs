//! A root by Newton's method inside a bracket.

/// Upper bound of bisections at the middle of the bracket. Newton's method converges long before, unless the root is next to zero.
const MAX_BISECTIONS: usize = 60;
/// After so many steps the last point is returned. Bisections after the first [`MAX_BISECTIONS`] halve the number of doubles in the bracket;
/// 64 of them leave one double.
const MAX_STEPS: usize = 200;

/// The root of an increasing function between `lower` and `upper`. Newton's method from `start`; a step that would leave the current
/// bracket is replaced by a bisection, so that the method always converges.
///
/// `f` returns the value and the derivative. The iteration ends when a step is at most `tolerance`. If `f` does not change its
/// sign, the result is the end of the bracket nearest to a root. A value of NaN is treated as positive (too far right).
///
/// ```
/// use fewbits_numerics::newton::increasing;
/// let root = increasing(|x| (x.exp() - 3.0, x.exp()), 0.0, 5.0, 2.5, 1e-15);
/// assert!((root - 3f64.ln()).abs() < 1e-15);
/// ```
pub fn increasing(mut f: impl FnMut(f64) -> (f64, f64), lower: f64, upper: f64, start: f64, tolerance: f64) -> f64 {
    let (mut low, mut high, mut x) = (lower, upper, start);
    for step in 0..MAX_STEPS {
        let (value, slope) = f(x);
        if value < 0.0 {
            low = x;
        } else {
            high = x;
        }
        let newton = x - value / slope;
        let next = if newton > low && newton < high {
            newton
        } else if step < MAX_BISECTIONS {
            0.5 * low + 0.5 * high
        } else {
            from_rank(((i128::from(rank(low)) + i128::from(rank(high))) / 2) as i64)
        };
        if (next - x).abs() <= tolerance {
            return next;
        }
        x = next;
    }
    x
}

/// The position of a double in the order of all doubles; that of zero is zero, and neighbours differ by one.
fn rank(x: f64) -> i64 {
    let bits = (x.to_bits() & (u64::MAX >> 1)) as i64;
    if x.is_sign_negative() { -bits } else { bits }
}

/// The double at a position; inverse of [`rank`].
fn from_rank(rank: i64) -> f64 {
    let size = f64::from_bits(rank.unsigned_abs());
    if rank < 0 { -size } else { size }
}

#[cfg(test)]
mod tests {
    use super::increasing;

    /// Defect: a hundred bisections by the middle of [0, 1] end at 4e-31.
    #[test]
    fn roots_next_to_zero_are_found_to_the_last_place() {
        let step = |at: f64| increasing(|x| (if x < at { -1.0 } else { 1.0 }, 0.0), -1.0, 1.0, 0.5, 0.0);
        for at in [1e-40, -1e-40, 3e-300, 5e-324, -5e-324, 0.3, -0.7] {
            let found = step(at);
            assert!((found - at).abs() <= f64::EPSILON * at.abs() + 5e-324, "{at}: {found}");
        }
        assert!(step(0.0).abs() <= 5e-324);
    }

    /// Quadratic convergence, with the bracket only where Newton's method alone would leave it.
    #[test]
    fn few_steps_are_enough() {
        for (start, most) in [(2.5, 8), (0.2, 9), (4.9, 11)] {
            let mut calls = 0;
            let f = |x: f64| {
                calls += 1;
                assert!((-0.3..=5.0).contains(&x));
                (x.exp() - 3.0, x.exp())
            };
            assert!((increasing(f, -0.3, 5.0, start, 1e-14) - 3f64.ln()).abs() < 1e-15);
            assert!(calls <= most, "{calls} from {start}");
        }
        // The tolerance limits the step, so a large tolerance ends at once.
        let mut calls = 0;
        let loose = increasing(
            |x| {
                calls += 1;
                (x - 0.7, 1.0)
            },
            -3.0,
            5.0,
            0.75,
            0.1,
        );
        assert!(calls == 1 && (loose - 0.7).abs() < 1e-15);
    }

    #[test]
    fn roots_are_found_from_bad_starts_and_at_the_ends() {
        // Newton alone diverges on the arc tangent from here.
        let root = increasing(|x| ((x - 1.0).atan(), 1.0 / (1.0 + (x - 1.0) * (x - 1.0))), -50.0, 90.0, 80.0, 1e-14);
        assert!((root - 1.0).abs() < 1e-14);
        // No slope at all: bisection.
        let step = |x: f64| (if x < 0.3 { -1.0 } else { 1.0 }, 0.0);
        assert!((increasing(step, 0.0, 1.0, 0.5, 1e-15) - 0.3).abs() < 1e-14);
        assert!((increasing(|_| (1.0, 0.0), 0.0, 1.0, 0.5, 1e-12)).abs() < 1e-11);
        assert!((increasing(|_| (-1.0, 0.0), 0.0, 1.0, 0.5, 1e-12) - 1.0).abs() < 1e-11);
        assert!(increasing(|_| (f64::NAN, f64::NAN), 0.0, 1.0, 0.5, 1e-12).is_finite());
    }
}
