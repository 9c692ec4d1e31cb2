//! Structs whose fields say everything about themselves: what a parameter is by default, what a column is measured in.

/// A struct of parameters: limits, default, after `=> quick` what `--quick` lowers it to, and meaning of a field in one place.
///
/// Limits are `[low..=high]`, either end may be missing; of a list `[low..=high; least..=most]`, first of its entries, then of its
/// length. The meaning is the field's documentation; one that is longer than a line may stand above the field instead. What speaks
/// of several fields is a function behind the struct: `check |p| accept("low", p.low < p.high, || ...);`, before it `cost |p| Cost::new(seconds, bytes);`
/// where a setting could ask for too much, and behind it `quicken |p| p.size = p.size.min(9);` where `--quick` depends on the setting. A struct `point struct` is an entry of a list or the
/// settings of several figures: it has no defaults, and its fields may be columns of a row.
///
/// ```
/// fewbits_experiments::parameters! {
///     struct Parameters {
///         a: f64 [-1.0..=1.0] = 0.9 => "Plant coefficient.",
///         trials: u64 [2..=10_000_000] = 4000 => quick 40 => "Simulated runs.",
///     }
/// }
/// let mut p = Parameters::default();
/// fewbits_experiments::Quick::quicken(&mut p);
/// assert_eq!((p.a, p.trials), (0.9, 40));
/// ```
#[macro_export]
macro_rules! parameters {
    (
        $(#[$outer:meta])*
        $visible:vis struct $name:ident {
            $($(#[doc = $doc:literal])* $(#[serde($($serde:tt)*)])? $shown:vis $field:ident: $type:ty $([$($limits:tt)*])?
                = $default:expr $(=> quick $quick:expr)? $(=> $meaning:literal)?,)*
        }
        $(cost $cost:expr;)?
        $(check $check:expr;)?
        $(quicken $quicken:expr;)?
    ) => {
        $crate::parameters! {
            $(#[$outer])*
            $visible point struct $name {
                $($(#[doc = $doc])* $(#[serde($($serde)*)])? $shown $field: $type $([$($limits)*])? $(=> $meaning)?,)*
            }
        }

        impl Default for $name {
            fn default() -> Self {
                Self { $($field: $default,)* }
            }
        }

        impl $crate::Quick for $name {
            fn quicken(&mut self) {
                $($(self.$field = $quick;)?)*
                $(let further: fn(&mut Self) = $quicken;
                further(self);)?
            }

            $(fn cost(&self) -> $crate::Cost {
                let cost: fn(&Self) -> $crate::Cost = $cost;
                cost(self)
            })?

            $(fn check(&self) -> Result<(), $crate::Refusal> {
                let check: fn(&Self) -> Result<(), $crate::Refusal> = $check;
                check(self)
            })?
        }
    };
    (
        $(#[$outer:meta])*
        $visible:vis point struct $name:ident {
            $($(#[doc = $doc:literal])* $(#[serde($($serde:tt)*)])? $shown:vis $field:ident: $type:ty $([$($limits:tt)*])?
                $(=> $meaning:literal)?,)*
        }
    ) => {
        $(#[$outer])*
        #[derive(::serde::Serialize, ::serde::Deserialize)]
        #[serde(deny_unknown_fields)]
        $visible struct $name {
            $($(#[doc = $doc])* $(#[doc = $meaning])? $(#[serde($($serde)*)])? $shown $field: $type,)*
        }

        impl $crate::Argument for $name {
            fn fields() -> Vec<$crate::Parameter> {
                let all = Vec::new();
                $(let all = $crate::Parameter::of(
                    stringify!($field), concat!("" $(, $doc)* $(, $meaning)?), $crate::limits!($($($limits)*)?)
                ).add(stringify!($($($serde)*)?), <$type as $crate::Argument>::fields(), all);)*
                all
            }
        }

        $crate::rows! { @fields $name [] [] $($field: $type [] [] concat!("" $(, $doc)* $(, $meaning)?),)* }
    };
}

/// The [`Limits`](crate::Limits) of a parameter as [`parameters!`](crate::parameters!) writes them.
#[macro_export]
#[doc(hidden)]
macro_rules! limits {
    ($($low:literal)? $(..= $high:literal)? $(; $($length:tt)*)?) => {
        $crate::Limits {
            low: [$($low as f64)?].first().copied(),
            high: [$($high as f64)?].first().copied(),
            length: [$($crate::limits!($($length)*))?].first().map(|length: &$crate::Limits| (length.low, length.high)),
        }
    };
    ($low:literal .. $(; $($length:tt)*)?) => {
        $crate::limits!($low $(; $($length)*)?)
    };
}

/// Structs of rows, and structs of lists of them ([`Field`](crate::schema::Field)): the fields are the columns, each with its unit
/// and its meaning behind its type. The meaning is the field's documentation; one that is longer than a line may stand above the
/// field instead. A row that is compared with references says by which of its fields it is found: `struct Row by "{distance} m"`, or
/// by a function of the row, `struct Row by name`. Each column of such rows that has references under its own name is compared with
/// them, without a word in the claims; behind `by "{distance} m" at full_trials` no plain averages are, with fewer trials undecided.
///
/// What a field is in the default plot stands behind its type and unit, with what it is called there: `as panel("ratio {}")`,
/// `as x("time t")` (several such columns stand together as words) or `as ladder` (words below one another, and what is drawn lies
/// across), `as key`, `as line("exact")`, `as dashed("bound")`, `as points("simulated")`, `as curve("mean")`. Where there
/// are several panels of one horizontal axis, `as line("exact") in errors` names those of the column. A row within a row has one
/// role, and a `{}` for each of its columns. [`figure!`](crate::figure!) then draws the rows.
///
/// ```
/// fewbits_experiments::rows! {
///     struct Row {
///         distance: f64 ["m"] => "Distance from the sensor.",
///         bit: u32 => "Bit received.",
///     }
/// }
/// assert_eq!(fewbits_experiments::Table::of(&vec![Row { distance: 2.0, bit: 1 }])?[0].columns[0].unit, "m");
/// # Ok::<(), fewbits_experiments::Error>(())
/// ```
///
/// Another role does not compile, and the error points at it:
///
/// ```compile_fail
/// fewbits_experiments::rows! {
///     struct Row {
///         distance: f64 ["m"] as abscissa => "Distance from the sensor.",
///     }
/// }
/// ```
#[macro_export]
macro_rules! rows {
    (@fields $name:ident [$($key:tt $($effort:ident)?)?] $names:tt
        $($field:ident: $type:ty [$($unit:tt)?] [$($role:ident $($label:literal)? [$($panel:ident)*])?] $meaning:expr,)*) => {
        impl $crate::schema::Field for $name {
            fn describe(row: $crate::Column, to: &mut $crate::schema::Described) {
                let first = to.described();
                $(<$type as $crate::schema::Field>::describe(
                    $crate::Column::of(stringify!($field), concat!("" $(, $unit)?), $meaning)
                        $(.drawn($crate::schema::Role::$role, concat!("" $(, $label)?), &[$(stringify!($panel)),*]))?,
                    to,
                );)*
                to.draw(first, row);
            }

            fn put(&self, to: &mut $crate::schema::Cells) {
                $($crate::schema::Field::put(&self.$field, to);)*
            }

            $(fn found_by(&self) -> Option<String> {
                Some($crate::rows!(@key self $key $names))
            }

            $(fn at_full_trials() -> bool {
                $crate::schema::efforts::$effort
            })?)?
        }
    };
    (@key $row:ident $key:ident $fields:tt) => {
        $key($row)
    };
    (@key $row:ident $key:literal [$($field:ident)*]) => {{
        #[allow(unused_variables)]
        let Self { $($field),* } = $row;
        format!($key)
    }};
    ($(
        $(#[$outer:meta])*
        $visible:vis struct $name:ident $(by $key:tt $(at $effort:ident)?)? {
            $($(#[doc = $doc:literal])* $shown:vis $field:ident: $type:ty $([$unit:tt])?
                $(as $role:ident $(($label:literal))? $(in $($panel:ident)+)?)? $(=> $meaning:literal)?,)*
        }
    )*) => {$(
        $(#[$outer])*
        $visible struct $name {
            $($(#[doc = $doc])* $(#[doc = $meaning])? $shown $field: $type,)*
        }

        $crate::rows! {
            @fields $name [$($key $($effort)?)?] [$($field)*]
            $($field: $type [$($unit)?] [$($role $($label)? [$($($panel)+)?])?] concat!("" $(, $doc)* $(, $meaning)?),)*
        }
    )*};
}

/// What stands at the head of a [`Figure`](crate::Figure): its parameters and tables, its id, its title, where in the
/// publications it comes from, and its caption.
///
/// `figure!(Parameters => Vec<Row>, "demo-fig1", "Averages", "the paper, figure 1", "What it shows.");`
///
/// With the axes behind the caption, `"What it shows."; semilog("error / m")` (or `linear`, `loglog`), it also draws the first table
/// whose columns have roles ([`rows!`](crate::rows!)); with several panels, `"What it shows."; { errors: semilog("error / m", "Errors"),
/// rates: linear("rate") }`, each draws the columns that name it, under its title.
///
/// Where many figures are values of one type, a field says what stands above: `figure!(Parameters => Vec<Row>, about);`, with axes
/// behind it as well.
#[macro_export]
macro_rules! figure {
    ($parameters:ty => $tables:ty, $id:expr, $title:literal, $source:literal, $caption:literal $(; $($panels:tt)+)?) => {
        type Parameters = $parameters;
        type Tables = $tables;

        fn about(&self) -> $crate::About {
            $crate::About::of($id, $title, $source).showing($caption)
        }

        $($crate::drawn! { $($panels)+ })?
    };
    ($parameters:ty => $tables:ty, $about:ident $(; $($panels:tt)+)?) => {
        type Parameters = $parameters;
        type Tables = $tables;

        fn about(&self) -> $crate::About {
            self.$about
        }

        $($crate::drawn! { $($panels)+ })?
    };
}

/// The default plot as [`figure!`](crate::figure!) writes its panels.
#[macro_export]
#[doc(hidden)]
macro_rules! drawn {
    ($panel:ident($y:expr)) => {
        $crate::drawn! { @panels "", "" => $panel($y) }
    };
    ({ $($name:ident: $panel:ident($y:expr $(, $heading:literal)?)),+ $(,)? }) => {
        $crate::drawn! { @panels $(stringify!($name), concat!("" $(, $heading)?) => $panel($y)),+ }
    };
    (@panels $($name:expr, $heading:expr => $panel:ident($y:expr)),+) => {
        fn plot(&self, _: &Self::Parameters, tables: &Self::Tables) -> $crate::plot::Plot {
            let title = $crate::Figure::about(self).title;
            $crate::plotted(tables, title, &[$(($name, $heading, &|title, x| $crate::plot::Panel::$panel(title, x, $y))),+])
        }
    };
}
