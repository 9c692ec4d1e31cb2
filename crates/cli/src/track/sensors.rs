//! Reports of sensors as options and tables have them.

use crate::error::{Error, Failure};
use crate::report::Report;
use fewbits_core::{ArgumentError, BitString, Message, NumberFormat, Sign};
use fewbits_dymbo::CellIndex;

/// Largest length of a word, because the centre's health test enumerates all words.
const MAX_BITS: u32 = 4;

/// Parses a value of `--send`.
pub(super) fn parse(text: &str) -> Result<Report, Error> {
    let refused =
        || Error::option("--send", text, "`value`, `bit`, or `word:2` to `word:4`; for one column as `column=bit`");
    match text {
        "value" => Ok(Report::Value),
        "bit" => Ok(Report::Sign),
        _ => {
            let bits = text.strip_prefix("word:").and_then(|bits| bits.parse().ok());
            bits.filter(|bits| (2..=MAX_BITS).contains(bits))
                .map(|bits| Report::Word { bits })
                .ok_or_else(refused)
        }
    }
}

/// A report as it stands in a table.
pub(super) fn bits(report: Report, cell: f64) -> Result<BitString, Failure> {
    let wrong = |expected: String| ArgumentError::new("report", cell, expected);
    Ok(match report {
        Report::Value | Report::Censored { .. } => double(cell)?,
        Report::Sign if cell == 0.0 || cell == -1.0 => Sign::Below.to_bits(&())?,
        Report::Sign if cell == 1.0 => Sign::Above.to_bits(&())?,
        Report::Sign => return Err(wrong("1, or 0 or -1: `--send bit` says that reports are bits".to_owned()).into()),
        Report::Word { bits } => {
            let largest = (1_u32 << bits) - 1;
            if !(0.0..=f64::from(largest)).contains(&cell) || cell.fract() != 0.0 {
                return Err(wrong(format!("a whole number from 0 to {largest}, the lowest cell first")).into());
            }
            CellIndex(cell as u16).to_bits(&bits)?
        }
    })
}

/// A number in double precision: a value, or a threshold as feedback of a bit.
pub(super) fn double(number: f64) -> Result<BitString, Failure> {
    Ok(Message::to_bits(&number, &NumberFormat::Double)?)
}
