//! Count vectors: the number of sensors of a group that report each symbol.
//!
//! The likelihood of `N` identical sensors depends only on how many reported each symbol. The `L^N` outcomes reduce to
//! `C(N + L - 1, L - 1)` count vectors with multinomial coefficients: 220 instead of 262144 for nine sensors of four levels.

use super::table::{Table, add_scaled};
use fewbits_numerics::binomial;

/// For larger groups the probabilities are computed in logarithms, so that powers and coefficients stay in range.
const LOG_COUNT: usize = 60;

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
    /// Recursion from the probabilities of `m` reports to those of `m + 1`, for a group that is not large.
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
            if total <= LOG_COUNT {
                steps.push(vectors.iter().map(|v| Step::to(v, m + 1)).collect());
            }
        }
        let log_multiplicity = vectors.iter().map(|v| log_multinomial(v)).collect();
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

    /// Multinomial probabilities of the count vectors at every node, given those of the symbols: tables of `total`, `total - 1` and
    /// `total - 2` reports, as far as these are not negative.
    ///
    /// By `R_m(n) = (m / n_t) P_t R_{m-1}(n - e_t)` with `t` the first symbol that occurs.
    pub(crate) fn probabilities(&self, symbols: &Table) -> Vec<Table> {
        let least = self.total.saturating_sub(2);
        if self.total > LOG_COUNT {
            return (least..=self.total).rev().map(|m| symbols.of_counts(m)).collect();
        }
        let mut levels = vec![nothing(symbols)];
        for steps in &self.steps {
            let next = raised(&levels[0], symbols, steps);
            levels.insert(0, next);
            levels.truncate(3);
        }
        levels
    }
}

impl Table {
    /// Multinomial probabilities of the counts of symbols of so many sensors, given the probabilities of a sensor's symbols: one row per
    /// count vector, in decreasing lexicographic order. Of two symbols, row `k` is the probability of `k` reports of the second.
    pub fn of_counts(&self, sensors: usize) -> Self {
        if sensors <= LOG_COUNT {
            return (1..=sensors).fold(nothing(self), |below, m| {
                let steps: Vec<Step> = vectors_of(m, self.rows()).iter().map(|v| Step::to(v, m)).collect();
                raised(&below, self, &steps)
            });
        }
        let logs = Self::new(self.values.iter().map(|p| p.ln()).collect(), self.nodes);
        let counts = logs.of_log_counts(sensors).values;
        Self::new(counts.into_iter().map(f64::exp).collect(), self.nodes)
    }

    /// Logarithms of [`of_counts`](Self::of_counts), given those of the probabilities of a sensor's symbols. They stay accurate if the
    /// probabilities underflow.
    pub fn of_log_counts(&self, sensors: usize) -> Self {
        let mut values = Vec::new();
        for vector in vectors_of(sensors, self.rows()) {
            let mut row = vec![log_multinomial(&vector); self.nodes];
            // Symbols that do not occur are left out, since zero times the logarithm of zero is one of no factors.
            for (n, log) in vector.iter().zip(self.iter()).filter(|(n, _)| **n > 0) {
                add_scaled(&mut row, *n as f64, log);
            }
            values.extend(row);
        }
        Self::new(values, self.nodes)
    }
}

/// The table of no reports: one row of ones.
fn nothing(symbols: &Table) -> Table {
    Table::new(vec![1.0; symbols.nodes], symbols.nodes)
}

/// One more report than in `below`.
fn raised(below: &Table, symbols: &Table, steps: &[Step]) -> Table {
    let mut values = Vec::with_capacity(steps.len() * symbols.nodes);
    for step in steps {
        let pairs = below.row(step.from).iter().zip(symbols.row(step.symbol));
        values.extend(pairs.map(|(from, p)| step.factor * p * from));
    }
    Table::new(values, symbols.nodes)
}

/// Logarithm of the number of orders of reports with these counts: the coefficient itself overflows for many sensors.
fn log_multinomial(vector: &[usize]) -> f64 {
    let ln_factorial = |n: usize| (2..=n).map(|i| (i as f64).ln()).sum::<f64>();
    ln_factorial(vector.iter().sum()) - vector.iter().map(|n| ln_factorial(*n)).sum::<f64>()
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
        let levels = all.probabilities(&Table::new(p.to_vec(), 1));
        assert_eq!(levels.iter().map(Table::rows).collect::<Vec<_>>(), [21, 15, 10]);
        assert_eq!(levels[0], Table::new(p.to_vec(), 1).of_counts(5));
        for ((v, q), l) in all.vectors.iter().zip(&levels[0].values).zip(&all.log_multiplicity) {
            let direct: f64 = v.iter().zip(&p).map(|(n, p)| p.powi(*n as i32)).product();
            assert!((q - l.exp() * direct).abs() < 1e-15);
        }
    }

    /// Powers of a probability underflow beyond about a thousand reports, the probabilities of counts do not.
    #[test]
    fn counts_of_many_sensors_sum_to_one() {
        let symbols = Table::new(vec![0.5, 0.0, 1.0, 0.5, 1.0, 0.0], 3);
        for sensors in [3, 50, 60, 61, 3000] {
            let counts = symbols.of_counts(sensors);
            for i in 0..3 {
                let sum: f64 = counts.iter().map(|row| row[i]).sum();
                assert!((sum - 1.0).abs() < 1e-9, "{sensors} {i}: {sum}");
            }
        }
        let many = Compositions::new(1200, 2).probabilities(&symbols);
        assert!(
            many.iter()
                .all(|m| (m.iter().map(|row| row[0]).sum::<f64>() - 1.0).abs() < 1e-9)
        );
    }
}
