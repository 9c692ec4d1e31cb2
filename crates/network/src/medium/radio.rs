//! Energy, timing and framing of a radio.
//!
//! | preset | source |
//! |---|---|
//! | [`Radio::cc2420`] | Texas Instruments, *CC2420 data sheet* (SWRS041): 250 kbit/s, currents at 3.3 V, turnaround of 12 symbols; times to and from sleep: Castalia 3.3, `CC2420.txt`; frame of IEEE 802.15.4-2006, sections 6.3 and 7.2 |
//! | [`Radio::lorawan`] | Semtech, *SX1276/77/78/79 data sheet*, table 10: currents at 3.3 V; LoRaWAN 1.0.4: frame, 1 s to the first receive window |
//! | [`Radio::esp32_wifi`] | Espressif, *ESP32 series data sheet*, "RF power consumption" and "Current consumption depending on work modes": currents at 3.3 V; wake-up below 1 ms: *ESP-IDF programming guide*, "Sleep modes"; frame of IEEE 802.11-2016, clauses 9 and 16, with LLC/SNAP, IPv4 and UDP |
//! | [`Radio::nrf52840`] | Nordic Semiconductor, *nRF52840 product specification*, "Radio transmitting/receiving": currents at 3 V with the DC/DC regulator and the crystal, at 250 kbit/s; frame and turnaround of IEEE 802.15.4-2006. Asleep and wake-up: as others quote it |
//! | [`Radio::first_order`] | Heinzelman, Chandrakasan and Balakrishnan, *Energy-efficient communication protocol for wireless microsensor networks*, HICSS 2000: 50 nJ/bit, 100 pJ/bit/m^2 |

use super::lora::{LORAWAN_OVERHEAD, Lora};
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
    /// Modulation whose frames take the time of LoRa's formula instead of `bit_rate`; `None` for others.
    #[serde(default)]
    pub lora: Option<Lora>,
}

/// Overhead of each part of a frame that needs several link frames: a fragment header (40 bits, RFC 4944, section 5.3) and the frame check of IEEE 802.15.4 (16 bits).
pub(crate) const FRAGMENT_OVERHEAD: Bits = Bits(56);

/// Energy of two AA cells.
pub const TWO_AA_CELLS: Joules = Joules::trusted(18_720.0);

/// Output powers of the CC2420 in dBm, each with the power consumption while sending, mW: the currents of the data sheet (17.4 mA at 0 dBm, 8.5 mA at -25 dBm) at 3.3 V.
pub(crate) const CC2420_OUTPUT: [(f64, f64); 8] = [
    (0.0, 57.42),
    (-1.0, 54.45),
    (-3.0, 50.16),
    (-5.0, 45.87),
    (-7.0, 41.25),
    (-10.0, 36.96),
    (-15.0, 32.67),
    (-25.0, 28.05),
];

impl Radio {
    /// The CC2420 with two AA cells, at one of the eight output powers of its data sheet, in dBm.
    ///
    /// # Errors
    /// If `output_dbm` is none of the eight.
    pub fn cc2420(output_dbm: f64) -> Result<Self, ArgumentError> {
        let milliwatts = CC2420_OUTPUT
            .iter()
            .find(|(dbm, _)| *dbm == output_dbm)
            .map(|(_, milliwatts)| *milliwatts)
            .ok_or_else(|| ArgumentError::new("output_dbm", output_dbm, "0, -1, -3, -5, -7, -10, -15 or -25"))?;
        Ok(Self {
            // 20 uA in power-down mode.
            sleep: Watts::trusted(0.066e-3),
            baseline: Watts::trusted(6e-3),
            wake: Seconds::trusted(0.194e-3),
            doze: Seconds::trusted(0.05e-3),
            ..Self::of_powers(milliwatts * 1e-3, 62e-3)
        })
    }

    /// An SX1276 at 13 dBm with LoRaWAN's frames at 125 kHz and this spreading factor, and two AA cells. A frame that is longer than LoRaWAN
    /// allows travels as several. The centre stands for gateway and network server; set `Channel`'s loss for what it misses. A confirmed
    /// frame is acknowledged a second later, in the first receive window.
    ///
    /// # Errors
    /// If `spreading` is not 7 to 12.
    pub fn lorawan(spreading: u32) -> Result<Self, ArgumentError> {
        let lora = Lora::new(spreading, 125e3)?;
        Ok(Self {
            // Of the modulation; frames take the time of the formula.
            bit_rate: f64::from(spreading) / lora.symbol().value() * 0.8,
            sleep: Watts::trusted(0.66e-6),
            turnaround: Seconds::trusted(1.0),
            wake: Seconds::trusted(0.25e-3),
            preamble: Bits(0),
            header: LORAWAN_OVERHEAD,
            // A frame without payload has no port.
            acknowledgement: Bits(LORAWAN_OVERHEAD.0 - 8),
            mtu: Some(LORAWAN_OVERHEAD + lora.max_payload()),
            lora: Some(lora),
            // 28 mA, 10.3 mA and, asleep, 0.2 uA.
            ..Self::of_powers(92.4e-3, 34e-3)
        })
    }

    /// An ESP32 as a station of a Wi-Fi network with two AA cells: 802.11b at 1 Mbit/s and 19.5 dBm (240
    /// mA, and 100 mA while it receives). Frames are datagrams over UDP. The radio stays in light sleep (0.8 mA) between frames and keeps
    /// its connection. The access point's beacons, which it must hear to keep it, are not counted. Currents are as others quote them.
    pub fn esp32_wifi() -> Self {
        Self {
            bit_rate: 1e6,
            sleep: Watts::trusted(2.64e-3),
            // Short interframe space.
            turnaround: Seconds::trusted(10e-6),
            wake: Seconds::trusted(1e-3),
            // Long preamble and header of the physical layer, 192 us.
            preamble: Bits(192),
            // 26 bytes of the link, 8 of LLC and SNAP, 20 of IPv4, 8 of UDP, and the check of 4.
            header: Bits(66 * 8),
            // 14 bytes.
            acknowledgement: Bits(192 + 112),
            // A datagram of 1500 bytes.
            mtu: Some(Bits(1538 * 8)),
            ..Self::of_powers(792e-3, 330e-3)
        }
    }

