//! How likely the samples of the visited nodes are for each position of the source.

use crate::rate::{Intervals, RateModel, RateSums};
use crate::{Error, Record};
use fewbits_core::{Columns, Likelihood};
use fewbits_numerics::error::refuse;
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
    /// If there is none, or a known rate is not positive.
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
    pub fn rate(&self) -> &RateModel {
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

    /// Expected sum over all samples of the squared residual over the noise variance, with the source at `position`, over the rate
    /// given the position and these records.
    pub fn chi_squared(&self, position: &Vector2<f64>) -> f64 {
        let sums = || self.records.iter().map(|record| record.sums(position));
        match &self.rate {
            RateModel::Known(rate) => sums().map(|sums| sums.chi_squared((*rate, 0.0))).sum(),
            RateModel::Joint(range) => {
                let sums = self.sums(position);
                sums.chi_squared(sums.rate_given_position(range))
            }
            RateModel::NodeWise(range) => sums()
                .map(|sums| sums.chi_squared(sums.rate_given_position(range)))
                .sum(),
            RateModel::SampleWise(range) => {
                let each = self
                    .records
                    .iter()
                    .map(|record| record.chi_squared_sample_wise(position, range));
                each.sum()
            }
        }
    }

    /// Number of samples of all records.
    pub fn samples(&self) -> usize {
        self.records.iter().map(|record| record.samples().len()).sum()
    }

    /// Over a run of cells of the given half width: writes the log likelihood blurred over each cell to `blurred`. Where that plus
    /// `priors` exceeds `floor`, or the largest of them less `dropped`, writes the log likelihood itself to `logs`; elsewhere the
    /// blurred one stands for both.
    pub(crate) fn blurred(
        &self,
        centres: &Columns<'_, 2>,
        half_width: f64,
        priors: &[f64],
        (floor, dropped): (f64, f64),
        [logs, blurred]: [&mut [f64]; 2],
    ) {
        let at = |i: usize| Vector2::new(centres[0][i], centres[1][i]);
        let mut intervals = [Intervals::default(), Intervals::default()];
        let largest = self.rate.largest();
        logs.fill(0.0);
        blurred.fill(0.0);
        if let RateModel::Joint(range) = &self.rate {
            let mut all = vec![RateSums::default(); logs.len()];
            for i in 0..logs.len() {
                let mut less = RateSums::default();
                for record in &self.records {
                    let (sums, share) = record.blurred_sums(&at(i), half_width, largest);
                    // The normalisation of the noise is not discounted: it would favour cells where the response is steep.
                    less = less.plus(&sums.discounted(share));
                    all[i] = all[i].plus(&sums);
                }
                let (log, cut) = less.log_uncut(range);
                blurred[i] = log;
                intervals[0].push(i, cut);
            }
            intervals[0].add_to(blurred);
            let best = blurred
                .iter()
                .zip(priors)
                .fold(f64::NEG_INFINITY, |best, (b, p)| best.max(b + p));
            let floor = floor.max(best - dropped);
            for (i, (log, sums)) in logs.iter_mut().zip(&all).enumerate() {
                if blurred[i] + priors[i] < floor {
                    *log = blurred[i];
                    continue;
                }
                let (own, cut) = sums.log_uncut(range);
                *log = own;
                intervals[1].push(i, cut);
            }
            intervals[1].add_to(logs);
            return;
        }
        for record in &self.records {
            let [plain_cuts, blurred_cuts] = &mut intervals;
            for i in 0..logs.len() {
                let position = at(i);
                let (sums, share) = record.blurred_sums(&position, half_width, largest);
                let less = sums.discounted(share);
                match &self.rate {
                    RateModel::Known(rate) => {
                        logs[i] += sums.log_given_rate(*rate);
                        blurred[i] += less.log_given_rate(*rate);
                    }
                    RateModel::Joint(range) | RateModel::NodeWise(range) => {
                        for (sums, numbers, cuts) in [
                            (sums, &mut *logs, &mut *plain_cuts),
                            (less, &mut *blurred, &mut *blurred_cuts),
                        ] {
                            let (log, cut) = sums.log_uncut(range);
                            numbers[i] += log;
                            cuts.push(i, cut);
                        }
                    }
                    RateModel::SampleWise(range) => {
                        let targets = [(&mut logs[i], &mut *plain_cuts), (&mut blurred[i], &mut *blurred_cuts)];
                        record.add_sample_wise(&position, range, share, i, targets);
                    }
                }
            }
            plain_cuts.add_to(logs);
            blurred_cuts.add_to(blurred);
        }
    }
}

impl Likelihood<2> for SourceLikelihood {
    fn log_likelihood(&self, position: &SVector<f64, 2>) -> f64 {
        if !self.admits(position, 0.0) {
            return f64::NEG_INFINITY;
        }
        match &self.rate {
            RateModel::Known(rate) => self.sums(position).log_given_rate(*rate),
            RateModel::Joint(range) => self.sums(position).log_marginal(range),
            RateModel::NodeWise(range) => self.records.iter().map(|r| r.sums(position).log_marginal(range)).sum(),
            RateModel::SampleWise(range) => self.records.iter().map(|r| r.log_sample_wise(position, range)).sum(),
        }
    }
}

/// `ln p(samples | position, rate)`: the state is (x, y, rate).
#[derive(Debug, Clone)]
pub struct RateLikelihood {
    records: Vec<Record>,
}

impl RateLikelihood {
    /// The likelihood of the given records.
    pub fn new(records: Vec<Record>) -> Self {
        Self { records }
    }
}

impl Likelihood<3> for RateLikelihood {
    fn log_likelihood(&self, state: &SVector<f64, 3>) -> f64 {
        let position = Vector2::new(state[0], state[1]);
        if !self.records.iter().all(|record| record.sensor().admits(&position, 0.0)) {
            return f64::NEG_INFINITY;
        }
        self.records
            .iter()
            .map(|record| record.sums(&position).log_given_rate(state[2]))
            .sum()
    }
}
