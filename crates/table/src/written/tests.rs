//! The quick reading of times against the reading of all spellings.

#![allow(clippy::unwrap_used)]
use super::*;
use crate::time::Unit;

fn clock(syntax: Syntax, scale: Scale) -> Clock {
    Clock {
        syntax,
        zone: None,
        scale,
        takes_leap_seconds: false,
        cuts: false,
        parts_behind: None,
        marks: None,
        largest: Time(i128::MAX),
    }
}

#[test]
fn dates_are_those_of_the_calendar() {
    for scale in [Scale::Utc, Scale::Local] {
        let clock = clock(Syntax::Date(Order::Ymd), scale);
        let zone = if scale == Scale::Utc { "Z" } else { "" };
        for year in (1..=9999).step_by(7).chain([1900, 1970, 2000, 2100, 2400]) {
            for (month, day) in [(1, 1), (2, 28), (2, 29), (3, 1), (12, 31), (4, 31), (0, 1), (13, 1)] {
                let text = format!("{year:04}-{month:02}-{day:02}T12:34:56.25{zone}");
                assert_eq!(clock.quick(text.as_bytes()), clock.slowly(&text).ok(), "{text}");
            }
        }
    }
}

#[test]
fn what_is_taken_is_what_the_clock_takes() {
    let clocks = [
        clock(Syntax::Date(Order::Ymd), Scale::Utc),
        clock(Syntax::Date(Order::Mdy), Scale::Local),
        clock(Syntax::Date(Order::Dmy), Scale::Local),
        clock(Syntax::Date(Order::Dmy), Scale::Utc),
        clock(Syntax::OfDay, Scale::Seconds),
        clock(Syntax::Number(Unit::Seconds), Scale::Seconds),
        clock(Syntax::Number(Unit::Milliseconds), Scale::Utc),
    ];
    let texts = [
        "2024-03-05",
        "2024/03/05 21:30",
        "2024-03-05T21:30:00+01:00",
        "2024-03-05 21:30:59.123456789012345678-11:30",
        "2024-03-05T24:00",
        "2024-03-05T23:59:60",
        "2024-03-05T21:3",
        "2024-03-05T21:30:00.",
        "2024-03-05T21:30:00+19:00",
        "2024-03-05T",
        "0001-01-01Z",
        "05.03.2024 21:30:00",
        "5/3/2024 9:42 PM",
        "5/3/2024 12:00 AM",
        "5/3/2024 12:59:59.5 pm",
        "5/3/2024 13:00 PM",
        "5/3/2024 0:30 AM",
        "05-03-2024T21:30+01:00",
        "5.3.2024",
        "31.2.2024",
        "31/12/2024 24:00",
        "5.3.24 10:00",
        "5/3-2024",
        "1/12/2024 1:02",
        "11/1/2024",
        "21:30",
        "9:42:01.25",
        "100:00:00",
        "0:30.5",
        "23:59:60",
        "9:42 PM",
        "12.50",
        "-0.001",
        "1700000000123.5",
        "1.0000000000000000",
        ".5",
        "5.",
        ".",
        "-",
        "1e3",
        "99999999999999999999",
    ];
    let mut taken = 0;
    for clock in &clocks {
        for text in texts {
            if let Some(found) = clock.quick(text.as_bytes()) {
                assert_eq!(Ok(found), clock.slowly(text), "{text}");
                taken += 1;
            }
        }
    }
    assert!(taken > 30, "{taken}");
}
