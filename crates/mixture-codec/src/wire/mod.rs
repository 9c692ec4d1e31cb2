//! Encoding of a mixture: in a few bytes ([`CodedMixture`]), or as plain numbers ([`RoundedMixture`]).
//!
//! Parameters are quantised in units of the component's own spread. The integers are range coded with distributions that sender
//! and receiver know, as 16-bit integer frequencies, so that every machine decodes the same numbers. Five components take about
//! 136 bits at resolution 1/4, a seventh of their parameters as 32-bit floats.
//!
//! Format 1, in the order of the code (`r` is the resolution; each number has a quantiser step and a distribution):
//!
//! | number | step | distribution |
//! |---|---|---|
//! | components `K`, 1 to 63 (0 is reserved for later formats) | 1 | uniform, 6 bits |
//! | index of the resolution in the format | 1 | uniform |
//! | `ln L_ii - ln unit` of the overall Gaussian, within 8 nepers | `r/2` | uniform |
//! | `L_ij / L_ii`, `j < i` | `r` | logistic(0, 0.5) |
//! | overall mean, within the format's range | `r L_ii / 2`; `r L_ii` if `K = 1` | uniform |
//! | weights in decreasing order: `f_i = w_i / rest`, `g = ln((f - lo)/(1 - f))`, `lo = 0.98/(K - i)` | `2 r` | logistic(-1.2, 0.8) |
//! | for each component, in coordinates `L^-1 (x - mean)`: `ln l_ii` | `r` | logistic(-0.62, 0.42) |
//! | `l_ij / l_ii` | `r` | logistic(0, 0.3) |
//! | mean | `1.4 r l_ii` | logistic(0, 0.55) |
//! | mean of the last, predicted from the overall mean and the other means | `1.4 r l_ii` | logistic(prediction, `0.35 l_ii + 0.05`) |
//!
//! Every logistic distribution is mixed 99:1 with one eight times as wide, and has an escape symbol for values outside its table, so every
//! finite mixture within the range can be encoded. For any bits, decoding gives a mixture with positive definite covariances or a typed
//! error. It is also strict: the message must be exactly the encoding of the decoded mixture. The code therefore needs no end mark and no
//! length field.

mod format;
mod numbers;
mod range;
mod rate;
mod table;
mod walk;

pub use format::WireFormat;
pub use numbers::RoundedMixture;
pub use rate::{RateControl, Rated};

use crate::Error;
use fewbits_core::{BitReader, BitWriter, CodecError, Message};
use fewbits_densities::Mixture;
use fewbits_numerics::error::refuse;
use range::{Coder, Law, Reader, Writer};
use walk::{Decoder, Quantiser, walk};

/// Version of the format. Every change of the encoding gets a new number and an entry in the changelog.
pub const FORMAT: u32 = 1;
/// Largest number of components of a message.
pub(crate) const MAX_COMPONENTS: usize = 63;

/// A quantised mixture as a message. It equals what the receiver decodes, to the last bit.
///
/// ```
/// use fewbits_core::Belief;
/// use fewbits_core::Message;
/// use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};
/// use fewbits_densities::{Component, Mixture};
/// use nalgebra::{Matrix2, Vector2};
/// let lobe = |w, x| Component::new(w, Vector2::new(x, 0.5), Matrix2::identity() * 0.1);
/// let belief = Mixture::new(vec![lobe(0.7, 0.0)?, lobe(0.3, 1.5)?])?;
/// let format = WireFormat::around_origin(1.0, 0.25)?;
/// let message = CodedMixture::new(&belief, &format, 0)?;
/// let bits = message.to_bits(&format)?;
/// assert!(bits.bits() < 90);
/// assert_eq!(CodedMixture::from_bits(&format, &bits)?, message);
/// assert!((message.mixture().mean() - belief.mean()).amax() < 0.2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct CodedMixture<const D: usize> {
    symbols: Vec<(Law, i64)>,
    mixture: Mixture<D>,
}

impl<const D: usize> CodedMixture<D> {
    /// Quantises a mixture at the resolution with the given index. Components of weight zero are left out.
    ///
    /// # Errors
    /// If there are more than 63 components, there is no such resolution, the mean is outside the range, or a standard
    /// deviation is outside the format's range.
    pub fn new(mixture: &Mixture<D>, format: &WireFormat<D>, resolution: usize) -> Result<Self, Error> {
        let kept = mixture.components().iter().filter(|c| c.weight() > 0.0).count();
        if kept > MAX_COMPONENTS {
            return refuse("mixture", format!("{kept} components"), "at most 63");
        }
        if resolution >= format.resolutions().len() {
            let expected = format!("below {}", format.resolutions().len());
            return refuse("resolution", resolution, expected);
        }
        let mut symbols = Quantiser::default();
        let coded = walk(&mut symbols, format, Some((mixture, resolution)))?;
        Ok(Self {
            symbols: symbols.symbols,
            mixture: coded,
        })
    }

    /// The mixture as the receiver decodes it.
    pub fn mixture(&self) -> &Mixture<D> {
        &self.mixture
    }

    /// The mixture as the receiver decodes it.
    pub fn into_mixture(self) -> Mixture<D> {
        self.mixture
    }
}

impl<const D: usize> Message for CodedMixture<D> {
    type Format = WireFormat<D>;

    /// The format is that of the constructor; the argument is not used.
    fn encode(&self, _: &WireFormat<D>, writer: &mut BitWriter) -> Result<(), CodecError> {
        let mut code = Writer::new();
        for (law, n) in &self.symbols {
            code.integer(law, Some(*n))?;
        }
        code.finish(writer)
    }

    fn decode(format: &WireFormat<D>, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        // No number takes more than 60 bits.
        let most = 60 * (MAX_COMPONENTS + 1) * (D * D + D + 2);
        let mut source = Decoder {
            reader: Reader::new(reader, most)?,
            symbols: Vec::new(),
        };
        let mixture = walk(&mut source, format, None)?;
        let message = Self {
            symbols: source.symbols,
            mixture,
        };
        let canonical = message.to_bits(format)?;
        let mut expected = BitReader::new(&canonical);
        if reader.remaining() < canonical.bits() {
            return Err(CodecError::EndOfMessage {
                requested: (canonical.bits() - reader.remaining()) as u32,
                available: reader.remaining(),
            });
        }
        while expected.remaining() > 0 {
            let width = expected.remaining().min(64) as u32;
            if expected.read(width)? != reader.read(width)? {
                let expected = "the shortest code of its symbols";
                return Err(CodecError::invalid("code word", "another than the encoder's", expected));
            }
        }
        Ok(message)
    }
}
