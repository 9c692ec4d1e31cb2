//! The stored form of a replica.

use super::bank::Bank;
use super::counts::{Residuals, Values};
use super::lattice::Lattice;
use super::replica::{CODERS, PREDICTORS, Replica};
use crate::error::Error;
use serde::{Deserialize, Serialize};
use std::vec::Vec;

#[derive(Serialize, Deserialize)]
#[serde(rename = "Replica")]
pub(super) struct StoredReplica {
    lattice: Lattice,
    bank: Bank,
    last: i64,
    before: i64,
    gap: u32,
    predictors: [f32; PREDICTORS],
    residuals: [StoredResiduals; PREDICTORS],
    values: StoredValues,
    coders: [f32; CODERS],
}

#[derive(Serialize, Deserialize)]
struct StoredResiduals {
    counts: Vec<u16>,
    total: u32,
}

#[derive(Serialize, Deserialize)]
struct StoredValues {
    indices: Vec<i64>,
    counts: Vec<u32>,
    total: u32,
}

impl From<Replica> for StoredReplica {
    fn from(replica: Replica) -> Self {
        let (indices, counts) = replica.values.iter().unzip();
        Self {
            lattice: replica.lattice,
            bank: replica.bank,
            last: replica.last,
            before: replica.before,
            gap: replica.gap,
            predictors: replica.predictors,
            residuals: replica.residuals.each_ref().map(|residuals| {
                let (counts, total) = residuals.to_counts();
                StoredResiduals {
                    counts: counts.to_vec(),
                    total,
                }
            }),
            values: StoredValues {
                indices,
                counts,
                total: replica.values.total(),
            },
            coders: replica.coders,
        }
    }
}

impl TryFrom<StoredReplica> for Replica {
    type Error = Error;

    fn try_from(stored: StoredReplica) -> Result<Self, Error> {
        let damaged = |name| move || Error::new(name, f64::NAN, "the counts that were stored");
        let mut replica = Self {
            lattice: stored.lattice,
            bank: stored.bank,
            last: stored.last,
            before: stored.before,
            gap: stored.gap,
            predictors: stored.predictors,
            coders: stored.coders,
            ..Self::UNSET
        };
        for (residuals, stored) in replica.residuals.iter_mut().zip(&stored.residuals) {
            *residuals = Residuals::from_counts(&stored.counts, stored.total).ok_or_else(damaged("residuals"))?;
        }
        let StoredValues { indices, counts, total } = stored.values;
        let agrees = |values: &Values| indices.len() == counts.len() && values.total() == total;
        let values = Values::from_counts(indices.iter().copied().zip(counts.iter().copied())).filter(agrees);
        replica.values = values.ok_or_else(damaged("values"))?;
        Ok(replica)
    }
}
