//! A sensor from the receiver's side: bits in, likelihoods out.

use super::Slot;
use crate::Error;
use fewbits_core::columns::lengths_agree;
use fewbits_core::factor::{Product, Repeated, Scalar};
use fewbits_core::{
    BitString, Columns, Evidence, Factor, Gaussian, Likelihood, Link, MeasurementNoise, Message, Observation, Observed,
    Scheme, Sensing, Tilted,
};
use fewbits_numerics::error::{ArgumentError, within};
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};

/// What a receiver needs to know of a sensor. Object-safe, so that sensors of different kinds can be in one list.
///
/// [`Reporting`] makes one from any [`Scheme`] and [`Sensing`].
pub trait RemoteSensor<const D: usize>: Send + Sync {
    /// The bits that the sensor is told before it measures, from the predicted belief.
    ///
    /// # Errors
    /// If the feedback of this belief does not fit its format, or if sensing model and scheme state different noise.
    fn feedback(&self, predicted: &Gaussian<D>) -> Result<BitString, Error>;

    /// The likelihood of the observation in a slot. `working` is the probability that the sensor works; a dead sensor is silent. A report
    /// proves that its sensor worked, so the centre asks for that of a report with `working = 1`.
    ///
    /// # Errors
    /// If the feedback does not decode, `working` is outside `[0, 1]`, or the scheme does not accept the report.
    fn likelihood(&self, slot: &Slot, working: f64) -> Result<Box<dyn Likelihood<D>>, Error>;

    /// Updates a Gaussian by [`likelihood`](Self::likelihood).
    ///
    /// # Errors
    /// As there, and as [`Likelihood::condition`].
    fn condition(&self, slot: &Slot, working: f64, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        self.likelihood(slot, working)?.condition(belief)
    }

    /// Log likelihood and correction of [`likelihood`](Self::likelihood) under a Gaussian.
    ///
    /// # Errors
    /// As there, and as [`Likelihood::evidence`].
    fn evidence(&self, slot: &Slot, working: f64, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        self.likelihood(slot, working)?.evidence(belief)
    }

    /// Predicted variance of a scalar measurement, noise included, if the sensor sends every measurement as a value.
    /// `None` for words, vectors and sensors that may be silent.
    fn value_variance(&self, predicted: &Gaussian<D>) -> Option<f64>;

    /// How the report in a slot is tested, if its sensor sends values. Default: as a value of [`value_variance`](Self::value_variance).
    fn test_of(&self, _slot: &Slot, predicted: &Gaussian<D>) -> Option<ReportTest> {
        self.value_variance(predicted).map(ReportTest::Value)
    }

    /// The value that the report in a slot is, and the variance of its noise. `None` for words, vectors, cells, and values that come only on
    /// change. A centre needs it to find sensors that are stuck at a value.
    fn value(&self, _slot: &Slot) -> Option<(f64, f64)> {
        None
    }

    /// Probability that a report that was sent arrives.
    fn arrival(&self) -> f64;

    /// Whether these bits are a report of the scheme. Bits that are none were sent, but say nothing; they are no word of the sensor.
    fn decodes(&self, _report: &BitString) -> bool {
        true
    }

    /// The group of this sensor: sensors of a group have the same sensing model, scheme and link. What those that were told the same observed at
    /// one instant is then one likelihood, [`together`](Self::together). `None`: the sensor is alone.
    fn group(&self) -> Option<u32> {
        None
    }

    /// The likelihood of the observations of several sensors of the group, each with the number of sensors that it is of: all silent, or all
    /// reports. `None`: one after the other.
    ///
    /// # Errors
    /// As [`likelihood`](Self::likelihood).
    fn together(&self, _counted: &[(&Slot, usize)], _working: f64) -> Result<Option<Box<dyn Likelihood<D>>>, Error> {
        Ok(None)
    }

    /// First coordinate of the noise-free measurement of `state`, if it is known. A centre needs it to test reports by a belief of points.
    fn measured(&self, _state: &SVector<f64, D>) -> Option<f64> {
        None
    }

