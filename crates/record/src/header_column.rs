//! One column of a header.

use crate::bound::{Bound, TENS};
use crate::codec::{Target, adaptive};
use crate::column::Column;
use crate::error::{Damage, Error};
use crate::integers::Integers;
use crate::wire::{Fields, flag, short_bound};
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

/// A non-negative number: decimals and digits if these are exact, otherwise its bits.
fn number<F: Fields>(fields: &mut F, own: f64) -> Result<f64, Damage> {
    let (form, digits) = digits(own).unwrap_or((if own == TAU { TURN } else { DOUBLE }, 0));
    match fields.byte(form)? {
        DOUBLE => Ok(fields.f64(own)?),
        TURN => Ok(TAU),
        decimals => {
            let ten = TENS.get(usize::from(decimals));
            Ok(fields.varint(digits)? as f64 / ten.ok_or(Damage::Content("decimals of a number"))?)
        }
    }
}

/// The damage of a header with an argument that no writer accepts.
pub(crate) fn refused(error: Error) -> Damage {
    Damage::Content(error.argument().map_or("header", |argument| argument.name))
}

/// A column of a header, with the bound of a share and its start. A reader may be given any column.
pub(crate) fn column<F: Fields>(
    fields: &mut F,
    own: &Column,
    share_bound: f64,
    start: Option<&Start>,
) -> Result<(Column, f64, Option<Start>), Damage> {
    let name = fields.text(&own.name)?;
    let flags = flag(own.period.is_some(), HAS_PERIOD)
        | flag(start.is_some(), HAS_START)
        | flag(!own.unit.is_empty(), HAS_UNIT)
        | flag(own.earlier > 0.0, HAS_EARLIER);
    let (kind, size, floor, places) = match own.bound {
        Bound::Lossless if own.integers.is_some() => (INTEGERS, 0.0, 0.0, 0),
        Bound::Lossless => (0, 0.0, 0.0, 0),
        Bound::Absolute(delta) => (1, delta, 0.0, 0),
        Bound::ShareOfRange(share) => (2, share, 0.0, 0),
        Bound::Decimals(places) => (3, 0.0, 0.0, places),
        Bound::Relative { share, floor } => (4, share, floor, 0),
    };
    let kind = fields.byte(kind | flags)?;
    let (mut integers, mut bound_of_share) = (None, 0.0);
    let bound = match kind & !(HAS_PERIOD | HAS_START | HAS_UNIT | HAS_EARLIER) {
        0 => Bound::Lossless,
        INTEGERS => {
            let origin = fields.signed(own.integers.map_or(0, Integers::origin))?;
            integers = Some(Integers::from_origin(origin));
            Bound::Lossless
        }
        1 => Bound::Absolute(number(fields, size)?),
        2 => {
            let share = number(fields, size)?;
            bound_of_share = short_bound(fields, share_bound)?;
            Bound::ShareOfRange(share)
        }
        3 => Bound::Decimals(fields.byte(places)?),
        4 => Bound::Relative {
            share: number(fields, size)?,
            floor: number(fields, floor)?,
        },
        _ => return Err(Damage::Content("bound")),
    };
    let mut column = Column::new(name, bound).map_err(refused)?;
    column.integers = integers;
    if kind & HAS_UNIT != 0 {
        column = column.with_unit(fields.text(&own.unit)?).map_err(refused)?;
    }
    if kind & HAS_PERIOD != 0 {
        let period = number(fields, own.period.unwrap_or(0.0))?;
        column = column.with_period(period).map_err(refused)?;
    }
    if kind & HAS_EARLIER != 0 {
        let earlier = number(fields, own.earlier)?;
        column = column.with_earlier_bound(earlier).map_err(refused)?;
    }
    let target = Target::of(&column, bound_of_share);
    let start = (kind & HAS_START != 0).then(|| adaptive::code_start(fields, start, &target));
    Ok((column, bound_of_share, start.transpose()?))
}
