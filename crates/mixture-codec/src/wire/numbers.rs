//! A mixture as numbers of one format, without compression.

use crate::Error;
use fewbits_core::{ArgumentError, BitReader, BitWriter, CodecError, Message, NumberFormat, RoundedGaussian};
use fewbits_densities::{Component, Mixture};

/// A mixture as it arrives in a number format: all weights but the first, since they sum to one, and then each component as a
/// [`RoundedGaussian`]. A Gaussian is a mixture of one and has no weight.
///
/// ```
/// use fewbits_core::{Message, NumberFormat};
/// use fewbits_densities::{Component, Mixture};
/// use fewbits_mixture_codec::wire::RoundedMixture;
/// use nalgebra::{Matrix2, Vector2};
/// let lobe = |w, x| Component::new(w, Vector2::new(x, 0.5), Matrix2::identity() * 0.1);
/// let belief = Mixture::new(vec![lobe(0.7, 0.0)?, lobe(0.3, 1.5)?])?;
/// let sent = RoundedMixture::new(&belief, &NumberFormat::Single)?;
/// let format = (2, NumberFormat::Single);
/// let bits = sent.to_bits(&format)?;
/// assert_eq!(bits.bits(), 11 * 32);
/// assert_eq!(RoundedMixture::from_bits(&format, &bits)?, sent);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct RoundedMixture<const D: usize> {
    weights: Vec<f64>,
    components: Vec<RoundedGaussian<D>>,
}

impl<const D: usize> RoundedMixture<D> {
    /// The mixture as it arrives in the given format.
    ///
    /// # Errors
    /// If a number exceeds the format.
    pub fn new(mixture: &Mixture<D>, format: &NumberFormat) -> Result<Self, ArgumentError> {
        let components = mixture.components();
        let weights = components.iter().skip(1).map(|c| format.rounded(c.weight()));
        let rounded = |c: &Component<D>| RoundedGaussian::with_factor(&c.gaussian(), c.factor().lower, format);
        Ok(Self {
            weights: weights.collect::<Result<_, _>>()?,
            components: components.iter().map(rounded).collect::<Result<_, _>>()?,
        })
    }

    /// Number of components.
    pub fn components(&self) -> usize {
        self.components.len()
    }

    /// The mixture that sender and receiver hold afterwards.
    ///
    /// # Errors
    /// If there is no component, a weight is negative, or a covariance is singular.
    pub fn mixture(&self) -> Result<Mixture<D>, Error> {
        let first = (1.0 - self.weights.iter().sum::<f64>()).max(0.0);
        let weights = std::iter::once(first).chain(self.weights.iter().copied());
        let components = weights.zip(&self.components).map(|(weight, rounded)| {
            let gaussian = rounded.belief();
            Component::new(weight, *gaussian.mean(), *gaussian.covariance())
        });
        Mixture::new(components.collect::<Result<_, _>>()?)
    }
}

impl<const D: usize> Message for RoundedMixture<D> {
    /// Number of components, and format of the numbers.
    type Format = (usize, NumberFormat);

    fn encode(&self, (components, format): &Self::Format, writer: &mut BitWriter) -> Result<(), CodecError> {
        if self.components.len() != *components {
            return Err(CodecError::invalid("components", self.components.len(), "the number that both ends know"));
        }
        self.weights
            .iter()
            .try_for_each(|weight| format.write(*weight, writer))?;
        self.components.iter().try_for_each(|one| one.encode(format, writer))
    }

    fn decode((components, format): &Self::Format, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let weights = (1..*components)
            .map(|_| format.read(reader))
            .collect::<Result<_, _>>()?;
        let components = (0..*components).map(|_| RoundedGaussian::decode(format, reader));
        Ok(Self {
            weights,
            components: components.collect::<Result<_, _>>()?,
        })
    }
}
