//! What nearly every figure uses.

pub(crate) use crate::claim::{Keyed, minus, over};
pub(crate) use crate::parameters::accept;
pub(crate) use crate::plot::{Axis, Layer, Marker, Panel, Plot, points};
pub(crate) use crate::sweep::{distinct, first, joined, select};
pub(crate) use crate::{About, Claims, Comparison, Context, Cost, Error, Figure, Measured, Quick, Tally};
pub(crate) use fewbits_monte_carlo::{Moments, Stream, Trial};
pub(crate) use garde::Validate;
pub(crate) use schemars::JsonSchema;
pub(crate) use serde::{Deserialize, Serialize};
