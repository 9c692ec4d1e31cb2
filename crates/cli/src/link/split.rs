//! JSON messages one behind the other: on lines, over several lines, or without anything between.

use std::collections::VecDeque;
use std::io::{BufRead, Read};

/// Longest message that is read, in bytes.
pub(super) const MAX_MESSAGE: u64 = 1 << 24;
/// Deepest nesting.
const MAX_DEPTH: usize = 128;
const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";

/// The messages of a stream. What is none comes out too, and costs no other that begins a line.
pub(super) struct Messages<R> {
    lines: R,
    is_first: bool,
    ready: VecDeque<Vec<u8>>,
    part: Part,
}

/// A message that has begun.
#[derive(Default)]
struct Part {
    bytes: Vec<u8>,
    /// Brackets that are open.
    open: Vec<u8>,
    /// The last byte that is no space, outside of texts.
    last: u8,
    is_text: bool,
    is_escaped: bool,
}

impl<R: BufRead> Messages<R> {
    pub(super) fn new(lines: R) -> Self {
        Self {
            lines,
            is_first: true,
            ready: VecDeque::new(),
            part: Part::default(),
        }
    }

    /// The next message.
    ///
    /// # Errors
    /// If the stream cannot be read.
    pub(super) fn next(&mut self) -> std::io::Result<Option<Vec<u8>>> {
        loop {
            if let Some(message) = self.ready.pop_front() {
                return Ok(Some(message));
            }
            let mut line = Vec::new();
            let count = (&mut self.lines).take(MAX_MESSAGE).read_until(b'\n', &mut line)?;
            if count == 0 {
                self.cut();
                return Ok(self.ready.pop_front());
            }
            let is_first = std::mem::take(&mut self.is_first);
            let line = line.strip_prefix(BYTE_ORDER_MARK).filter(|_| is_first).unwrap_or(&line);
            line.iter().for_each(|byte| self.take(*byte));
        }
    }

    /// A message was cut off. It may have swallowed others: a bracket at the beginning of a line may be one's.
    fn cut(&mut self) {
        let part = std::mem::take(&mut self.part);
        let mut message = Vec::new();
        for line in part.bytes.split_inclusive(|byte| *byte == b'\n') {
            if matches!(line, [b'{' | b'[', ..]) {
                self.push(std::mem::take(&mut message));
            }
            message.extend(line);
        }
        self.push(message);
    }

    /// A message has ended.
    fn end(&mut self) {
        let part = std::mem::take(&mut self.part);
        self.push(part.bytes);
    }

    fn push(&mut self, message: Vec<u8>) {
        if !message.trim_ascii().is_empty() {
            self.ready.push_back(message);
        }
    }

    fn take(&mut self, byte: u8) {
        let part = &mut self.part;
        if part.is_text {
            part.bytes.push(byte);
            match byte {
                // A text holds no line end: it was cut off.
                b'\n' => self.cut(),
                _ if part.is_escaped => part.is_escaped = false,
                b'\\' => part.is_escaped = true,
                b'"' => (part.is_text, part.last) = (false, byte),
                _ => {}
            }
            return;
        }
        // A bracket opens where a value may begin. Elsewhere what came before was cut off, and this begins another message.
        let may_open = match part.last {
            0 | b':' | b'[' => true,
            b',' => part.open.last() == Some(&b'['),
            _ => false,
        };
        if matches!(byte, b'{' | b'[') && !may_open || part.bytes.len() as u64 >= MAX_MESSAGE {
            self.cut();
        }
        let part = &mut self.part;
        part.bytes.push(byte);
        if !byte.is_ascii_whitespace() {
            part.last = byte;
        }
        match byte {
            b'"' => part.is_text = true,
            b'{' | b'[' => part.open.push(byte),
            b'}' | b']' => {
                let opened = part.open.pop();
                let is_pair = opened == Some(if byte == b'}' { b'{' } else { b'[' });
                if !is_pair {
                    self.cut();
                } else if part.open.is_empty() {
                    self.end();
                }
            }
            b'\n' if part.open.is_empty() => self.end(),
            _ => {}
        }
        if self.part.open.len() > MAX_DEPTH {
            self.cut();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn split(text: &str) -> Vec<String> {
        let mut messages = Messages::new(text.as_bytes());
        let mut all = Vec::new();
        while let Some(message) = messages.next().unwrap() {
            all.push(String::from_utf8(message).unwrap().split_whitespace().collect());
        }
        all
    }

    #[test]
    fn messages_end_where_their_brackets_close() {
        for (text, expected) in [
            ("{\"a\":1}\n\n[2]\n", &["{\"a\":1}", "[2]"][..]),
            ("\u{feff}[\n {\"a\": 1},\n {\"b\": [2]}\n]\n[]", &["[{\"a\":1},{\"b\":[2]}]", "[]"]),
            ("[1][2] {}", &["[1]", "[2]", "{}"]),
            (r#"{"a":"}]\"{"}{"b":"\\"}"#, &[r#"{"a":"}]\"{"}"#, r#"{"b":"\\"}"#]),
            // What is no message costs no other.
            ("hello\n[1]\n", &["hello", "[1]"]),
            ("{\"a\":1\n[1]\n", &["{\"a\":1", "[1]"]),
            ("{\"a\":\"x\n[1]\n", &["{\"a\":\"x", "[1]"]),
            ("{\"a\",\n{\"b\":1}\n", &["{\"a\",", "{\"b\":1}"]),
            ("[1}\n{}\n", &["[1}", "{}"]),
            ("]\n{}\n", &["]", "{}"]),
            ("{\n", &["{"]),
            // Even if the cut could be seen only at the end.
            ("{\"a\":\n{\"b\":1}\n{\"c\":2}\n", &["{\"a\":", "{\"b\":1}", "{\"c\":2}"]),
            ("[\n[1]\n", &["[", "[1]"]),
            ("", &[]),
        ] {
            assert_eq!(split(text), expected, "{text}");
        }
    }

    #[test]
    fn any_bytes_end() {
        let bytes: Vec<u8> = (0..200_000_u32)
            .map(|i| b"{}[]\",:\\ \na1"[(i.wrapping_mul(2_654_435_761) >> 27) as usize % 12])
            .collect();
        let mut messages = Messages::new(&bytes[..]);
        let mut count = 0;
        while let Some(message) = messages.next().unwrap() {
            count += message.len();
        }
        assert!(count <= bytes.len() && count > bytes.len() / 2);
        // No nesting is without end.
        let deep = "[".repeat(100_000);
        assert!(split(&deep).len() > 700);
    }
}
