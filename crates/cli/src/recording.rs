//! Opening of recordings.

use crate::error::Error;
use crate::files::is_regular;
use crate::say;
use crate::target::is_live;
use crate::waiting::Source;
use fewbits_record::{Column, Playback};
use std::fs::File;
use std::io::{Cursor, Read, Seek};
use std::path::Path;

/// A source with random access.
pub(crate) trait ReadSeek: Read + Seek {}

impl<T: Read + Seek> ReadSeek for T {}

/// Opens a file or standard input for reading from front to end. Returns its name for messages too.
pub(crate) fn stream(file: &str) -> Result<(Box<dyn Read + Send>, &str), Error> {
    Ok(match file {
        "-" => (Box::new(std::io::stdin()), "standard input"),
        file => (Box::new(File::open(file).map_err(Error::io(file, "open"))?), file),
    })
}

/// As [`stream`]; of a pipe, a signal is the end.
pub(crate) fn live(file: &str) -> Result<(Box<dyn Read + Send>, &str), Error> {
    let (source, name) = stream(file)?;
    match is_live() {
        true => Ok((Box::new(Source::new(source, None, None)), name)),
        false => Ok((source, name)),
    }
}

/// Opens a recording with random access. A pipe has none: its bytes are kept in memory.
pub(crate) fn open(path: &Path) -> Result<Playback<Box<dyn ReadSeek>>, Error> {
    let name = path.display().to_string();
    if is_regular(&name) {
        let source: Box<dyn ReadSeek> = Box::new(File::open(path).map_err(Error::io(&name, "open"))?);
        return Playback::opened(source, path).map_err(Error::recording(&name));
    }
    let (mut stream, file) = stream(&name)?;
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).map_err(Error::io(file, "read"))?;
    let source: Box<dyn ReadSeek> = Box::new(Cursor::new(bytes));
    Playback::new(source).map_err(Error::recording(&name))
}

/// Refuses another unit than that of a column of a file, if both are known.
pub(crate) fn same_unit(column: &Column, unit: &str, file: &str) -> Result<(), String> {
    if unit == column.unit() || unit.is_empty() || column.unit().is_empty() {
        return Ok(());
    }
    let (name, known) = (say::name(column.name()), column.unit());
    Err(format!("column `{name}` is in {unit}, and in {known} in {file}: convert it, or keep the two apart"))
}
