//! The probability of each pair of track and report, summed over all joint associations.

use fewbits_core::Error;
use fewbits_numerics::error::{entries, refuse};

/// Most tracks, or reports, of one cluster; the other side may have any number.
const LARGEST: usize = 14;

/// Logarithms of the weights of an association. A joint association has the product of the weights of its pairs, of `missed` for each track
/// without a report, and of `unassigned` for each report without a track. `-inf` excludes.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weights {
    /// `pairs[i][j]`: track `i` caused report `j`.
    pub pairs: Vec<Vec<f64>>,
    /// Track `i` caused none.
    pub missed: Vec<f64>,
    /// Report `j` is of no track.
    pub unassigned: Vec<f64>,
}

/// Probabilities of an association, each summed over all joint associations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Marginals {
    /// `assigned[i][j]`: track `i` caused report `j`.
    pub assigned: Vec<Vec<f64>>,
    /// Track `i` caused none.
    pub missed: Vec<f64>,
    /// Report `j` is of no track.
    pub unassigned: Vec<f64>,
    /// `ln` of the sum of the weights of all joint associations.
    pub log_evidence: f64,
}

/// `ln(exp a + exp b)`.
fn log_add(a: f64, b: f64) -> f64 {
    let (high, low) = if a > b { (a, b) } else { (b, a) };
    if low == f64::NEG_INFINITY {
        high
    } else {
        high + (low - high).exp().ln_1p()
    }
}

/// Probabilities of all pairs: each track causes at most one report, and each report is of at most one track.
///
/// Tracks and reports that could belong together form clusters, which are independent. Within a cluster the sum over all joint associations
/// is exact. It runs over the reports with the set of tracks that have one, or the other way round where reports are fewer:
///
/// ```text
/// forward[j+1][S] = forward[j][S] unassigned_j + sum_{i in S} forward[j][S - i] pair_ij
/// backward[j][S]  = backward[j+1][S] unassigned_j + sum_{i not in S} pair_ij backward[j+1][S + i],  backward[m][S] = prod_{i not in S} missed_i
/// P(i, j) = sum_{S without i} forward[j][S] pair_ij backward[j+1][S + i] / backward[0][{}]
/// ```
///
/// # Errors
/// If lengths differ, a weight is NaN or infinite, or a cluster has more than 14 tracks and as many reports;
/// [`Error::Impossible`] if every joint association has weight zero.
pub fn marginals(weights: &Weights) -> Result<Marginals, Error> {
    let (tracks, reports) = (weights.missed.len(), weights.unassigned.len());
    entries("pairs", weights.pairs.len(), tracks)?;
    for row in &weights.pairs {
        entries("pairs", row.len(), reports)?;
    }
    let all = weights
        .pairs
        .iter()
        .flatten()
        .chain(&weights.missed)
        .chain(&weights.unassigned);
    if let Some(bad) = all.copied().find(|w| w.is_nan() || *w == f64::INFINITY) {
        return refuse("weights", bad, "logarithms below infinity");
    }
    let mut found = Marginals {
        assigned: vec![vec![0.0; reports]; tracks],
        missed: vec![0.0; tracks],
        unassigned: vec![0.0; reports],
        log_evidence: 0.0,
    };
    for (members, heard) in clusters(weights) {
        // Sets are of the smaller side.
        let swapped = heard.len() < members.len();
        let (few, many) = if swapped {
            (&heard, &members)
        } else {
            (&members, &heard)
        };
        if few.len() > LARGEST {
            let given = format!("{} tracks with {} reports", members.len(), heard.len());
            return refuse("cluster", given, format!("at most {LARGEST} of either: a tighter gate"));
        }
        let (alone, other): (&[f64], &[f64]) = if swapped {
            (&weights.unassigned, &weights.missed)
        } else {
            (&weights.missed, &weights.unassigned)
        };
        let pair = |a: usize, b: usize| {
            if swapped {
                weights.pairs[b][a]
            } else {
                weights.pairs[a][b]
            }
        };
        let exact = Sums::new(
            few.iter().map(|a| alone[*a]).collect(),
            many.iter().map(|b| other[*b]).collect(),
            few.iter()
                .map(|a| many.iter().map(|b| pair(*a, *b)).collect())
                .collect(),
        );
        let total = exact.total();
        if total == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        found.log_evidence += total;
        for (i, a) in few.iter().enumerate() {
            let lonely = exact.without(i);
            for (j, b) in many.iter().enumerate() {
                let (track, report) = if swapped { (*b, *a) } else { (*a, *b) };
                found.assigned[track][report] = exact.joined(i, j);
            }
            if swapped {
                found.unassigned[*a] = lonely
            } else {
                found.missed[*a] = lonely
            }
        }
        for (j, b) in many.iter().enumerate() {
            let lonely = exact.skipped(j);
            if swapped {
                found.missed[*b] = lonely
            } else {
                found.unassigned[*b] = lonely
            }
        }
    }
    Ok(found)
}

