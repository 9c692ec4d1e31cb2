//! From an index to bits and back.

use crate::Config;
use crate::lattice::{LARGEST, Lattice};
use crate::law::{Law, PRECISION, Place};
use crate::packet::{Packet, PacketReader, push_number, read_number};
use crate::replica::{Replica, Slot};
use fewbits_core::CodecError;

/// What a slot says: an index, or a number that no index represents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Content {
    /// A residual that the law has a frequency for.
    Near(i64),
    /// A residual beyond them.
    Far(i64),
    /// A sample as it is; the lattice moves there.
    Whole(f64),
}

/// Bits of the length of a far residual.
const LENGTH: u32 = 6;

fn zigzag(k: i64) -> u64 {
    ((k << 1) ^ (k >> 63)) as u64
}

fn unzigzag(z: u64) -> i64 {
    (z >> 1) as i64 ^ -((z & 1) as i64)
}

impl Content {
    /// What to say of a sample; `None` if silence says it.
    pub(crate) fn of(replica: &Replica, slot: &Slot, sample: f64) -> Option<Self> {
        match replica.lattice.index(sample, slot.prediction) {
            None => Some(Self::Whole(sample)),
            Some(j) => match j - slot.prediction {
                0 => None,
                k if Law::residual_of(Law::symbol(k)).is_some() => Some(Self::Near(k)),
                k => Some(Self::Far(k)),
            },
        }
    }

    pub(crate) fn place(&self, law: &Law<'_>) -> Place {
        law.place(match self {
            Self::Near(k) => Law::symbol(*k),
            Self::Far(_) | Self::Whole(_) => Law::symbol(0),
        })
    }

    /// What follows the symbol of the law.
    pub(crate) fn push_rest(&self, packet: &mut Packet) {
        match self {
            Self::Near(_) => {}
            Self::Far(k) => {
                let z = zigzag(*k);
                let length = 64 - z.leading_zeros();
                packet.push(0, 1);
                packet.push(u64::from(length), LENGTH);
                packet.push(z, length);
            }
            Self::Whole(sample) => {
                packet.push(1, 1);
                push_number(packet, *sample);
            }
        }
    }

    pub(crate) fn read(symbol: u32, rest: &mut PacketReader) -> Result<Self, CodecError> {
        if let Some(k) = Law::residual_of(symbol) {
            return Ok(Self::Near(k));
        }
        if rest.read(1)? == 1 {
            return Ok(Self::Whole(read_number(rest)?));
        }
        let length = rest.read(LENGTH)? as u32;
        let k = unzigzag(rest.read(length)?);
        if Law::residual_of(Law::symbol(k)).is_some() || k == 0 || k.unsigned_abs() >= 1 << 50 {
            return Err(CodecError::Invalid {
                what: "residual",
                value: k.to_string(),
                expected: "one that needs the escape",
            });
        }
        Ok(Self::Far(k))
    }

    /// Moves the replica to what was said.
    pub(crate) fn apply(
        &self,
        config: &Config,
        replica: &mut Replica,
        slot: &Slot,
        outside: f64,
    ) -> Result<(), CodecError> {
        match self {
            Self::Near(k) | Self::Far(k) => {
                let j = slot.prediction + k;
                let sent = match replica.lattice.cells() {
                    None => j.abs() <= LARGEST,
                    Some(_) => replica.lattice.shortest(*k) == *k,
                };
                if !sent {
                    return Err(CodecError::Invalid {
                        what: "index",
                        value: j.to_string(),
                        expected: "at most 2^40 in size, the shortest way around a circle",
                    });
                }
                replica.update(slot, j, outside);
            }
            Self::Whole(sample) => replica.move_to(Lattice::new(config, *sample)),
        }
        Ok(())
    }
}

fn word(place: &Place, last: bool) -> (u32, u32) {
    if last { place.last_word() } else { place.word() }
}

/// Appends a report as whole bits; returns its ideal length.
pub(crate) fn push(content: &Content, law: &Law<'_>, packet: &mut Packet) -> f64 {
    let place = content.place(law);
    let (value, bits) = word(&place, matches!(content, Content::Near(_)));
    packet.push(u64::from(value), bits);
    let before = packet.bits();
    content.push_rest(packet);
    place.information() + (packet.bits() - before) as f64
}

/// Reads what [`push`] wrote, to the packet's end.
pub(crate) fn read(law: &Law<'_>, reader: &mut PacketReader) -> Result<Content, CodecError> {
    let (symbol, place) = law.find(reader.peek(PRECISION) as u32);
    let (expected, bits) = word(&place, Law::residual_of(symbol).is_some());
    let word = reader.read(bits)?;
    if word != u64::from(expected) {
        return Err(CodecError::Invalid {
            what: "code word",
            value: word.to_string(),
            expected: "the shortest of its symbol",
        });
    }
    let content = Content::read(symbol, reader)?;
    reader.finish()?;
    Ok(content)
}
