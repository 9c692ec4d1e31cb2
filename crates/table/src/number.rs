//! Numbers as loggers write them. What a double cannot hold is refused, never rounded in silence.

use crate::hint::{BLANKS, DASHES, SPACES, hint, is_padded};
use std::borrow::Cow;

/// How numbers are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Syntax {
    pub(crate) decimal: u8,
    pub(crate) thousands: Option<u8>,
}

impl Syntax {
    /// A number without the marks between its groups of digits; other texts as they are.
    pub(crate) fn without_groups(self, text: &str) -> Cow<'_, str> {
        let mark = self.thousands.map(char::from).filter(|mark| text.contains(*mark));
        let plain = mark.and_then(|mark| grouped(text, mark, char::from(self.decimal)));
        plain.map_or(Cow::Borrowed(text), Cow::Owned)
    }
}

impl Default for Syntax {
    fn default() -> Self {
        Self {
            decimal: b'.',
            thousands: None,
        }
    }
}

/// A number of a cell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Number {
    /// A double, and the decimals that were written.
    Double(f64, u8),
    /// A whole number of 64 bits that is no double.
    Whole(i64),
}

/// Why a cell is not a number that can be kept: the problem and what would mend it.
pub(crate) type Problem = (&'static str, &'static str);

pub(crate) const NO_NUMBER: &str = "is not a number";
const TOO_LARGE: Problem =
    ("is beyond the largest double", "mend the cell, or name it with --missing to make it a gap");
const TOO_SMALL: Problem = ("is below the smallest double", "write 0, or name it with --missing to make it a gap");
const TOO_LONG: Problem = (
    "is a whole number that neither a double nor 64 bits hold",
    "name it with --missing if it means a gap, split the column, or leave it out with --without",
);

/// Powers of ten that are exact doubles.
pub(crate) const TENS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// Why a text is not a number that can be kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    NoNumber,
    TooLarge,
    TooSmall,
    TooLong,
}

impl Fault {
    /// The problem with the cell, and what would mend it.
    fn problem(self, text: &[u8]) -> Problem {
        match self {
            Self::NoNumber => (NO_NUMBER, hint(&String::from_utf8_lossy(text))),
            Self::TooLarge => TOO_LARGE,
            Self::TooSmall => TOO_SMALL,
            Self::TooLong => TOO_LONG,
        }
    }
}

/// Parses a trimmed cell that is not empty.
#[inline]
pub(crate) fn parse(text: &[u8], syntax: Syntax) -> Result<Number, Problem> {
    read(text, syntax).map_err(|fault| fault.problem(text))
}

/// As [`parse`], without the words for what is wrong.
#[inline]
pub(crate) fn read(text: &[u8], syntax: Syntax) -> Result<Number, Fault> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        _ => (false, text),
    };
    let (mut mantissa, mut i, mut decimals, mut after) = (0_u64, 0, 0_u8, false);
    // Up to 19 digits fit 64 bits, and numbers below 2^53 over a power of ten below 10^22 are one correctly rounded division.
    while i < digits.len() && i < 20 {
        let c = digits[i];
        if c.is_ascii_digit() {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(c - b'0'));
            decimals += u8::from(after);
        } else if c == syntax.decimal && !after {
            after = true;
        } else {
            break;
        }
        i += 1;
    }
    let has_digit = i > usize::from(after);
    if i == digits.len() && has_digit && mantissa <= 1 << 53 && i - usize::from(after) <= 16 {
        let size = mantissa as f64 / TENS[usize::from(decimals)];
        return Ok(Number::Double(if negative { -size } else { size }, decimals));
    }
    match syntax {
        Syntax {
            decimal: b'.',
            thousands: None,
        } => long(text).map_or_else(|| slowly(text, syntax), Ok),
        _ => slowly(text, syntax),
    }
}

/// A number of many digits or with an exponent, as programs write doubles; `None` if it may be anything else.
fn long(text: &[u8]) -> Option<Number> {
    let is_plain = text
        .iter()
        .all(|c| c.is_ascii_digit() || matches!(c, b'.' | b'-' | b'+' | b'e' | b'E'));
    let text = std::str::from_utf8(text).ok().filter(|_| is_plain)?;
    let places = text.split_once('.').map_or("", |(_, places)| places);
    let value: f64 = text.parse().ok()?;
    // Whole numbers, and those that are too small or too large, are looked at more closely.
    let decimals = u8::try_from(places.len()).unwrap_or(u8::MAX);
    (value.is_finite() && value.fract() != 0.0).then_some(Number::Double(value, decimals))
}

