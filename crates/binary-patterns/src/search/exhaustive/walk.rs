//! Search through the tree of all multisets of masks.

use super::setting::{LinearSearch, MaskSet};
use crate::patterns::linear::Span;
use crate::search::outcomes::{Candidates, Outcomes};
use crate::{BinaryQuantizer, Error, Mask, linear_pattern};
use fewbits_quantizer_design::outcomes::Table;
use nalgebra::DMatrix;
use rayon::prelude::*;

/// Levels of the search tree whose branches are distributed over threads.
const PARALLEL_LEVELS: usize = 2;

/// The best sets so far.
pub(super) struct Top {
    keep: usize,
    pub(super) sets: Vec<MaskSet>,
    /// Sets with a larger error cannot enter.
    bar: f64,
}

impl Top {
    fn new(keep: usize) -> Self {
        Self {
            keep,
            sets: Vec::new(),
            bar: f64::INFINITY,
        }
    }

    fn push(&mut self, chosen: &[(Mask, usize)], last: (Mask, usize), mse: f64) {
        if mse > self.bar {
            return;
        }
        let masks = chosen
            .iter()
            .chain([&last])
            .flat_map(|&(mask, count)| std::iter::repeat_n(mask, count))
            .collect();
        self.sets.push(MaskSet { masks, mse });
        if self.sets.len() >= self.keep.saturating_mul(4) {
            self.finish();
        }
    }

    pub(super) fn finish(&mut self) {
        self.sets
            .sort_by(|a, b| a.mse.total_cmp(&b.mse).then_with(|| a.masks.cmp(&b.masks)));
        if self.sets.len() >= self.keep {
            self.sets.truncate(self.keep);
            self.bar = self.sets.last().map_or(f64::INFINITY, |s| s.mse);
        }
    }

    fn merge(mut self, other: Self) -> Self {
        self.sets.extend(other.sets);
        self.finish();
        self
    }
}

pub(super) struct Walk<'a> {
    search: &'a LinearSearch,
    keep: usize,
    pub(super) candidates: Candidates,
    variance: f64,
    /// `tables[j][m - 1]`: probabilities of the counts of `m` sensors with mask `j + 1`.
    tables: Vec<Vec<Table>>,
    /// `leaves[r - 1]`: the integrands of all masks for `r` remaining sensors.
    leaves: Vec<DMatrix<f64>>,
}

impl<'a> Walk<'a> {
    pub(super) fn new(search: &'a LinearSearch, keep: usize) -> Result<Self, Error> {
        let quantizers = (1..1 << search.bits)
            .map(|mask| linear_pattern(mask, search.bits)?.on(&search.grid))
            .collect::<Result<Vec<_>, _>>()?;
        let candidates = Candidates::new(&search.source, &quantizers, &[search.noise_deviation]);
        let tables_of = |quantizer: &BinaryQuantizer| {
            let p = quantizer.probabilities_at(&candidates.nodes.points, search.noise_deviation);
            (1..=search.sensors).map(|count| p.of_counts(count)).collect()
        };
        let tables: Vec<Vec<Table>> = quantizers.iter().map(tables_of).collect();
        let leaves = (0..search.sensors)
            .map(|r| candidates.integrands(tables.iter().map(|t| &t[r])))
            .collect();
        Ok(Self {
            search,
            keep,
            candidates,
            variance: search.source.variance(),
            tables,
            leaves,
        })
    }

    /// Evaluates all sets that continue `chosen` with `left` more sensors, whose masks are `first` or later.
    pub(super) fn branch(
        &self,
        first: usize,
        left: usize,
        span: Span,
        chosen: &[(Mask, usize)],
        level: Outcomes,
    ) -> Top {
        let mut found = Top::new(self.keep);
        self.close(first, left, span, chosen, &level, &mut found);
        let mut steps = Vec::new();
        // The last mask has no later one.
        for j in first..self.tables.len() - 1 {
            let next = span.with(j as Mask + 1);
            // Each remaining sensor can raise the rank by at most one.
            let possible = |m: &usize| !self.search.full_rank || next.rank() + (left - m) >= self.search.bits;
            steps.extend((1..left).filter(possible).map(|m| (j, m, next)));
        }
        let descend = |&(j, m, next): &(usize, usize, Span)| {
            let mut chosen = chosen.to_vec();
            chosen.push((j as Mask + 1, m));
            let level = level.with(&self.tables[j][m - 1], self.candidates.flips[j]);
            self.branch(j + 1, left - m, next, &chosen, level)
        };
        // Merged in the order of the branches, so that the result does not depend on the number of threads.
        if chosen.len() < PARALLEL_LEVELS {
            let parts: Vec<Top> = steps.par_iter().map(descend).collect();
            parts.into_iter().fold(found, Top::merge)
        } else {
            steps.iter().map(descend).fold(found, Top::merge)
        }
    }

    /// Evaluates all sets in which the `left` remaining sensors share one mask.
    fn close(
        &self,
        first: usize,
        left: usize,
        span: Span,
        chosen: &[(Mask, usize)],
        level: &Outcomes,
        found: &mut Top,
    ) {
        let allowed = |j: usize| !self.search.full_rank || span.with(j as Mask + 1).rank() == self.search.bits;
        let until = self.tables.len();
        let Some(from) = (first..until).find(|&j| allowed(j)) else {
            return;
        };
        let rows_each = (left + 1) * 2;
        let rows = (until - from) * rows_each;
        // All candidates for the last mask in one matrix product.
        let sums = level.integrals(&self.leaves[left - 1].rows(from * rows_each, rows));
        for j in (from..until).filter(|&j| allowed(j)) {
            let at = [rows, (j - from) * rows_each];
            let explained = self.candidates.explained(level, &sums, at, left, j);
            found.push(chosen, (j as Mask + 1, left), self.variance - explained);
        }
    }
}