    /// Period of the first coordinate of the measurement, if it is on a circle ([`fewbits_core::circle`]).
    fn period(&self) -> Option<f64> {
        None
    }
}

/// How a report of a sensor that sends values is tested.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ReportTest {
    /// By its normalised innovation: it is a value whose predicted variance is this, noise included.
    Value(f64),
    /// By its probability beside that of a cell about the prediction: it says that the measurement lies in a cell of this width, and its
    /// likelihood is the cell's probability divided by the width; of a half-line, of infinite width, its probability. Only an improbable cell
    /// is tested, since nothing says which others there were.
    Cell(f64),
}

/// A sensor that reports by a [`Scheme`]: its sensing model, its scheme, its link, and the rule for its feedback.
///
/// `ask` computes the scheme's feedback from the predicted state and the predicted measurement `N(h(m), H P H' + R)`.
#[derive(Debug, Clone)]
pub struct Reporting<S, C, A, const M: usize> {
    sensing: S,
    scheme: C,
    link: Link,
    ask: A,
    sends_values: bool,
    tests: Option<fn(&BitString) -> Option<ReportTest>>,
    group: Option<u32>,
}

/// Relative difference between the noise of sensing model and scheme that is treated as rounding.
const NOISE_TOLERANCE: f64 = 1e-9;

impl<S, C, A, const M: usize> Reporting<S, C, A, M> {
    /// A sensor that sends words or bits, or may be silent.
    pub fn new(sensing: S, scheme: C, link: Link, ask: A) -> Self {
        Self {
            sensing,
            scheme,
            link,
            ask,
            sends_values: false,
            tests: None,
            group: None,
        }
    }

    /// The same sensor in a group: all its sensors are made of the same sensing model, scheme and link. The words, bits or silences of scalar
    /// measurements of those that were told the same update a belief as one factor, at a cost that does not grow with their number.
    #[must_use]
    pub fn in_group(self, group: u32) -> Self {
        Self {
            group: Some(group),
            ..self
        }
    }

    /// The same sensor, with a scheme that sends every measurement as a value. Its health is tested by normalised innovations.
    #[must_use]
    pub fn sending_values(self) -> Self {
        Self {
            sends_values: true,
            ..self
        }
    }

    /// The same sensor, whose values do not all mean the same: how a report is tested, from its bits. The variance in
    /// [`ReportTest::Value`] is that of its noise alone. `None`: as a usual value.
    #[must_use]
    pub fn testing(self, tests: fn(&BitString) -> Option<ReportTest>) -> Self {
        Self {
            tests: Some(tests),
            ..self
        }
    }
}

impl<S, const D: usize> Reporting<S, fewbits_core::FullValue, fn(&Gaussian<D>, &Gaussian<1>), 1> {
    /// A sensor that sends every measurement as a value, without feedback.
    pub fn values(sensing: S, scheme: fewbits_core::FullValue, link: Link) -> Self {
        Self::new(sensing, scheme, link, (|_, _| ()) as fn(&Gaussian<D>, &Gaussian<1>)).sending_values()
    }
}

impl<S, C, A, const M: usize> Reporting<S, C, A, M> {
    fn predicted<const D: usize>(&self, predicted: &Gaussian<D>) -> Result<Gaussian<M>, Error>
    where
        S: Sensing<D, M>,
        C: MeasurementNoise<M>,
    {
        let mean = self.sensing.mean(predicted.mean());
        let (sensed, supposed) =
            (self.sensing.noise_covariance_at(predicted.mean()), self.scheme.noise_covariance_at(&mean));
        // Compared relative to the deviations of both coordinates: the result does not depend on the units.
        let scale = sensed.diagonal().map(f64::sqrt);
        let off =
            |i: usize, j: usize| (sensed[(i, j)] - supposed[(i, j)]).abs() > NOISE_TOLERANCE * scale[i] * scale[j];
        if (0..M).any(|i| (0..M).any(|j| off(i, j))) {
            let expected = format!("the noise covariance of the sensing model, {:?}", sensed.as_slice());
            return Err(
                ArgumentError::new("noise", format!("{:?} in the scheme", supposed.as_slice()), expected).into()
            );
        }
        let jacobian: SMatrix<f64, M, D> = self.sensing.jacobian(predicted.mean());
        Ok(Gaussian::from_trusted_parts(mean, congruence(&jacobian, predicted.covariance()) + supposed))
    }

