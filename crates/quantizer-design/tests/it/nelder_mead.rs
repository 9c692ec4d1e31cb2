//! The simplex search of Nelder and Mead (1965), as a reference that knows nothing of quantizers.

/// The least value found from `start` with first steps of size `step`, until the simplex is small or the
/// search is over.
pub fn minimise(f: &mut dyn FnMut(&[f64]) -> f64, start: &[f64], step: f64, is_over: &dyn Fn() -> bool) -> f64 {
    let n = start.len();
    let mut simplex: Vec<(f64, Vec<f64>)> = vec![(f(start), start.to_vec())];
    for i in 0..n {
        if is_over() {
            return simplex.iter().map(|c| c.0).fold(f64::INFINITY, f64::min);
        }
        let mut corner = start.to_vec();
        corner[i] += step;
        simplex.push((f(&corner), corner));
    }
    for _ in 0..400 * n {
        simplex.sort_by(|a, b| a.0.total_cmp(&b.0));
        let (best, worst) = (simplex[0].0, simplex[n].0);
        if is_over() || worst - best <= 1e-10 * best.abs() {
            break;
        }
        let centre: Vec<f64> = (0..n)
            .map(|i| simplex[..n].iter().map(|c| c.1[i]).sum::<f64>() / n as f64)
            .collect();
        let along = |t: f64| -> Vec<f64> { (0..n).map(|i| centre[i] + t * (simplex[n].1[i] - centre[i])).collect() };
        let reflected = along(-1.0);
        let value = f(&reflected);
        let (next, at) = if value < best {
            let further = along(-2.0);
            let there = f(&further);
            if there < value {
                (there, further)
            } else {
                (value, reflected)
            }
        } else if value < simplex[n - 1].0 {
            (value, reflected)
        } else {
            let nearer = along(if value < worst { -0.5 } else { 0.5 });
            (f(&nearer), nearer)
        };
        if next < worst {
            simplex[n] = (next, at);
        } else {
            let first = simplex[0].1.clone();
            for (value, corner) in &mut simplex[1..] {
                corner.iter_mut().zip(&first).for_each(|(c, b)| *c = 0.5 * (*c + b));
                *value = f(corner);
            }
        }
    }
    simplex.iter().map(|c| c.0).fold(f64::INFINITY, f64::min)
}
