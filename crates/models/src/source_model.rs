//! The concentrations that a diffusing source causes at sensors: the interface between a model of the medium and an estimator.

use crate::Error;
use nalgebra::{Vector2, Vector3};
use std::ops::Deref;

/// A concentration and its gradient with respect to the position of the source.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SourceGradient {
    /// Concentration per unit rate, kg/m^3 per kg/s.
    pub value: f64,
    /// Gradient of `value` with respect to the position of the source, per metre.
    pub gradient: Vector3<f64>,
}

/// A place at which a model computes concentrations, made by [`SourceModel::receptor`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Receptor {
    /// Position, m.
    pub place: Vector3<f64>,
    /// The model's own index of this place, such as the number of its adjoint solution; 0 if the model needs none.
    pub index: usize,
}

/// Stated by a model whose field does not change along the ground: with `d` the horizontal offset from source to receptor,
///
/// `concentration = f(|d|, heights, age) exp((wind . d - |wind| |d|) / (2 diffusivity))`,
///
/// and `ln f` changes by at most `1/r + 2 r / (4 diffusivity age) + speed / diffusivity` per metre at distance `r`. An estimator
/// may then tabulate `f` over the distance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Homogeneous {
    /// Diffusivity, m^2/s.
    pub diffusivity: f64,
    /// Horizontal wind, m/s.
    pub wind: Vector2<f64>,
    /// Norm of the wind, its vertical part included, m/s.
    pub speed: f64,
    /// Shorter distances are replaced by this one, m.
    pub closest: f64,
}

/// The concentration at sensors from a point source with a constant release rate, in any geometry.
///
/// A model gives concentrations **per unit rate** (kg/m^3 per kg/s) after a release of `age` seconds. The concentration of a source
/// with rate `mu` that began at `start` is `mu` times that at `age = time - start`; that of one that has stopped is the difference of two.
/// A model that is computed on a grid implements [`receptor`](Self::receptor) (it refuses places without an adjoint solution),
/// [`concentration`](Self::concentration), [`source_gradient`](Self::source_gradient), [`variation`](Self::variation),
/// [`admits`](Self::admits), and [`concentrations`](Self::concentrations) where instants share work.
///
/// Laws:
/// 1. `concentration` is 0 at age zero and before, 0 where `admits` is false, never negative, never NaN. An infinite age is the
///    steady state.
/// 2. `source_gradient` has the value of `concentration`; its gradient is finite, and the derivative wherever there is one.
/// 3. `concentrations` equals `concentration` age by age, to the bit.
/// 4. `variation` never decreases with `half_width` and is 0 only where the concentration is constant.
/// 5. If `admits(source, 0)` is true, so is `admits(s, w)` for every square that holds the source.
///
/// The trait is object-safe. `&M`, `Box<M>` and `Arc<M>` are models if `M` is: share a large model by an `Arc`.
pub trait SourceModel {
    /// The receptor at `place`, m.
    ///
    /// # Errors
    /// If the model has no concentrations there.
    fn receptor(&self, place: &Vector3<f64>) -> Result<Receptor, Error> {
        Ok(Receptor {
            place: *place,
            index: 0,
        })
    }

    /// Concentration per unit rate at a receptor, kg/m^3 per kg/s, of a source at `source` that has released for `age` seconds.
    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64;

    /// [`concentration`](Self::concentration) at several ages: writes one number per age to `out`, which has the length of `ages`.
    fn concentrations(&self, receptor: &Receptor, source: &Vector3<f64>, ages: &[f64], out: &mut [f64]) {
        for (age, out) in ages.iter().zip(out) {
            *out = self.concentration(receptor, source, *age);
        }
    }

    /// Concentration and its gradient with respect to the position of the source.
    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient;

    /// An approximate upper bound, in kg/m^3 per kg/s, of the change of the concentration at the receptor while the source moves within the
    /// horizontal square of the given half width (m) around `source`.
    ///
    /// An estimator adds it to the noise while its cells are coarse, so that a narrow ridge of the likelihood between cell centres is not
    /// missed. Too large a value costs time; a value too small by more than a factor of two may miss the ridge.
    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64;

    /// Whether some position in the horizontal square of the given half width (m) around `source`, at its height, is possible for a source.
    /// With half width 0: whether `source` is. False within walls and outside the model's region.
    fn admits(&self, source: &Vector3<f64>, half_width: f64) -> bool {
        let _ = (source, half_width);
        true
    }

    /// `Some` if nothing changes along the ground.
    fn homogeneous(&self) -> Option<Homogeneous> {
        None
    }

    /// Derivative of the concentration with respect to the diffusivity, kg/m^3 per kg/s per m^2/s. `None` if the model does not have a
    /// single diffusivity.
    fn diffusivity_slope(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> Option<f64> {
        let _ = (receptor, source, age);
        None
    }
}

/// References and boxes, as what they point to.
impl<P: Deref<Target: SourceModel>> SourceModel for P {
    fn receptor(&self, place: &Vector3<f64>) -> Result<Receptor, Error> {
        (**self).receptor(place)
    }

    fn concentration(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> f64 {
        (**self).concentration(receptor, source, age)
    }

    fn concentrations(&self, receptor: &Receptor, source: &Vector3<f64>, ages: &[f64], out: &mut [f64]) {
        (**self).concentrations(receptor, source, ages, out);
    }

    fn source_gradient(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> SourceGradient {
        (**self).source_gradient(receptor, source, age)
    }

    fn variation(&self, receptor: &Receptor, source: &Vector3<f64>, half_width: f64, age: f64) -> f64 {
        (**self).variation(receptor, source, half_width, age)
    }

    fn admits(&self, source: &Vector3<f64>, half_width: f64) -> bool {
        (**self).admits(source, half_width)
    }

    fn homogeneous(&self) -> Option<Homogeneous> {
        (**self).homogeneous()
    }

    fn diffusivity_slope(&self, receptor: &Receptor, source: &Vector3<f64>, age: f64) -> Option<f64> {
        (**self).diffusivity_slope(receptor, source, age)
    }
}
