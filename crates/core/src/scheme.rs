//! Rules by which sensors report a few bits, together with the likelihoods of the reports.

use crate::error::Error;
use crate::factor::Factor;
use crate::message::Message;
use crate::observation::{Link, Observation};
use nalgebra::SVector;
use rand::Rng;

/// A rule by which sensors with `M`-dimensional measurements report, and the likelihood of what is then observed.
///
/// What both ends know is part of the scheme or of its `Feedback`. The feedback is broadcast to the sensor and costs its bits. What both
/// ends compute without data (a schedule of thresholds, an innovation covariance) is part of the scheme, one value per slot. What only the
/// sensor knows is its `State`.
///
/// The scheme contains the measurement noise, since the likelihood of a report depends on it.
///
/// Laws ([`crate::laws::scheme`]):
/// 1. total probability: for every noise-free measurement, feedback and link, the probabilities of all observations sum
///    (integrate) to one, [`Observation::Lost`] included. Where `Lost` cannot occur (no known losses, all words decode), its factor
///    is `p(the sensor spoke | m)`, see [`Link::lost_given_sent`];
/// 2. honesty: the reports of `encode` at measurements `m + noise`, sent through [`Link::transmit`], have the frequencies that `factor`
///    states;
/// 3. words that are no report: over a link that inverts bits, either all words of the report's format decode, or `factor` adds the
///    probability of those that do not, computed from the code book, to that of `Lost`, or it refuses such a link. Laws 1 and 2
///    together check it: `transmit` delivers such words as `Lost`.
///
/// A scheme without memory has `type State = ()` and takes `(): &mut ()` in `encode`.
pub trait Scheme<const M: usize>: Send + Sync {
    /// What the sensor remembers from slot to slot; `()` if it needs no memory.
    type State: Default + Send + Sync;
    /// What the sensor is told before it measures; `()` if it is told nothing.
    type Feedback: Message;
    /// What the sensor sends.
    type Report: Message;
    /// The likelihood of an observation as a function of the noise-free measurement.
    type Factor: Factor<M>;

    /// The sensor's memory before its first measurement; [`Default`] if not overridden.
    fn start(&self) -> Self::State {
        Self::State::default()
    }

    /// The format of the feedback's encoding.
    fn feedback_format(&self) -> <Self::Feedback as Message>::Format;

    /// The format of the report's encoding.
    fn report_format(&self) -> <Self::Report as Message>::Format;

    /// The report of the sensor for a measurement. `None` is silence, which sends zero bits.
    ///
    /// # Errors
    /// If the measurement or the feedback is not finite; the state is then unchanged.
    fn encode(
        &self,
        rng: &mut dyn Rng,
        state: &mut Self::State,
        measurement: &SVector<f64, M>,
        feedback: &Self::Feedback,
    ) -> Result<Option<Self::Report>, Error>;

    /// The likelihood at the receiver: `p(observation | h(x) = m)`, by the table of [`Observation`].
    ///
    /// # Errors
    /// If the feedback is not finite, or if the scheme cannot send such a report.
    fn factor(
        &self,
        feedback: &Self::Feedback,
        observation: &Observation<Self::Report>,
        link: &Link,
    ) -> Result<Self::Factor, Error>;
}

/// A scheme whose sensor draws no random numbers, so that its reports are the same with every random source.
///
/// Law ([`crate::laws::scheme::deterministic`]): `encode` draws nothing, and the same input gives the same report.
pub trait Deterministic<const M: usize>: Scheme<M> {}