    #[inline(always)]
    fn observed(&self, slot: &Slot, working: f64) -> Result<Observed<S, C::Factor, M>, Error>
    where
        S: Clone,
        C: Scheme<M>,
    {
        let factor = factor_of(&self.scheme, &self.link, slot, working)?;
        Ok(Observed::new(self.sensing.clone(), factor))
    }
}

/// What a slot says of the measurement. Its code does not depend on the state's dimension.
fn factor_of<C: Scheme<M>, const M: usize>(
    scheme: &C,
    link: &Link,
    slot: &Slot,
    working: f64,
) -> Result<C::Factor, Error> {
    let feedback = C::Feedback::from_bits(&scheme.feedback_format(), &slot.feedback)?;
    let observation = match &slot.observation {
        // Bits that are no report of the scheme: a report was sent, but not understood.
        Observation::Received(bits) => {
            C::Report::from_bits(&scheme.report_format(), bits).map_or(Observation::Lost, Observation::Received)
        }
        Observation::Nothing => Observation::Nothing,
        Observation::Lost => Observation::Lost,
    };
    scheme.factor(&feedback, &observation, &supposed(link, working)?)
}

impl<const D: usize, const M: usize, S, C, A> RemoteSensor<D> for Reporting<S, C, A, M>
where
    S: Sensing<D, M> + Clone + 'static,
    C: Scheme<M> + MeasurementNoise<M>,
    C::Factor: 'static,
    A: Fn(&Gaussian<D>, &Gaussian<M>) -> C::Feedback + Send + Sync,
{
    fn feedback(&self, predicted: &Gaussian<D>) -> Result<BitString, Error> {
        let measurement = self.predicted(predicted)?;
        Ok((self.ask)(predicted, &measurement).to_bits(&self.scheme.feedback_format())?)
    }

    fn likelihood(&self, slot: &Slot, working: f64) -> Result<Box<dyn Likelihood<D>>, Error> {
        Ok(Box::new(self.observed(slot, working)?))
    }

    fn condition(&self, slot: &Slot, working: f64, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        self.observed(slot, working)?.condition(belief)
    }

    fn evidence(&self, slot: &Slot, working: f64, belief: &Gaussian<D>) -> Result<Evidence, Error> {
        self.observed(slot, working)?.evidence(belief)
    }

    fn value_variance(&self, predicted: &Gaussian<D>) -> Option<f64> {
        if !(self.sends_values && M == 1) {
            return None;
        }
        Some(self.predicted(predicted).ok()?.covariance()[(0, 0)])
    }

    fn test_of(&self, slot: &Slot, predicted: &Gaussian<D>) -> Option<ReportTest> {
        let usual = RemoteSensor::value_variance(self, predicted)?;
        let own = self.tests.and_then(|tests| slot.observation.received().and_then(tests));
        Some(match own {
            None => ReportTest::Value(usual),
            Some(ReportTest::Value(noise)) => {
                let mean = self.sensing.mean(predicted.mean());
                ReportTest::Value((usual - self.scheme.noise_covariance_at(&mean)[(0, 0)]).max(0.0) + noise)
            }
            Some(cell) => cell,
        })
    }

    fn value(&self, slot: &Slot) -> Option<(f64, f64)> {
        let own = self.tests.and_then(|tests| slot.observation.received().and_then(tests));
        if !self.sends_values || M != 1 || matches!(own, Some(ReportTest::Cell(_))) {
            return None;
        }
        match self.observed(slot, 1.0).ok()?.factor.as_scalar()? {
            Scalar::Value(value) => Some((value.value()[0], value.noise_covariance()[0])),
            Scalar::Levels(_) => None,
        }
    }

    fn arrival(&self) -> f64 {
        self.link.arrival()
    }

    fn decodes(&self, report: &BitString) -> bool {
        C::Report::from_bits(&self.scheme.report_format(), report).is_ok()
    }

    fn group(&self) -> Option<u32> {
        self.group
    }

    fn together(&self, counted: &[(&Slot, usize)], working: f64) -> Result<Option<Box<dyn Likelihood<D>>>, Error> {
        let scalar = |slot: &Slot| {
            let factor = self.observed(slot, working)?.factor.as_scalar();
            Ok(factor.filter(|_| M == 1))
        };
        let joint = Joint::new(counted, &scalar)?;
        Ok(joint.map(|joint| Box::new(Observed::new(self.sensing.clone(), joint)) as Box<dyn Likelihood<D>>))
    }

    fn measured(&self, state: &SVector<f64, D>) -> Option<f64> {
        self.sensing.mean(state).iter().next().copied()
    }

    fn period(&self) -> Option<f64> {
        self.sensing.periods().first().copied().flatten()
    }
}

