//! Receivers of the comparison: the mixed fusion centre under discrete dynamics, and what is no filter of likelihoods.

mod followers;
mod look_up;
mod mixed;

pub use followers::{Followed, Followers};
pub use look_up::LookUp;
pub use mixed::mixed;

use fewbits_baselines::over_bits::{Estimator, OverBits};
use fewbits_core::{Scheme, SchemeNode, SensorNode};
use fewbits_protocol::BoxError;

/// The receiver of an estimator in types, before its first slot.
pub fn over_bits<E>(estimator: E) -> impl Fn() -> Result<OverBits<E>, BoxError> + Clone + Send + Sync + 'static
where
    E: Estimator + Clone + Send + Sync + 'static,
{
    move || Ok(OverBits::new(estimator.clone()))
}

/// The sensors' halves of schemes without memory: one for each sensor, or one for all.
pub fn each<C>(schemes: Vec<C>) -> impl Fn(usize) -> Box<dyn SensorNode<1>> + Clone + Send + Sync + 'static
where
    C: Scheme<1> + Clone + Send + Sync + 'static,
    C::State: 'static,
{
    move |i| Box::new(SchemeNode::new(schemes[i % schemes.len()].clone()))
}
