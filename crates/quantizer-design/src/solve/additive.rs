//! A decoder that needs little memory: the estimate is a sum of one number per sensor.

use super::solution::Solution;
use crate::error::{Error, not_converged, refuse};
use crate::law::symbol_tables;
use crate::outcomes::{Table, dot, moments};
use fewbits_numerics::error::entries;
use nalgebra::{DMatrix, DVector};

/// Singular values below this fraction of the largest are treated as zero. They occur because the indicators of a sensor's symbols sum to
/// one.
const RANK_TOLERANCE: f64 = 1e-12;

/// The best estimate of the form `offset + sum_n weight_n[symbol_n]`.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct AdditiveDecoder {
    /// Mean of the unknown.
    pub offset: f64,
    /// For every sensor, a number per symbol.
    pub weights: Vec<Vec<f64>>,
    /// Mean squared error of these estimates, in squared units.
    pub mean_squared_error: f64,
}

impl AdditiveDecoder {
    /// The estimate from one symbol per sensor.
    ///
    /// # Errors
    /// If there is not one symbol per sensor, or a symbol is out of range.
    pub(super) fn decode(&self, symbols: &[usize]) -> Result<f64, Error> {
        entries("symbols", symbols.len(), self.weights.len())?;
        symbols
            .iter()
            .zip(&self.weights)
            .try_fold(self.offset, |sum, (symbol, weights)| match weights.get(*symbol) {
                Some(weight) => Ok(sum + weight),
                None => refuse("symbol", symbol, format!("a number below {}", weights.len())),
            })
    }
}

impl Solution {
    /// The additive decoder of least mean squared error, by normal equations from the joint probabilities of pairs of symbols.
    ///
    /// # Errors
    /// If a symbol table cannot be computed, which cannot happen for a design that has a value.
    pub(super) fn additive_decoder(&self) -> Result<AdditiveDecoder, Error> {
        let (system, model) = (self.system(), self.system().model());
        let mut tables: Vec<Table> = vec![Table::default(); model.sensors()];
        for (group, symbols) in system.groups().iter().zip(symbol_tables(system)?) {
            group.sensors.iter().for_each(|n| tables[*n] = symbols.clone());
        }
        let firsts: Vec<usize> = tables
            .iter()
            .scan(0, |at, t| {
                let first = *at;
                *at += t.rows();
                Some(first)
            })
            .collect();
        let size = tables.iter().map(Table::rows).sum();
        let (mut gram, mut moment) = (DMatrix::zeros(size, size), DVector::zeros(size));
        for (m, first) in tables.iter().zip(&firsts) {
            for t in 0..m.rows() {
                moment[first + t] = dot(&model.moment.weights, m.row(t));
                // A sensor sends one symbol at a time, so its own block of the matrix is diagonal.
                gram[(first + t, first + t)] = dot(&model.mass.weights, m.row(t));
            }
        }
        for m in 0..tables.len() {
            for n in m + 1..tables.len() {
                let joint = moments(&[&tables[m], &tables[n]], std::slice::from_ref(&model.mass));
                for (at, p) in joint.iter().enumerate() {
                    let (row, column) = (firsts[m] + at / tables[n].rows(), firsts[n] + at % tables[n].rows());
                    (gram[(row, column)], gram[(column, row)]) = (*p, *p);
                }
            }
        }
        // The matrix is singular (indicators of a sensor's symbols sum to one); the least solution of the normal equations is taken.
        let svd = gram.svd(true, true);
        let cut = RANK_TOLERANCE * svd.singular_values.max();
        let stalled = |_| not_converged("additive decoder", 0, cut);
        let weights = svd.solve(&moment, cut).map_err(stalled)?;
        Ok(AdditiveDecoder {
            offset: model.mean,
            mean_squared_error: (model.variance - weights.dot(&moment)).max(0.0),
            weights: tables
                .iter()
                .zip(&firsts)
                .map(|(t, first)| weights.rows(*first, t.rows()).iter().copied().collect())
                .collect(),
        })
    }
}
