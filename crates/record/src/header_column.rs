//! One column of a header.

use crate::bound::{Bound, TENS};
use crate::codec::{Target, adaptive};
use crate::error::{Damage, Error};
use crate::schema::Column;
use crate::wire::{Bytes, push_text, push_varint, text};
use fewbits_block_codec::Start;

/// Flags beside the kind of a bound: a period follows, a start follows, a unit follows.
const HAS_PERIOD: u8 = 0x10;
const HAS_START: u8 = 0x20;
const HAS_UNIT: u8 = 0x40;
/// Stored in place of the number of decimals: the double itself follows.
const DOUBLE: u8 = 0xff;

/// Appends a non-negative number: decimals and digits if these are exact, otherwise its bits.
fn push_number(body: &mut Vec<u8>, number: f64) {
    let digits = (0_u8..).zip(TENS).find_map(|(decimals, ten)| {
        let digits = (number * ten).round();
        // Such digits take at most 6 bytes, the double itself 8.
        (digits < 2f64.powi(42) && digits / ten == number).then_some((decimals, digits as u64))
    });
    match digits {
        Some((decimals, digits)) => {
            body.push(decimals);
            push_varint(body, digits);
        }
        None => {
            body.push(DOUBLE);
            body.extend(number.to_le_bytes());
        }
    }
}

fn read_number(body: &mut Bytes<'_>) -> Result<f64, Damage> {
    match body.byte()? {
        DOUBLE => Ok(body.f64()?),
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
        | flag(!column.unit.is_empty(), HAS_UNIT);
    match column.bound {
        Bound::Lossless => body.push(flags),
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
    }
    if !column.unit.is_empty() {
        push_text(body, &column.unit);
    }
    if let Some(period) = column.period {
        push_number(body, period);
    }
    if let Some(start) = start {
        body.extend(start.to_bytes());
    }
}

pub(crate) fn read_column(body: &mut Bytes<'_>) -> Result<(Column, f64, Option<Start>), Error> {
    let name = text(body).map_err(Error::header)?;
    let kind = body.byte().map_err(Error::header)?;
    let mut share_bound = 0.0;
    let bound = match kind & !(HAS_PERIOD | HAS_START | HAS_UNIT) {
        0 => Bound::Lossless,
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
        _ => return Err(Error::Header(Damage::Content("bound"))),
    };
    let mut column = Column::new(name, bound)?;
    if kind & HAS_UNIT != 0 {
        column = column.with_unit(text(body).map_err(Error::header)?)?;
    }
    if kind & HAS_PERIOD != 0 {
        column = column.with_period(read_number(body).map_err(Error::header)?)?;
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
