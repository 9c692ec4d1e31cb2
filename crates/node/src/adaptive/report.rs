//! Encoding of the report of a slot as bits.

use super::Config;
use super::lattice::{LARGEST, Lattice};
use super::law::{Law, Place};
use super::replica::{Replica, Slot};
use crate::error::Error;
use crate::packet::{Packet, push_number};

/// Content of a report: an index, or a number that no index represents.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Content {
    /// A residual that has its own frequency.
    Near(i64),
    /// A larger residual.
    Far(i64),
    /// The sample as a number; a new lattice starts there.
    Whole(f64),
}

fn zigzag(k: i64) -> u64 {
    ((k << 1) ^ (k >> 63)) as u64
}

impl Content {
    /// Bits of the length field of a far residual.
    pub const LENGTH: u32 = 6;

    /// The content of the report of a sample; `None` for silence.
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

    /// The interval of its symbol in the cumulative frequencies.
    pub fn place(&self, law: &Law<'_>) -> Place {
        law.place(match self {
            Self::Near(k) => Law::symbol(*k),
            Self::Far(_) | Self::Whole(_) => Law::symbol(0),
        })
    }

    /// Appends what follows the symbol. Far residual: `0`, the length, and the residual in zigzag order. Sample: `1` and the number.
    pub fn push_rest(&self, packet: &mut Packet) {
        match self {
            Self::Near(_) => {}
            Self::Far(k) => {
                let z = zigzag(*k);
                let length = 64 - z.leading_zeros();
                packet.push(0, 1);
                packet.push(u64::from(length), Self::LENGTH);
                packet.push(z, length);
            }
            Self::Whole(sample) => {
                packet.push(1, 1);
                push_number(packet, *sample);
            }
        }
    }

    /// Updates the replica with the content. `outside` is the bank's probability of a report.
    ///
    /// # Errors
    /// If no sensor can have sent this content. The replica is then unchanged.
    pub fn apply(&self, config: &Config, replica: &mut Replica, slot: &Slot, outside: f32) -> Result<(), Error> {
        match self {
            Self::Near(k) | Self::Far(k) => {
                let j = slot.prediction + k;
                let sent = match replica.lattice.cells() {
                    None => j.abs() <= LARGEST,
                    Some(_) => replica.lattice.shortest(*k) == *k,
                };
                if !sent {
                    let expected = "at most 2^40 in size, the shortest way around a circle";
                    return Err(Error::new("index", j as f64, expected));
                }
                replica.update(slot, j, outside);
            }
            Self::Whole(sample) => replica.move_to(Lattice::new(config, *sample)),
        }
        Ok(())
    }

    /// The word of its symbol: value and length. The word of a near residual ends the packet.
    pub(crate) fn word(&self, place: &Place) -> (u32, u32) {
        match self {
            Self::Near(_) => place.last_word(),
            Self::Far(_) | Self::Whole(_) => place.word(),
        }
    }
}

/// Appends a report. Returns the interval of its symbol, and the number of bits that follow the symbol uncoded.
pub(crate) fn push(content: &Content, law: &Law<'_>, packet: &mut Packet) -> (Place, u32) {
    let place = content.place(law);
    let (value, bits) = content.word(&place);
    packet.push(u64::from(value), bits);
    let before = packet.bits();
    content.push_rest(packet);
    (place, packet.bits() - before)
}
