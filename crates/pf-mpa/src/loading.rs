//! How far the cells of a range should reach.

use crate::Error;
use fewbits_numerics::error::refuse;
use fewbits_numerics::{golden, normal};

/// Standard deviations from the mean to the outermost edge of the uniform quantizer with the least mean squared error for a normal
/// variable: 1.596, 1.991, 2.344, 2.682 for 2, 4, 8, 16 levels.
///
/// # Errors
/// If there are fewer than two levels or more than 65536.
pub fn optimal_loading(levels: usize) -> Result<f64, Error> {
    if !(2..=65_536).contains(&levels) {
        return refuse("levels", levels, "2 to 65536 levels");
    }
    // Mean squared error if each cell is reconstructed by its nominal middle; the cells are symmetric about zero.
    let error = |loading: f64| {
        let width = 2.0 * loading / levels as f64;
        let cell = |q: usize| {
            let lower = if q == 0 {
                f64::NEG_INFINITY
            } else {
                q as f64 * width - loading
            };
            let upper = if q + 1 == levels {
                f64::INFINITY
            } else {
                (q + 1) as f64 * width - loading
            };
            let middle = (q as f64 + 0.5) * width - loading;
            let moments = normal::truncated_moments(lower, upper).ok();
            let squared = moments.map_or(0.0, |m| m.variance + (m.mean - middle) * (m.mean - middle));
            normal::log_interval(lower, upper).exp() * squared
        };
        (0..levels).map(cell).sum::<f64>()
    };
    // The search runs over `-loading`: if errors differ by less than rounding, the largest loading is returned.
    Ok(-golden::maximum(|x| -error(-x), -12.0, -0.5, 1e-10).0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_loading_is_the_textbook_one() {
        for (levels, known) in [(2, 1.596), (4, 1.991), (8, 2.344), (16, 2.682)] {
            assert!((optimal_loading(levels).unwrap() - known).abs() < 1e-3, "{levels}");
        }
        // Two levels by hand: twice the mean of a half-normal variable.
        let exact = 2.0 * (2.0 / std::f64::consts::PI).sqrt();
        assert!((optimal_loading(2).unwrap() - exact).abs() < 1e-7);
        assert!(optimal_loading(1).is_err() && optimal_loading(0).is_err());
    }
}
