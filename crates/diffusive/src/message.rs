//! Messages between nodes: raw records or a belief, as bits.

pub use crate::packed::{AddedNumbers, Content, PackedBelief};

use crate::belief::{SentBelief, Travelling};
use crate::fit::Fit;
use crate::form::{COUNT_BITS, Form, MAX_COUNT};
use crate::record::Record;
use crate::sensor::SourceSensor;
use fewbits_core::{BitReader, BitWriter, CodecError, Error, Message, NumberFormat};
use fewbits_mixture_codec::wire::RoundedMixture;
use fewbits_numerics::error::{all_finite, non_negative, refuse, within};
use nalgebra::Vector2;
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
        let numbers = &wire.numbers;
        let content = match belief {
            Travelling::Position(SentBelief::Mixture(mixture)) => {
                Content::Position(RoundedMixture::new(mixture, numbers)?)
            }
            Travelling::WithRate(SentBelief::Mixture(mixture)) => {
                Content::WithRate(RoundedMixture::new(mixture, numbers)?)
            }
            Travelling::Position(SentBelief::Other(density)) => added(density.numbers(), false, numbers)?,
            Travelling::WithRate(SentBelief::Other(density)) => added(density.numbers(), true, numbers)?,
        };
        Ok(Self::Belief(PackedBelief {
            content,
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
        let belief = match (&packed.content, form) {
            (Content::Position(mixture), _) => Travelling::Position(SentBelief::Mixture(mixture.mixture()?)),
            (Content::WithRate(mixture), _) => Travelling::WithRate(SentBelief::Mixture(mixture.mixture()?)),
            (Content::Added(numbers), Form::Other(form)) => form.0.read(numbers)?,
            (Content::Added(numbers), _) => return refuse("message", format!("code {}", numbers.code), "a mixture"),
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
                writer.write(0, 1)?;
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
                writer.write(1, 1)?;
                encode_content(&belief.content, &format.wire.numbers, writer)?;
                NumberFormat::Single.write(belief.chi_squared, writer)?;
                writer.write(belief.samples as u64, SAMPLE_COUNT_BITS)?;
            }
        }
        Ok(())
    }

    fn decode(format: &Contract, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if reader.read(1)? == 0 {
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
        Ok(Self::Belief(PackedBelief {
            content: decode_content(format, reader)?,
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

/// The numbers of an added form as they arrive.
fn added(
    (components, code, numbers): (usize, usize, Vec<f64>),
    with_rate: bool,
    format: &NumberFormat,
) -> Result<Content, Error> {
    let numbers = numbers.into_iter().map(|x| format.rounded(x));
    Ok(Content::Added(AddedNumbers {
        components,
        code,
        with_rate,
        numbers: numbers.collect::<Result<_, _>>()?,
    }))
}

fn encode_content(content: &Content, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
    let (components, code, with_rate) = match content {
        Content::Position(mixture) => (mixture.components(), MAX_COUNT, false),
        Content::WithRate(mixture) => (mixture.components(), MAX_COUNT, true),
        Content::Added(added) => (added.components, added.code, added.with_rate),
    };
    writer.write(components as u64, COUNT_BITS)?;
    writer.write(code as u64, COUNT_BITS)?;
    with_rate.encode(&(), writer)?;
    match content {
        Content::Position(mixture) => mixture.encode(&(components, *format), writer),
        Content::WithRate(mixture) => mixture.encode(&(components, *format), writer),
        Content::Added(added) => added.numbers.iter().try_for_each(|x| format.write(*x, writer)),
    }
}

fn decode_content(format: &Contract, reader: &mut BitReader<'_>) -> Result<Content, CodecError> {
    let components = reader.read(COUNT_BITS)? as usize;
    let code = reader.read(COUNT_BITS)? as usize;
    let with_rate = bool::decode(&(), reader)?;
    let numbers = format.wire.numbers;
    match (code, format.form) {
        (MAX_COUNT, _) if with_rate => RoundedMixture::decode(&(components, numbers), reader).map(Content::WithRate),
        (MAX_COUNT, _) => RoundedMixture::decode(&(components, numbers), reader).map(Content::Position),
        (code, Form::Other(form)) => {
            let count = form.0.numbers(components, code, with_rate);
            let numbers = (0..count).map(|_| numbers.read(reader));
            Ok(Content::Added(AddedNumbers {
                components,
                code,
                with_rate,
                numbers: numbers.collect::<Result<_, _>>()?,
            }))
        }
        (code, _) => Err(CodecError::invalid("code", code, "31, a mixture")),
    }
}
