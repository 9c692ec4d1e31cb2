//! Numbers as messages: the bits that a number takes, and the rounded value that arrives.

use crate::bits::{BitReader, BitWriter, CodecError};
use crate::cell::Cell;
use crate::gaussian::Gaussian;
use crate::message::Message;
use fewbits_numerics::error::{ArgumentError, all_finite, finite, within};
use fewbits_numerics::linalg::triangular_factor;
use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

/// The encoding of a number. Both ends know the format; it costs no bits itself.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NumberFormat {
    /// 64-bit floating point.
    #[default]
    Double,
    /// 32-bit floating point.
    Single,
    /// The index of one of `2^bits` evenly spaced levels.
    Fixed(EvenLevels),
}

/// `2^bits` evenly spaced levels from `lower` to `upper`, ends included. A value is rounded to the nearest level; values beyond the ends
/// are rounded to the ends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct EvenLevels {
    lower: f64,
    upper: f64,
    bits: u32,
}

/// The stored form of [`EvenLevels`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    lower: f64,
    upper: f64,
    bits: u32,
}

impl TryFrom<Numbers> for EvenLevels {
    type Error = ArgumentError;

    fn try_from(parts: Numbers) -> Result<Self, ArgumentError> {
        EvenLevels::new(parts.lower, parts.upper, parts.bits)
    }
}

impl EvenLevels {
    /// The levels from `lower` to `upper` (measurement units), `bits` of 1 to 32.
    ///
    /// # Errors
    /// If an end is not finite, `lower < upper` does not hold, or `bits` is outside 1 to 32.
    pub fn new(lower: f64, upper: f64, bits: u32) -> Result<Self, ArgumentError> {
        finite("lower", lower)?;
        finite("upper", upper)?;
        within("bits", f64::from(bits), 1.0, 32.0)?;
        finite("upper - lower", upper - lower)?;
        if lower < upper {
            Ok(Self { lower, upper, bits })
        } else {
            Err(ArgumentError::new("lower", lower, format!("a number below `upper` = {upper}")))
        }
    }

    /// Largest index.
    fn top(&self) -> f64 {
        ((1_u64 << self.bits) - 1) as f64
    }

    /// Index of the level nearest to `value`.
    fn nearest(&self, value: f64) -> u64 {
        let share = (value - self.lower) / (self.upper - self.lower);
        (share * self.top()).round().clamp(0.0, self.top()) as u64
    }

    /// The level with an index.
    fn level(&self, index: u64) -> f64 {
        // A weighted mean of the ends meets both exactly.
        let share = index as f64 / self.top();
        self.lower * (1.0 - share) + self.upper * share
    }

    /// The cell of values that are rounded to `level`: half a step to either side, unbounded at the first and last level.
    ///
    /// # Errors
    /// If `level` is NaN.
    pub fn cell(&self, level: f64) -> Result<Cell, ArgumentError> {
        let index = self.nearest(finite("level", level)?);
        let half = 0.5 * (self.upper - self.lower) / self.top();
        let centre = self.level(index);
        let lower = if index == 0 { f64::NEG_INFINITY } else { centre - half };
        let upper = if index as f64 == self.top() {
            f64::INFINITY
        } else {
            centre + half
        };
        Cell::new(lower, upper)
    }
}

impl NumberFormat {
    /// The format of `2^bits` evenly spaced levels from `lower` to `upper`.
    ///
    /// # Errors
    /// As [`EvenLevels::new`].
    pub fn fixed(lower: f64, upper: f64, bits: u32) -> Result<Self, ArgumentError> {
        Ok(Self::Fixed(EvenLevels::new(lower, upper, bits)?))
    }

    /// Bits of one number.
    pub fn bits(&self) -> u32 {
        match self {
            Self::Double => 64,
            Self::Single => 32,
            Self::Fixed(levels) => levels.bits,
        }
    }

    /// The number that arrives when `value` is sent.
    ///
    /// # Errors
    /// If `value` is not finite, or rounds to infinity in single precision.
    #[inline]
    pub fn rounded(&self, value: f64) -> Result<f64, ArgumentError> {
        finite("value", value)?;
        match self {
            Self::Double => Ok(value),
            Self::Single => finite("value", f64::from(value as f32))
                .map_err(|_| ArgumentError::new("value", value, "a number within the range of single precision")),
            Self::Fixed(levels) => Ok(levels.level(levels.nearest(value))),
        }
    }

    /// Appends `value`.
    ///
    /// # Errors
    /// If the format does not hold `value` exactly; see [`NumberFormat::rounded`].
    #[inline]
    pub fn write(&self, value: f64, writer: &mut BitWriter) -> Result<(), CodecError> {
        if self.rounded(value) != Ok(value) {
            return Err(invalid(value, "a finite number that the format holds exactly"));
        }
        match self {
            Self::Double => writer.write(value.to_bits(), 64),
            Self::Single => writer.write(u64::from((value as f32).to_bits()), 32),
            Self::Fixed(levels) => writer.write(levels.nearest(value), levels.bits),
        }
    }

