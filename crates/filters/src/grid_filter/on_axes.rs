//! The grid filter under the receiver's contract: all observations of one instant jointly.

use super::{GridFilter, GridWorkspace, check_axes};
use crate::Error;
use crate::contract::{Info, StateFilter};
use fewbits_core::{Columns, Gaussian, GaussianDynamics, Likelihood};
use fewbits_numerics::error::refuse;
use nalgebra::SVector;
use rand::Rng;

/// [`GridFilter`] over the coordinates `axes` of the state. Processes all observations of one instant jointly, without linearisation.
#[derive(Debug, Clone)]
pub struct GridOnAxes<const D: usize, const K: usize> {
    grid: GridFilter,
    axes: [usize; K],
    workspace: GridWorkspace<K>,
}

impl<const D: usize, const K: usize> GridOnAxes<D, K> {
    /// The filter for likelihoods that depend only on the coordinates `axes`.
    ///
    /// # Errors
    /// If `axes` are not different coordinates of a state of `D`.
    pub fn new(grid: GridFilter, axes: [usize; K]) -> Result<Self, Error> {
        check_axes::<D, K>(&axes)?;
        Ok(Self {
            grid,
            axes,
            workspace: GridWorkspace::default(),
        })
    }
}

/// Likelihoods of a state of `D` as functions of the coordinates `axes`; the other coordinates are those of `state`.
struct OnPlane<'a, const D: usize, const K: usize> {
    observed: &'a [&'a dyn Likelihood<D>],
    axes: [usize; K],
    state: SVector<f64, D>,
}

impl<const D: usize, const K: usize> Likelihood<K> for OnPlane<'_, D, K> {
    fn log_likelihood(&self, place: &SVector<f64, K>) -> f64 {
        let mut state = self.state;
        self.axes
            .iter()
            .zip(place.iter())
            .for_each(|(axis, x)| state[*axis] = *x);
        self.observed.log_likelihood(&state)
    }

    fn add_log_likelihoods(&self, places: Columns<'_, K>, logs: &mut [f64]) {
        const BLOCK: usize = 256;
        if !fewbits_core::columns::lengths_agree(&places, logs) {
            return;
        }
        // Coordinates on which no likelihood depends.
        let constant: [[f64; BLOCK]; D] = std::array::from_fn(|d| [self.state[d]; BLOCK]);
        for (block, logs) in logs.chunks_mut(BLOCK).enumerate() {
            let (start, count) = (block * BLOCK, logs.len());
            let column = |d: usize| match self.axes.iter().position(|axis| *axis == d) {
                Some(k) => &places[k][start..start + count],
                None => &constant[d][..count],
            };
            let states: Columns<'_, D> = std::array::from_fn(column);
            self.observed.add_log_likelihoods(states, logs);
        }
    }
}

impl<const D: usize, const K: usize> StateFilter<D> for GridOnAxes<D, K> {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(*prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        *belief = dynamics.predict(belief, 1.0);
        Ok(())
    }

    /// An error if a likelihood depends on a coordinate outside `axes`.
    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        if observed.is_empty() {
            return Ok(Info::default());
        }
        // The grid covers `axes` only. The other coordinates are held at the mean, so no likelihood may depend on them.
        let others = (0..D).filter(|d| !self.axes.contains(d));
        for axis in others {
            if observed.iter().any(|one| one.reads(belief.mean(), axis)) {
                let expected = format!("likelihoods that read the coordinates {:?} only", self.axes);
                return refuse("observed", format!("a likelihood that reads coordinate {axis}"), expected);
            }
        }
        let joint = OnPlane {
            observed,
            axes: self.axes,
            state: *belief.mean(),
        };
        let (next, info) = self.grid.update(belief, self.axes, &joint, &mut self.workspace)?;
        *belief = next;
        Ok(Info::new(info.log_likelihood))
    }
}
