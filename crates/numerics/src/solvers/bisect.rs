//! The place where a condition ceases to hold, by halving a bracket.

/// Halves the bracket between `inside`, where the condition holds, and `outside`, where it does not, and returns both ends. Either may be the
/// larger one. The condition must change once between them; neither end is evaluated.
///
/// After `halvings` steps the width is that of the start divided by `2^halvings`, at least the distance of neighbouring numbers.
///
/// ```
/// let (below, above) = fewbits_numerics::bisect::boundary(|x| x * x < 2.0, 0.0, 2.0, 60);
/// assert!(below <= std::f64::consts::SQRT_2 && std::f64::consts::SQRT_2 <= above && above - below < 1e-15);
/// ```
pub fn boundary(mut holds: impl FnMut(f64) -> bool, inside: f64, outside: f64, halvings: u32) -> (f64, f64) {
    let (mut inside, mut outside) = (inside, outside);
    for _ in 0..halvings {
        let middle = 0.5 * (inside + outside);
        if holds(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    (inside, outside)
}

#[cfg(test)]
mod tests {
    use super::boundary;

    #[test]
    fn both_ends_close_in_on_the_place_from_either_side() {
        for (inside, outside) in [(0.0, 8.0), (8.0, 0.0)] {
            let holds = |x: f64| (x < 2.7) == (inside < outside);
            let (near, far) = boundary(holds, inside, outside, 20);
            assert!(holds(near) && !holds(far));
            assert_eq!((near - far).abs(), 8.0 / f64::from(1 << 20));
        }
        assert_eq!(boundary(|_| true, 0.0, 1.0, 0), (0.0, 1.0));
    }
}
