//! What many figures use.

pub(crate) use crate::arguments::{Refusal, accept, accept_each};
pub(crate) use crate::claim::{find, minus, over};
pub(crate) use crate::picture::{Named, plotted};
pub(crate) use crate::reference;
pub(crate) use crate::schema::{Answer, Field, List};
pub(crate) use crate::sweep::{distinct, first, joined, product, select};
pub(crate) use crate::{About, Claims, Context, Cost, Error, Figure, Measured, Quick};
pub(crate) use fewbits_core::{Belief, Dynamics, Gaussian, Link, Observation, Observed, Sensing, Sign};
pub(crate) use fewbits_monte_carlo::parallel;
pub(crate) use fewbits_monte_carlo::{Moments, Stream, Trial};
pub(crate) use fewbits_plot::{Axis, Layer, Marker, Panel, Plot, points};
pub(crate) use nalgebra::{Matrix1, Matrix2, Matrix4, SMatrix, SVector, Vector1, Vector2, Vector3, Vector4};
pub(crate) use rand::{Rng, RngExt};
pub(crate) use rand_distr::StandardNormal;
