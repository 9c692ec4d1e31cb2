//! Decoding of reports: the receiver's half of `fewbits_node::adaptive::Content`.

use crate::packet::{PacketReader, read_number};
use fewbits_block_codec::bytes::unzigzag;
use fewbits_core::CodecError;
use fewbits_node::adaptive::{Config, Content, Law, PRECISION, Replica, Slot};

/// `-log2` of the probability of a symbol with this frequency.
pub(crate) fn information(frequency: u32) -> f64 {
    f64::from(PRECISION) - f64::from(frequency).log2()
}

/// The content that a symbol of the law and the bits after it encode.
pub(crate) fn content(symbol: u32, rest: &mut PacketReader) -> Result<Content, CodecError> {
    if let Some(k) = Law::residual_of(symbol) {
        return Ok(Content::Near(k));
    }
    if rest.read(1)? == 1 {
        return Ok(Content::Whole(read_number(rest)?));
    }
    let length = rest.read(Content::LENGTH)? as u32;
    let k = unzigzag(rest.read(length)?);
    if Law::residual_of(Law::symbol(k)).is_some() || k == 0 || k.unsigned_abs() >= 1 << 50 {
        return Err(CodecError::invalid("residual", k, "one that needs the escape"));
    }
    Ok(Content::Far(k))
}

/// Updates the replica with the content of a report.
pub(crate) fn apply(
    content: &Content,
    config: &Config,
    replica: &mut Replica,
    slot: &Slot,
    outside: f32,
) -> Result<(), CodecError> {
    let applied = content.apply(config, replica, slot, outside);
    applied.map_err(|error| CodecError::invalid(error.name, error.value, error.expected))
}

/// Reads what `fewbits_node::adaptive::push` wrote, up to the packet's end.
pub(crate) fn read(law: &Law<'_>, reader: &mut PacketReader) -> Result<Content, CodecError> {
    let (symbol, place) = law.find(reader.peek(PRECISION) as u32);
    // The symbol of a near residual ends the packet, so its word may be shorter.
    let last = Law::residual_of(symbol).is_some();
    let (expected, bits) = if last { place.last_word() } else { place.word() };
    let word = reader.read(bits)?;
    if word != u64::from(expected) {
        return Err(CodecError::invalid("code word", word, "the shortest of its symbol"));
    }
    let content = content(symbol, reader)?;
    reader.finish()?;
    Ok(content)
}
