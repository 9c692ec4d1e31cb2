//! Numbers in options.

use crate::error::Error;

/// A finite number.
pub(crate) fn number(option: &'static str, text: &str, expected: &'static str) -> Result<f64, Error> {
    let number: Option<f64> = text.trim().parse().ok();
    number
        .filter(|number| number.is_finite())
        .ok_or_else(|| Error::option(option, text, expected))
}

/// A number above 0.
pub(crate) fn above_zero(option: &'static str, text: &str, expected: &'static str) -> Result<f64, Error> {
    let found = number(option, text, expected)?;
    if found > 0.0 {
        Ok(found)
    } else {
        Err(Error::option(option, text, expected))
    }
}

/// `20±5`.
pub(crate) fn mean_and_deviation(option: &'static str, text: &str) -> Result<(f64, f64), Error> {
    const EXPECTED: &str = "a mean and a standard deviation above 0, as `20±5`";
    let (mean, deviation) = text
        .split_once('±')
        .or(text.split_once("+-"))
        .ok_or_else(|| Error::option(option, text, EXPECTED))?;
    Ok((number(option, mean, EXPECTED)?, above_zero(option, deviation, EXPECTED)?))
}
