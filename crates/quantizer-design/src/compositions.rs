//! Count vectors: the number of sensors of a group that report each symbol.
//!
//! The likelihood of `N` identical sensors depends only on how many reported each symbol. The `L^N` outcomes reduce to
//! `C(N + L - 1, L - 1)` count vectors with multinomial coefficients: 220 instead of 262144 for nine sensors of four levels.

use fewbits_numerics::binomial;

/// Number of ways to distribute `total` reports over `parts` symbols.
pub(crate) fn count(total: usize, parts: usize) -> u64 {
    if parts == 0 {
        u64::from(total == 0)
    } else {
        binomial::saturating(total + parts - 1, parts - 1)
    }
}

/// The count vectors of `total` reports in decreasing lexicographic order, and those of fewer reports from which they are built.
#[derive(Debug, Clone)]
pub(crate) struct Compositions {
    pub(crate) total: usize,
    pub(crate) parts: usize,
    pub(crate) vectors: Vec<Vec<usize>>,
    /// Log multinomial coefficients.
    pub(crate) log_multiplicity: Vec<f64>,
    /// `up[m][r * parts + t]`: rank among vectors of `m + 1` reports of vector `r` of `m` reports with one more report of `t`.
    up: Vec<Vec<usize>>,
    /// Recursion from the probabilities of `m` reports to those of `m + 1`.
    steps: Vec<Vec<Step>>,
}

impl Compositions {
    pub(crate) fn new(total: usize, parts: usize) -> Self {
        let (mut up, mut steps) = (Vec::with_capacity(total), Vec::with_capacity(total));
        let mut vectors = vec![vec![0; parts]];
        for m in 0..total {
            // The index of each count vector of `m` reports after one more report of symbol `t`.
            let raised = |v: &Vec<usize>, t: usize| {
                let mut raised = v.clone();
                raised[t] += 1;
                rank(&raised)
            };
            up.push(
                vectors
                    .iter()
                    .flat_map(|v| (0..parts).map(move |t| raised(v, t)))
                    .collect(),
            );
            vectors = vectors_of(m + 1, parts);
            steps.push(vectors.iter().map(|v| Step::to(v, m + 1)).collect());
        }
        // In logarithms, since multinomial coefficients of many sensors overflow.
        let ln_factorial = |n: usize| (2..=n).map(|i| (i as f64).ln()).sum::<f64>();
        let log_multiplicity = vectors
            .iter()
            .map(|v| ln_factorial(total) - v.iter().map(|n| ln_factorial(*n)).sum::<f64>())
            .collect();
        Self {
            total,
            parts,
            vectors,
            log_multiplicity,
            up,
            steps,
        }
    }

    /// Number of vectors.
    pub(crate) fn len(&self) -> usize {
        self.vectors.len()
    }

    /// Number of vectors with `missing` reports fewer than the total.
    pub(crate) fn len_below(&self, missing: usize) -> usize {
        count(self.total - missing, self.parts) as usize
    }

    /// For each vector with `missing` reports fewer than the total: ranks of the vectors with one more report.
    pub(crate) fn up(&self, missing: usize) -> &[usize] {
        &self.up[self.total - missing]
    }

    /// Multinomial probabilities at every node; `symbol[t * nodes + i]` is the probability of symbol `t` at node `i`.
    ///
    /// By `R_m(n) = (m / n_t) P_t R_{m-1}(n - e_t)` with `t` the first symbol that occurs. Returns the tables of `total`, `total - 1` and
    /// `total - 2` reports, as far as these are not negative.
    pub(crate) fn probabilities(&self, symbol: &[f64], nodes: usize) -> Vec<Vec<f64>> {
        let mut levels = vec![vec![1.0; nodes]];
        for steps in &self.steps {
            let below = &levels[levels.len() - 1];
            let mut table = Vec::with_capacity(steps.len() * nodes);
            for step in steps {
                let from = &below[step.from * nodes..(step.from + 1) * nodes];
                let p = &symbol[step.symbol * nodes..(step.symbol + 1) * nodes];
                table.extend(from.iter().zip(p).map(|(from, p)| step.factor * p * from));
            }
            levels.push(table);
            if levels.len() > 3 {
                levels.remove(0);
            }
        }
        levels.reverse();
        levels
    }
}

/// One step of the recursion from `m - 1` reports to `m`.
#[derive(Debug, Clone, Copy)]
struct Step {
    from: usize,
    symbol: usize,
    factor: f64,
}

impl Step {
    fn to(vector: &[usize], reports: usize) -> Self {
        let symbol = vector.iter().position(|n| *n > 0).unwrap_or(0);
        let mut before = vector.to_vec();
        before[symbol] -= 1;
        Self {
            from: rank(&before),
            symbol,
            factor: reports as f64 / vector[symbol] as f64,
        }
    }
}

/// All count vectors of so many reports.
fn vectors_of(total: usize, parts: usize) -> Vec<Vec<usize>> {
    let mut vector = vec![0; parts];
    vector[0] = total;
    let mut all = vec![vector.clone()];
    // Next vector: one report moves from the last non-empty place before the end to the place after it, and so do all reports of the end.
    while let Some(i) = (0..parts - 1).rev().find(|i| vector[*i] > 0) {
        let end = std::mem::take(&mut vector[parts - 1]);
        vector[i] -= 1;
        vector[i + 1] = end + 1;
        all.push(vector.clone());
    }
    all
}

/// Index of a count vector among those of equal sum and length, in decreasing lexicographic order.
pub(crate) fn rank(vector: &[usize]) -> usize {
    let mut left: usize = vector.iter().sum();
    let mut rank = 0;
    for (i, n) in vector.iter().enumerate() {
        let after = vector.len() - i - 1;
        if left > *n && after > 0 {
            rank += count(left - n - 1, after + 1) as usize;
        }
        left -= n;
    }
    rank
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_number_the_vectors_in_order() {
        let all = Compositions::new(4, 3);
        assert_eq!(all.len(), 15);
        for (i, v) in all.vectors.iter().enumerate() {
            assert_eq!(rank(v), i);
            assert_eq!(v.iter().sum::<usize>(), 4);
        }
        assert!(all.vectors.windows(2).all(|w| w[0] > w[1]));
        let sum: f64 = all.log_multiplicity.iter().map(|l| l.exp()).sum();
        assert!((sum - 81.0).abs() < 1e-9);
    }

    #[test]
    fn probabilities_are_multinomial() {
        let all = Compositions::new(5, 3);
        let p = [0.2, 0.3, 0.5];
        let levels = all.probabilities(&p, 1);
        assert_eq!(levels.iter().map(Vec::len).collect::<Vec<_>>(), [21, 15, 10]);
        for ((v, q), l) in all.vectors.iter().zip(&levels[0]).zip(&all.log_multiplicity) {
            let direct: f64 = v.iter().zip(&p).map(|(n, p)| p.powi(*n as i32)).product();
            assert!((q - l.exp() * direct).abs() < 1e-15);
        }
    }
}