    /// Reads a number.
    ///
    /// # Errors
    /// If bits are missing or are those of an infinity or NaN.
    #[inline]
    pub fn read(&self, reader: &mut BitReader<'_>) -> Result<f64, CodecError> {
        let word = reader.read(self.bits())?;
        let value = match self {
            Self::Double => f64::from_bits(word),
            Self::Single => f64::from(f32::from_bits(word as u32)),
            Self::Fixed(levels) => levels.level(word),
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(invalid(value, "a finite number"))
        }
    }
}

fn invalid(value: f64, expected: &'static str) -> CodecError {
    CodecError::invalid("number", value, expected)
}

impl Message for f64 {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        format.write(*self, writer)
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        format.read(reader)
    }
}

impl<const M: usize> Message for SVector<f64, M> {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        self.iter().try_for_each(|value| format.write(*value, writer))
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let mut vector = Self::zeros();
        for value in vector.iter_mut() {
            *value = format.read(reader)?;
        }
        Ok(vector)
    }
}

/// Mean and covariance as a [`RoundedGaussian`], which must be this Gaussian: in [`NumberFormat::Double`] every Gaussian arrives as it is.
/// [`RoundedGaussian::new`] rounds a Gaussian to a shorter format.
impl<const D: usize> Message for Gaussian<D> {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        match RoundedGaussian::new(self, format) {
            Ok(rounded) if rounded.belief() == *self => rounded.encode(format, writer),
            _ => Err(CodecError::invalid("belief", format!("{self:?}"), "a Gaussian that the format holds exactly")),
        }
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        RoundedGaussian::decode(format, reader).map(|rounded| rounded.belief())
    }
}

/// A Gaussian as it arrives in a number format: the mean and a lower triangle row by row, `D + D (D + 1)/2` numbers. The triangle is that of
/// the covariance in [`NumberFormat::Double`]. In a shorter format it is the triangular factor of the covariance: a product of factors is
/// positive semidefinite however they were rounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoundedGaussian<const D: usize> {
    mean: SVector<f64, D>,
    triangle: SMatrix<f64, D, D>,
    covariance: SMatrix<f64, D, D>,
}

impl<const D: usize> RoundedGaussian<D> {
    /// The belief as it arrives in the given format.
    ///
    /// # Errors
    /// If a number is not finite or exceeds the format.
    pub fn new(belief: &Gaussian<D>, format: &NumberFormat) -> Result<Self, ArgumentError> {
        Self::with_factor(belief, triangular_factor(belief.covariance()), format)
    }

    /// The same from a belief whose lower triangular factor is known.
    ///
    /// # Errors
    /// If a number is not finite or exceeds the format.
    pub fn with_factor(
        belief: &Gaussian<D>,
        lower: SMatrix<f64, D, D>,
        format: &NumberFormat,
    ) -> Result<Self, ArgumentError> {
        let mut mean = *belief.mean();
        let mut triangle = match format {
            NumberFormat::Double => belief.covariance().lower_triangle(),
            _ => lower.lower_triangle(),
        };
        for x in mean.iter_mut() {
            *x = format.rounded(*x)?;
        }
        for at in triangle_of::<D>() {
            triangle[at] = format.rounded(triangle[at])?;
        }
        Ok(Self {
            mean,
            triangle,
            covariance: covariance_of(&triangle, format),
        })
    }

    /// The belief that sender and receiver hold afterwards.
    pub fn belief(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.mean, self.covariance)
    }
}

