//! Priors by a function of the unknown.

use super::prior::{Prior, Shape, TABLE_NODES, TABLE_PANELS, check_interval};
use crate::error::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::entries;
use fewbits_numerics::quadrature::gauss_legendre;
use std::ops::RangeInclusive;

/// Largest relative difference between the integrals by half of the panels and by all; a rougher function is an error.
const ROUGHNESS: f64 = 1e-6;

impl Prior {
    /// As [`density`](Self::density), for a function that takes all nodes at once and may fail. It returns one number per node.
    ///
    /// # Errors
    /// As [`density`](Self::density), those of the function, or if it returns another number of values.
    pub fn density_by<E: From<Error>>(
        density: impl FnOnce(&[f64]) -> Result<Vec<f64>, E>,
        support: RangeInclusive<f64>,
    ) -> Result<Self, E> {
        let (low, high) = support.into_inner();
        check_interval(low, high)?;
        let rule = gauss_legendre::<TABLE_NODES>();
        let panels = [TABLE_PANELS, TABLE_PANELS / 2];
        let nodes: Vec<(f64, f64)> = panels
            .iter()
            .flat_map(|panels| rule.panels(low, high, *panels))
            .collect();
        let places: Vec<f64> = nodes.iter().map(|(x, _)| *x).collect();
        let mut densities = density(&places)?;
        entries("density", densities.len(), places.len()).map_err(Error::from)?;
        let fine = TABLE_PANELS * TABLE_NODES;
        let weighed = densities.iter().zip(&nodes).map(|(p, (_, weight))| p.max(0.0) * weight);
        let weighed: Vec<f64> = weighed.collect();
        let (whole, half) = (weighed[..fine].iter().sum::<f64>(), weighed[fine..].iter().sum::<f64>());
        densities.truncate(fine);
        let found: Self = Shape::Table { low, high, densities }.try_into()?;
        if (half - whole).abs() > ROUGHNESS * whole {
            let given = format!("integrals {half} and {whole} by 32 and 64 panels");
            return Err(Error::from(ArgumentError::new("density", given, "a smooth function")).into());
        }
        Ok(found)
    }
}
