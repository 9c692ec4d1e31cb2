//! The maximum of a function with one peak, without derivatives.

/// `(sqrt(5) - 1) / 2`.
const RATIO: f64 = 0.618_033_988_749_894_9;

/// The point of `[low, high]` at which `f` is largest, and the value there, by golden-section search.
///
/// The search ends when the bracket is `tolerance` times `high - low`. `f` must increase up to one peak and decrease after it. A maximum
/// at an end of the interval is found too.
///
/// Each step takes one evaluation and leaves 0.618 of the bracket. A `tolerance` below the root of the machine's precision (1e-8) gains
/// nothing, since differences of `f` are rounding errors there.
///
/// ```
/// let (x, value) = fewbits_numerics::golden::maximum(|x| -(x - 0.3) * (x - 0.3), 0.0, 1.0, 1e-9);
/// assert!((x - 0.3).abs() < 1e-7 && value > -1e-14);
/// ```
pub fn maximum(f: impl Fn(f64) -> f64, low: f64, high: f64, tolerance: f64) -> (f64, f64) {
    let ends = [(low, f(low)), (high, f(high))];
    let (mut low, mut high) = (low, high);
    let stop = tolerance * (high - low);
    let (mut a, mut b) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_a, mut at_b) = (f(a), f(b));
    while high - low > stop {
        if at_a >= at_b {
            high = b;
            (b, at_b) = (a, at_a);
            a = high - RATIO * (high - low);
            at_a = f(a);
        } else {
            low = a;
            (a, at_a) = (b, at_b);
            b = low + RATIO * (high - low);
            at_b = f(b);
        }
    }
    let middle = 0.5 * (low + high);
    ends.into_iter()
        .fold((middle, f(middle)), |best, end| if end.1 > best.1 { end } else { best })
}

#[cfg(test)]
mod tests {
    use super::maximum;

    #[test]
    fn maxima_inside_and_at_the_ends_are_found() {
        assert!((maximum(|x| -(x - 0.3) * (x - 0.3), 0.0, 1.0, 1e-9).0 - 0.3).abs() < 1e-7);
        assert_eq!(maximum(|x| x, 0.0, 1.0, 1e-9), (1.0, 1.0));
        assert_eq!(maximum(|x| -x, 0.0, 1.0, 1e-9), (0.0, 0.0));
    }
}
