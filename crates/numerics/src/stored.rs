//! Serialised forms of types whose constructors check their arguments, and floats that are stored exactly in every format.
//!
//! Some text formats print a float exactly but read it back with an error of one unit in the last place. Put
//! `#[serde(with = "fewbits_numerics::stored")]` on a field of type `f64` or `f32`, a matrix, or an `Option`, `Vec`, array or pair of
//! [`Floats`]. In text formats each float is then written as a string, the shortest that reads back exactly (`"0.1"`); binary formats
//! store the float as usual. Plain numbers in text are accepted too.
//!
//! ```
//! #[derive(Debug, PartialEq, serde::Serialize, serde::Deserialize)]
//! struct Belief {
//!     #[serde(with = "fewbits_numerics::stored")]
//!     weights: [f64; 2],
//! }
//! let belief = Belief { weights: [0.1, 1.0 / 3.0] };
//! let text = serde_json::to_string(&belief).unwrap();
//! assert_eq!(text, r#"{"weights":["0.1","0.3333333333333333"]}"#);
//! assert_eq!(serde_json::from_str::<Belief>(&text).unwrap(), belief);
//! assert_eq!(serde_json::from_str::<Belief>(r#"{"weights":[0.5, 1]}"#).unwrap(), Belief { weights: [0.5, 1.0] });
//! ```

use nalgebra::SMatrix;
use serde::de::{Error, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use std::fmt::{Formatter, Result as Written};

/// One float: text in text formats, eight bytes in binary ones.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exact(pub f64);

impl Serialize for Exact {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if serializer.is_human_readable() {
            serializer.collect_str(&format_args!("{:?}", self.0))
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

/// Stored as the same number in `f64`.
impl Floats for f32 {
    type Form = Exact;

    fn form(&self) -> Exact {
        Exact((*self).into())
    }

    fn read(form: Exact) -> Option<Self> {
        Some(form.0 as Self)
    }
}

/// Integers beside floats are stored as they are.
impl Floats for i64 {
    type Form = Self;

    fn form(&self) -> Self {
        *self
    }

    fn read(form: Self) -> Option<Self> {
        Some(form)
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

impl<A: Floats, B: Floats> Floats for (A, B) {
    type Form = (A::Form, B::Form);

    fn form(&self) -> Self::Form {
        (self.0.form(), self.1.form())
    }

    fn read((a, b): Self::Form) -> Option<Self> {
        Some((A::read(a)?, B::read(b)?))
    }
}

/// Writes floats exactly. For use through `#[serde(with = "fewbits_numerics::stored")]`.
///
/// # Errors
/// If the format returns an error.
pub fn serialize<T: Floats, S: Serializer>(value: &T, serializer: S) -> Result<S::Ok, S::Error> {
    value.form().serialize(serializer)
}

/// Reads what [`serialize`] wrote, or plain numbers.
///
/// # Errors
/// If the format returns an error, an array has the wrong length, or a string is not a number.
pub fn deserialize<'de, T: Floats, D: Deserializer<'de>>(deserializer: D) -> Result<T, D::Error> {
    T::read(T::Form::deserialize(deserializer)?).ok_or_else(|| D::Error::custom("an array of another length"))
}

/// Implements serde for a type whose constructor checks its arguments: lists the fields of the stored form, each with its type and its
/// value, and the constructor that reads them. The type itself has the attribute `#[serde(try_from = "Form", into = "Form")]`. In the
/// second form of the macro the fields have no values: the type is written by its own derive, `into` is left out, and the form and its
/// fields may have serde attributes. A type with a dimension is written `[const D: usize] Type as Form`; its form is then `Form<D>`.
///
/// ```
/// use fewbits_numerics::{ArgumentError, error::positive, stored};
/// #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
/// #[serde(try_from = "Form", into = "Form")]
/// struct Noise {
///     deviation: f64,
/// }
///
/// impl Noise {
///     fn new(variance: f64) -> Result<Self, ArgumentError> {
///         Ok(Self { deviation: positive("variance", variance)?.sqrt() })
///     }
/// }
///
/// stored! { Noise as Form |noise| {
///     variance: f64 = noise.deviation * noise.deviation,
/// } => Noise::new(variance), ArgumentError }
///
/// assert_eq!(serde_json::from_str::<Noise>(r#"{"variance": 4.0}"#).unwrap(), Noise { deviation: 2.0 });
/// assert!(serde_json::from_str::<Noise>(r#"{"variance": -4.0}"#).is_err());
/// assert_eq!(serde_json::to_string(&Noise { deviation: 3.0 }).unwrap(), r#"{"variance":9.0}"#);
/// ```
#[macro_export]
macro_rules! stored {
    ($(#[$meta:meta])* $([$(const $n:ident: usize),+])? $type:ident as $form:ident |$value:ident| { $($(#[$attribute:meta])* $field:ident: $kind:ty = $get:expr),+ $(,)? } => $make:expr, $error:ty) => {
        $crate::stored! { #[derive(::serde::Serialize)] $(#[$meta])* $([$(const $n: usize),+])? $type as $form { $($(#[$attribute])* $field: $kind),+ } => $make, $error }

        impl$(<$(const $n: usize),+>)? From<$type$(<$($n),+>)?> for $form$(<$($n),+>)? {
            fn from($value: $type$(<$($n),+>)?) -> Self {
                Self { $($field: $get),+ }
            }
        }
    };
    ($(#[$meta:meta])* $([$(const $n:ident: usize),+])? $type:ident as $form:ident { $($(#[$attribute:meta])* $field:ident: $kind:ty),+ $(,)? } => $make:expr, $error:ty) => {
        #[derive(::serde::Deserialize)]
        $(#[$meta])*
        #[serde(deny_unknown_fields)]
        struct $form$(<$(const $n: usize),+>)? { $($(#[$attribute])* $field: $kind),+ }

        impl$(<$(const $n: usize),+>)? TryFrom<$form$(<$($n),+>)?> for $type$(<$($n),+>)? {
            type Error = $error;

            fn try_from($form { $($field),+ }: $form$(<$($n),+>)?) -> Result<Self, $error> {
                $make
            }
        }
    };
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// As a text, never as a number: no parser of numbers can change a bit. Random bit patterns.
    #[test]
    fn every_float_returns_to_the_bit_as_text() {
        let mut state = 1_u64;
        for _ in 0..100_000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let value = f64::from_bits(state ^ state >> 29);
            if value.is_nan() {
                continue;
            }
            let stored = serde_json::to_value(Exact(value)).unwrap();
            assert!(stored.is_string());
            assert_eq!(serde_json::from_value::<Exact>(stored).unwrap().0.to_bits(), value.to_bits());
        }
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
