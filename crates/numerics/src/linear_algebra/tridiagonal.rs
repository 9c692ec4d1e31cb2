//! Tridiagonal systems of linear equations.

use crate::error::ArgumentError;

/// Solves `below[i-1] x[i-1] + diagonal[i] x[i] + above[i] x[i+1] = right[i]` by elimination with partial pivoting.
///
/// `below` and `above` have one entry fewer than `diagonal` and `right`. The method is backward stable for every matrix and takes `O(n)`
/// steps.
///
/// # Errors
/// If lengths do not fit, an entry is not finite, or the matrix is singular in working precision.
pub fn solve(below: &[f64], diagonal: &[f64], above: &[f64], right: &[f64]) -> Result<Vec<f64>, ArgumentError> {
    let n = diagonal.len();
    for (name, values, length) in [
        ("below", below, n.saturating_sub(1)),
        ("diagonal", diagonal, n),
        ("above", above, n.saturating_sub(1)),
        ("right", right, n),
    ] {
        if values.len() != length {
            return Err(ArgumentError::new(name, format!("{} numbers", values.len()), format!("{length} numbers")));
        }
        crate::error::all_finite(name, values)?;
    }
    let singular = |row: usize| ArgumentError::new("diagonal", format!("dependent at row {row}"), "a regular matrix");
    // Rows of the eliminated matrix hold up to three entries: pivoting fills a second diagonal above.
    let mut rows: Vec<[f64; 3]> = (0..n)
        .map(|i| [diagonal[i], above.get(i).copied().unwrap_or(0.0), 0.0])
        .collect();
    let mut x = right.to_vec();
    for i in 0..n.saturating_sub(1) {
        let mut next = [below[i], rows[i + 1][0], rows[i + 1][1]];
        if next[0].abs() > rows[i][0].abs() {
            std::mem::swap(&mut next, &mut rows[i]);
            x.swap(i, i + 1);
        }
        if rows[i][0] == 0.0 {
            return Err(singular(i));
        }
        let factor = next[0] / rows[i][0];
        rows[i + 1] = [next[1] - factor * rows[i][1], next[2] - factor * rows[i][2], 0.0];
        x[i + 1] -= factor * x[i];
    }
    for i in (0..n).rev() {
        let tail =
            rows[i][1] * x.get(i + 1).copied().unwrap_or(0.0) + rows[i][2] * x.get(i + 2).copied().unwrap_or(0.0);
        x[i] = (x[i] - tail) / rows[i][0];
        if !x[i].is_finite() {
            return Err(singular(i));
        }
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::solve;

    #[test]
    fn solutions_satisfy_their_equations_pivoting_or_not() {
        let n = 9;
        for (scale, middle) in [(1.0, 4.0), (1e-6, 0.01), (1e6, 0.0)] {
            let below: Vec<f64> = (0..n - 1).map(|i| scale * (1.0 + (i as f64).sin())).collect();
            let above: Vec<f64> = (0..n - 1).map(|i| scale * (2.0 + (i as f64).cos())).collect();
            let diagonal: Vec<f64> = (0..n)
                .map(|i| scale * middle * (1.0 + 0.1 * i as f64) + scale * 1e-9)
                .collect();
            let right: Vec<f64> = (0..n).map(|i| i as f64 - 3.0).collect();
            let x = solve(&below, &diagonal, &above, &right).unwrap();
            for i in 0..n {
                let left = if i > 0 { below[i - 1] * x[i - 1] } else { 0.0 };
                let next = if i + 1 < n { above[i] * x[i + 1] } else { 0.0 };
                let size = left.abs() + (diagonal[i] * x[i]).abs() + next.abs() + 1.0;
                assert!((left + diagonal[i] * x[i] + next - right[i]).abs() < 1e-13 * size, "row {i} at {scale}");
            }
        }
        assert_eq!(solve(&[], &[], &[], &[]), Ok(vec![]));
        assert_eq!(solve(&[], &[4.0], &[], &[2.0]), Ok(vec![0.5]));
    }

    #[test]
    fn singular_and_misshapen_systems_are_refused() {
        assert!(solve(&[1.0], &[1.0, 1.0], &[1.0], &[1.0, 2.0]).is_err());
        assert!(solve(&[], &[0.0], &[], &[1.0]).is_err());
        assert!(solve(&[0.0], &[0.0, 1.0], &[0.0], &[1.0, 1.0]).is_err());
        assert!(solve(&[1.0], &[1.0], &[], &[1.0]).is_err());
        assert!(solve(&[], &[f64::NAN], &[], &[1.0]).is_err());
    }
}
