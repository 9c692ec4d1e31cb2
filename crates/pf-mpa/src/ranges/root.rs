//! Factors of small matrices.

/// The lower triangular root of the first `size` rows and columns of a matrix of these entries; `None` if a squared pivot is not above
/// `least`. For few numbers, again and again: a plain loop over arrays.
pub(super) fn root<const S: usize>(
    size: usize,
    least: f64,
    entry: impl Fn(usize, usize) -> f64,
) -> Option<[[f64; S]; S]> {
    let mut root = [[0.0; S]; S];
    for j in 0..size {
        let left = entry(j, j) - root[j][..j].iter().map(|x| x * x).sum::<f64>();
        if left <= least || !left.is_finite() {
            return None;
        }
        root[j][j] = left.sqrt();
        for i in j + 1..size {
            let known: f64 = (0..j).map(|k| root[i][k] * root[j][k]).sum();
            root[i][j] = (entry(i, j) - known) / root[j][j];
        }
    }
    Some(root)
}
