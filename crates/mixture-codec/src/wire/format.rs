//! The format that sender and receiver agree on beforehand.

use crate::Error;
use fewbits_numerics::error::{all_finite, positive, refuse, within};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// The format that sender and receiver agree on: range of the means, unit, and resolutions of the quantiser.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredFormat<D>")]
pub struct WireFormat<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    pub(super) centre: SVector<f64, D>,
    pub(super) half_width: f64,
    pub(super) unit: f64,
    pub(super) resolutions: Vec<f64>,
}

impl<const D: usize> WireFormat<D> {
    /// A format for beliefs whose mean is within `half_width` of `centre` along each axis and whose standard deviations are
    /// between `unit / 2981` and `2981 unit` (8 nepers). The resolutions are quantiser steps in standard deviations.
    ///
    /// # Errors
    /// If a number is not finite; `half_width`, `unit` or a resolution is not above 0; a resolution is above 4 or below 1e-4; or
    /// there is none or more than 16.
    pub fn new(centre: SVector<f64, D>, half_width: f64, unit: f64, resolutions: &[f64]) -> Result<Self, Error> {
        all_finite("centre", centre.as_slice())?;
        positive("half_width", half_width)?;
        positive("unit", unit)?;
        if resolutions.is_empty() || resolutions.len() > 16 {
            return refuse("resolutions", format!("{} numbers", resolutions.len()), "1 to 16");
        }
        for r in resolutions {
            within("resolutions", *r, 1e-4, 4.0)?;
        }
        Ok(Self {
            centre,
            half_width,
            unit,
            resolutions: resolutions.to_vec(),
        })
    }

    /// A format with means within `20 unit` of the origin and one resolution.
    ///
    /// # Errors
    /// As [`WireFormat::new`].
    pub fn around_origin(unit: f64, resolution: f64) -> Result<Self, Error> {
        Self::new(SVector::zeros(), 20.0 * positive("unit", unit)?, unit, &[resolution])
    }

    /// The resolutions; a message contains the index of one.
    pub fn resolutions(&self) -> &[f64] {
        &self.resolutions
    }
}

/// The stored form of [`WireFormat`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredFormat<const D: usize> {
    #[serde(with = "fewbits_numerics::stored")]
    centre: SVector<f64, D>,
    half_width: f64,
    unit: f64,
    resolutions: Vec<f64>,
}

impl<const D: usize> TryFrom<StoredFormat<D>> for WireFormat<D> {
    type Error = Error;

    fn try_from(parts: StoredFormat<D>) -> Result<Self, Error> {
        WireFormat::new(parts.centre, parts.half_width, parts.unit, &parts.resolutions)
    }
}
