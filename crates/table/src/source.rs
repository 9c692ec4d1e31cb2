//! What a stream of bytes is, by its first bytes; compressed and encoded text becomes UTF-8.

use crate::error::Error;
use encoding_rs::{CoderResult, Decoder, Encoding, UTF_8, UTF_16BE, UTF_16LE};
use std::io::{BufRead, BufReader, Cursor, Read};

/// Bytes read from a source at once.
const CHUNK: usize = 1 << 18;

/// A source of bytes.
pub(crate) type Bytes = Box<dyn Read + Send>;

const NO_TABLE: &str = "give the table itself, as CSV";
/// The first bytes of files that are no tables of text, what they are, and what to do.
const OTHERS: [(&[u8], &str, &str); 18] = [
    (b"\"TOB", "a binary file of Campbell Scientific", "convert it to TOA5 with CardConvert or LoggerNet"),
    (b"TOB1", "a binary file of Campbell Scientific", "convert it to TOA5 with CardConvert or LoggerNet"),
    (
        b"\xff\xfe\0\0",
        "text in UTF-32",
        "save it as UTF-8, as: iconv -f UTF-32 -t UTF-8 FILE | fewbits ... -",
    ),
    (
        b"\0\0\xfe\xff",
        "text in UTF-32",
        "save it as UTF-8, as: iconv -f UTF-32 -t UTF-8 FILE | fewbits ... -",
    ),
    (
        b"PK\x03\x04",
        "a ZIP archive or an Excel workbook (.xlsx)",
        "save the sheet as CSV, or unpack the archive",
    ),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook (.xls)", "save the sheet as CSV"),
    (b"PAR1", "a Parquet file", "give it as a file, not through a pipe, to a program built with Parquet"),
    (b"ARROW1", "an Arrow file", "convert it to Parquet or CSV"),
    (b"\x89HDF", "an HDF5 or NetCDF-4 file", "export the table as CSV"),
    (b"CDF", "a NetCDF file", "export the table as CSV"),
    (b"SQLite format 3", "an SQLite database", "export the table as CSV"),
    (b"\x89PNG", "a picture (PNG)", NO_TABLE),
    (b"\xff\xd8\xff", "a picture (JPEG)", NO_TABLE),
    (b"GIF8", "a picture (GIF)", NO_TABLE),
    (b"%PDF", "a PDF document", NO_TABLE),
    (b"\0\0\0\0", "a binary file", NO_TABLE),
    (b"BZh", "packed by bzip2", "unpack it first: bunzip2 -c FILE | fewbits ... -"),
    (b"\xfd7zXZ", "packed by xz", "unpack it first: xz -dc FILE | fewbits ... -"),
];

/// Reads at least so many bytes, if there are.
fn first_bytes(source: &mut impl Read, count: usize) -> std::io::Result<Vec<u8>> {
    let mut first = Vec::new();
    source.take(count as u64).read_to_end(&mut first)?;
    Ok(first)
}

/// The text of a source in UTF-8, and the label of its encoding if that is another.
pub(crate) fn text(source: Bytes, said: Option<&str>) -> Result<(Box<dyn BufRead + Send>, Option<String>), Error> {
    text_within(source, said, 0)
}

fn text_within(
    mut source: Bytes,
    said: Option<&str>,
    depth: u8,
) -> Result<(Box<dyn BufRead + Send>, Option<String>), Error> {
    let first = first_bytes(&mut source, 4)?;
    if let Some((_, what, mend)) = OTHERS
        .iter()
        .find(|(magic, ..)| first.starts_with(&magic[..magic.len().min(4)]))
    {
        return Err(Error::Format { what, mend });
    }
    let whole = |first: Vec<u8>, source: Bytes| -> Bytes { Box::new(Cursor::new(first).chain(source)) };
    if first.starts_with(b"\x1f\x8b") && depth < 2 {
        #[cfg(feature = "gzip")]
        return text_within(Box::new(flate2::read::MultiGzDecoder::new(whole(first, source))), said, depth + 1);
        #[cfg(not(feature = "gzip"))]
        return Err(Error::Format {
            what: "packed by gzip",
            mend: "unpack it first: gunzip -c FILE | fewbits ... -",
        });
    }
    if first.starts_with(b"\x28\xb5\x2f\xfd") && depth < 2 {
        #[cfg(feature = "zstd")]
        return text_within(Box::new(zstd::stream::read::Decoder::new(whole(first, source))?), said, depth + 1);
        #[cfg(not(feature = "zstd"))]
        return Err(Error::Format {
            what: "packed by zstd",
            mend: "unpack it first: zstd -dc FILE | fewbits ... -, or build with the feature zstd",
        });
    }
    let (encoding, mark) = match said.and_then(|label| Encoding::for_label(label.as_bytes())) {
        Some(encoding) => (encoding, Encoding::for_bom(&first).map_or(0, |(_, length)| length)),
        None => Encoding::for_bom(&first).unwrap_or(match first.as_slice() {
            // Text of ASCII in 16 bits without its mark.
            [c, 0, d, 0] if *c != 0 && *d != 0 => (UTF_16LE, 0),
            [0, c, 0, d] if *c != 0 && *d != 0 => (UTF_16BE, 0),
            _ => (UTF_8, 0),
        }),
    };
    let rest: Bytes = whole(first[mark.min(first.len())..].to_vec(), source);
    if encoding == UTF_8 {
        return Ok((Box::new(BufReader::with_capacity(CHUNK, rest)), None));
    }
    let decoded = Decoded {
        source: rest,
        decoder: encoding.new_decoder_without_bom_handling(),
        raw: Vec::new(),
        ended: false,
        finished: false,
    };
    Ok((Box::new(BufReader::with_capacity(CHUNK, decoded)), Some(encoding.name().to_ascii_lowercase())))
}

/// Text of another encoding as UTF-8.
struct Decoded {
    source: Bytes,
    decoder: Decoder,
    raw: Vec<u8>,
    ended: bool,
    finished: bool,
}

impl Read for Decoded {
    fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
        if target.len() < 16 {
            // Too small for any character: the buffer above asks for more.
            return Ok(0);
        }
        loop {
            if self.finished {
                return Ok(0);
            }
            if self.raw.is_empty() && !self.ended {
                let mut chunk = vec![0; CHUNK.min(target.len())];
                let count = self.source.read(&mut chunk)?;
                chunk.truncate(count);
                self.ended = count == 0;
                self.raw = chunk;
            }
            let (result, used, written, _) = self.decoder.decode_to_utf8(&self.raw, target, self.ended);
            self.raw.drain(..used);
            self.finished = self.ended && self.raw.is_empty() && result == CoderResult::InputEmpty;
            if written > 0 {
                return Ok(written);
            }
        }
    }
}
