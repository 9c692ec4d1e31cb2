//! Messages between nodes: raw records or a belief, as bits.

pub use crate::packed::PackedBelief;

use crate::belief::{SentBelief, Travelling};
use crate::fit::Fit;
use crate::form::{COUNT_BITS, Form, MAX_COUNT, gaussian_scalars};
use crate::record::Record;
use crate::sensor::SourceSensor;
use fewbits_core::{BitReader, BitWriter, CodecError, Error, Message, NumberFormat};
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, entries, non_negative, refuse, within};
use nalgebra::{SMatrix, SVector, Vector2};
use serde::{Deserialize, Serialize};

/// Code of a sample: evenly spaced levels, `step` noise standard deviations apart.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct SampleCode {
    /// Bits per sample.
    pub bits: u32,
    /// Spacing of the levels in noise standard deviations.
    pub step: f64,
}

/// Share of the levels that are below zero: far from the source samples scatter around zero.
const BELOW: f64 = 1.0 / 16.0;

/// How beliefs and records are encoded. All nodes know the positions of all nodes, so a node is sent as its index.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Wire {
    /// Format of the numbers of a belief.
    pub numbers: NumberFormat,
    /// Code of the samples of raw records; `None` for double precision.
    pub samples: Option<SampleCode>,
    /// Bits of a node's index.
    pub index_bits: u32,
}

impl Default for Wire {
    /// Single precision, unquantised samples, 9 bits for one of 512 nodes.
    fn default() -> Self {
        Self {
            numbers: NumberFormat::Single,
            samples: None,
            index_bits: 9,
        }
    }
}

impl Wire {
    /// The format of a sample under noise of the given standard deviation.
    ///
    /// # Errors
    /// If the bits are outside 1 to 32 or the step is not positive.
    pub(crate) fn sample_format(&self, noise: f64) -> Result<NumberFormat, Error> {
        match self.samples {
            None => Ok(NumberFormat::Double),
            Some(code) => {
                within("bits", f64::from(code.bits), 1.0, 32.0)?;
                let step = code.step * noise;
                let levels = (1_u64 << code.bits) as f64 - 1.0;
                let lower = -(levels * BELOW).round() * step;
                Ok(NumberFormat::fixed(lower, lower + levels * step, code.bits)?)
            }
        }
    }

    /// The record as the receiver decodes it: samples rounded, and `step^2 / 12` added to the noise variance for the rounding.
    ///
    /// # Errors
    /// If the bits of a sample are outside 1 to 32, its step is not positive, or a sample is not finite.
    pub fn quantised(&self, record: Record) -> Result<Record, Error> {
        if self.samples.is_none() {
            return Ok(record);
        }
        let format = self.sample_format(record.noise())?;
        let samples = record.samples().iter().map(|y| format.rounded(*y));
        self.received(record.sensor(), record.node(), &samples.collect::<Result<Vec<_>, _>>()?)
    }

    /// The record of samples that were received from a node, bias subtracted.
    pub(crate) fn received(
        &self,
        sensor: &SourceSensor,
        node: &Vector2<f64>,
        samples: &[f64],
    ) -> Result<Record, Error> {
        all_finite("samples", samples)?;
        let noise = match self.samples {
            Some(code) => sensor.noise() * (1.0 + code.step * code.step / 12.0).sqrt(),
            None => sensor.noise(),
        };
        Record::new(sensor, node, samples.to_vec(), noise)
    }

    /// Whether messages can hold so many records, and the indices of so many nodes.
    ///
    /// # Errors
    /// If not.
    pub(crate) fn check(&self, records: usize, nodes: usize) -> Result<(), Error> {
        self.sample_format(1.0)?;
        let most_records = (1 << RECORD_COUNT_BITS) - 1;
        if records > most_records {
            return refuse(
                "max_nodes",
                records,
                format!("at most {most_records} nodes, of which a message holds records"),
            );
        }
        let index_bits = self.index_bits;
        if index_bits > 32 || nodes as u64 > 1 << index_bits {
            let expected = format!("bits for the indices of {nodes} nodes, at most 32");
            return refuse("index_bits", index_bits, expected);
        }
        Ok(())
    }
}

