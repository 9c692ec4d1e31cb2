//! A scheme with the same small number of bits in every slot.

use crate::Error;
use fewbits_core::factor::Levels;
use fewbits_core::{BitReader, BitWriter, Cell, CodecError, Gaussian, Message, Observed};
use fewbits_filters::{Imm, ImmBelief, MomentFilter, StateFilter, Switching};
use fewbits_models::{LinearGaussian, LinearSensor};
use fewbits_numerics::error::{ArgumentError, finite, positive};
use fewbits_numerics::{bisect, normal};
use nalgebra::{Matrix2, Vector1, Vector2};
use rand_pcg::Pcg64Mcg;
use serde::{Deserialize, Serialize};

/// Per-slot factors of the velocities; zero is the random walk.
const DECAYS: [f64; 3] = [0.0, 0.6, 0.95];
/// Scales of the driving noise, in powers of four of the unit.
const SCALES: std::ops::RangeInclusive<i32> = -2..=2;
/// Probability that the model changes in a slot.
const SWITCHING: f64 = 0.05;
/// Number of slots after which the sequence of thresholds of one bit repeats.
const TURNS: usize = 4;

/// Sends a word of 1 to 3 bits in every slot: the cell of the sample among quantiles of the prediction that both ends compute.
///
/// Both ends run one interacting-multiple-model filter ([`Imm`]) of random walks and decaying velocities at scales
/// `unit 4^-2 .. unit 4^2`. The cells have equal probability under its prediction. With one bit the threshold alternates between the
/// quantiles one half, one tenth and nine tenths, because the median alone does not reveal the scale. A word is a [`Levels`] factor, and
/// the estimate is the filter's mean. There is no error bound: the scheme is for links that carry a fixed number of bits. On different
/// machines the states may differ in the last digit; words then still have the same meaning. A deserialized scheme continues with the
/// same bits.
///
/// ```
/// use fewbits_adaptive::FixedRate;
/// let (mut sensor, mut receiver) = (FixedRate::new(2, 1.0, 20.0)?, FixedRate::new(2, 1.0, 20.0)?);
/// for n in 0..200 {
///     let sample = 20.0 + 3.0 * (f64::from(n) * 0.05).sin();
///     let word = sensor.encode(sample)?;
///     let estimate = receiver.receive(word)?;
///     assert_eq!(estimate, sensor.estimate());
///     assert!(n < 50 || (estimate - sample).abs() < 0.5);
/// }
/// # Ok::<(), fewbits_adaptive::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredFixedRate")]
pub struct FixedRate {
    bits: u32,
    unit: f64,
    #[serde(skip_serializing)]
    noise_variance: f64,
    #[serde(skip_serializing)]
    models: Switching<LinearGaussian<2, 1>>,
    #[serde(skip_serializing)]
    filter: Imm<2, MomentFilter>,
    #[serde(skip_serializing)]
    sensor: LinearSensor<2, 1>,
    belief: ImmBelief<2>,
    /// Number of slots so far, modulo [`TURNS`].
    turn: usize,
}

/// The filter of moments draws nothing, so both ends agree.
fn no_draws() -> Pcg64Mcg {
    Pcg64Mcg::new(0)
}

/// A word of a [`FixedRate`] scheme: the index of the cell, counted from the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Word(pub u8);

impl Message for Word {
    /// Length of a word in bits.
    type Format = u32;

    fn encode(&self, bits: &u32, writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(self.0), *bits)
    }

    fn decode(bits: &u32, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(Self(u8::try_from(reader.read(*bits)?).unwrap_or(u8::MAX)))
    }
}

/// The stored form of [`FixedRate`].
#[derive(Deserialize)]
#[serde(rename = "FixedRate", deny_unknown_fields)]
struct StoredFixedRate {
    bits: u32,
    unit: f64,
    belief: ImmBelief<2>,
    turn: usize,
}

impl TryFrom<StoredFixedRate> for FixedRate {
    type Error = Error;

    fn try_from(stored: StoredFixedRate) -> Result<Self, Error> {
        let rate = FixedRate::new(stored.bits, stored.unit, 0.0)?;
        let (found, models) = (stored.belief.modes().len(), rate.belief.modes().len());
        if found != models {
            let expected = format!("{models}, one for each model");
            return Err(ArgumentError::new("belief", format!("{found} Gaussians"), expected).into());
        }
        Ok(FixedRate {
            belief: stored.belief,
            turn: stored.turn % TURNS,
            ..rate
        })
    }
}