/// Everything that is not a short plain number.
#[cold]
fn slowly(text: &[u8], syntax: Syntax) -> Result<Number, Fault> {
    // Of words, only those for infinities and what is no number are numbers.
    if matches!(text.first(), Some(first) if first.is_ascii_alphabetic() && !b"nNiI".contains(first)) {
        return Err(Fault::NoNumber);
    }
    let text = std::str::from_utf8(text).map_err(|_| Fault::NoNumber)?;
    let text = formula(text.trim_matches(BLANKS)).ok_or(Fault::NoNumber)?;
    let mut plain: String = text.replace(DASHES, "-");
    if syntax.thousands == Some(b' ') {
        plain = plain.replace(SPACES, " ");
    }
    if syntax.thousands == Some(b'\'') {
        plain = plain.replace('\u{2019}', "'");
    }
    if let Some(exponent) = fortran(&plain) {
        plain = exponent;
    }
    if let Some(rest) = plain.strip_prefix(['+', '-']).filter(|rest| rest.starts_with(' ')) {
        // A sign apart, as `+ 0.081`.
        plain = format!("{}{}", &plain[..1], rest.trim_start());
    }
    if let Some(mark) = syntax.thousands {
        plain = grouped(&plain, char::from(mark), char::from(syntax.decimal)).ok_or(Fault::NoNumber)?;
    }
    if syntax.decimal != b'.' {
        if plain.contains('.') {
            return Err(Fault::NoNumber);
        }
        plain = plain.replacen(char::from(syntax.decimal), ".", 1);
    }
    if let Some(special) = special(&plain) {
        return Ok(Number::Double(special, 0));
    }
    let value: f64 = plain.parse().map_err(|_| Fault::NoNumber)?;
    let size = plain.trim_start_matches(['-', '+']);
    let begins_with_word = size.starts_with(|c: char| c.is_ascii_alphabetic());
    if value.is_infinite() && !begins_with_word {
        return Err(Fault::TooLarge);
    }
    if value == 0.0
        && size
            .split(['e', 'E'])
            .next()
            .is_some_and(|digits| digits.contains(|c| matches!(c, '1'..='9')))
    {
        return Err(Fault::TooSmall);
    }
    let (whole, places) = size.split_once('.').unwrap_or((size, ""));
    if size.contains(['e', 'E']) || begins_with_word || places.bytes().any(|c| c != b'0') {
        return Ok(Number::Double(value, u8::try_from(places.len()).unwrap_or(u8::MAX)));
    }
    // A whole number: it must be this double, or fit 64 bits.
    let negative = plain.starts_with('-');
    let exact: Option<i128> = whole.parse().ok().map(|size: i128| if negative { -size } else { size });
    match exact {
        // The cast of a double beyond 128 bits saturates, and is then no whole number that was parsed.
        Some(exact) if value as i128 == exact => {
            Ok(Number::Double(value, u8::try_from(places.len()).unwrap_or(u8::MAX)))
        }
        Some(exact) => i64::try_from(exact).map(Number::Whole).map_err(|_| Fault::TooLong),
        None => Err(Fault::TooLong),
    }
}

/// A text without the marks of `="0.5"`, as which spreadsheets keep texts of digits; `None` if zeros in front say that it is no number.
fn formula(text: &str) -> Option<&str> {
    let inner = text.strip_prefix("=\"").and_then(|text| text.strip_suffix('"'));
    inner.map_or(Some(text), |inner| Some(inner).filter(|inner| !is_padded(inner)))
}

/// A number with an exponent as of Fortran, `1.95D+01`, with that of others.
fn fortran(text: &str) -> Option<String> {
    let (size, exponent) = text.split_once(['D', 'd'])?;
    let is_exponent = exponent.starts_with(['+', '-']) && exponent[1..].bytes().all(|c| c.is_ascii_digit());
    (is_exponent && size.contains('.') && size.parse::<f64>().is_ok()).then(|| format!("{size}e{exponent}"))
}

/// Not-a-number and infinities as runtimes of several systems write them.
fn special(text: &str) -> Option<f64> {
    Some(match text.to_ascii_lowercase().as_str() {
        "nan(ind)" | "1.#qnan" | "1.#ind" | "nan(snan)" | "1.#snan" => f64::NAN,
        "-nan(ind)" | "-1.#ind" | "-1.#qnan" | "-nan(snan)" => -f64::NAN,
        "1.#inf" | "+1.#inf" | "∞" | "+∞" => f64::INFINITY,
        "-1.#inf" | "-∞" => f64::NEG_INFINITY,
        _ => return None,
    })
}