/// Row and column of each entry of the lower triangle.
fn triangle_of<const D: usize>() -> impl Iterator<Item = (usize, usize)> {
    (0..D).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

fn covariance_of<const D: usize>(triangle: &SMatrix<f64, D, D>, format: &NumberFormat) -> SMatrix<f64, D, D> {
    match format {
        NumberFormat::Double => SMatrix::from_fn(|i, j| triangle[(i.max(j), i.min(j))]),
        _ => triangle * triangle.transpose(),
    }
}

impl<const D: usize> Message for RoundedGaussian<D> {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        self.mean.encode(format, writer)?;
        triangle_of::<D>().try_for_each(|at| format.write(self.triangle[at], writer))
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let mean = SVector::<f64, D>::decode(format, reader)?;
        let mut triangle = SMatrix::<f64, D, D>::zeros();
        for at in triangle_of::<D>() {
            triangle[at] = format.read(reader)?;
        }
        let covariance: SMatrix<f64, D, D> = covariance_of(&triangle, format);
        let checked = match format {
            // The entries of a covariance need not be those of any.
            NumberFormat::Double => Gaussian::new(mean, covariance),
            _ => {
                all_finite("covariance", covariance.as_slice()).map(|_| Gaussian::from_trusted_parts(mean, covariance))
            }
        };
        let belief = checked
            .map_err(|error| CodecError::invalid("covariance", error.value, "a finite positive semidefinite matrix"))?;
        Ok(Self {
            mean,
            triangle,
            covariance: *belief.covariance(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{EvenLevels, NumberFormat, RoundedGaussian};
    use crate::bits::BitString;
    use crate::gaussian::Gaussian;
    use crate::laws::message::{decoding_is_total, round_trip};
    use crate::message::Message;
    use nalgebra::{Matrix2, Matrix4, Vector2, Vector4};

    #[test]
    fn what_a_format_holds_comes_back_to_the_last_bit() {
        let fixed = NumberFormat::fixed(-1.0, 1.0, 3).unwrap();
        for (format, bits) in [(NumberFormat::Double, 128), (NumberFormat::Single, 64), (fixed, 6)] {
            let value = Vector2::new(0.3, -0.9).map(|x| format.rounded(x).unwrap());
            assert_eq!(round_trip(&value, &format).unwrap(), bits);
        }
        assert!(fixed.rounded(f64::NAN).is_err() && NumberFormat::Single.rounded(1e300).is_err());
    }

    /// In double precision the numbers of every Gaussian arrive, thin ones too; in shorter formats only those that the format holds.
    #[test]
    fn a_gaussian_arrives_as_it_is_or_is_refused() {
        let thin = Vector4::new(1.0, 1.0 / 3.0, -0.7, 0.0);
        let belief = Gaussian::new(thin, thin * thin.transpose()).unwrap();
        assert_eq!(round_trip(&belief, &NumberFormat::Double), Ok(14 * 64));
        assert!(belief.to_bits(&NumberFormat::Single).is_err());
        let whole = Gaussian::new(Vector2::new(1.0, 2.0), Matrix2::new(4.0, 2.0, 2.0, 10.0)).unwrap();
        assert_eq!(round_trip(&whole, &NumberFormat::Single), Ok(5 * 32));
        // Entries that are no covariance are refused.
        let bits = Vector4::new(0.0, 0.0, 1.0, 3.0).to_bits(&NumberFormat::Double).unwrap();
        let bits = BitString::from_bytes([bits.bytes(), &1.0_f64.to_be_bytes()].concat(), 320).unwrap();
        assert!(Gaussian::<2>::from_bits(&NumberFormat::Double, &bits).is_err());
    }

    #[test]
    fn cells_of_levels_partition_the_line() {
        let levels = EvenLevels::new(-2.0, 5.0, 2).unwrap();
        let cells: Vec<_> = (0..4).map(|i| levels.cell(levels.level(i)).unwrap()).collect();
        assert_eq!((cells[0].lower(), cells[3].upper()), (f64::NEG_INFINITY, f64::INFINITY));
        for pair in cells.windows(2) {
            assert!((pair[0].upper() - pair[1].lower()).abs() < 1e-15);
        }
        assert!(EvenLevels::new(0.0, 1.0, 0).is_err() && EvenLevels::new(0.0, 1.0, 64).is_err());
        assert!(EvenLevels::new(1.0, 1.0, 4).is_err() && EvenLevels::new(-1e308, 1e308, 4).is_err());
        assert!(serde_json::from_str::<EvenLevels>(r#"{"lower":1,"upper":0,"bits":4}"#).is_err());
    }

    #[test]
    fn a_rounded_gaussian_is_fourteen_numbers_and_stays_a_covariance() {
        let root = Matrix4::from_fn(|i, j| (i * 4 + j) as f64 * 0.1 - 0.5);
        for scale in [1e-4, 1.0, 1e4] {
            // Rank two, so that rounding the covariance itself would lose definiteness.
            let mut thin = root * scale;
            thin.column_mut(2).fill(0.0);
            thin.column_mut(3).fill(0.0);
            let belief = Gaussian::new(Vector4::repeat(scale / 3.0), thin * thin.transpose()).unwrap();
            let sent = RoundedGaussian::new(&belief, &NumberFormat::Single).unwrap();
            assert_eq!(round_trip(&sent, &NumberFormat::Single), Ok(448));
            let arrived = sent.belief();
            assert!(Gaussian::new(*arrived.mean(), *arrived.covariance()).is_ok());
            assert!((arrived.covariance() - belief.covariance()).amax() < 1e-5 * scale * scale);
        }
        let bits = RoundedGaussian::new(&Gaussian::known(Vector4::zeros()).unwrap(), &NumberFormat::Double).unwrap();
        let bits = bits.to_bits(&NumberFormat::Double).unwrap();
        assert!(
            (0..bits.bits())
                .step_by(7)
                .all(|i| decoding_is_total::<RoundedGaussian<4>>(&bits.clone().with_flipped(i), &NumberFormat::Double))
        );
    }
}