/// A product of factors of the one component of a measurement (`M` is 1), times a constant.
struct Joint {
    product: Product,
    log_scale: f64,
}

impl Joint {
    /// Of several slots with their counts. `None` if there is nothing to multiply.
    fn new(
        counted: &[(&Slot, usize)],
        scalar: &dyn Fn(&Slot) -> Result<Option<Scalar>, Error>,
    ) -> Result<Option<Self>, Error> {
        let (mut product, mut log_scale) = (Product::default(), 0.0);
        for (slot, count) in counted {
            let Some(Scalar::Levels(levels)) = scalar(slot)? else {
                // Values are exact one after the other.
                return Ok(None);
            };
            match levels.as_constant() {
                Some(log) => log_scale += *count as f64 * log,
                None => product.push_repeated(Repeated::new(Scalar::Levels(levels), *count)?),
            }
        }
        Ok((!product.factors().is_empty()).then_some(Self { product, log_scale }))
    }
}

impl<const M: usize> Factor<M> for Joint {
    fn location(&self) -> Option<SVector<f64, M>> {
        self.product.location().map(|at| SVector::repeat(at[0]))
    }

    fn log_likelihood(&self, m: &SVector<f64, M>) -> f64 {
        self.log_scale + self.product.log_likelihood(&[m[0]].into())
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, M>, log_weights: &mut [f64]) {
        if lengths_agree(means, log_weights) {
            log_weights.iter_mut().for_each(|w| *w += self.log_scale);
            self.product.add_log_likelihoods(&[means[0]], log_weights);
        }
    }

    fn tilted(&self, prior: &Gaussian<M>) -> Result<Tilted<M>, Error> {
        let first = Gaussian::from_trusted_parts([prior.mean()[0]].into(), [[prior.covariance()[(0, 0)]]].into());
        let found = self.product.tilted(&first)?;
        Ok(Tilted {
            log_evidence: found.log_evidence + self.log_scale,
            mean: SVector::repeat(found.mean[0]),
            covariance: SMatrix::repeat(found.covariance[0]),
        })
    }
}

/// A sensor that works with probability `working` is described by a link of larger loss, `1 - (1 - loss) working`. The erasure is also
/// multiplied by `working`, since a known loss requires a working sensor.
#[inline]
fn supposed(link: &Link, working: f64) -> Result<Link, Error> {
    within("working", working, 0.0, 1.0)?;
    if working == 1.0 {
        return Ok(*link);
    }
    let loss = 1.0 - (1.0 - link.loss()) * working;
    // Rounding of the products may leave a sum above one.
    let erasure = (link.erasure() * working).min(1.0 - loss);
    Ok(Link::new(loss, link.crossover())?.with_erasure(erasure)?)
}
