//! Schemes that send the word of the cell that holds the measurement.

use crate::cell::Cell;
use crate::error::Error;
use crate::factor::{Constant, Levels, Scalar};
use crate::measurement_noise::MeasurementNoise;
use crate::message::Message;
use crate::noise::Noise;
use crate::observation::{Link, Observation};
use crate::scheme::{Deterministic, Scheme};
use nalgebra::{Matrix1, Vector1};
use rand::Rng;

/// A sensor that divides the measurement axis into cells and sends a word for the cell that holds its measurement, in every slot. Several
/// cells may have the same word.
///
/// Such a sensor is a [`Scheme`]. A missing report does not depend on the measurement. A link that inverts bits makes a received word
/// possible in every cell.
pub trait Quantized: Send + Sync {
    /// What the sensor is told before it measures; `()` if its cells are fixed.
    type Feedback: Message;
    /// The report of a cell.
    type Report: Message;

    /// The format of the feedback's encoding.
    fn format_of_feedback(&self) -> <Self::Feedback as Message>::Format;

    /// The format of the report's encoding.
    fn format_of_report(&self) -> <Self::Report as Message>::Format;

    /// The noise of the measurement.
    fn measurement_noise(&self) -> Noise;

    /// Whether the feedback is valid; by default it always is.
    ///
    /// # Errors
    /// If it is not.
    fn check(&self, _feedback: &Self::Feedback) -> Result<(), Error> {
        Ok(())
    }

    /// The report of a measurement.
    ///
    /// # Errors
    /// If the measurement or the feedback is not finite.
    fn report_of(&self, measurement: f64, feedback: &Self::Feedback) -> Result<Self::Report, Error>;

    /// The increasing edges between the cells, in measurement units.
    ///
    /// # Errors
    /// If the feedback is not valid, or the cells are too many to list.
    fn edges(&self, feedback: &Self::Feedback) -> Result<Vec<f64>, Error>;

    /// The word of each cell as it travels, from the lowest cell on.
    fn words(&self) -> impl Iterator<Item = u64>;

    /// The word of a report.
    ///
    /// # Errors
    /// If there is no such report.
    fn word_of(&self, report: &Self::Report) -> Result<u64, Error>;

    /// Number of bits of a word.
    fn word_bits(&self) -> u32;

    /// The cell of a report, if it is known without listing all cells and only this cell has the report's word.
    ///
    /// # Errors
    /// If there is no such report, or the feedback is not valid.
    fn only_cell(&self, _report: &Self::Report, _feedback: &Self::Feedback) -> Result<Option<Cell>, Error> {
        Ok(None)
    }
}

impl<Q: Quantized> MeasurementNoise<1> for Q {
    fn noise_covariance_at(&self, m: &Vector1<f64>) -> Matrix1<f64> {
        Matrix1::new(self.measurement_noise().variance(m[0]))
    }
}

impl<Q: Quantized> Deterministic<1> for Q {}

impl<Q: Quantized> Scheme<1> for Q {
    type State = ();
    type Feedback = Q::Feedback;
    type Report = Q::Report;
    type Factor = Scalar;

    fn feedback_format(&self) -> <Q::Feedback as Message>::Format {
        self.format_of_feedback()
    }

    fn report_format(&self) -> <Q::Report as Message>::Format {
        self.format_of_report()
    }

    #[inline]
    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &Vector1<f64>,
        feedback: &Q::Feedback,
    ) -> Result<Option<Q::Report>, Error> {
        self.report_of(measurement[0], feedback).map(Some)
    }

    fn factor(
        &self,
        feedback: &Q::Feedback,
        observation: &Observation<Q::Report>,
        link: &Link,
    ) -> Result<Scalar, Error> {
        self.check(feedback)?;
        let Observation::Received(report) = observation else {
            return Ok(Constant::of_delivery(observation, link).into());
        };
        let noise = self.measurement_noise();
        if link.crossover() == 0.0
            && let Some(cell) = self.only_cell(report, feedback)?
        {
            return Ok(Levels::new(cell, noise, 0.0, link.of_received()?)?.into());
        }
        let (received, edges) = (self.word_of(report)?, self.edges(feedback)?);
        let given = link.received_given_words(self.words(), received, self.word_bits())?;
        // A word that no cell has arrives only over a link that inverts bits.
        if given.iter().all(|p| *p == 0.0) {
            return Ok(Levels::constant(0.0)?.into());
        }
        Ok(Levels::partition(&edges, &given, noise)?.into())
    }
}
