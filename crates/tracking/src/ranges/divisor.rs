//! The step of which all numbers are multiples.

/// What is left of a division is nothing if it is less than this share.
const NOTHING: f64 = 1e-6;

/// The largest number of which both are multiples (Euclid). Zero is a multiple of every number, and a divisor `a` that is negligible beside `b` stays.
pub(crate) fn common_divisor(a: f64, b: f64) -> f64 {
    let least = NOTHING * a.max(b);
    if a > 0.0 && a < least {
        return a;
    }
    let (mut a, mut b) = (a, b);
    while b > least {
        let rest = a % b;
        // Rounding may leave nearly a whole divisor.
        (a, b) = (b, if b - rest < least { 0.0 } else { rest });
    }
    a
}

#[cfg(test)]
mod tests {
    use super::common_divisor;

    #[test]
    fn decimals_have_their_step() {
        let of = |numbers: &[f64]| numbers.iter().fold(0.0, |step, x| common_divisor(step, *x));
        assert!((of(&[5.5, 11.0, 10.0, 7.5, 9.0]) - 0.5).abs() < 1e-12);
        assert!((of(&[3.27, 4.11, 12.4, 0.0]) - 0.01).abs() < 1e-4);
        assert!(of(&[3.271_828_18, 4.111_592_6, 12.434_21]) < 1e-3);
    }
}
