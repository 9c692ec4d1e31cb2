//! One column of a recording: name, unit, error bound.

use crate::bound::Bound;
use crate::error::Error;
use crate::integers::Integers;
use fewbits_block_codec::{ArgumentError, ensure};

/// Largest length of a name or a unit in bytes.
const MAX_NAME: usize = 1 << 10;
/// Largest number of cells on a circle, for which the codec's indices are exact.
const MAX_CIRCLE_CELLS: f64 = (1_u64 << 40) as f64;

/// One column: name, unit, error bound.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    pub(crate) name: String,
    pub(crate) unit: String,
    pub(crate) bound: Bound,
    pub(crate) period: Option<f64>,
    /// Size of the range that a share refers to, if it is known beforehand.
    pub(crate) range: Option<f64>,
    /// The bound of the recordings that the samples come from, which adds to the column's own.
    pub(crate) earlier: f64,
    /// How its samples stand for whole numbers, if they do.
    pub(crate) integers: Option<Integers>,
}

impl Column {
    /// A column without a unit.
    ///
    /// # Errors
    /// If the name is longer than 1024 bytes, an absolute bound is not positive or its double not finite, a share is not in `(0, 1]`, or
    /// there are more than 15 decimals.
    pub fn new(name: impl Into<String>, bound: Bound) -> Result<Self, Error> {
        Ok(Self {
            name: text("name", name.into())?,
            unit: String::new(),
            bound: bound.checked()?,
            period: None,
            range: None,
            earlier: 0.0,
            integers: None,
        })
    }

    /// A column of whole numbers of 64 bits, which are kept exactly. Its samples are codes: [`Integers::code`] of these numbers. Numbers
    /// near `origin` take few bits.
    ///
    /// # Errors
    /// If the name is longer than 1024 bytes.
    pub fn of_integers(name: impl Into<String>, origin: i64) -> Result<Self, Error> {
        let integers = Some(Integers::from_origin(origin));
        Self::new(name, Bound::Lossless).map(|column| Self { integers, ..column })
    }

    /// What the samples stand for, if they are codes of whole numbers ([`of_integers`](Self::of_integers)).
    pub fn integers(&self) -> Option<Integers> {
        self.integers
    }

    /// Declares that the samples were restored from a recording within this bound, in units of the column (0: exactly). The distance
    /// from the original samples is then at most the sum of both bounds, which [`keeps`](Self::keeps) allows.
    ///
    /// # Errors
    /// If it is negative or not finite, or is above 0 while the bound is [`Bound::Decimals`] or [`Bound::Relative`], to which none can be
    /// added.
    pub fn with_earlier_bound(self, earlier: f64) -> Result<Self, Error> {
        let expected = "zero or a positive number whose double is finite";
        ensure!(earlier >= 0.0 && (2.0 * earlier).is_finite(), "earlier", earlier, expected);
        ensure!(earlier == 0.0 || self.integers.is_none(), "earlier", earlier, "zero for a column of whole numbers");
        let expected = "an absolute bound, a share of the range or lossless for a column with an earlier bound";
        ensure!(earlier == 0.0 || self.is_summed(), "bound", format!("{:?}", self.bound), expected);
        Ok(Self { earlier, ..self })
    }

    /// Whether the bound is a distance, of which others can be added and which can be kept around a circle.
    fn is_summed(&self) -> bool {
        !matches!(self.bound, Bound::Decimals(_) | Bound::Relative { .. })
    }

    /// Sets the unit of the samples, which is only shown to users.
    ///
    /// # Errors
    /// If it is longer than 1024 bytes.
    pub fn with_unit(mut self, unit: impl Into<String>) -> Result<Self, Error> {
        self.unit = text("unit", unit.into())?;
        Ok(self)
    }