    /// An nRF52840 with frames of IEEE 802.15.4 at 0 dBm and two AA cells: 6.40 mA sending and 6.53 mA receiving, crystal and regulator
    /// included, as the specification states them for 250 kbit/s. Asleep it draws 1.5 uA with its clock running, and its wake-up is that of the crystal
    /// (0.36 ms) and the ramp of the radio (0.04 ms): these are the specification's as others quote it.
    pub fn nrf52840() -> Self {
        Self {
            sleep: Watts::trusted(4.5e-6),
            wake: Seconds::trusted(0.4e-3),
            ..Self::of_powers(19.2e-3, 19.59e-3)
        }
    }

    /// A radio that takes these powers, in watts, to send and to receive, on two AA cells; it sleeps and wakes for nothing. Frames and bit rate
    /// are those of IEEE 802.15.4 at 2.4 GHz.
    fn of_powers(transmit: f64, receive: f64) -> Self {
        let (transmit, receive) = (Watts::trusted(transmit), Watts::trusted(receive));
        Self {
            bit_rate: 250e3,
            transceiver: Transceiver::Powers { transmit, receive },
            sleep: Watts::ZERO,
            baseline: Watts::ZERO,
            active: receive,
            turnaround: Seconds::trusted(0.192e-3),
            wake: Seconds::ZERO,
            doze: Seconds::ZERO,
            guard: Seconds::ZERO,
            preamble: Bits(48),
            header: Bits(72),
            acknowledgement: Bits(88),
            mtu: Some(Bits(127 * 8)),
            battery: Some(TWO_AA_CELLS),
            lora: None,
        }
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
            lora: None,
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
        let framing = |radio: &Self| (radio.preamble, radio.header, radio.acknowledgement, radio.mtu, radio.lora);
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

    /// Time on air of `bits` bits. With LoRa that is the time of one frame, or of as many as are too long for one.
    pub fn duration(&self, bits: Bits) -> Seconds {
        let Some(lora) = self.lora else {
            return Seconds::trusted(bits.0 as f64 / self.bit_rate);
        };
        let bytes = bits.0.div_ceil(8);
        let most = self.mtu.map_or(u64::MAX, |mtu| mtu.0 / 8).max(1);
        let whole = Seconds::trusted((bytes / most) as f64 * lora.time_on_air(most).value());
        match bytes % most {
            0 if bytes > 0 => whole,
            rest => whole + lora.time_on_air(rest),
        }
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
        assert!((Radio::cc2420(-25.0).unwrap().transmit(Bits(250_000), 1.0).value() - 28.05e-3).abs() < 1e-15);
        let simple = Radio::first_order();
        assert!((simple.transmit(Bits(2000), 100.0).value() - 2000.0 * (50e-9 + 100e-12 * 1e4)).abs() < 1e-15);
        assert!((simple.receive(Bits(2000)).value() - 1e-4).abs() < 1e-18);
    }

    /// A report of ten bytes by hand: its time on air, and its energy at the sender with the wake-up.
    #[test]
    fn wifi_and_nordic_frames_cost_what_their_currents_say() {
        let wifi = Radio::esp32_wifi();
        let report = wifi.on_air(Bits(80));
        assert!((wifi.duration(report).value() - (192e-6 + 76.0 * 8e-6)).abs() < 1e-12);
        assert!((wifi.transmit(report, 1.0).value() - 0.240 * 3.3 * 800e-6).abs() < 1e-9);
        assert!((wifi.wake_up().value() - 0.100 * 3.3 * 1e-3).abs() < 1e-9);
        let nordic = Radio::nrf52840();
        let report = nordic.on_air(Bits(80));
        assert!((nordic.duration(report).value() - 200.0 / 250e3).abs() < 1e-12);
        assert!((nordic.transmit(report, 1.0).value() - 6.40e-3 * 3.0 * 800e-6).abs() < 1e-12);
        assert!((nordic.receive(report).value() - 6.53e-3 * 3.0 * 800e-6).abs() < 1e-12);
        assert!((nordic.wake_up().value() - 6.53e-3 * 3.0 * 0.4e-3).abs() < 1e-12);
        assert!((nordic.sleep.value() - 1.5e-6 * 3.0).abs() < 1e-12);
        // The same frames as a CC2420, so the two understand each other.
        assert!(nordic.understands(&Radio::cc2420(0.0).unwrap()) && !nordic.understands(&wifi));
        assert!(wifi.checked().is_ok() && nordic.checked().is_ok());
    }

    #[test]
    fn lorawan_frames_take_the_time_of_the_formula() {
        let radio = Radio::lorawan(12).unwrap();
        let report = radio.on_air(Bits(80));
        assert!((radio.duration(report).value() - 1.4828).abs() < 1e-4);
        assert!((radio.transmit(report, 1.0).value() - 92.4e-3 * 1.4828).abs() < 1e-4);
        assert_eq!((radio.link_frames(Bits(51 * 8)), radio.link_frames(Bits(51 * 8 + 1))), (1, 2));
        assert!(radio.duration(radio.on_air(Bits(60 * 8))) > radio.duration(radio.on_air(Bits(51 * 8))));
        assert!(!radio.understands(&Radio::lorawan(7).unwrap()) && radio.checked().is_ok());
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
