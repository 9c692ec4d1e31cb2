//! Bessel functions of integer order, spherical ones, and the zeros of both and of their derivatives.

/// `J_m'(x)`.
pub fn jn_derivative(m: i32, x: f64) -> f64 {
    if m == 0 {
        -libm::j1(x)
    } else {
        0.5 * (libm::jn(m - 1, x) - libm::jn(m + 1, x))
    }
}

/// Here and below an argument counts as zero: one step of the recurrence must not overflow.
const NEGLIGIBLE: f64 = 1e-40;
/// Orders above the wanted one at which the downward recurrence begins: right to rounding for orders up to a few hundred.
const MILLER: u32 = 40;

/// Spherical Bessel function `j_l(x)` for `x >= 0`: upwards where that is stable, downwards (Miller) elsewhere.
pub fn spherical(l: u32, x: f64) -> f64 {
    if x < NEGLIGIBLE {
        return if l == 0 { 1.0 } else { 0.0 };
    }
    let zeroth = x.sin() / x;
    if l == 0 {
        return zeroth;
    }
    if x > f64::from(l) {
        let (mut below, mut here) = (zeroth, zeroth / x - x.cos() / x);
        for n in 1..l {
            (below, here) = (here, f64::from(2 * n + 1) / x * here - below);
        }
        return here;
    }
    // j_l(x) < x^l / (2l + 1)!!, below the smallest number long before the recurrence would overflow.
    let (mut above, mut here, mut wanted) = (0.0, 1e-290, 0.0);
    for n in (0..l + MILLER).rev() {
        if n + 1 == l {
            wanted = here;
        }
        (above, here) = (here, f64::from(2 * n + 3) / x * here - above);
        if here.abs() > 1e250 {
            (above, here, wanted) = (above * 1e-250, here * 1e-250, wanted * 1e-250);
        }
    }
    // `here` is proportional to j_0 and `above` to j_1; the larger of the two fixes the scale.
    let first = zeroth / x - x.cos() / x;
    if first.abs() > zeroth.abs() {
        wanted * (first / above)
    } else {
        wanted * (zeroth / here)
    }
}

/// `j_l'(x)` for `x > 0`.
pub fn spherical_derivative(l: u32, x: f64) -> f64 {
    if l == 0 {
        return -spherical(1, x);
    }
    spherical(l - 1, x) - f64::from(l + 1) / x * spherical(l, x)
}

/// The positive zeros of `f` up to `limit`, increasing, from `start`, where `f` is not zero.
///
/// Zeros of the functions of this file are more than 2 apart beyond their order, so that a step of 1 passes over none.
pub fn zeros(f: impl Fn(f64) -> f64, start: f64, limit: f64) -> Vec<f64> {
    let mut found = Vec::new();
    let (mut x, mut value) = (start, f(start));
    while x < limit {
        let next = x + 1.0;
        let next_value = f(next);
        if value == 0.0 {
            found.push(x);
        } else if (value > 0.0) != (next_value > 0.0) && next_value != 0.0 {
            found.push(bisect(&f, x, next, value > 0.0));
        }
        (x, value) = (next, next_value);
    }
    found.retain(|zero| *zero <= limit);
    found
}

