//! A request: the design problem and its options.

use super::control::Watch;
use super::participant::WordedCells;
use crate::criterion::{AllowedCells, Criterion};
use crate::deadline::{Clock, system_clock};
use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use fewbits_core::Link;
use std::time::Duration;

/// Largest number of bits of a word. For longer words a Lloyd-Max quantizer is nearly optimal.
pub const MAX_BITS: u32 = 6;
/// Largest total number of bits that is distributed over the sensors.
pub(super) const MAX_TOTAL: u32 = 40;

/// The numbers of bits that the sensors may send.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum BitBudget {
    /// The same number for every sensor.
    Each(u32),
    /// A number for each sensor, in order; zero for a sensor that is not used.
    PerSensor(Vec<u32>),
    /// The total over all sensors. The design chooses the number of each sensor.
    Total(u32),
}

/// A design problem: the model, the bits, the links and the criterion. A constructor sets all fields; others than its own are replaced:
///
/// ```
/// use fewbits_core::Link;
/// use fewbits_quantizer_design::{AllowedCells, BitBudget, Criterion, ObservationModel, Request};
/// let model = ObservationModel::gaussian_with_deviations(1.0, &[0.3])?;
/// let request = Request {
///     criterion: Criterion::MutualInformation,
///     cells: AllowedCells::Any,
///     ..Request::estimation(model, BitBudget::Each(1), Link::PERFECT)
/// };
/// assert!(request.run()?.best().value > 0.4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// ```
/// use fewbits_core::Link;
/// use fewbits_quantizer_design::solve::{BitBudget, Request};
/// use fewbits_quantizer_design::{Noise, Prior, ObservationModel};
///
/// let noise = Noise::equicorrelated_with_deviations(&[1.0, 1.5], 0.5)?;
/// let model = ObservationModel::new(Prior::normal(20.0, 4.0)?, noise)?;
/// let solutions = Request::estimation(model, BitBudget::Each(2), Link::flipping(0.02)?).run()?;
/// let best = solutions.best();
/// println!("{}", best.table());
/// let estimate = best.decoder(100)?.decode_symbols(&best.encode(&[21.3, 22.0])?)?;
/// assert!((estimate.mean - 21.0).abs() < 2.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Request<'a> {
    /// Prior and noise.
    pub model: ObservationModel,
    /// Bits of the sensors.
    pub bits: BitBudget,
    /// The link of each sensor.
    pub links: Vec<Link>,
    /// The quantity that is optimised. The error probability needs a discrete prior.
    pub criterion: Criterion,
    /// Whether a word may stand for several intervals. Folded cells help if noise is shared or small; they are harder to interpret.
    pub cells: AllowedCells,
    /// Number of starts of the search over all sensors (default 60), at least two. Starts with one sensor's cells folded come in addition
    /// if folded cells are allowed. Fewer are used if a start is expensive. The result is reproducible unless a time limit is reached.
    pub starts: usize,
    /// An additional start: a design for every sensor of the model.
    pub start: Option<Vec<WordedCells>>,
    /// The search ends after this time with the best design so far. Computing its value takes additional time: a fraction of a second, or
    /// some seconds for a million joint symbols with correlated unequal noise.
    pub time_limit: Option<Duration>,
    /// The clock (default: the system's). Another one is needed for a time limit and for
    /// [`Progress::elapsed`](super::Progress::elapsed) where the standard library has no clock, as in a browser.
    pub clock: Clock,
    /// Called between steps of the search. If it breaks, the search ends with the best design so far, which is marked as cut short.
    pub progress: Option<&'a mut Watch<'a>>,
}

impl Request<'_> {
    /// Quantizers, words and decoder for the estimate of least mean squared error, with the same link for all sensors and one interval per
    /// word. The prior may also be discrete;
    /// its values are then numbers to be estimated, not hypotheses.
    pub fn estimation(model: ObservationModel, bits: BitBudget, link: Link) -> Self {
        Self {
            links: vec![link; model.sensors()],
            model,
            bits,
            criterion: Criterion::MeanSquaredError,
            cells: AllowedCells::Intervals,
            starts: 60,
            start: None,
            clock: system_clock,
            time_limit: None,
            progress: None,
        }
    }

    /// Quantizers, words and decoder for deciding between the values of a discrete prior with the smallest error probability.
    ///
    /// # Errors
    /// If the prior is not discrete.
    pub fn detection(model: ObservationModel, bits: BitBudget, link: Link) -> Result<Self, Error> {
        if model.prior().points().is_none() {
            return refuse("prior", "a continuous prior", "a discrete prior: the hypotheses");
        }
        Ok(Self {
            criterion: Criterion::BayesError,
            ..Self::estimation(model, bits, link)
        })
    }
}
