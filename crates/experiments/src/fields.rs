//! Structs whose fields say everything about themselves: what a parameter is by default, what a column is measured in.

/// A struct of parameters: range (`garde`), default, after `=> quick` what `--quick` lowers it to, and meaning of a field in one
/// place. The meaning is the field's documentation; one that is longer than a line may stand above the field instead. Ranges that speak of other fields, of `self`, need the derive where they stand:
/// `parameters! { self #[derive(Validate)] struct ... }`.
///
/// ```
/// fewbits_experiments::parameters! {
///     struct Parameters {
///         #[garde(range(min = -1.0, max = 1.0))]
///         a: f64 = 0.9 => "Plant coefficient.",
///         #[garde(range(min = 2, max = 10_000_000))]
///         trials: u64 = 4000 => quick 40 => "Simulated runs.",
///     }
/// }
/// let mut p = Parameters::default();
/// fewbits_experiments::Quick::quicken(&mut p);
/// assert_eq!((p.a, p.trials), (0.9, 40));
/// ```
#[macro_export]
macro_rules! parameters {
    (
        self #[$validate:meta]
        $(#[$outer:meta])*
        $visible:vis struct $name:ident {
            $($(#[$attribute:meta])* $shown:vis $field:ident: $type:ty = $default:expr
                $(=> quick $quick:expr)? $(=> $meaning:literal)?,)*
        }
    ) => {
        $(#[$outer])*
        #[derive(::serde::Serialize, ::serde::Deserialize, ::schemars::JsonSchema)]
        #[$validate]
        #[serde(deny_unknown_fields)]
        $visible struct $name {
            $($(#[$attribute])* $(#[doc = $meaning])? $shown $field: $type,)*
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::Quick for $name {
            fn quicken(&mut self) {
                $($(self.$field = $quick;)?)*
            }
        }
    };
    ($($struct:tt)*) => {
        $crate::parameters! { self #[derive(::garde::Validate)] $($struct)* }
    };
}

/// Structs of rows, and structs of lists of them: the fields are the columns, each with its unit and its meaning behind its type.
/// The meaning is the field's documentation; one that is longer than a line may stand above the field instead. A row that is
/// compared with references says by which of its fields it is found: `struct Row by "{distance} m"`
/// ([`Claims::keyed`](crate::Claims::keyed)).
///
/// ```
/// fewbits_experiments::rows! {
///     struct Row {
///         distance: f64 ["m"] => "Distance from the sensor.",
///         bit: u32 => "Bit received.",
///     }
/// }
/// assert_eq!(fewbits_experiments::Tables::of(&vec![Row { distance: 2.0, bit: 1 }])?.main.columns()[0].unit, "m");
/// # Ok::<(), fewbits_experiments::Error>(())
/// ```
#[macro_export]
macro_rules! rows {
    (@keyed $name:ident [] [$($field:ident)*]) => {};
    (@keyed $name:ident [$key:literal] [$($field:ident)*]) => {
        impl $crate::claim::Keyed for $name {
            #[allow(unused_variables)]
            fn key(&self) -> String {
                let Self { $($field),* } = self;
                format!($key)
            }
        }
    };
    ($(
        $(#[$outer:meta])*
        $visible:vis struct $name:ident $(by $key:literal)? {
            $($(#[$attribute:meta])* $shown:vis $field:ident: $type:ty $([$unit:tt])? $(=> $meaning:literal)?,)*
        }
    )*) => {$(
        $crate::rows! { @keyed $name [$($key)?] [$($field)*] }
        $(#[$outer])*
        #[derive(::serde::Serialize, ::schemars::JsonSchema)]
        $visible struct $name {
            $($(#[$attribute])* $(#[doc = $meaning])? $(#[schemars(extend("unit" = $unit))])? $shown $field: $type,)*
        }
    )*};
}

/// What stands at the head of a [`Figure`](crate::Figure): its parameters and tables, its id, its title, where in the
/// publications it comes from, and its caption.
///
/// `figure!(Parameters => Vec<Row>, "demo-fig1", "Averages", "the paper, figure 1", "What it shows.");`
#[macro_export]
macro_rules! figure {
    ($parameters:ty => $tables:ty, $id:expr, $title:literal, $source:literal, $caption:literal) => {
        type Parameters = $parameters;
        type Tables = $tables;

        const ABOUT: $crate::About = $crate::About::of($id, $title, $source).showing($caption);
    };
}
