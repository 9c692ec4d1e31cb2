//! Parsing and printing of numbers in options.

use crate::error::Error;

pub(crate) use fewbits_tracking::short;

/// Parses a finite number.
pub(crate) fn number(option: &'static str, text: &str, expected: &'static str) -> Result<f64, Error> {
    let number: Option<f64> = text.trim().parse().ok();
    number
        .filter(|number| number.is_finite())
        .ok_or_else(|| Error::option(option, text, expected))
}

/// Parses a positive number.
pub(crate) fn above_zero(option: &'static str, text: &str, expected: &'static str) -> Result<f64, Error> {
    let found = number(option, text, expected)?;
    if found > 0.0 {
        Ok(found)
    } else {
        Err(Error::option(option, text, expected))
    }
}

/// Parses mean and standard deviation in the form `20±5`.
pub(crate) fn mean_and_deviation(option: &'static str, text: &str) -> Result<(f64, f64), Error> {
    const EXPECTED: &str = "a mean and a standard deviation above 0, as `20±5`";
    let (mean, deviation) = text
        .split_once('±')
        .or(text.split_once("+-"))
        .ok_or_else(|| Error::option(option, text, EXPECTED))?;
    Ok((number(option, mean, EXPECTED)?, above_zero(option, deviation, EXPECTED)?))
}

/// Lower and upper end of numbers, with one more included.
pub(crate) fn widened<T: PartialOrd + Copy>(ends: Option<(T, T)>, number: T) -> Option<(T, T)> {
    let (low, high) = ends.unwrap_or((number, number));
    Some((if number < low { number } else { low }, if number > high { number } else { high }))
}

/// A number with all its digits, with an exponent instead of many zeros.
pub(crate) fn exact(number: f64) -> String {
    if number == 0.0 || (1e-7..1e16).contains(&number.abs()) {
        format!("{number}")
    } else {
        format!("{number:e}")
    }
}

/// A number of a column of a table: six decimals, or six digits and an exponent where decimals would hide it.
pub(crate) fn column(number: f64) -> String {
    if number == 0.0 || (1e-3..1e6).contains(&number.abs()) {
        format!("{number:.6}")
    } else {
        format!("{number:.5e}")
    }
}

#[cfg(test)]
mod tests {
    use super::exact;

    #[test]
    fn all_digits_without_rows_of_zeros() {
        for (number, text) in [(0.0, "0"), (-20.125, "-20.125"), (1e308, "1e308"), (2.5e-9, "2.5e-9")] {
            assert_eq!(exact(number), text);
        }
    }
}