/// The number without the marks between groups of digits: of three, or, as in India, of three at the end and of two before. `None` if a
/// group has another length.
fn grouped(text: &str, mark: char, decimal: char) -> Option<String> {
    if !text.contains(mark) {
        return Some(text.to_owned());
    }
    let (whole, rest) = text.split_once(decimal).unwrap_or((text, ""));
    let (sign, digits) = whole.split_at(usize::from(whole.starts_with(['-', '+'])));
    let groups: Vec<&str> = digits.split(mark).collect();
    let are_of = |groups: &[&str], length: usize| {
        let (first, rest) = groups.split_first().unwrap_or((&"", &[]));
        (1..=length).contains(&first.len()) && rest.iter().all(|group| group.len() == length)
    };
    let is_grouped = match groups.split_last() {
        Some((last, before)) => are_of(&groups, 3) || (last.len() == 3 && are_of(before, 2)),
        None => false,
    };
    if !is_grouped || rest.contains(mark) {
        return None;
    }
    let decimal = if rest.is_empty() {
        String::new()
    } else {
        format!("{decimal}{rest}")
    };
    Some(format!("{sign}{}{decimal}", groups.concat()))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Option<f64> {
        match parse(text.as_bytes(), Syntax::default()) {
            Ok(Number::Double(value, _)) => Some(value),
            _ => None,
        }
    }

    #[test]
    fn numbers_have_the_bits_of_the_standard_library() {
        for text in [
            "0",
            "-0",
            "-0.0",
            "+3",
            "19.750",
            ".5",
            "5.",
            "9007199254740992",
            "0.1",
            "0.30000000000000004",
            "1e-310",
            "5e-324",
            "1.7976931348623157e308",
            "123456789.123456789",
            "-12345678901234.5",
            "6.02214076e23",
        ] {
            let expected: f64 = text.parse().unwrap_or(f64::NAN);
            assert_eq!(value(text).map(f64::to_bits), Some(expected.to_bits()), "{text}");
        }
    }

    #[test]
    fn what_a_double_cannot_hold_is_refused_or_whole() {
        let of = |text: &str| parse(text.as_bytes(), Syntax::default());
        assert_eq!(of("9007199254740993.0"), Ok(Number::Whole(9_007_199_254_740_993)));
        assert_eq!(of("-9007199254740993"), Ok(Number::Whole(-9_007_199_254_740_993)));
        assert_eq!(of("1152921504606846976"), Ok(Number::Double(1_152_921_504_606_846_976.0, 0)));
        for (text, problem) in [
            ("1e400", TOO_LARGE),
            ("-1e400", TOO_LARGE),
            ("1e-400", TOO_SMALL),
            ("99999999999999999999", TOO_LONG),
        ] {
            assert_eq!(of(text), Err(problem), "{text}");
        }
        for text in ["", "-", ".", "26..5", "1.2.3", "0x10", "1e", "twelve"] {
            assert!(of(text).is_err(), "{text}");
        }
    }

    #[test]
    fn commas_groups_and_signs() {
        let of = |text: &str, decimal, thousands| match parse(text.as_bytes(), Syntax { decimal, thousands }) {
            Ok(Number::Double(value, _)) => Some(value),
            _ => None,
        };
        assert_eq!(of("19,75", b',', None), Some(19.75));
        assert_eq!(of("1.299,99", b',', Some(b'.')), Some(1299.99));
        assert_eq!(of("1,721,992,142.283", b'.', Some(b',')), Some(1_721_992_142.283));
        assert_eq!(of("-1 234.5", b'.', Some(b' ')), Some(-1234.5));
        assert_eq!(of("1,72", b'.', Some(b',')), None);
        // Lakhs and crores.
        assert_eq!(of("1,23,456.75", b'.', Some(b',')), Some(123_456.75));
        assert_eq!(of("-12,34,56,789", b'.', Some(b',')), Some(-123_456_789.0));
        for text in ["1,234,56,789", "1,23,45", "123,45,678", "1,2,345", ",345", "1,,345"] {
            assert_eq!(of(text, b'.', Some(b',')), None, "{text}");
        }
        assert_eq!(of("19.75", b',', None), None);
        assert_eq!(value("\u{2212}3.5"), Some(-3.5));
        assert_eq!(value("+ 0.081"), Some(0.081));
        assert_eq!(value("-1.#INF"), Some(f64::NEG_INFINITY));
        assert!(value("-nan(ind)").is_some_and(f64::is_nan));
    }
}
