//! Both halves of a scheme over bits.

use fewbits_core::{Scheme, SchemeNode, SensorNode};
use fewbits_protocol::{BoxError, Estimator, Feedback, OverBits, Receiver, ReportLength};
use std::marker::PhantomData;

/// Both halves of a scheme over bits, and how its sensors learn what they must know.
pub(crate) struct Halves<R, C, N> {
    pub(crate) centre: C,
    pub(crate) feedback: Feedback,
    pub(crate) report: ReportLength,
    pub(crate) node: N,
    pub(crate) receiver: PhantomData<R>,
}

impl<R, C, N> Halves<R, C, N>
where
    R: Receiver,
    C: Fn() -> Result<R, BoxError> + Send + Sync + 'static,
    N: Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static,
{
    pub(crate) fn new(centre: C, feedback: Feedback, report: ReportLength, node: N) -> Self {
        Self {
            centre,
            feedback,
            report,
            node,
            receiver: PhantomData,
        }
    }
}

/// The receiver of an estimator in types, before its first slot.
pub(crate) fn over_bits<E>(e: E) -> impl Fn() -> Result<OverBits<E>, BoxError> + Send + Sync + 'static
where
    E: Estimator + Clone + Send + Sync + 'static,
{
    move || Ok(OverBits::new(e.clone()))
}

/// The sensors' half of a scheme without memory.
pub(crate) fn each<C>(scheme: C) -> impl Fn(usize) -> Box<dyn SensorNode<1>> + Send + Sync + 'static
where
    C: Scheme<1> + Clone + Send + Sync + 'static,
    C::State: 'static,
{
    move |_| Box::new(SchemeNode::new(scheme.clone()))
}

pub(crate) fn bits(bits: usize) -> ReportLength {
    ReportLength::Fixed(bits as u32)
}
