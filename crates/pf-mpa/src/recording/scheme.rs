//! How the ranges of a recording travel: in full or as levels, some of them outliers.

use super::settings::RangeSettings;
use crate::factor::RangeFactor;
use crate::quantized::{QuantizedRange, RangeReference, reported};
use crate::sensor::RangeNoise;
use fewbits_core::factor::Robust;
use fewbits_core::{Link, MeasurementNoise, Message, NumberFormat, Observation, Scheme};
use fewbits_numerics::error::finite;
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix1, Vector1};
use rand::Rng;

/// A range that may have nothing to do with the distance: `(1 - e) p + e c`, `c` what a stray report has on average.
#[derive(Clone)]
pub(super) struct Tolerant<C> {
    pub scheme: C,
    pub settings: RangeSettings,
}

/// A range in full.
#[derive(Clone, Copy)]
pub(super) struct FullRange(pub RangeNoise);

impl MeasurementNoise<1> for FullRange {
    fn noise_covariance_at(&self, range: &Vector1<f64>) -> Matrix1<f64> {
        let deviation = self.0.deviation(range[0]);
        Matrix1::new(deviation * deviation)
    }
}

impl Scheme<1> for FullRange {
    type State = ();
    type Feedback = ();
    type Report = f64;
    type Factor = RangeFactor;

    fn start(&self) {}

    fn feedback_format(&self) {}

    fn report_format(&self) -> NumberFormat {
        NumberFormat::Single
    }

    fn encode<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        (): &mut (),
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<f64>, fewbits_core::Error> {
        Ok(Some(self.report_format().rounded(finite("range", measurement[0])?)?))
    }

    fn factor(&self, (): &(), observation: &Observation<f64>, link: &Link) -> Result<RangeFactor, fewbits_core::Error> {
        match observation {
            Observation::Received(range) => RangeFactor::arrived(*range, link.of_received()?, self.0),
            Observation::Nothing | Observation::Lost => RangeFactor::constant(link.delivery(observation), self.0),
        }
        .map_err(reported)
    }
}

/// What a stray report of a scheme has on average.
pub(super) trait Stray: Scheme<1> {
    fn stray(&self, settings: &RangeSettings, feedback: &Self::Feedback, report: &Self::Report) -> f64;
}

impl Stray for FullRange {
    fn stray(&self, settings: &RangeSettings, (): &(), _: &f64) -> f64 {
        1.0 / settings.stray
    }
}

impl Stray for QuantizedRange {
    /// A stray range seldom falls into an inner cell.
    fn stray(&self, settings: &RangeSettings, reference: &RangeReference, level: &Symbol) -> f64 {
        let levels = self.levels();
        let inner = (2.0 * reference.half_width / settings.stray).min(1.0) / levels as f64;
        if level.0 == 0 || level.0 + 1 == levels {
            0.5 * (1.0 - (levels - 2) as f64 * inner)
        } else {
            inner
        }
    }
}

impl<C: MeasurementNoise<1>> MeasurementNoise<1> for Tolerant<C> {
    fn noise_covariance_at(&self, range: &Vector1<f64>) -> Matrix1<f64> {
        self.scheme.noise_covariance_at(range)
    }
}

impl<C: Stray> Scheme<1> for Tolerant<C> {
    type State = C::State;
    type Feedback = C::Feedback;
    type Report = C::Report;
    type Factor = Robust<C::Factor>;

    fn start(&self) -> C::State {
        self.scheme.start()
    }

    fn feedback_format(&self) -> <C::Feedback as Message>::Format {
        self.scheme.feedback_format()
    }

    fn report_format(&self) -> <C::Report as Message>::Format {
        self.scheme.report_format()
    }

    fn encode<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        state: &mut C::State,
        measurement: &Vector1<f64>,
        feedback: &C::Feedback,
    ) -> Result<Option<C::Report>, fewbits_core::Error> {
        self.scheme.encode(rng, state, measurement, feedback)
    }

    fn factor(
        &self,
        feedback: &C::Feedback,
        observation: &Observation<C::Report>,
        link: &Link,
    ) -> Result<Self::Factor, fewbits_core::Error> {
        let factor = self.scheme.factor(feedback, observation, link)?;
        let (share, density) = match observation {
            Observation::Received(report) => {
                (self.settings.outliers, self.scheme.stray(&self.settings, feedback, report))
            }
            // A report that did not come is no outlier.
            Observation::Nothing | Observation::Lost => (0.0, 0.0),
        };
        Ok(Robust::new(factor, share, density * link.arrival())?)
    }
}
