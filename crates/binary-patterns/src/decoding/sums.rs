//! Sums over the nodes of a posterior density.

/// `(sum w, sum w x)`.
pub fn moments(w: &[f64], x: &[f64]) -> (f64, f64) {
    w.iter()
        .zip(x)
        .fold((0.0, 0.0), |(m0, m1), (w, x)| (m0 + w, m1 + w * x))
}

/// `sum w (x - estimate)^2`.
pub fn squared_error(w: &[f64], x: &[f64], estimate: f64) -> f64 {
    w.iter().zip(x).map(|(w, x)| w * (x - estimate) * (x - estimate)).sum()
}
