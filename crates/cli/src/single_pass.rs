//! Tables that are packed in a single pass, and the identity of what is packed.

use crate::arguments::{BoundOptions, TableOptions};
use crate::error::Error;
use crate::files::is_regular;
use crate::input::Table;
use fewbits_record::Schema;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// Whether an output is written beside its place, so that it can be given up.
pub(crate) fn is_written_beside(path: &Path) -> bool {
    std::fs::metadata(path).map_or(true, |found| found.is_file())
}

/// The table, if it is a file of plain numbers in its first rows, and no bound needs the ranges of columns.
pub(crate) fn readable_once(options: &TableOptions, bounds: &BoundOptions) -> Result<Option<Table>, Error> {
    let is_candidate = is_regular(&options.file)
        && options.by.is_none()
        && options.dialect.said()?.skip_bad == 0
        && !bounds.bound.contains('%');
    if !is_candidate {
        return Ok(None);
    }
    let table = Table::open(options)?;
    Ok(table.is_plain().then_some(table))
}

/// An identity that depends on the bytes of the table and on the schema: the same command gives the same bytes, also after a kill.
pub(crate) fn identity(file: &str, schema: &Schema) -> std::io::Result<u32> {
    // FNV-1a.
    let add = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
    let mut hash = format!("{schema:?}").as_bytes().iter().fold(0xcbf2_9ce4_8422_2325, add);
    let (mut source, mut chunk) = (File::open(file)?, vec![0; 1 << 16]);
    loop {
        match source.read(&mut chunk)? {
            0 => return Ok((hash ^ (hash >> 32)) as u32),
            count => hash = chunk[..count].iter().fold(hash, add),
        }
    }
}
