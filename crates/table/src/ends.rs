//! The ends of the range of a column, and values that make it and may stand for gaps.

/// A range that shrinks by this factor without one value, at either end, is made by that value.
const SHRINK: f64 = 4.0;

/// The extreme value at one end, how often it occurs, and the next.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct End {
    value: f64,
    count: u64,
    next: Option<f64>,
}

impl End {
    /// Adds a value; `sign` is 1 at the upper end and -1 at the lower.
    pub(crate) fn add(&mut self, value: f64, sign: f64) {
        let beyond = |a: f64, b: f64| sign * a > sign * b;
        if self.count == 0 {
            *self = Self {
                value,
                count: 1,
                next: None,
            };
        } else if value == self.value {
            self.count += 1;
        } else if beyond(value, self.value) {
            *self = Self {
                value,
                count: 1,
                next: Some(self.value),
            };
        } else if self.next.is_none_or(|next| beyond(value, next)) {
            self.next = Some(value);
        }
    }
}

/// A value that may stand for a gap: it makes most of the range of its column, and few cells have it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Sentinel {
    /// The value.
    pub value: f64,
    /// Cells that have it.
    pub count: u64,
    /// The range without it.
    pub range_without: (f64, f64),
}

/// Whether a number often stands for a gap: nines, with or without a decimal, and the ends of small integers.
fn is_usual_sentinel(value: f64) -> bool {
    let size = value.abs();
    let nines = [
        99.0,
        99.9,
        99.99,
        999.0,
        999.9,
        999.99,
        9999.0,
        9999.9,
        9999.99,
        99_999.0,
        99_999.9,
        999_999.0,
        9_999_999.0,
    ];
    nines.contains(&size) || [-7999.0, -6999.0, -32_768.0, 32_767.0, 65_535.0].contains(&value)
}

/// The value at either end that makes most of the range of so many numbers.
pub(crate) fn sentinel((low, high): (f64, f64), lower: End, upper: End, all: u64) -> Option<Sentinel> {
    let rare = |end: End| {
        20 * end.count <= all || end.count == 1 || (is_usual_sentinel(end.value) && 10 * end.count <= 9 * all)
    };
    let found = |end: End, without: (f64, f64)| {
        let is_made = high - low > SHRINK * (without.1 - without.0) && without.1 > without.0;
        (rare(end) && is_made && all >= 8).then_some(Sentinel {
            value: end.value,
            count: end.count,
            range_without: without,
        })
    };
    let at_low = lower.next.and_then(|next| found(lower, (next, high)));
    at_low.or_else(|| upper.next.and_then(|next| found(upper, (low, next))))
}