impl FixedRate {
    /// Words of `bits` bits for a signal that starts at about `start` with uncertainty `unit`, and typically changes by up to a few
    /// `unit` per slot. `unit` may be wrong by a factor of ten.
    ///
    /// # Errors
    /// If `bits` is not 1, 2 or 3, `unit` not positive or `start` not finite.
    pub fn new(bits: u32, unit: f64, start: f64) -> Result<Self, Error> {
        if !(1..=3).contains(&bits) {
            return Err(ArgumentError::new("bits", bits, "1, 2 or 3").into());
        }
        positive("unit", unit)?;
        finite("start", start)?;
        let mut models = Vec::new();
        // One model for each decay and scale.
        for decay in DECAYS {
            for scale in SCALES {
                let q = unit * 4.0_f64.powi(scale);
                let transition = Matrix2::new(1.0, decay, 0.0, decay);
                let gain = Vector2::new(1.0, if decay > 0.0 { 1.0 } else { 0.0 });
                models.push(LinearGaussian::new(transition, gain, Vector1::new(q * q))?);
            }
        }
        let noise = unit * 4.0_f64.powi(*SCALES.start());
        let prior = Gaussian::new(Vector2::new(start, 0.0), Matrix2::new(unit * unit, 0.0, 0.0, 0.0))?;
        Ok(Self {
            bits,
            unit,
            noise_variance: noise * noise,
            belief: ImmBelief::agreed(&prior, models.len())?,
            filter: Imm::new(MomentFilter, vec![1.0; models.len()], SWITCHING)?,
            models: Switching::new(models)?,
            sensor: LinearSensor::scalar(Vector2::new(1.0, 0.0), noise * noise)?,
            turn: 0,
        })
    }

    /// The estimate of the last sample.
    pub fn estimate(&self) -> f64 {
        self.belief.moment_matched().mean()[0]
    }

    /// Encodes a sample and updates the state (sensor's half).
    ///
    /// # Errors
    /// If the sample is not finite. The state is then unchanged.
    pub fn encode(&mut self, sample: f64) -> Result<Word, Error> {
        finite("sample", sample)?;
        let predicted = self.predicted()?;
        let edges = self.edges(&predicted);
        let word = Word(edges.iter().filter(|edge| sample >= **edge).count() as u8);
        self.update(predicted, &edges, word)?;
        Ok(word)
    }

    /// Updates the state with a received word and returns the estimate (receiver's half).
    ///
    /// # Errors
    /// If the word has more than the configured bits. The state is then unchanged.
    pub fn receive(&mut self, word: Word) -> Result<f64, Error> {
        if u32::from(word.0) >= 1 << self.bits {
            return Err(ArgumentError::new("word", word.0, format!("a number of {} bits", self.bits)).into());
        }
        let predicted = self.predicted()?;
        let edges = self.edges(&predicted);
        self.update(predicted, &edges, word)?;
        Ok(self.estimate())
    }

    /// Updates the state with a slot whose word is known to be lost, and returns the estimate.
    ///
    /// # Errors
    /// If the belief would not be finite.
    pub fn miss(&mut self) -> Result<f64, Error> {
        self.belief = self.predicted()?;
        self.turn = (self.turn + 1) % TURNS;
        Ok(self.estimate())
    }

    fn predicted(&mut self) -> Result<ImmBelief<2>, Error> {
        let mut next = self.belief.clone();
        self.filter.predict(&mut no_draws(), &self.models, &mut next)?;
        Ok(next)
    }

    /// Quantiles of the predicted sample, by bisection.
    fn edges(&self, predicted: &ImmBelief<2>) -> Vec<f64> {
        let modes = || predicted.probabilities().iter().zip(predicted.modes());
        let deviation = |mode: &Gaussian<2>| (mode.covariance()[(0, 0)] + self.noise_variance).sqrt();
        let below = |edge: f64| -> f64 {
            modes()
                .map(|(p, mode)| p * normal::cdf((edge - mode.mean()[0]) / deviation(mode)))
                .sum()
        };
        // Beyond nine deviations of every model that counts, the distribution is flat to rounding.
        let ends = modes().filter(|(p, _)| **p > 1e-9).map(|(_, mode)| {
            let reach = 9.0 * deviation(mode);
            (mode.mean()[0] - reach, mode.mean()[0] + reach)
        });
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), (a, b)| (l.min(a), h.max(b)));
        let count = 1_u32 << self.bits;
        (1..count)
            .map(|i| {
                // One bit: mostly the median, and in turn a far quantile, which detects jumps.
                let target = if self.bits == 1 {
                    [0.5, 0.1, 0.5, 0.9][self.turn]
                } else {
                    f64::from(i) / f64::from(count)
                };
                // 50 halvings reach the rounding of the range.
                let (low, high) = bisect::boundary(|x| below(x) < target, low, high, 50);
                0.5 * (low + high)
            })
            .collect()
    }

    fn update(&mut self, mut predicted: ImmBelief<2>, edges: &[f64], word: Word) -> Result<(), Error> {
        let i = usize::from(word.0);
        let lower = i.checked_sub(1).and_then(|i| edges.get(i)).copied();
        let upper = edges.get(i).copied();
        let cell = Cell::new(lower.unwrap_or(f64::NEG_INFINITY), upper.unwrap_or(f64::INFINITY))?;
        let observed = Observed::new(self.sensor, Levels::certain(cell, self.noise_variance)?);
        self.filter.update(&mut no_draws(), &mut predicted, &[&observed])?;
        self.belief = predicted;
        self.turn = (self.turn + 1) % TURNS;
        Ok(())
    }
}
