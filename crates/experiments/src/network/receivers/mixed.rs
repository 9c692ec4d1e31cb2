//! The fusion centre of `fewbits-filters` in slots, under dynamics of one slot.

use fewbits_core::{ArgumentError, Evolution, Gaussian, GaussianDynamics, Link, MeasurementNoise, Scheme, Sensing};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting};
use fewbits_link::FusionReceiver;
use fewbits_monte_carlo::Stream;
use fewbits_protocol::BoxError;

/// Dynamics of one slot, which is a second for the centre.
struct Slotwise<G>(G);

impl<const D: usize, G: GaussianDynamics<D> + Clone> Evolution<D> for Slotwise<G> {
    fn over(&self, seconds: f64) -> Result<Box<dyn GaussianDynamics<D> + '_>, ArgumentError> {
        if seconds != 1.0 {
            return Err(ArgumentError::new("seconds", seconds, "1, the length of a slot"));
        }
        Ok(Box::new(self.0.clone()))
    }
}

/// Makes the receiver of sensors that all report by one scheme over perfect links, before its first slot.
pub fn mixed<const D: usize, G, S, C>(
    dynamics: G,
    start: Gaussian<D>,
    sensors: Vec<S>,
    scheme: C,
    ask: impl Fn(&Gaussian<1>) -> C::Feedback + Clone + Send + Sync + 'static,
) -> impl Fn() -> Result<FusionReceiver<D, MomentFilter>, BoxError> + Clone + Send + Sync + 'static
where
    G: GaussianDynamics<D> + Clone + Send + Sync + 'static,
    S: Sensing<D, 1> + Clone + Send + Sync + 'static,
    C: Scheme<1> + MeasurementNoise<1> + Clone + Send + Sync + 'static,
    C::Factor: 'static,
{
    move || {
        // A Gaussian needs no draws.
        let (none, world) = (Stream::new(0), Slotwise(dynamics.clone()));
        let mut centre = FusionCentre::new(&mut none.rng(), world, MomentFilter, &start)?;
        for (number, sensing) in (0..).zip(&sensors) {
            let ask = ask.clone();
            let ask = move |_: &Gaussian<D>, measured: &Gaussian<1>| ask(measured);
            centre.join(number, Reporting::new(sensing.clone(), scheme.clone(), Link::PERFECT, ask))?;
        }
        Ok(FusionReceiver::new(centre, 1.0, none))
    }
}