/// Message from one node to the next.
#[derive(Debug, Clone, PartialEq)]
pub enum Packet {
    /// Indices and samples of all nodes so far.
    Raw(Vec<(usize, Vec<f64>)>),
    /// A belief.
    Belief(PackedBelief),
}

/// Bits of the number of records of a message.
pub(crate) const RECORD_COUNT_BITS: u32 = 10;
/// Bits of the number of samples so far; a larger number is sent as the largest.
const SAMPLE_COUNT_BITS: u32 = 16;

impl Packet {
    /// The message of raw records: the nodes' indices and samples.
    pub fn raw(records: &[Record], nodes: &[usize]) -> Self {
        let samples = records.iter().map(|r| r.samples().to_vec());
        Self::Raw(nodes.iter().copied().zip(samples).collect())
    }

    /// The message that carries a belief and how the samples fitted so far.
    ///
    /// # Errors
    /// If a number does not fit the format.
    pub fn belief_of(belief: &Travelling, fit: &Fit, wire: &Wire) -> Result<Self, Error> {
        let round = |numbers: Vec<f64>| -> Result<Vec<f64>, ArgumentError> {
            numbers.into_iter().map(|x| wire.numbers.rounded(x)).collect()
        };
        let (components, code, numbers) = match belief {
            Travelling::Position(belief) => numbers_of(belief),
            Travelling::WithRate(belief) => numbers_of(belief),
        };
        Ok(Self::Belief(PackedBelief {
            components,
            code,
            with_rate: matches!(belief, Travelling::WithRate(_)),
            numbers: round(numbers)?,
            // A sum beyond single precision is sent as the largest number: both lead to refusal.
            chi_squared: NumberFormat::Single.rounded(fit.chi_squared.min(f64::from(f32::MAX)))?,
            samples: fit.samples.min((1 << SAMPLE_COUNT_BITS) - 1),
        }))
    }

    /// The belief that a packet of numbers holds, and the fit so far; `None` for raw records.
    ///
    /// # Errors
    /// If the numbers are not a valid belief of this form.
    pub fn belief(&self, form: Form) -> Result<Option<(Travelling, Fit)>, Error> {
        let Self::Belief(packed) = self else { return Ok(None) };
        let belief = match (packed.code, form) {
            (Some(code), Form::Other(form)) => form.0.read(packed, code)?,
            (Some(code), _) => return refuse("message", format!("code {code}"), "a mixture"),
            (None, _) if packed.with_rate => Travelling::WithRate(SentBelief::Mixture(mixture_of(packed)?)),
            (None, _) => Travelling::Position(SentBelief::Mixture(mixture_of(packed)?)),
        };
        let fit = Fit {
            chi_squared: non_negative("chi_squared", packed.chi_squared)?,
            samples: packed.samples,
        };
        Ok(Some((belief, fit)))
    }
}

/// Format that both ends of a link agree on.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contract {
    /// Form of the beliefs.
    pub form: Form,
    /// Encoding of beliefs and records.
    pub wire: Wire,
    /// Standard deviation of the sensors' noise.
    pub noise: f64,
    /// Number of samples per node.
    pub samples: usize,
}

impl Message for Packet {
    type Format = Contract;

    /// One bit for the kind. Raw: the number of records (10 bits), and of each its index and samples. Belief: components and the code
    /// of another form (5 bits each, 31 for a mixture), one bit for the rate, the numbers, and the fit so far (32 bits for the sum, 16 for
    /// the samples).
    fn encode(&self, format: &Contract, writer: &mut BitWriter) -> Result<(), CodecError> {
        match self {
            Self::Raw(records) => {
                writer.write_bit(false);
                writer.write(records.len() as u64, RECORD_COUNT_BITS)?;
                let code = format.wire.sample_format(format.noise).map_err(invalid)?;
                for (node, samples) in records {
                    writer.write(*node as u64, format.wire.index_bits)?;
                    for sample in samples {
                        code.write(*sample, writer)?;
                    }
                }
            }
            Self::Belief(belief) => {
                writer.write_bit(true);
                writer.write(belief.components as u64, COUNT_BITS)?;
                writer.write(belief.code.unwrap_or(MAX_COUNT) as u64, COUNT_BITS)?;
                writer.write_bit(belief.with_rate);
                for number in &belief.numbers {
                    format.wire.numbers.write(*number, writer)?;
                }
                NumberFormat::Single.write(belief.chi_squared, writer)?;
                writer.write(belief.samples as u64, SAMPLE_COUNT_BITS)?;
            }
        }
        Ok(())
    }

