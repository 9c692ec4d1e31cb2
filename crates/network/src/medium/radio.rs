//! Energy, timing and framing of a radio.
//!
//! | preset | source |
//! |---|---|
//! | [`Radio::cc2420`] | Texas Instruments, *CC2420 data sheet* (SWRS041): 250 kbit/s, currents at 3.3 V; frame of IEEE 802.15.4-2006, sections 6.3 and 7.2 |
//! | [`Radio::first_order`] | Heinzelman, Chandrakasan and Balakrishnan, *Energy-efficient communication protocol for wireless microsensor networks*, HICSS 2000: 50 nJ/bit, 100 pJ/bit/m^2 |

use crate::units::{Bits, Joules, Seconds, Watts};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::positive;
use serde::{Deserialize, Serialize};

/// Energy of the bits on air. Which formula applies depends on the radio model.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Transceiver {
    /// Constant powers while the radio sends and receives.
    Powers {
        /// Power while sending.
        transmit: Watts,
        /// Power while receiving.
        receive: Watts,
    },
    /// `E_elec k + eps k d^2` to send `k` bits over `d` metres, `E_elec k` to receive them.
    FirstOrder {
        /// Energy `E_elec` of the electronics, per bit.
        electronics: Joules,
        /// Energy `eps` of the amplifier, per bit and square metre.
        amplifier: Joules,
    },
}

/// A radio, its framing, and the power and battery of its node.
///
/// A frame is sent as one link frame, or as several if it is longer than [`mtu`](Self::mtu) allows. Each link frame adds a preamble and a
/// link-layer header to its part of the bits. Sender and receivers pay a wake-up (from sleep to active and back, at the power of
/// receiving), and a turnaround before an acknowledgement. Nodes are synchronised to slots. They sleep except during frames that are for
/// them; `guard` is how long a receiver listens before each frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radio {
    /// Bits per second on air.
    pub bit_rate: f64,
    /// Energy of sending and receiving.
    pub transceiver: Transceiver,
    /// Power of the sleeping radio.
    pub sleep: Watts,
    /// Constant power of the rest of the node.
    pub baseline: Watts,
    /// Power during wake-up, turnaround and guard time.
    pub active: Watts,
    /// Time to change between sending and receiving.
    pub turnaround: Seconds,
    /// Time from sleep to ready.
    pub wake: Seconds,
    /// Time from ready to sleep.
    pub doze: Seconds,
    /// Time that a receiver listens before each frame.
    pub guard: Seconds,
    /// Length of preamble, start delimiter and length field.
    pub preamble: Bits,
    /// Length of the link-layer header with addresses. The frame check is part of the frame itself.
    pub header: Bits,
    /// Length of an acknowledgement with its preamble.
    pub acknowledgement: Bits,
    /// Longest link frame without preamble; `None` for no limit.
    pub mtu: Option<Bits>,
    /// Energy of the batteries; `None` for a node with mains power.
    pub battery: Option<Joules>,
}

/// Overhead of each part of a frame that needs several link frames: a fragment header (40 bits, RFC 4944, section 5.3) and the
/// frame check of IEEE 802.15.4 (16 bits).
pub const FRAGMENT_OVERHEAD: Bits = Bits(56);

/// Energy of two AA cells.
pub const TWO_AA_CELLS: Joules = Joules::trusted(18_720.0);

/// Output powers of the CC2420 in dBm, each with the power consumption while sending, mW, as the simulator Castalia 3.3 has them
/// (`CC2420.txt`): near the currents of the data sheet at 3.3 V, and not equal to them (17.4 mA at 0 dBm).
pub const CC2420_OUTPUT: [(f64, f64); 8] = [
    (0.0, 57.42),
    (-1.0, 54.45),
    (-3.0, 50.16),
    (-5.0, 45.87),
    (-7.0, 41.25),
    (-10.0, 36.96),
    (-15.0, 32.67),
    (-25.0, 29.04),
];

impl Radio {
    /// The CC2420 with two AA cells, at an output power of [`CC2420_OUTPUT`].
    ///
    /// # Errors
    /// If `output_dbm` is none of the eight.
    pub fn cc2420(output_dbm: f64) -> Result<Self, ArgumentError> {
        let milliwatts = CC2420_OUTPUT
            .iter()
            .find(|(dbm, _)| *dbm == output_dbm)
            .map(|(_, milliwatts)| *milliwatts)
            .ok_or_else(|| ArgumentError::new("output_dbm", output_dbm, "0, -1, -3, -5, -7, -10, -15 or -25"))?;
        let receive = Watts::trusted(62e-3);
        Ok(Self {
            bit_rate: 250e3,
            transceiver: Transceiver::Powers {
                transmit: Watts::trusted(milliwatts * 1e-3),
                receive,
            },
            sleep: Watts::trusted(1.4e-3),
            baseline: Watts::trusted(6e-3),
            active: receive,
            turnaround: Seconds::trusted(0.01e-3),
            wake: Seconds::trusted(0.194e-3),
            doze: Seconds::trusted(0.05e-3),
            guard: Seconds::ZERO,
            preamble: Bits(48),
            header: Bits(72),
            acknowledgement: Bits(88),
            mtu: Some(Bits(127 * 8)),
            battery: Some(TWO_AA_CELLS),
        })
    }

    /// The first-order model: only bits cost energy.
    pub fn first_order() -> Self {
        Self {
            bit_rate: 1e6,
            transceiver: Transceiver::FirstOrder {
                electronics: Joules::trusted(50e-9),
                amplifier: Joules::trusted(100e-12),
            },
            sleep: Watts::ZERO,
            baseline: Watts::ZERO,
            active: Watts::ZERO,
            turnaround: Seconds::ZERO,
            wake: Seconds::ZERO,
            doze: Seconds::ZERO,
            guard: Seconds::ZERO,
            preamble: Bits(0),
            header: Bits(0),
            acknowledgement: Bits(0),
            mtu: None,
            battery: Some(Joules::trusted(0.5)),
        }
    }