/// Tracks and reports of each connected part of the graph of possible pairs.
fn clusters(weights: &Weights) -> Vec<(Vec<usize>, Vec<usize>)> {
    let (tracks, reports) = (weights.missed.len(), weights.unassigned.len());
    let mut parent: Vec<usize> = (0..tracks + reports).collect();
    let root = |parent: &[usize], mut at: usize| {
        while parent[at] != at {
            at = parent[at];
        }
        at
    };
    for (i, row) in weights.pairs.iter().enumerate() {
        for j in (0..reports).filter(|j| row[*j] > f64::NEG_INFINITY) {
            let (a, b) = (root(&parent, i), root(&parent, tracks + j));
            parent[a.max(b)] = a.min(b);
        }
    }
    let roots: Vec<usize> = (0..tracks + reports).map(|at| root(&parent, at)).collect();
    let with = |head: usize| {
        let of = |range: std::ops::Range<usize>| range.filter(|at| roots[*at] == head).collect::<Vec<usize>>();
        (of(0..tracks), of(tracks..tracks + reports).iter().map(|at| at - tracks).collect())
    };
    (0..tracks + reports).filter(|at| roots[*at] == *at).map(with).collect()
}

/// Sums over all joint associations of `few` with `many`, in logarithms, by the set of `few` that is taken.
struct Sums {
    alone: usize,
    /// Weight of each of `many` without a partner.
    other: Vec<f64>,
    /// `pairs[i][j]`, of `few` and `many`.
    pairs: Vec<Vec<f64>>,
    forward: Vec<Vec<f64>>,
    backward: Vec<Vec<f64>>,
}

impl Sums {
    fn new(alone: Vec<f64>, other: Vec<f64>, pairs: Vec<Vec<f64>>) -> Self {
        let sets = 1_usize << alone.len();
        let members = |set: usize| (0..alone.len()).filter(move |i| set >> i & 1 == 1);
        let mut forward = vec![vec![f64::NEG_INFINITY; sets]];
        forward[0][0] = 0.0;
        for (j, skip) in other.iter().enumerate() {
            let last = &forward[j];
            let of = |set: usize| {
                let taken = members(set).map(|i| last[set ^ 1 << i] + pairs[i][j]);
                taken.fold(last[set] + skip, log_add)
            };
            let next = (0..sets).map(of).collect();
            forward.push(next);
        }
        let rest = |set: usize| (0..alone.len()).filter(|i| set >> i & 1 == 0).map(|i| alone[i]).sum();
        let mut backward: Vec<Vec<f64>> = vec![(0..sets).map(rest).collect()];
        for (j, skip) in other.iter().enumerate().rev() {
            let next = &backward[backward.len() - 1];
            let of = |set: usize| {
                let free = (0..alone.len()).filter(|i| set >> i & 1 == 0);
                let taken = free.map(|i| pairs[i][j] + next[set | 1 << i]);
                taken.fold(next[set] + skip, log_add)
            };
            let last = (0..sets).map(of).collect();
            backward.push(last);
        }
        backward.reverse();
        Self {
            alone: alone.len(),
            other,
            pairs,
            forward,
            backward,
        }
    }

    fn total(&self) -> f64 {
        self.backward[0][0]
    }

    fn sets(&self) -> impl Iterator<Item = usize> + '_ {
        0..1 << self.alone
    }

    /// `P(i with j)`.
    fn joined(&self, i: usize, j: usize) -> f64 {
        let free = self.sets().filter(|set| set >> i & 1 == 0);
        let log = |set: usize| self.forward[j][set] + self.pairs[i][j] + self.backward[j + 1][set | 1 << i];
        free.map(|set| (log(set) - self.total()).exp()).sum()
    }

    /// `P(i alone)`.
    fn without(&self, i: usize) -> f64 {
        let (first, last) = (&self.forward[self.other.len()], &self.backward[self.other.len()]);
        let free = self.sets().filter(|set| set >> i & 1 == 0);
        free.map(|set| (first[set] + last[set] - self.total()).exp()).sum()
    }

    /// `P(j alone)`.
    fn skipped(&self, j: usize) -> f64 {
        let log = |set: usize| self.forward[j][set] + self.other[j] + self.backward[j + 1][set];
        self.sets().map(|set| (log(set) - self.total()).exp()).sum()
    }
}
