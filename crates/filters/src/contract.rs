//! The contract of filters at a receiver: a time update, and one measurement update for all that was observed at one instant.
//!
//! Everything here is object-safe, so that models, sensors and observations of any kind stand in one list. A filter that is known
//! at compile time is faster through its own functions ([`crate::assumed_density`], [`crate::ParticleFilter`]).

use crate::assumed_density;
use crate::grid_filter::check_axes;
use crate::{Error, GridFilter, GridWorkspace, ParticleFilter, Workspace};
use fewbits_core::{
    Belief, Columns, ColumnsMut, Evolution, Factor, Gaussian, GaussianDynamics, Likelihood, Observed, Sensing,
};
use fewbits_densities::Particles;
use fewbits_numerics::error::{at_least_one, refuse};
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// Dynamics over a fixed time as a filter sees them: [`GaussianDynamics`] without their types.
///
/// `noise_scale` multiplies the covariance of the process noise; 1 is the model as it was stated.
pub trait Motion<const D: usize> {
    /// Moves a Gaussian: `f(m)`, `F P F' + noise_scale Q` with `F` and `Q` at the mean.
    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D>;

    /// Moves every state of a cloud by a draw of its own.
    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, states: ColumnsMut<'_, D>);
}

impl<const D: usize, G: GaussianDynamics<D>> Motion<D> for G {
    fn predict(&self, belief: &Gaussian<D>, noise_scale: f64) -> Gaussian<D> {
        let jacobian = self.jacobian(belief.mean());
        let noise = self.noise_covariance_at(belief.mean()) * noise_scale;
        Gaussian::from_trusted_parts(self.mean(belief.mean()), congruence(&jacobian, belief.covariance()) + noise)
    }

    fn move_columns(&self, rng: &mut dyn Rng, noise_scale: f64, mut states: ColumnsMut<'_, D>) {
        if noise_scale == 1.0 {
            self.propagate_columns(rng, states);
            return;
        }
        // What a draw adds to the mean is stretched.
        let stretch = noise_scale.sqrt();
        for i in 0..fewbits_core::columns::count(&states) {
            let state = SVector::<f64, D>::from_fn(|d, _| states[d][i]);
            let mean = self.mean(&state);
            let moved = mean + (self.propagate(rng, &state) - mean) * stretch;
            fewbits_core::columns::set_state(&mut states, i, &moved);
        }
    }
}

/// A world that moves in continuous time as a filter sees it: [`Evolution`] without its types.
pub trait Evolving<const D: usize> {
    /// The motion over `seconds`.
    ///
    /// # Errors
    /// If the time is negative or not finite.
    fn over(&self, seconds: f64) -> Result<Box<dyn Motion<D>>, Error>;
}

impl<const D: usize, E: Evolution<D>> Evolving<D> for E
where
    E::Step: 'static,
{
    fn over(&self, seconds: f64) -> Result<Box<dyn Motion<D>>, Error> {
        Ok(Box::new(Evolution::over(self, seconds)?))
    }
}

/// What conditioning a Gaussian on one observation gives.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditioned<const D: usize> {
    /// The Gaussian with the moments of the posterior.
    pub belief: Gaussian<D>,
    /// `ln p(observation | past)`.
    pub log_likelihood: f64,
    /// Mean of the first component of the noise-free measurement after the observation, minus before.
    pub correction: f64,
}

/// What one observation says about the state: weighs clouds and grids ([`Likelihood`]), conditions Gaussians.
pub trait StateLikelihood<const D: usize>: Likelihood<D> {
    /// Conditions a Gaussian, the sensing linearised at its mean.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if the observation has probability zero under the belief.
    fn condition(&self, belief: &Gaussian<D>) -> Result<Conditioned<D>, Error>;

    /// Whether the likelihood depends on this coordinate, near this state.
    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool;
}

impl<const D: usize, const M: usize, S: Sensing<D, M>, F: Factor<M>> StateLikelihood<D> for Observed<S, F, M> {
    fn condition(&self, belief: &Gaussian<D>) -> Result<Conditioned<D>, Error> {
        let (posterior, info) = assumed_density::update_through(belief, self)?;
        Ok(Conditioned {
            belief: posterior,
            log_likelihood: info.log_likelihood,
            correction: if M == 0 { 0.0 } else { info.correction[0] },
        })
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        let jacobian: SMatrix<f64, M, D> = self.sensing.jacobian(state);
        jacobian.column(axis).iter().any(|x| *x != 0.0)
    }
}

/// What an update reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[non_exhaustive]
pub struct Info {
    /// `ln p(all observations of the instant | past)`.
    pub log_likelihood: f64,
    /// Effective sample size, of particles.
    pub effective_sample_size: Option<f64>,
}

/// A filter as a receiver needs it. Both updates work in place; one that fails leaves the belief as it was.
pub trait StateFilter<const D: usize> {
    /// What the filter knows.
    type Belief: Belief<D> + Clone;