    /// The same radio on a node with mains power. Its energy is counted, but it never runs out.
    #[must_use]
    pub fn on_mains(self) -> Self {
        Self { battery: None, ..self }
    }

    /// # Errors
    /// If the bit rate is not positive, or a link frame cannot hold one bit of a fragment.
    pub(crate) fn checked(self) -> Result<Self, ArgumentError> {
        positive("bit_rate", self.bit_rate)?;
        let least = self.header + FRAGMENT_OVERHEAD;
        match self.mtu {
            Some(mtu) if mtu <= least => Err(ArgumentError::new("mtu", mtu, format!("more than {least}"))),
            _ => Ok(self),
        }
    }

    /// Whether each radio can receive frames of the other: bit rate and framing are equal.
    pub(crate) fn understands(&self, other: &Self) -> bool {
        let framing = |radio: &Self| (radio.preamble, radio.header, radio.acknowledgement, radio.mtu);
        self.bit_rate == other.bit_rate && framing(self) == framing(other)
    }

    /// Number of link frames for a frame or batch of `body` bits.
    pub fn link_frames(&self, body: Bits) -> u64 {
        match self.mtu {
            Some(mtu) if self.header + body > mtu => {
                let room = mtu.0.saturating_sub((self.header + FRAGMENT_OVERHEAD).0).max(1);
                body.0.div_ceil(room)
            }
            _ => 1,
        }
    }

    /// Number of bits on air of a frame or batch of `body` bits, with preambles and headers.
    pub fn on_air(&self, body: Bits) -> Bits {
        match self.link_frames(body) {
            1 => self.preamble + self.header + body,
            several => (self.preamble + self.header + FRAGMENT_OVERHEAD) * several + body,
        }
    }

    /// Time from the end of a frame to the end of its acknowledgement without channel delay: turnaround and acknowledgement.
    pub fn answer_time(&self) -> Seconds {
        self.turnaround + self.duration(self.acknowledgement)
    }

    /// Time on air of `bits` bits.
    pub fn duration(&self, bits: Bits) -> Seconds {
        Seconds::trusted(bits.0 as f64 / self.bit_rate)
    }

    /// Energy of sending `bits` over `distance` metres.
    pub fn transmit(&self, bits: Bits, distance: f64) -> Joules {
        match self.transceiver {
            Transceiver::Powers { transmit, .. } => transmit * self.duration(bits),
            Transceiver::FirstOrder { electronics, amplifier } => {
                Joules::trusted(bits.0 as f64 * (electronics.value() + amplifier.value() * distance * distance))
            }
        }
    }

    /// Energy of receiving `bits`.
    pub fn receive(&self, bits: Bits) -> Joules {
        match self.transceiver {
            Transceiver::Powers { receive, .. } => receive * self.duration(bits),
            Transceiver::FirstOrder { electronics, .. } => Joules::trusted(bits.0 as f64 * electronics.value()),
        }
    }

    /// Energy of waking up and returning to sleep.
    pub fn wake_up(&self) -> Joules {
        self.active * (self.wake + self.doze)
    }

    /// Energy of a turnaround between sending and receiving.
    pub fn turn(&self) -> Joules {
        self.active * self.turnaround
    }

    /// Energy of listening during the guard time before a frame.
    pub fn listen(&self) -> Joules {
        self.active * self.guard
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_payload_bit_costs_what_it_costs_on_a_node() {
        let radio = Radio::cc2420(0.0).unwrap();
        // 128 bits at 250 kbit/s and 57.42 mW.
        assert!((radio.transmit(Bits(128), 10.0).value() - 128.0 / 250e3 * 57.42e-3).abs() < 1e-15);
        assert!((radio.receive(Bits(250_000)).value() - 62e-3).abs() < 1e-12);
        assert!((radio.wake_up().value() - 62e-3 * 0.244e-3).abs() < 1e-15);
        assert!(Radio::cc2420(3.0).is_err() && Radio::cc2420(f64::NAN).is_err());
        assert!((Radio::cc2420(-25.0).unwrap().transmit(Bits(250_000), 1.0).value() - 29.04e-3).abs() < 1e-15);
        let simple = Radio::first_order();
        assert!((simple.transmit(Bits(2000), 100.0).value() - 2000.0 * (50e-9 + 100e-12 * 1e4)).abs() < 1e-15);
        assert!((simple.receive(Bits(2000)).value() - 1e-4).abs() < 1e-18);
    }

    /// 127 bytes without preamble: header 9, frame 118 (one link frame), or parts of 111 bytes and 7 of fragment header and check.
    #[test]
    fn long_frames_are_cut_at_127_bytes() {
        let radio = Radio::cc2420(0.0).unwrap();
        assert_eq!((radio.link_frames(Bits(118 * 8)), radio.link_frames(Bits(118 * 8 + 1))), (1, 2));
        assert_eq!(radio.on_air(Bits(118 * 8)), Bits(48 + 127 * 8));
        assert_eq!(radio.on_air(Bits(2 * 888)), Bits(2 * (48 + 127 * 8)));
        assert_eq!(radio.link_frames(Bits(32_000)), 37);
        assert_eq!(Radio::first_order().link_frames(Bits(1 << 40)), 1);
        let none = Radio {
            mtu: Some(Bits(128)),
            ..radio
        };
        assert!(none.checked().is_err() && radio.checked().is_ok());
    }
}
