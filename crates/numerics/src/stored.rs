//! Serialised forms of matrices, and of numbers that may be infinite.
//!
//! A float is stored by serde as any other number. Two kinds need `#[serde(with = "fewbits_numerics::stored")]` on their field: matrices,
//! for which nalgebra is built without serde, and numbers that may be infinite, which JSON does not have. Text formats hold an infinity or
//! NaN as text (`"inf"`, `"-inf"`, `"NaN"`), binary formats as the number it is.
//!
//! A JSON reader returns every bit of a number only if it rounds correctly: `serde_json` needs its feature `float_roundtrip`.
//!
//! ```
//! #[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
//! struct Interval {
//!     #[serde(with = "fewbits_numerics::stored")]
//!     ends: [f64; 2],
//! }
//! let interval = Interval { ends: [1.0 / 3.0, f64::INFINITY] };
//! let text = serde_json::to_string(&interval).unwrap();
//! assert_eq!(text, r#"{"ends":[0.3333333333333333,"inf"]}"#);
//! assert_eq!(serde_json::from_str::<Interval>(&text).unwrap(), interval);
//! ```

use nalgebra::SMatrix;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt::{Formatter, Result as Written};

/// One float: the text of an infinity or NaN in text formats, otherwise a number.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exact(pub f64);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() && !self.0.is_finite() {
            serializer.collect_str(&self.0)
        } else {
            serializer.serialize_f64(self.0)
        }
    }
}

impl<'de> Deserialize<'de> for Exact {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Read;

        impl Visitor<'_> for Read {
            type Value = Exact;

            fn expecting(&self, formatter: &mut Formatter<'_>) -> Written {
                formatter.write_str("a number, or its text")
            }

            fn visit_f64<E: Error>(self, value: f64) -> Result<Exact, E> {
                Ok(Exact(value))
            }

            fn visit_u64<E: Error>(self, value: u64) -> Result<Exact, E> {
                Ok(Exact(value as f64))
            }

            fn visit_i64<E: Error>(self, value: i64) -> Result<Exact, E> {
                Ok(Exact(value as f64))
            }

            fn visit_str<E: Error>(self, text: &str) -> Result<Exact, E> {
                text.parse()
                    .map(Exact)
                    .map_err(|_| E::custom(format_args!("`{text}` is no number")))
            }
        }

        if deserializer.is_human_readable() {
            deserializer.deserialize_any(Read)
        } else {
            deserializer.deserialize_f64(Read)
        }
    }
}

/// A type that holds floats. Its stored form has [`Exact`] in place of each float.
pub trait Floats: Sized {
    /// The stored form.
    type Form: Serialize + for<'de> Deserialize<'de>;

    /// Converts a value to its stored form.
    fn form(&self) -> Self::Form;

    /// Converts a stored form back; `None` if it has the wrong length.
    fn read(form: Self::Form) -> Option<Self>;
}

impl Floats for f64 {
    type Form = Exact;

    fn form(&self) -> Exact {
        Exact(*self)
    }

    fn read(form: Exact) -> Option<Self> {
        Some(form.0)
    }
}

impl<T: Floats> Floats for Option<T> {
    type Form = Option<T::Form>;

    fn form(&self) -> Self::Form {
        self.as_ref().map(T::form)
    }

    fn read(form: Self::Form) -> Option<Self> {
        form.map_or(Some(None), |form| T::read(form).map(Some))
    }
}

impl<T: Floats> Floats for Vec<T> {
    type Form = Vec<T::Form>;

    fn form(&self) -> Self::Form {
        self.iter().map(T::form).collect()
    }

    fn read(form: Self::Form) -> Option<Self> {
        form.into_iter().map(T::read).collect()
    }
}

impl<T: Floats, const N: usize> Floats for [T; N] {
    type Form = Vec<T::Form>;

    fn form(&self) -> Self::Form {
        self.iter().map(T::form).collect()
    }

    fn read(form: Self::Form) -> Option<Self> {
        Vec::<T>::read(form)?.try_into().ok()
    }
}

/// Stored column by column, as nalgebra does.
impl<const R: usize, const C: usize> Floats for SMatrix<f64, R, C> {
    type Form = Vec<Exact>;

    fn form(&self) -> Self::Form {
        self.iter().copied().map(Exact).collect()
    }

    fn read(form: Self::Form) -> Option<Self> {
        (form.len() == R * C).then(|| Self::from_iterator(form.into_iter().map(|x| x.0)))
    }
}

/// Writes floats. For use through `#[serde(with = "fewbits_numerics::stored")]`.
///
/// # Errors
/// If the format returns an error.
pub fn serialize<T: Floats, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    value.form().serialize(serializer)
}

/// Reads what [`serialize`] wrote, or numbers as text.
///
/// # Errors
/// If the format returns an error, an array has the wrong length, or a string is not a number.
pub fn deserialize<'de, T: Floats, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::read(T::Form::deserialize(deserializer)?).ok_or_else(|| D::Error::custom("an array of another length"))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// Random bit patterns, infinities among them.
    #[test]
    fn every_number_returns_to_the_bit() {
        let mut state = 1_u64;
        let random = (0..100_000).map(|_| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            f64::from_bits(state ^ state >> 29)
        });
        let special = [
            f64::INFINITY,
            f64::NEG_INFINITY,
            -0.0,
            f64::MIN_POSITIVE / 3.0,
            f64::MAX,
        ];
        for value in special.into_iter().chain(random).filter(|value| !value.is_nan()) {
            let text = serde_json::to_string(&Exact(value)).unwrap();
            assert_eq!(serde_json::from_str::<Exact>(&text).unwrap().0.to_bits(), value.to_bits());
            assert_eq!(text.starts_with('"'), value.is_infinite());
        }
        let text = serde_json::to_string(&Exact(f64::NAN)).unwrap();
        assert!(serde_json::from_str::<Exact>(&text).unwrap().0.is_nan());
    }

    #[test]
    fn arrays_of_another_length_are_refused() {
        let read = |text: &str| deserialize::<[f64; 2], _>(&mut serde_json::Deserializer::from_str(text));
        assert_eq!(read(r#"["1.5", -2]"#).unwrap(), [1.5, -2.0]);
        for bad in [r#"["1"]"#, "[1,2,3]", r#"["x","1"]"#, "[null, 1]"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