fn bisect(f: &impl Fn(f64) -> f64, mut low: f64, mut high: f64, low_is_positive: bool) -> f64 {
    // From a step of 1 to the last place.
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if (f(middle) > 0.0) == low_is_positive {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Abramowitz and Stegun, tables 9.5, 10.1 and 10.6.
    #[test]
    fn tabulated_zeros() {
        let first = |zeros: Vec<f64>, n: usize| zeros[n - 1];
        assert!((first(zeros(libm::j0, 0.5, 20.0), 1) - 2.404_825_557_695_773).abs() < 1e-13);
        assert!((first(zeros(|x| libm::jn(3, x), 2.5, 20.0), 2) - 9.761_023_129_981_67).abs() < 1e-12);
        assert!((first(zeros(|x| jn_derivative(0, x), 0.5, 20.0), 1) - 3.831_705_970_207_512).abs() < 1e-13);
        assert!((first(zeros(|x| jn_derivative(1, x), 0.5, 20.0), 1) - 1.841_183_781_340_66).abs() < 1e-12);
        assert!((first(zeros(|x| jn_derivative(2, x), 0.5, 20.0), 1) - 3.054_236_928_227_14).abs() < 1e-12);
        assert!((first(zeros(|x| spherical(1, x), 0.5, 20.0), 1) - 4.493_409_457_909_064).abs() < 1e-12);
        assert!((first(zeros(|x| spherical_derivative(1, x), 0.5, 20.0), 1) - 2.081_575_977_818_1).abs() < 1e-11);
    }

    #[test]
    fn zeros_are_found_on_the_steps_and_end_at_the_limit() {
        assert_eq!(zeros(|x| (x - 2.5) * (x - 20.5), 0.5, 20.0), [2.5]);
        let found = zeros(|x| (x - 6.1) * (x - 18.9) * (x - 20.2), 0.5, 20.0);
        assert!(found.len() == 2 && (found[0] - 6.1).abs() < 1e-13 && (found[1] - 18.9).abs() < 1e-13, "{found:?}");
        let found = zeros(|x| spherical(0, x), 0.5, 100.0);
        assert_eq!(found.len(), 31);
        assert!(
            (1_u32..)
                .zip(&found)
                .all(|(n, zero)| (zero - std::f64::consts::PI * f64::from(n)).abs() < 1e-13)
        );
    }

    #[test]
    fn spherical_values() {
        // j_2(x) = (3/x^3 - 1/x) sin x - 3/x^2 cos x, and the leading term for small x.
        for x in [0.8_f64, 1.7, 2.5, 9.0] {
            let closed = (3.0 / x.powi(3) - 1.0 / x) * x.sin() - 3.0 / (x * x) * x.cos();
            assert!((spherical(2, x) - closed).abs() < 1e-14, "{x}");
        }
        assert!((spherical(5, 0.01) / (1e-10 / 10_395.0) - 1.0).abs() < 1e-4);
        assert!((spherical(40, 3.0)).abs() < 1e-30 && spherical(40, 3.0) > 0.0);
        // One term of the power series is left of the smallest arguments, and nothing below.
        for (l, x) in [(1, 1e-39), (2, 3e-20), (7, 2e-7), (35, 1.3e-6), (50, 1e-4), (60, 1e-3)] {
            let leading = (1..=l).fold(1.0, |product, n| product * x / f64::from(2 * n + 1));
            assert!((spherical(l, x) / leading - 1.0).abs() < 1e-7, "j_{l}({x})");
        }
        assert_eq!(
            [
                spherical(0, 1e-50),
                spherical(3, 1e-50),
                spherical(0, 0.0),
                spherical(1, 0.0)
            ],
            [1.0, 0.0, 1.0, 0.0]
        );
        // Three neighbours obey the recurrence, on both sides of the order and where the sine vanishes.
        for x in [0.3, 2.9, 9.424_777_960_769_38, 17.3, 43.982_297_150_257_1, 98.7] {
            for l in 1..120 {
                let [below, here, above] = [l - 1, l, l + 1].map(|l| spherical(l, x));
                let middle = f64::from(2 * l + 1) / x * here;
                assert!((below + above - middle).abs() < 1e-12 * (below.abs() + middle.abs()), "{l} {x}");
            }
        }
        // Sum over l of (2 l + 1) j_l(x)^2 is one.
        for x in [0.5, 3.0, 9.424_777_960_769_38, 17.0] {
            let sum: f64 = (0..80).map(|l| f64::from(2 * l + 1) * spherical(l, x).powi(2)).sum();
            assert!((sum - 1.0).abs() < 1e-13);
        }
    }
}