    /// Declares that samples are directions on a circle of this circumference (360 for degrees). The bound then holds around the circle,
    /// and restored values lie in `[0, period)`. No effect on lossless columns.
    ///
    /// # Errors
    /// If `period` is not positive and finite, exceeds `2^40` times the bound, or the bound is [`Bound::Decimals`] or
    /// [`Bound::Relative`].
    pub fn with_period(mut self, period: f64) -> Result<Self, Error> {
        ArgumentError::positive("period", period)?;
        let expected = "an absolute bound, a share of the range or lossless for a column on a circle";
        ensure!(self.is_summed(), "bound", format!("{:?}", self.bound), expected);
        check_circle(self.bound, period)?;
        self.period = Some(period);
        Ok(self)
    }

    /// Sets the range that a share refers to, if it is known beforehand. Without it, it is the range of the rows so far, or on a circle
    /// the period.
    ///
    /// # Errors
    /// If an end is not finite or `from` is above `to`.
    pub fn with_range(mut self, from: f64, to: f64) -> Result<Self, Error> {
        ArgumentError::finite("from", from)?;
        ArgumentError::finite("to", to)?;
        let range = to - from;
        let expected = "a range of finite width, `from` below `to`";
        ensure!((0.0..f64::INFINITY).contains(&range), "range", format!("{from:?} to {to:?}"), expected);
        self.range = Some(range);
        Ok(self)
    }

    /// The name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The unit; empty if there is none.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// The error bound.
    pub fn bound(&self) -> Bound {
        self.bound
    }

    /// The bound of the recordings that the samples come from ([`with_earlier_bound`](Self::with_earlier_bound)); 0 if there are none.
    pub fn earlier_bound(&self) -> f64 {
        self.earlier
    }

    /// Circumference of the circle, if samples are directions.
    pub fn period(&self) -> Option<f64> {
        self.period
    }

    /// Whether a restored cell is within the bound of a sample. Gaps, NaN and infinities must have the same bits. `share_bound` is that of
    /// the block ([`Block::share_bounds`](crate::Block::share_bounds)), for columns with a share.
    pub fn keeps(&self, sample: Option<f64>, restored: Option<f64>, share_bound: Option<f64>) -> bool {
        let (Some(sample), Some(restored)) = (sample, restored) else {
            return sample.is_none() && restored.is_none();
        };
        if sample.to_bits() == restored.to_bits() || !sample.is_finite() || !restored.is_finite() {
            return sample.to_bits() == restored.to_bits();
        }
        self.whole_bound(share_bound.unwrap_or(0.0))
            .holds(sample, restored, self.period)
    }

    /// The bound relative to the original samples: with that of the recordings that the samples come from.
    fn whole_bound(&self, share_bound: f64) -> Bound {
        match self.bound_in(share_bound) {
            bound if self.earlier == 0.0 => bound,
            // The sum may have been rounded down, and both bounds can be reached.
            Bound::Absolute(delta) => Bound::Absolute((delta + self.earlier).next_up()),
            _ => Bound::Absolute(self.earlier),
        }
    }

    /// The bound in a block; `share_bound` is the value of a share there, 0 for lossless.
    pub(crate) fn bound_in(&self, share_bound: f64) -> Bound {
        match self.bound {
            Bound::ShareOfRange(_) if share_bound > 0.0 => Bound::Absolute(share_bound),
            Bound::ShareOfRange(_) => Bound::Lossless,
            bound => bound,
        }
    }

    /// The size of the range that a share refers to, if it is known before the first row.
    pub(crate) fn known_range(&self) -> Option<f64> {
        self.period.or(self.range)
    }
}

/// Refuses a circle of more cells than the codec's indices can count.
pub(crate) fn check_circle(bound: Bound, period: f64) -> Result<(), ArgumentError> {
    let smallest = match bound {
        Bound::Absolute(delta) => delta,
        Bound::ShareOfRange(share) => share * period,
        Bound::Lossless | Bound::Decimals(_) | Bound::Relative { .. } => period,
    };
    ensure!(period / smallest <= MAX_CIRCLE_CELLS, "period", period, "at most 2^40 times the bound");
    Ok(())
}

/// A text of at most 1024 bytes.
pub(crate) fn text(name: &'static str, text: String) -> Result<String, ArgumentError> {
    ensure!(text.len() <= MAX_NAME, name, format!("{} bytes long", text.len()), "at most 1024 bytes");
    Ok(text)
}