    fn decode(format: &Contract, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if !reader.read_bit()? {
            let count = reader.read(RECORD_COUNT_BITS)? as usize;
            let code = format.wire.sample_format(format.noise).map_err(invalid)?;
            let mut records = Vec::new();
            for _ in 0..count {
                let node = reader.read(format.wire.index_bits)? as usize;
                let samples = (0..format.samples)
                    .map(|_| code.read(reader))
                    .collect::<Result<_, _>>()?;
                records.push((node, samples));
            }
            return Ok(Self::Raw(records));
        }
        let components = reader.read(COUNT_BITS)? as usize;
        let code = Some(reader.read(COUNT_BITS)? as usize).filter(|code| *code != MAX_COUNT);
        let with_rate = reader.read_bit()?;
        let count = match (code, format.form) {
            (Some(code), Form::Other(form)) => form.0.numbers(components, code, with_rate),
            (Some(code), _) => return Err(CodecError::invalid("code", code, "31, a mixture")),
            // The first weight is not sent: they sum to one.
            (None, _) => (components * (1 + gaussian_scalars(with_rate))).saturating_sub(1),
        };
        let numbers = (0..count)
            .map(|_| format.wire.numbers.read(reader))
            .collect::<Result<_, _>>()?;
        Ok(Self::Belief(PackedBelief {
            components,
            code,
            with_rate,
            numbers,
            chi_squared: NumberFormat::Single.read(reader)?,
            samples: reader.read(SAMPLE_COUNT_BITS)? as usize,
        }))
    }
}

fn invalid(error: Error) -> CodecError {
    CodecError::Invalid {
        what: "wire format",
        value: error.to_string(),
        expected: "a valid sample code",
    }
}

/// Number of components, code and numbers of a belief.
fn numbers_of<const D: usize>(belief: &SentBelief<D>) -> (usize, Option<usize>, Vec<f64>) {
    let mut numbers = Vec::new();
    match belief {
        SentBelief::Mixture(mixture) => {
            numbers.extend(mixture.components().iter().skip(1).map(Component::weight));
            mixture.components().iter().for_each(|c| push_gaussian(c, &mut numbers));
            (mixture.len(), None, numbers)
        }
        SentBelief::Other(density) => {
            let (components, code, numbers) = density.numbers();
            (components, Some(code), numbers)
        }
    }
}

fn mixture_of<const D: usize>(packed: &PackedBelief) -> Result<Mixture<D>, Error> {
    let (count, numbers) = (packed.components, &packed.numbers);
    let (weights, gaussians) = numbers.split_at(count.saturating_sub(1).min(numbers.len()));
    let first = (1.0 - weights.iter().sum::<f64>()).max(0.0);
    let weights = std::iter::once(first).chain(weights.iter().copied());
    let gaussians = gaussians.chunks(gaussian_scalars(D == 3)).zip(weights);
    let components = gaussians.map(|(chunk, weight)| read_gaussian(weight, chunk));
    Mixture::new(components.collect::<Result<_, _>>()?)
}

/// Appends the numbers of a Gaussian: its mean and its lower Cholesky factor, row by row.
pub fn push_gaussian<const D: usize>(c: &Component<D>, numbers: &mut Vec<f64>) {
    numbers.extend(c.mean().iter());
    for i in 0..D {
        numbers.extend((0..=i).map(|j| c.factor().lower[(i, j)]));
    }
}

/// The Gaussian of these numbers.
///
/// # Errors
/// If the numbers are too many or few, or no Gaussian.
pub fn read_gaussian<const D: usize>(weight: f64, numbers: &[f64]) -> Result<Component<D>, Error> {
    entries("numbers", numbers.len(), gaussian_scalars(D == 3))?;
    let (mean, mut rest) = numbers.split_at(D);
    let mut lower = SMatrix::<f64, D, D>::zeros();
    for i in 0..D {
        let (row, others) = rest.split_at(i + 1);
        (0..=i).for_each(|j| lower[(i, j)] = row[j]);
        rest = others;
    }
    Component::new(weight, SVector::from_column_slice(mean), lower * lower.transpose())
}
