//! The posterior mean given the bits of a bank, its table over all outcomes, and exact errors.

use super::sums::{moments, squared_error};
use crate::observation::bank::Bank;
use crate::observation::source::Nodes;
use crate::{Error, LookupTable, PatternSensor};
use fewbits_core::Observation;
use fewbits_numerics::error::entries;
use fewbits_quantizer_design::outcomes::{IMPOSSIBLE, Table, for_each_log};

impl Bank {
    /// The posterior mean from one observation per sensor, without a table. A missing bit carries no information.
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors.
    pub fn posterior_mean(&self, observations: &[Observation<bool>]) -> Result<f64, Error> {
        let (score, nodes) = self.posterior_score(observations)?;
        Ok(mean_under(&score, &nodes))
    }

    /// `E[(x - estimate)^2 | observations]`: at the posterior mean the posterior variance.
    pub(crate) fn posterior_squared_error(
        &self,
        observations: &[Observation<bool>],
        estimate: f64,
    ) -> Result<f64, Error> {
        let (score, nodes) = self.posterior_score(observations)?;
        let w = weights_under(&score, &nodes);
        let (mass, _) = moments(&w, &nodes.points);
        Ok(if mass > 0.0 {
            squared_error(&w, &nodes.points, estimate) / mass
        } else {
            0.0
        })
    }

    /// Log likelihood of the observations at the quadrature nodes of the source, and the nodes.
    fn posterior_score(&self, observations: &[Observation<bool>]) -> Result<(Vec<f64>, Nodes), Error> {
        entries("observations", observations.len(), self.sensors())?;
        let nodes = self.fine_nodes();
        let mut score = vec![0.0; nodes.points.len()];
        for (n, observation) in observations.iter().enumerate() {
            let Some(bit) = observation.received() else {
                continue;
            };
            let sensor = self.sensor(n);
            for (s, x) in score.iter_mut().zip(&nodes.points) {
                *s += sensor.log_probabilities(*x)[usize::from(*bit)];
            }
        }
        Ok((score, nodes))
    }

    /// The look-up table of the posterior mean, the estimate of least mean squared error.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn table(&self) -> Result<LookupTable, Error> {
        let mut estimates = vec![0.0; self.checked_outcomes()?];
        let nodes = self.fine_nodes();
        let mut impossible = Vec::new();
        self.for_outcomes(&nodes, |index, w| {
            let (mass, first) = moments(w, &nodes.points);
            if mass > IMPOSSIBLE {
                estimates[index] = first / mass;
            } else {
                impossible.push(index);
            }
        });
        // Outcomes whose probability underflows are computed in logarithms, which takes longer.
        if !impossible.is_empty() {
            self.for_log_outcomes(&nodes.points, |index, score| {
                if impossible.binary_search(&index).is_ok() {
                    estimates[index] = mean_under(score, &nodes);
                }
            });
        }
        LookupTable::new(self.clone(), estimates)
    }

    /// Exact mean squared error of the posterior mean, `sum_z int (x - E[X|z])^2 p(x) P(z|x) dx`.
    ///
    /// Every term is positive, so no digits are lost if the error is small.
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes.
    pub fn mmse(&self) -> Result<f64, Error> {
        self.checked_outcomes()?;
        let nodes = self.fine_nodes();
        let mut error = 0.0;
        self.for_outcomes(&nodes, |_, w| {
            let (mass, first) = moments(w, &nodes.points);
            if mass > IMPOSSIBLE {
                error += squared_error(w, &nodes.points, first / mass);
            }
        });
        Ok(error)
    }

    /// Visits all outcomes with their indices and `ln P(outcome|x)` at the points.
    #[doc(hidden)]
    pub fn for_log_outcomes(&self, points: &[f64], visit: impl FnMut(usize, &[f64])) {
        let of = |(sensor, count): (&PatternSensor, usize)| {
            let logs: Vec<[f64; 2]> = points.iter().map(|&x| sensor.log_probabilities(x)).collect();
            let rows = [0, 1].map(|bit| logs.iter().map(|l| l[bit]).collect::<Vec<_>>());
            Table::new(rows.concat(), points.len()).of_log_counts(count)
        };
        let tables: Vec<Table> = self.groups().map(of).collect();
        for_each_log(&tables, &vec![0.0; points.len()], visit);
    }
}

/// Mean of the source if its density is multiplied by the exponential of `score`, which is given at the nodes.
fn mean_under(score: &[f64], nodes: &Nodes) -> f64 {
    let (mass, first) = moments(&weights_under(score, nodes), &nodes.points);
    if mass > 0.0 { first / mass } else { 0.0 }
}

/// Weights of the nodes times the exponential of `score`, up to a constant. The largest score is subtracted first, so that at least one
/// does not underflow.
fn weights_under(score: &[f64], nodes: &Nodes) -> Vec<f64> {
    let best = score.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    score
        .iter()
        .zip(&nodes.weights)
        .map(|(s, w)| w * (s - best).exp())
        .collect()
}
