//! Structs whose fields say everything about themselves: what a parameter is by default, what a column is measured in.

/// A struct of parameters: documentation, range (`garde`) and default of a field in one place, and after `=> quick` what
/// `--quick` lowers it to. Ranges that speak of other fields, of `self`, need the derive where they stand:
/// `parameters! { self #[derive(Validate)] struct ... }`.
///
/// ```
/// fewbits_experiments::parameters! {
///     struct Parameters {
///         /// Plant coefficient.
///         #[garde(range(min = -1.0, max = 1.0))]
///         a: f64 = 0.9,
///         /// Simulated runs.
///         #[garde(range(min = 2, max = 10_000_000))]
///         trials: u64 = 4000 => quick 40,
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
            $($(#[$attribute:meta])* $shown:vis $field:ident: $type:ty = $default:expr $(=> quick $quick:expr)?,)*
        }
    ) => {
        $(#[$outer])*
        #[derive(::serde::Serialize, ::serde::Deserialize, ::schemars::JsonSchema)]
        #[$validate]
        #[serde(deny_unknown_fields)]
        $visible struct $name {
            $($(#[$attribute])* $shown $field: $type,)*
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

/// Structs of rows, and structs of lists of them: the fields are the columns, each with its unit behind its type.
///
/// ```
/// fewbits_experiments::rows! {
///     struct Row {
///         /// Distance from the sensor.
///         distance: f64 ["m"],
///         /// Bit received.
///         bit: u32,
///     }
/// }
/// assert_eq!(fewbits_experiments::Tables::of(&vec![Row { distance: 2.0, bit: 1 }])?.main.columns()[0].unit, "m");
/// # Ok::<(), fewbits_experiments::Error>(())
/// ```
#[macro_export]
macro_rules! rows {
    ($(
        $(#[$outer:meta])*
        $visible:vis struct $name:ident {
            $($(#[$attribute:meta])* $shown:vis $field:ident: $type:ty $([$unit:tt])?,)*
        }
    )*) => {$(
        $(#[$outer])*
        #[derive(::serde::Serialize, ::schemars::JsonSchema)]
        $visible struct $name {
            $($(#[$attribute])* $(#[schemars(extend("unit" = $unit))])? $shown $field: $type,)*
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