    /// The belief before the first update.
    ///
    /// # Errors
    /// If the prior cannot be represented.
    fn start(&mut self, rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Self::Belief, Error>;

    /// Time update, the process noise multiplied by `noise_scale`.
    ///
    /// # Errors
    /// Those of the filter.
    fn predict(
        &mut self,
        rng: &mut dyn Rng,
        motion: &dyn Motion<D>,
        noise_scale: f64,
        belief: &mut Self::Belief,
    ) -> Result<(), Error>;

    /// Takes in all observations of one instant.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if they have probability zero under the belief.
    fn update(
        &mut self,
        rng: &mut dyn Rng,
        belief: &mut Self::Belief,
        observed: &[Box<dyn StateLikelihood<D>>],
    ) -> Result<Info, Error>;
}

/// The filter of [`assumed_density`]: with values it is the extended Kalman filter. Observations of one instant are taken in one
/// after the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct MomentFilter;

impl<const D: usize> StateFilter<D> for MomentFilter {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(*prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        motion: &dyn Motion<D>,
        noise_scale: f64,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        *belief = motion.predict(belief, noise_scale);
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[Box<dyn StateLikelihood<D>>],
    ) -> Result<Info, Error> {
        let (mut next, mut log_likelihood) = (*belief, 0.0);
        for one in observed {
            let conditioned = one.condition(&next)?;
            next = conditioned.belief;
            log_likelihood += conditioned.log_likelihood;
        }
        *belief = next;
        Ok(Info {
            log_likelihood,
            effective_sample_size: None,
        })
    }
}

/// [`GridFilter`] over the coordinates `axes` of the state: all observations of one instant jointly, without linearisation.
#[derive(Debug, Clone)]
pub struct GridOnAxes<const D: usize, const K: usize> {
    grid: GridFilter,
    axes: [usize; K],
    workspace: GridWorkspace<K>,
}

impl<const D: usize, const K: usize> GridOnAxes<D, K> {
    /// The filter for likelihoods that depend on no other coordinates than `axes`.
    ///
    /// # Errors
    /// If these are not different coordinates of a state of `D`.
    pub fn new(grid: GridFilter, axes: [usize; K]) -> Result<Self, Error> {
        check_axes::<D, K>(&axes)?;
        Ok(Self {
            grid,
            axes,
            workspace: GridWorkspace::default(),
        })
    }
}

/// Likelihoods of a state of `D` as one of the coordinates `axes`, the others at `state`.
struct OnPlane<'a, const D: usize, const K: usize> {
    observed: &'a [Box<dyn StateLikelihood<D>>],
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
        self.observed.iter().map(|one| one.log_likelihood(&state)).sum()
    }

    fn add_log_likelihoods(&self, places: Columns<'_, K>, logs: &mut [f64]) {
        const BLOCK: usize = 256;
        if !fewbits_core::columns::lengths_agree(&places, logs) {
            return;
        }
        // Coordinates that nothing reads.
        let constant: [[f64; BLOCK]; D] = std::array::from_fn(|d| [self.state[d]; BLOCK]);
        for (block, logs) in logs.chunks_mut(BLOCK).enumerate() {
            let (start, count) = (block * BLOCK, logs.len());
            let column = |d: usize| match self.axes.iter().position(|axis| *axis == d) {
                Some(k) => &places[k][start..start + count],
                None => &constant[d][..count],
            };
            let states: Columns<'_, D> = std::array::from_fn(column);
            self.observed
                .iter()
                .for_each(|one| one.add_log_likelihoods(states, logs));
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
        motion: &dyn Motion<D>,
        noise_scale: f64,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        *belief = motion.predict(belief, noise_scale);
        Ok(())
    }

    /// Refuses likelihoods that read another coordinate than the grid's.
    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[Box<dyn StateLikelihood<D>>],
    ) -> Result<Info, Error> {
        if observed.is_empty() {
            return Ok(Info::default());
        }
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
        Ok(Info {
            log_likelihood: info.log_likelihood,
            effective_sample_size: None,
        })
    }
}

/// [`ParticleFilter`] (bootstrap) with a number of particles.
#[derive(Debug, Clone)]
pub struct BootstrapFilter<const D: usize> {
    filter: ParticleFilter,
    count: usize,
    workspace: Workspace<D>,
}

impl<const D: usize> BootstrapFilter<D> {
    /// The filter with `count` particles.
    ///
    /// # Errors
    /// If there is none.
    pub fn new(filter: ParticleFilter, count: usize) -> Result<Self, Error> {
        Ok(Self {
            filter,
            count: at_least_one("count", count)?,
            workspace: Workspace::default(),
        })
    }
}

/// Observations of one instant: their log likelihoods add.
struct All<'a, const D: usize>(&'a [Box<dyn StateLikelihood<D>>]);

impl<const D: usize> Likelihood<D> for All<'_, D> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.0.iter().map(|one| one.log_likelihood(state)).sum()
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, logs: &mut [f64]) {
        self.0.iter().for_each(|one| one.add_log_likelihoods(states, logs));
    }
}

impl<const D: usize> StateFilter<D> for BootstrapFilter<D> {
    type Belief = Particles<D>;

    fn start(&mut self, mut rng: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Particles<D>, Error> {
        Ok(Particles::from_belief(&mut rng, prior, self.count)?)
    }

    fn predict(
        &mut self,
        mut rng: &mut dyn Rng,
        motion: &dyn Motion<D>,
        noise_scale: f64,
        belief: &mut Particles<D>,
    ) -> Result<(), Error> {
        self.filter.resample(&mut rng, belief, &mut self.workspace)?;
        motion.move_columns(rng, noise_scale, belief.columns_mut());
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Particles<D>,
        observed: &[Box<dyn StateLikelihood<D>>],
    ) -> Result<Info, Error> {
        let info = self.filter.update(belief, &All(observed))?;
        Ok(Info {
            log_likelihood: info.log_likelihood,
            effective_sample_size: Some(info.effective_sample_size),
        })
    }
}
