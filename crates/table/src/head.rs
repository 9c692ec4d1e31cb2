//! The first lines of a table, read without waiting for more than it takes to see rows.

use crate::error::Error;
use crate::known;
use std::io::BufRead;

/// Largest number of lines and of bytes that are examined.
const MAX_LINES: usize = 1000;
pub(crate) const MAX_BYTES: usize = 1 << 18;

/// The first lines of a text.
pub(crate) struct Head {
    /// Bytes that were read.
    pub(crate) bytes: Vec<u8>,
    /// The whole lines among them, with their numbers.
    pub(crate) lines: Vec<(u64, String)>,
    /// The last byte of lines.
    pub(crate) end: u8,
}

impl Head {
    /// The lines that are not blank, without the blanks around them.
    pub(crate) fn filled_lines(&self) -> impl Iterator<Item = &str> {
        self.lines
            .iter()
            .map(|(_, line)| line.trim())
            .filter(|line| !line.is_empty())
    }

    /// Reads what is there: all of a file's beginning, but of a live source no more than it takes to see rows.
    pub(crate) fn read(reader: &mut dyn BufRead) -> Result<Self, Error> {
        let (mut bytes, mut ended) = (Vec::new(), false);
        while !ended && bytes.len() < MAX_BYTES && !is_enough(&bytes) {
            let chunk = reader.fill_buf()?;
            let count = chunk.len().min(MAX_BYTES);
            ended = count == 0;
            bytes.extend_from_slice(&chunk[..count]);
            reader.consume(count);
        }
        let end = if bytes.contains(&b'\n') || !bytes.contains(&b'\r') {
            b'\n'
        } else {
            b'\r'
        };
        let mut pieces: Vec<&[u8]> = bytes.split(|c| *c == end).take(MAX_LINES + 1).collect();
        // The last one may be cut, or is the nothing behind the last end.
        if !ended || pieces.last().is_some_and(|piece| piece.is_empty()) {
            pieces.pop();
        }
        // Ends of lines of several systems in one file: as `Lines` splits them.
        let parts = pieces.iter().flat_map(|line| {
            let trimmed = line.len() - line.iter().rev().take_while(|c| matches!(c, b'\r' | b'\n')).count();
            line[..trimmed].split(|c| *c == b'\r')
        });
        // Marks of an encoding, also several where files were joined.
        let text = |line: &[u8]| String::from_utf8_lossy(line).trim_start_matches('\u{feff}').to_owned();
        let lines = (1..).zip(parts.map(text)).collect();
        Ok(Self { bytes, lines, end })
    }
}

/// Whether bytes hold lines enough: a dozen, or a first row behind the line of names.
fn is_enough(bytes: &[u8]) -> bool {
    let lines: Vec<&[u8]> = bytes
        .split_inclusive(|c| *c == b'\n')
        .filter(|line| line.ends_with(b"\n"))
        .collect();
    if lines.len() >= 12 {
        return true;
    }
    let is_data =
        |line: &&[u8]| line.iter().any(u8::is_ascii_digit) && !line.starts_with(b"#") && !line.starts_with(b"\"#");
    let needed = if lines.first().is_some_and(|line| known::needs_more(line)) {
        6
    } else {
        2
    };
    lines.len() >= needed && lines.last().is_some_and(is_data)
}
