//! A factor of the measurements of a sensor.

use crate::circle::{all_nearest, nearest};
use crate::columns::ColumnsMut;
use crate::factor::Factor;
use crate::sensing::Sensing;
use nalgebra::SVector;

/// A factor composed with a sensing model `h`: `p(observation | x) = p(observation | m = h(x))`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Observed<S, F, const M: usize> {
    /// The sensing model, `h`.
    pub sensing: S,
    /// The likelihood of the observation as a function of `h(x)`.
    pub factor: F,
}

impl<S, F, const M: usize> Observed<S, F, M> {
    /// The likelihood of `factor` at the noise-free measurement of `sensing`.
    pub fn new(sensing: S, factor: F) -> Self {
        Self { sensing, factor }
    }
}

impl<S, F: Factor<M>, const M: usize> Observed<S, F, M> {
    /// The noise-free measurement, components on a circle nearest to the factor's location.
    #[inline(always)]
    pub(crate) fn measured<const D: usize>(&self, state: &SVector<f64, D>) -> SVector<f64, M>
    where
        S: Sensing<D, M>,
    {
        let (mean, periods) = (self.sensing.mean(state), self.sensing.periods());
        match self.on_circle(&periods) {
            Some(location) => all_nearest(mean, &location, &periods),
            None => mean,
        }
    }

    /// The factor's location, if a component is on a circle.
    #[inline(always)]
    pub(crate) fn on_circle(&self, periods: &[Option<f64>; M]) -> Option<SVector<f64, M>> {
        let is_circular = periods.iter().any(Option::is_some);
        is_circular.then(|| self.factor.location()).flatten()
    }

    /// Every measurement of a component on a circle moved nearest to the factor's location.
    #[inline(always)]
    pub(crate) fn move_near<const D: usize>(&self, means: &mut ColumnsMut<'_, M>)
    where
        S: Sensing<D, M>,
    {
        let periods = self.sensing.periods();
        let Some(location) = self.on_circle(&periods) else {
            return;
        };
        for (k, column) in means.iter_mut().enumerate() {
            if let Some(period) = periods[k] {
                column.iter_mut().for_each(|m| *m = nearest(*m, location[k], period));
            }
        }
    }
}
