//! A filter of its own range noise, so that the filters of a bank can differ in it.
//!
//! All filters of a bank receive the same likelihood, with the same noise. The rest of a filter's noise is a coordinate of its state.

use super::settings::{BIAS, OFFSET};
use fewbits_core::{Gaussian, GaussianDynamics, Likelihood};
use fewbits_filters::{Error, Info, MomentFilter, StateFilter};
use rand::Rng;

/// [`MomentFilter`] of a state whose coordinate [`OFFSET`] is the bias plus an error that is drawn anew for each range.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnError {
    /// Variance of that error, in square metres.
    pub variance: f64,
}

impl OwnError {
    /// Replaces the offset by that of the next range: the bias plus an independent error.
    fn renew<const D: usize>(&self, belief: &mut Gaussian<D>) {
        let (mut mean, mut covariance) = (*belief.mean(), *belief.covariance());
        mean[OFFSET] = mean[BIAS];
        covariance.set_row(OFFSET, &covariance.row(BIAS).into_owned());
        covariance.set_column(OFFSET, &covariance.column(BIAS).into_owned());
        covariance[(OFFSET, OFFSET)] += self.variance;
        *belief = Gaussian::from_trusted_parts(mean, covariance);
    }
}

impl<const D: usize> StateFilter<D> for OwnError {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        let mut start = *prior;
        self.renew(&mut start);
        Ok(start)
    }

    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        MomentFilter.predict(rng, dynamics, belief)?;
        self.renew(belief);
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        let (mut next, mut info) = (*belief, Info::default());
        for one in observed {
            info.log_likelihood += one.condition(&mut next)?.log_likelihood;
            self.renew(&mut next);
        }
        *belief = next;
        Ok(info)
    }
}
