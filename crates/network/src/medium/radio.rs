//! What the radio takes.
//!
//! | preset | source |
//! |---|---|
//! | [`Radio::cc2420`] | Texas Instruments, *CC2420 data sheet* (SWRS041): 250 kbit/s, currents at 3.3 V; frame of IEEE 802.15.4-2006, sections 6.3 and 7.2 |
//! | [`Radio::first_order`] | Heinzelman, Chandrakasan and Balakrishnan, *Energy-efficient communication protocol for wireless microsensor networks*, HICSS 2000: 50 nJ/bit, 100 pJ/bit/m^2 |

use crate::units::{Bits, Joules, Seconds, Watts};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::positive;
use serde::{Deserialize, Serialize};

/// Energy of the bits on air.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Transceiver {
    /// So much power while it sends or receives.
    Powers {
        /// While sending.
        transmit: Watts,
        /// While receiving.
        receive: Watts,
    },
    /// `E_elec k + eps k d^2` to send `k` bits over `d` metres, `E_elec k` to receive them.
    FirstOrder {
        /// `E_elec`, per bit.
        electronics: Joules,
        /// `eps`, per bit and square metre.
        amplifier: Joules,
    },
}

/// A radio with its framing, and the node it sits on.
///
/// Every frame costs its preamble and link-layer header besides its own bits, the sender and each receiver a wake-up
/// (sleep to active and back, at the power of receiving), and the turnaround before an acknowledgement. Nodes are synchronised
/// to slots and sleep outside the frames that are for them; `guard` is how long a receiver listens in vain before each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Radio {
    /// Bits per second on air.
    pub bit_rate: f64,
    /// Energy of sending and receiving.
    pub transceiver: Transceiver,
    /// Power asleep.
    pub sleep: Watts,
    /// Power of the rest of the node, always.
    pub baseline: Watts,
    /// Power during wake-up, turnaround and guard time.
    pub active: Watts,
    /// Sending to receiving or back.
    pub turnaround: Seconds,
    /// Asleep to ready.
    pub wake: Seconds,
    /// Ready to asleep.
    pub doze: Seconds,
    /// Listening before each frame.
    pub guard: Seconds,
    /// Preamble, start delimiter and length.
    pub preamble: Bits,
    /// Link-layer header with addresses; the frame check is part of the frame itself.
    pub header: Bits,
    /// An acknowledgement with its preamble.
    pub acknowledgement: Bits,
    /// Energy of the batteries.
    pub battery: Joules,
}

/// Two AA cells.
pub const TWO_AA_CELLS: Joules = Joules::trusted(18_720.0);

/// Output powers of the CC2420 in dBm and what sending at them takes, mW.
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
    /// The CC2420 on two AA cells, at an output power of [`CC2420_OUTPUT`].
    ///
    /// # Errors
    /// If the output power is none of the eight.
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
            battery: TWO_AA_CELLS,
        })
    }

    /// The first-order model: bits alone cost, nothing else does.
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
            battery: Joules::trusted(0.5),
        }
    }

    /// # Errors
    /// If the bit rate is not positive.
    pub(crate) fn checked(self) -> Result<Self, ArgumentError> {
        positive("bit_rate", self.bit_rate)?;
        Ok(self)
    }

    /// Time on air.
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

    /// Energy of waking up and going back to sleep.
    pub fn wake_up(&self) -> Joules {
        self.active * (self.wake + self.doze)
    }

    /// Energy of a turnaround.
    pub fn turn(&self) -> Joules {
        self.active * self.turnaround
    }

    /// Energy of listening before a frame.
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
}
