//! How likely the samples of the visited nodes are for each position of the source.

use crate::rate::{RateModel, RateSums};
use crate::{Error, Record};
use fewbits_core::Likelihood;
use fewbits_numerics::ArgumentError;
use nalgebra::{SVector, Vector2};

/// `ln p(samples of all nodes | position)` under a model of the release rate.
#[derive(Debug, Clone, PartialEq)]
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
            return Err(ArgumentError::new("records", "empty", "at least one").into());
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

    /// The log likelihood blurred over a cell of the given half width, and the log likelihood itself where the first exceeds
    /// `floor`; elsewhere the blurred one stands for both.
    #[inline]
    pub(crate) fn blurred(&self, position: &Vector2<f64>, half_width: f64, floor: f64) -> (f64, f64) {
        let (mut all, mut blurred) = (RateSums::default(), RateSums::default());
        let (mut log, mut blurred_log) = (0.0, 0.0);
        for record in &self.records {
            let sums = record.sums(position);
            let share = record.discount(position, half_width);
            // The normalisation of the noise is not discounted: it would favour cells where the response is steep.
            let less = sums.discounted(share);
            match &self.rate {
                RateModel::Known(rate) => {
                    log += sums.log_given_rate(*rate);
                    blurred_log += less.log_given_rate(*rate);
                }
                RateModel::Joint(_) => {
                    all = all.plus(&sums);
                    blurred = blurred.plus(&less);
                }
                RateModel::NodeWise(range) => {
                    log += sums.log_marginal(range);
                    blurred_log += less.log_marginal(range);
                }
                RateModel::SampleWise(range) => {
                    log += record.log_sample_wise(position, range, 1.0);
                    blurred_log += record.log_sample_wise(position, range, share)
                        - 0.5 * share.ln() * record.samples().len() as f64;
                }
            }
        }
        match &self.rate {
            RateModel::Joint(range) => {
                let score = blurred.log_marginal(range);
                (if score > floor { all.log_marginal(range) } else { score }, score)
            }
            _ => (log, blurred_log),
        }
    }
}

impl Likelihood<2> for SourceLikelihood {
    fn log_likelihood(&self, position: &SVector<f64, 2>) -> f64 {
        match &self.rate {
            RateModel::Known(rate) => self.sums(position).log_given_rate(*rate),
            RateModel::Joint(range) => self.sums(position).log_marginal(range),
            RateModel::NodeWise(range) => self.records.iter().map(|r| r.sums(position).log_marginal(range)).sum(),
            RateModel::SampleWise(range) => self
                .records
                .iter()
                .map(|r| r.log_sample_wise(position, range, 1.0))
                .sum(),
        }
    }
}

/// `ln p(samples | position, rate)`: the state is (x, y, rate).
#[derive(Debug, Clone, PartialEq)]
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
        self.records
            .iter()
            .map(|record| record.sums(&position).log_given_rate(state[2]))
            .sum()
    }
}
