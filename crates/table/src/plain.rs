//! Rows of plain cells, split where they lie in the buffer of the source: no copy, and a short number is read in the same pass.
//!
//! Whatever is odd (a quote, a comment, text beyond ASCII, too many cells) is left to [`Rows::next`](crate::rows::Rows::next), which reads
//! the same line anew. So there is one meaning of a row; a test compares both ways cell by cell.

use crate::number::{Syntax, TENS};

/// A cell without the spaces around it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cell {
    from: u32,
    to: u32,
    /// The number and its decimals, if it is short and plain.
    pub(crate) number: Option<(f64, u8)>,
}

impl Cell {
    /// The text of the cell, which is ASCII.
    #[inline]
    pub(crate) fn text(self, line: &[u8]) -> &str {
        std::str::from_utf8(self.bytes(line)).unwrap_or_default()
    }

    /// The bytes of the cell.
    #[inline]
    pub(crate) fn bytes(self, line: &[u8]) -> &[u8] {
        &line[self.from as usize..self.to as usize]
    }

    pub(crate) fn is_empty(self) -> bool {
        self.from == self.to
    }
}

/// Splits plain lines.
#[derive(Debug, Clone)]
pub(crate) struct Scanner {
    delimiter: u8,
    decimal: u8,
    comment: Vec<u8>,
    /// The first name, by which lines that repeat the names are found.
    first_name: Vec<u8>,
    columns: usize,
    /// What ends a cell, or makes a line odd.
    ends: [bool; 256],
    pub(crate) cells: Vec<Cell>,
}

impl Scanner {
    /// A scanner of lines with so many cells; `None` if the marks of decimals and cells are the same.
    pub(crate) fn new(
        (delimiter, quote): (u8, u8),
        syntax: Syntax,
        comment: &[u8],
        first_name: &str,
        columns: usize,
    ) -> Option<Self> {
        let mut ends = [false; 256];
        for byte in [delimiter, quote, b'\r', b'\n', 0] {
            ends[usize::from(byte)] = true;
        }
        ends[128..].fill(true);
        (delimiter != syntax.decimal && columns > 0).then(|| Self {
            delimiter,
            decimal: syntax.decimal,
            comment: comment.to_vec(),
            first_name: first_name.as_bytes().to_vec(),
            columns,
            ends,
            cells: Vec::with_capacity(columns),
        })
    }

    fn is_space(&self, byte: u8) -> bool {
        byte == b' ' || (byte == b'\t' && self.delimiter != b'\t')
    }

    /// Splits the line at the beginning of `text` into [`cells`](Self::cells). Returns its length with its end; `None` if the line is odd or
    /// its end is not there.
    #[inline]
    pub(crate) fn line(&mut self, text: &[u8]) -> Option<usize> {
        if !self.comment.is_empty() && text.starts_with(&self.comment) {
            return None;
        }
        self.cells.clear();
        let (mut at, mut is_blank) = (0, true);
        loop {
            while self.is_space(*text.get(at)?) {
                at += 1;
            }
            let from = at;
            let number = number_at(text, &mut at, self.decimal)?;
            let mut to = at;
            while self.is_space(*text.get(at)?) {
                at += 1;
            }
            let mut end = text[at];
            let number = if end == self.delimiter || matches!(end, b'\n' | b'\r') {
                number
            } else {
                // No number: up to what ends the cell.
                while !self.ends[usize::from(*text.get(at)?)] {
                    at += 1;
                }
                end = text[at];
                to = at;
                while to > from && self.is_space(text[to - 1]) {
                    to -= 1;
                }
                None
            };
            is_blank &= from == to;
            self.cells.push(Cell {
                from: u32::try_from(from).ok()?,
                to: u32::try_from(to).ok()?,
                number: number.filter(|_| from < to),
            });
            at += 1;
            if end == self.delimiter {
                if self.cells.len() == self.columns {
                    return None;
                }
                continue;
            }
            match end {
                b'\n' => {}
                b'\r' if *text.get(at)? == b'\n' => at += 1,
                _ => return None,
            }
            let is_header = text[self.cells[0].from as usize..self.cells[0].to as usize] == self.first_name;
            return (self.cells.len() == self.columns && !is_blank && !is_header).then_some(at);
        }
    }
}

/// Reads digits with a mark of decimals and moves behind them. The outer `None`: the text ends within. The inner: what was read is no short
/// number, of at most 16 digits and at most 2^53 without the mark, so that one correctly rounded division gives it.
#[inline]
fn number_at(text: &[u8], at: &mut usize, decimal: u8) -> Option<Option<(f64, u8)>> {
    let negative = match *text.get(*at)? {
        b'-' => {
            *at += 1;
            true
        }
        b'+' => {
            *at += 1;
            false
        }
        _ => false,
    };
    let mut mantissa = 0_u64;
    let mut digits = |at: &mut usize| {
        let from = *at;
        loop {
            let digit = text.get(*at)?.wrapping_sub(b'0');
            if digit > 9 {
                return Some(*at - from);
            }
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            *at += 1;
        }
    };
    let whole = digits(at)?;
    let mut decimals = 0;
    if *text.get(*at)? == decimal {
        *at += 1;
        decimals = digits(at)?;
    }
    let count = whole + decimals;
    if !(1..=16).contains(&count) || mantissa > 1 << 53 {
        return Some(None);
    }
    let size = mantissa as f64 / TENS[decimals];
    Some(Some((if negative { -size } else { size }, decimals as u8)))
}
