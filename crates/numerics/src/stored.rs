//! The stored form of a checked type.

/// How a type with a checking constructor is written and read by serde: the fields of its stored form, each with its type and its
/// value, and the constructor that reads them. The type itself says `#[serde(try_from = "Form", into = "Form")]`; without values
/// (second form) it is written by its own derive, and `into` is left out; fields may then have serde's attributes.
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
    ($type:ident as $form:ident |$value:ident| { $($field:ident: $kind:ty = $get:expr),+ $(,)? } => $make:expr, $error:ty) => {
        $crate::stored! { #[derive(::serde::Serialize)] $type as $form { $($field: $kind),+ } => $make, $error }

        impl From<$type> for $form {
            fn from($value: $type) -> Self {
                Self { $($field: $get),+ }
            }
        }
    };
    ($(#[$meta:meta])* $type:ident as $form:ident { $($(#[$attribute:meta])* $field:ident: $kind:ty),+ $(,)? } => $make:expr, $error:ty) => {
        $(#[$meta])*
        #[derive(::serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        struct $form { $($(#[$attribute])* $field: $kind),+ }

        impl TryFrom<$form> for $type {
            type Error = $error;

            fn try_from($form { $($field),+ }: $form) -> Result<Self, $error> {
                $make
            }
        }
    };
}
