//! Likelihood of the samples of the visited nodes as a function of the position of the source.

use crate::rate::{Intervals, RateModel, RateSums};
use crate::record::Record;
use fewbits_core::{Columns, Error, Likelihood};
use fewbits_numerics::error::refuse;
use fewbits_numerics::normal::log_interval;
use nalgebra::{SVector, Vector2};

/// `ln p(samples of all nodes | position)` under a model of the release rate.
#[derive(Debug, Clone)]
pub struct SourceLikelihood {
    records: Vec<Record>,
    rate: RateModel,
}

impl SourceLikelihood {
    /// The likelihood of the given records.
    ///
    /// # Errors
    /// If there is no record, or a known rate is not positive.
    pub fn new(records: Vec<Record>, rate: RateModel) -> Result<Self, Error> {
        rate.check()?;
        if records.is_empty() {
            return refuse("records", "empty", "at least one");
        }
        Ok(Self { records, rate })
    }

    /// The records.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// The model of the rate.
    pub(crate) fn rate(&self) -> &RateModel {
        &self.rate
    }

    /// Sums over all records with the source at `position`.
    #[inline]
    pub fn sums(&self, position: &Vector2<f64>) -> RateSums {
        self.records
            .iter()
            .fold(RateSums::default(), |sum, record| sum.plus(&record.sums(position)))
    }

    /// Whether a source can be in the square of the given half width about `position`.
    pub(crate) fn admits(&self, position: &Vector2<f64>, half_width: f64) -> bool {
        self.records
            .iter()
            .all(|record| record.sensor().admits(position, half_width))
    }

    /// Whether [`admits`](Self::admits) depends on the position.
    pub(crate) fn has_walls(&self) -> bool {
        self.records
            .iter()
            .any(|record| record.sensor().homogeneous().is_none())
    }

    /// Calls `visit` with the sums of each group of samples that share one rate: all samples, those of a node, or a single one. The first
    /// argument has the information reduced for a cell of the given half width, the second is in full.
    ///
    /// The normalisation of the noise is not reduced: it would favour cells in which the response is steep.
    #[inline]
    fn each_group(
        &self,
        position: &Vector2<f64>,
        half_width: Option<f64>,
        mut visit: impl FnMut(&RateSums, &RateSums),
    ) {
        let (mut blurred, mut all) = (RateSums::default(), RateSums::default());
        for record in &self.records {
            let (sums, share) = match half_width {
                Some(half_width) => record.blurred_sums(position, half_width, self.rate.largest()),
                None => (record.sums(position), 1.0),
            };
            match self.rate {
                // One rate for all samples: their sums add up and are visited once, at the end.
                RateModel::Known(_) | RateModel::Joint(_) => {
                    (blurred, all) = (blurred.plus(&sums.discounted(share)), all.plus(&sums));
                }
                RateModel::NodeWise(_) => visit(&sums.discounted(share), &sums),
                RateModel::SampleWise(_) => {
                    record.each_sample(position, |sums| visit(&sums.discounted(share), &sums));
                }
            }
        }
        if matches!(self.rate, RateModel::Known(_) | RateModel::Joint(_)) {
            visit(&blurred, &all);
        }
    }

    /// Expected sum of squared residuals over the noise variance, with the source at `position`. The expectation is over the rate
    /// given the position and these records.
    pub(crate) fn chi_squared(&self, position: &Vector2<f64>) -> f64 {
        let mut total = 0.0;
        self.each_group(position, None, |_, sums| total += sums.chi_squared(self.rate.given_position(sums)));
        total
    }

    /// Number of samples of all records.
    pub(crate) fn samples(&self) -> usize {
        self.records.iter().map(|record| record.samples().len()).sum()
    }

    /// For a run of cells of the given half width, writes the log likelihood averaged over each cell to `blurred`. If its sum with `priors`
    /// exceeds `floor`, or the largest such sum minus `dropped`, it writes the log likelihood at the centre to `logs`. For other cells
    /// the average stands for both, if all samples share one rate.
    pub(crate) fn blurred(
        &self,
        centres: &Columns<'_, 2>,
        half_width: f64,
        priors: &[f64],
        (floor, dropped): (f64, f64),
        [logs, blurred]: [&mut [f64]; 2],
    ) {
        let at = |i: usize| Vector2::new(centres[0][i], centres[1][i]);
        let (mut intervals, mut groups) = (Intervals::default(), Vec::with_capacity(logs.len()));
        logs.fill(0.0);
        blurred.fill(0.0);
        for i in 0..logs.len() {
            self.each_group(&at(i), Some(half_width), |less, sums| {
                let (log, cut) = self.rate.log_uncut(less);
                blurred[i] += log;
                intervals.push(i, cut);
                groups.push(*sums);
            });
        }
        intervals.add_to(blurred);
        let best = blurred
            .iter()
            .zip(priors)
            .fold(f64::NEG_INFINITY, |best, (b, p)| best.max(b + p));
        // If the rate is known or redrawn, the log likelihood is written for all cells.
        let floor = match self.rate {
            RateModel::Joint(_) => floor.max(best - dropped),
            _ => f64::NEG_INFINITY,
        };
        let each = groups.len().div_ceil(logs.len().max(1));
        for (i, groups) in groups.chunks(each.max(1)).enumerate() {
            if blurred[i] + priors[i] < floor {
                logs[i] = blurred[i];
                continue;
            }
            for sums in groups {
                let (log, cut) = self.rate.log_uncut(sums);
                logs[i] += log;
                intervals.push(i, cut);
            }
        }
        intervals.add_to(logs);
    }
}

impl Likelihood<2> for SourceLikelihood {
    fn log_likelihood(&self, position: &SVector<f64, 2>) -> f64 {
        if !self.admits(position, 0.0) {
            return f64::NEG_INFINITY;
        }
        let mut total = 0.0;
        self.each_group(position, None, |_, sums| {
            let (log, cut) = self.rate.log_uncut(sums);
            total += log + cut.map_or(0.0, |(from, to)| log_interval(from, to));
        });
        total
    }
}
