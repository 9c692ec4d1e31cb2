//! One column of a header.

use crate::bound::{Bound, TENS};
use crate::codec::{Target, adaptive};
use crate::column::Column;
use crate::error::{Damage, Error};
use crate::integers::Integers;
use crate::wire::{Bytes, push_text, push_varint, text, unzigzag, zigzag};
use fewbits_block_codec::Start;
use std::f64::consts::TAU;

/// Flags beside the kind of a bound: a period follows, a start follows, a unit follows.
const HAS_PERIOD: u8 = 0x10;
const HAS_START: u8 = 0x20;
const HAS_UNIT: u8 = 0x40;
const HAS_EARLIER: u8 = 0x80;
/// Kind of a column of whole numbers.
const INTEGERS: u8 = 5;
/// Stored in place of the number of decimals: the double itself follows; twice pi, the circumference of directions in radians.
const DOUBLE: u8 = 0xff;
const TURN: u8 = 0xfe;
/// Digits below this take at most 6 bytes, the double itself 8.
const MOST_DIGITS: f64 = (1_u64 << 42) as f64;
/// Largest share of a bound that is given up for fewer digits.
const GIVEN_UP: f64 = 1.0 / (1 << 16) as f64;

/// Decimals and digits, if these are exact and short.
fn digits(number: f64) -> Option<(u8, u64)> {
    (0_u8..).zip(TENS).find_map(|(decimals, ten)| {
        let digits = (number * ten).round();
        (digits < MOST_DIGITS && digits / ten == number).then_some((decimals, digits as u64))
    })
}

/// A bound that takes few bytes, at most this one: bounds that were computed, as a hundredth of a range, have many digits.
pub(crate) fn shortened(bound: f64) -> f64 {
    if digits(bound).is_some_and(|(_, digits)| digits < 1 << 21) {
        return bound;
    }
    let short = TENS.iter().find_map(|ten| {
        let digits = (bound * ten).floor();
        let short = digits / ten;
        (digits < MOST_DIGITS && short <= bound && short >= bound * (1.0 - GIVEN_UP)).then_some(short)
    });
    short.unwrap_or(bound)
}

/// Appends a non-negative number: decimals and digits if these are exact, otherwise its bits.
fn push_number(body: &mut Vec<u8>, number: f64) {
    match digits(number) {
        Some((decimals, digits)) => {
            body.push(decimals);
            push_varint(body, digits);
        }
        None if number == TAU => body.push(TURN),
        None => {
            body.push(DOUBLE);
            body.extend(number.to_le_bytes());
        }
    }
}

fn read_number(body: &mut Bytes<'_>) -> Result<f64, Damage> {
    match body.byte()? {
        DOUBLE => Ok(body.f64()?),
        TURN => Ok(TAU),
        decimals => {
            let ten = TENS
                .get(usize::from(decimals))
                .ok_or(Damage::Content("decimals of a number"))?;
            Ok(body.varint()? as f64 / ten)
        }
    }
}

pub(crate) fn push_column(body: &mut Vec<u8>, column: &Column, share_bound: f64, start: Option<&Start>) {
    push_text(body, &column.name);
    let flag = |given: bool, flag: u8| if given { flag } else { 0 };
    let flags = flag(column.period.is_some(), HAS_PERIOD)
        | flag(start.is_some(), HAS_START)
        | flag(!column.unit.is_empty(), HAS_UNIT)
        | flag(column.earlier > 0.0, HAS_EARLIER);
    match column.bound {
        Bound::Lossless => match column.integers {
            None => body.push(flags),
            Some(integers) => {
                body.push(INTEGERS | flags);
                push_varint(body, zigzag(integers.origin()));
            }
        },
        Bound::Absolute(delta) => {
            body.push(1 | flags);
            push_number(body, delta);
        }
        Bound::ShareOfRange(share) => {
            body.push(2 | flags);
            push_number(body, share);
            body.extend_from_slice(&share_bound.to_be_bytes()[..3]);
        }
        Bound::Decimals(places) => {
            body.push(3 | flags);
            body.push(places);
        }
        Bound::Relative { share, floor } => {
            body.push(4 | flags);
            push_number(body, share);
            push_number(body, floor);
        }
    }
    if !column.unit.is_empty() {
        push_text(body, &column.unit);
    }
    if let Some(period) = column.period {
        push_number(body, period);
    }
    if column.earlier > 0.0 {
        push_number(body, column.earlier);
    }
    if let Some(start) = start {
        body.extend(start.to_bytes());
    }
}

pub(crate) fn read_column(body: &mut Bytes<'_>) -> Result<(Column, f64, Option<Start>), Error> {
    let name = text(body).map_err(Error::header)?;
    let kind = body.byte().map_err(Error::header)?;
    let (mut share_bound, mut integers) = (0.0, None);
    let bound = match kind & !(HAS_PERIOD | HAS_START | HAS_UNIT | HAS_EARLIER) {
        0 => Bound::Lossless,
        INTEGERS => {
            integers = Some(Integers::from_origin(unzigzag(body.varint().map_err(Error::header)?)));
            Bound::Lossless
        }
        1 => Bound::Absolute(read_number(body).map_err(Error::header)?),
        2 => {
            let share = read_number(body).map_err(Error::header)?;
            let [a, b, c] = body.array().map_err(Error::header)?;
            share_bound = f64::from_be_bytes([a, b, c, 0, 0, 0, 0, 0]);
            if !(share_bound >= 0.0 && (2.0 * share_bound).is_finite()) {
                return Err(Error::Header(Damage::Content("bound of a share")));
            }
            Bound::ShareOfRange(share)
        }
        3 => Bound::Decimals(body.byte().map_err(Error::header)?),
        4 => Bound::Relative {
            share: read_number(body).map_err(Error::header)?,
            floor: read_number(body).map_err(Error::header)?,
        },
        _ => return Err(Error::Header(Damage::Content("bound"))),
    };
    let mut column = Column {
        integers,
        ..Column::new(name, bound)?
    };
    if kind & HAS_UNIT != 0 {
        column = column.with_unit(text(body).map_err(Error::header)?)?;
    }
    if kind & HAS_PERIOD != 0 {
        column = column.with_period(read_number(body).map_err(Error::header)?)?;
    }
    if kind & HAS_EARLIER != 0 {
        column = column.with_earlier_bound(read_number(body).map_err(Error::header)?)?;
    }
    let mut start = None;
    if kind & HAS_START != 0 {
        let target = Target {
            promise: column.promise(share_bound),
            period: column.period,
        };
        start = Some(adaptive::read_start(&mut body.0, &target).map_err(Error::header)?);
    }
    Ok((column, share_bound, start))
}
