//! A designed quantizer with its reconstruction values.

use crate::error::{Error, refuse};
use crate::quantizer::{Quantizer, check_increasing};
use fewbits_numerics::error::{all_finite, finite, non_negative, positive, probabilities};
use serde::{Deserialize, Serialize};

/// A scalar quantizer of smallest squared error: cells `[b_{i-1}, b_i)` and the centroid of each.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Table")]
pub struct LloydMax {
    pub(super) breakpoints: Vec<f64>,
    pub(super) centroids: Vec<f64>,
    pub(super) probabilities: Vec<f64>,
    pub(super) mean_squared_error: f64,
}

/// The stored form of [`LloydMax`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    breakpoints: Vec<f64>,
    centroids: Vec<f64>,
    probabilities: Vec<f64>,
    mean_squared_error: f64,
}

impl TryFrom<Table> for LloydMax {
    type Error = Error;

    fn try_from(table: Table) -> Result<Self, Error> {
        let design = LloydMax {
            breakpoints: table.breakpoints,
            centroids: table.centroids,
            probabilities: table.probabilities,
            mean_squared_error: table.mean_squared_error,
        };
        design.checked()
    }
}

impl LloydMax {
    /// Checks that the parts of a stored quantizer are consistent.
    fn checked(self) -> Result<Self, Error> {
        let (breakpoints, centroids) = (&self.breakpoints, &self.centroids);
        check_increasing(breakpoints)?;
        all_finite("centroids", centroids)?;
        probabilities("probabilities", &self.probabilities)?;
        non_negative("mean_squared_error", self.mean_squared_error)?;
        let levels = breakpoints.len() + 1;
        if breakpoints.is_empty() || centroids.len() != levels || self.probabilities.len() != levels {
            let given = format!("{} centroids, {} probabilities", centroids.len(), self.probabilities.len());
            return refuse("centroids", given, format!("one per cell, {levels} of each, and at least two cells"));
        }
        let inside = |i: usize| {
            (i == 0 || breakpoints[i - 1] <= centroids[i]) && (i + 1 == levels || centroids[i] <= breakpoints[i])
        };
        if let Some(at) = (0..levels).find(|i| !inside(*i)) {
            return refuse("centroids", format!("{} at index {at}", centroids[at]), "a point of its own cell");
        }
        Ok(self)
    }

    /// Finite breakpoints, increasing, one fewer than levels.
    pub fn breakpoints(&self) -> &[f64] {
        &self.breakpoints
    }

    /// Reconstruction value of each cell.
    pub fn centroids(&self) -> &[f64] {
        &self.centroids
    }

    /// Probability of each cell.
    pub fn probabilities(&self) -> &[f64] {
        &self.probabilities
    }

    /// Mean squared error of reconstruction by centroids, in the squared unit of the variable.
    pub fn mean_squared_error(&self) -> f64 {
        self.mean_squared_error
    }

    /// The quantizer of `mean + deviation X`, where this one is the quantizer of `X`.
    ///
    /// # Errors
    /// If `mean` is not finite, `deviation` is not a positive number, the mean is so large that breakpoints coincide,
    /// or a centroid or the squared error overflows.
    pub fn affine(&self, mean: f64, deviation: f64) -> Result<Self, Error> {
        finite("mean", mean)?;
        positive("deviation", deviation)?;
        let map = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| mean + deviation * x).collect() };
        let breakpoints = map(&self.breakpoints);
        check_increasing(&breakpoints)?;
        let centroids = map(&self.centroids);
        all_finite("centroids", &centroids)?;
        let mean_squared_error = deviation * (deviation * self.mean_squared_error);
        if !mean_squared_error.is_finite() {
            return refuse("deviation", deviation, "a deviation whose square is finite");
        }
        Ok(Self {
            breakpoints,
            centroids,
            probabilities: self.probabilities.clone(),
            mean_squared_error,
        })
    }
}

impl From<&LloydMax> for Quantizer {
    fn from(design: &LloydMax) -> Self {
        Self {
            breakpoints: design.breakpoints().to_vec(),
            labels: (0..design.centroids().len()).collect(),
            levels: design.centroids().len(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lloyd_max::gaussian;

    #[test]
    fn tables_are_stored_and_checked_when_restored() {
        let q = gaussian(8).unwrap();
        let json = serde_json::to_string(&q).unwrap();
        assert_eq!(serde_json::from_str::<LloydMax>(&json).unwrap(), q);
        for (from, to) in [
            ("\"centroids\":[-", "\"centroids\":["),
            ("\"mean_squared_error\":", "\"mean_squared_error\":-"),
        ] {
            assert!(serde_json::from_str::<LloydMax>(&json.replacen(from, to, 1)).is_err());
        }
    }

    #[test]
    fn errors_that_overflow_are_refused() {
        let error = gaussian(4).unwrap().affine(0.0, 1e160).unwrap_err();
        assert!(error.to_string().contains("deviation"), "{error}");
        let wide = crate::density::Uniform::new(-1e200, 1e200).unwrap();
        assert!(crate::lloyd_max::design(&wide, 4).is_err());
        assert!(gaussian(4).unwrap().affine(1e200, 1e150).is_err());
        assert!(gaussian(4).unwrap().affine(1e150, 1e150).is_ok());
    }
}
