//! A way of reporting little: the sensor's half and what its reports mean, in one place.

use crate::error::Error;
use crate::factor::Factor;
use crate::message::Message;
use crate::observation::{Link, Observation};
use nalgebra::SVector;
use rand::Rng;

/// A scheme by which sensors with `M`-dimensional measurements report, and what their reports mean.
///
/// Whatever both ends know is the scheme itself or its `Feedback`: the feedback is broadcast and costs its bits; what both
/// compute without data (a schedule of thresholds, an innovation covariance) goes into the scheme, one value a slot. What
/// only the sensor knows is its `State`.
///
/// The noise of the measurement belongs to the scheme, since what a report says about the noise-free measurement depends on
/// it; a scheme whose noise depends on the measurement knows how.
///
/// Laws ([`crate::laws::scheme`]):
/// 1. total probability: for every noise-free measurement, feedback and link, the probabilities of all observations sum
///    (integrate) to one, [`Observation::Lost`] included. Where `Lost` cannot occur (no known losses, all words decode), its factor
///    is `p(the sensor spoke | m)`, see [`Link::lost_given_sent`];
/// 2. honesty: what `encode` reports of `m + noise`, sent through [`Link::transmit`], has the frequencies that `factor` says;
/// 3. words that are no report: over a link that inverts bits, either all words of the report's format decode, or `factor` adds the
///    probability of those that do not, computed from the code book, to that of `Lost`, or it refuses such a link. Laws 1 and 2
///    together check it: `transmit` delivers such words as `Lost`.
pub trait Scheme<const M: usize> {
    /// What the sensor remembers from slot to slot; `()` for most.
    type State;
    /// What the sensor is told before it measures; `()` without feedback.
    type Feedback: Message;
    /// What the sensor may report.
    type Report: Message;
    /// What an observation says about the noise-free measurement.
    type Factor: Factor<M>;

    /// The sensor's memory before its first measurement.
    fn start(&self) -> Self::State;

    /// How a feedback travels.
    fn feedback_format(&self) -> <Self::Feedback as Message>::Format;

    /// How a report travels.
    fn report_format(&self) -> <Self::Report as Message>::Format;

    /// The sensor's half. `None` is silence: zero bits on air.
    ///
    /// # Errors
    /// If the measurement or the feedback is not finite; the state is then as it was.
    fn encode<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        state: &mut Self::State,
        measurement: &SVector<f64, M>,
        feedback: &Self::Feedback,
    ) -> Result<Option<Self::Report>, Error>;

    /// The receiver's half: `p(observation | h(x) = m)`, by the table of [`Observation`].
    ///
    /// # Errors
    /// If the feedback is not finite, or the report is none that the scheme can send.
    fn factor(
        &self,
        feedback: &Self::Feedback,
        observation: &Observation<Self::Report>,
        link: &Link,
    ) -> Result<Self::Factor, Error>;
}

/// A scheme whose sensor draws no random numbers, so that it reports without a random source
/// ([`SchemeNode::answer`](crate::SchemeNode::answer)).
///
/// Law ([`crate::laws::scheme::deterministic`]): `encode` draws nothing, and says the same again.
pub trait Deterministic<const M: usize>: Scheme<M> {}

/// A [`Scheme`] whose sensor remembers nothing and draws no random numbers.
///
/// Such a scheme says how a sample becomes a report, or silence, and what an observation means; it is then a [`Scheme`] and
/// [`Deterministic`].
pub trait Memoryless<const M: usize> {
    /// [`Scheme::Feedback`].
    type Feedback: Message;
    /// [`Scheme::Report`].
    type Report: Message;
    /// [`Scheme::Factor`].
    type Factor: Factor<M>;

    /// [`Scheme::feedback_format`].
    fn feedback_format(&self) -> <Self::Feedback as Message>::Format;

    /// [`Scheme::report_format`].
    fn report_format(&self) -> <Self::Report as Message>::Format;

    /// The report of a sample. `None` is silence.
    ///
    /// # Errors
    /// If the sample or the feedback is not finite.
    fn report_of(&self, sample: &SVector<f64, M>, feedback: &Self::Feedback) -> Result<Option<Self::Report>, Error>;

    /// [`Scheme::factor`].
    ///
    /// # Errors
    /// As [`Scheme::factor`].
    fn meaning_of(
        &self,
        feedback: &Self::Feedback,
        observation: &Observation<Self::Report>,
        link: &Link,
    ) -> Result<Self::Factor, Error>;
}

impl<S: Memoryless<M>, const M: usize> Scheme<M> for S {
    type State = ();
    type Feedback = S::Feedback;
    type Report = S::Report;
    type Factor = S::Factor;

    fn start(&self) {}

    fn feedback_format(&self) -> <S::Feedback as Message>::Format {
        Memoryless::feedback_format(self)
    }

    fn report_format(&self) -> <S::Report as Message>::Format {
        Memoryless::report_format(self)
    }

    #[inline]
    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        sample: &SVector<f64, M>,
        feedback: &S::Feedback,
    ) -> Result<Option<S::Report>, Error> {
        self.report_of(sample, feedback)
    }

    #[inline]
    fn factor(
        &self,
        feedback: &S::Feedback,
        observation: &Observation<S::Report>,
        link: &Link,
    ) -> Result<S::Factor, Error> {
        self.meaning_of(feedback, observation, link)
    }
}

impl<S: Memoryless<M>, const M: usize> Deterministic<M> for S {}
