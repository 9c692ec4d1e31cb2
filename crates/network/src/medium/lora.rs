//! LoRa: time on air by Semtech's formula, and LoRaWAN's duty cycle.

use crate::units::{Bits, Seconds};
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// Symbols of sync word and start of frame, beside the preamble.
const SYNC_SYMBOLS: f64 = 4.25;
/// Symbols before those that depend on the payload.
const FIRST_SYMBOLS: f64 = 8.0;
/// From this symbol time on the low data rate optimisation is on, seconds.
const SLOW_SYMBOL: f64 = 0.016;
/// Application payload that LoRaWAN allows in Europe at each spreading factor from 7 to 12, bytes (RP002-1.0.3, table 8, without options).
const EU868_PAYLOAD: [u64; 6] = [242, 242, 115, 51, 51, 51];
/// Bytes around the application payload of a LoRaWAN frame: header, address, control, counter, port, integrity code.
pub(crate) const LORAWAN_OVERHEAD: Bits = Bits(13 * 8);

/// Modulation of a LoRa frame with explicit header and checksum.
///
/// Time on air by Semtech, *SX1276/77/78/79 data sheet*, section 4.1.1.7:
/// `T = (n_preamble + 4.25 + 8 + max(ceil((8 PL - 4 SF + 44) / (4 (SF - 2 DE))) (CR + 4), 0)) 2^SF / BW`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lora {
    spreading: u32,
    bandwidth: f64,
    coding: u32,
    preamble: u32,
    /// Largest share of the time that a node may send.
    #[serde(default)]
    duty_cycle: Option<f64>,
}

impl Lora {
    /// Spreading factor 7 to 12 at 125, 250 or 500 kHz, coding rate 4/5 and eight preamble symbols, as in LoRaWAN.
    ///
    /// # Errors
    /// If an argument is none of these.
    pub fn new(spreading: u32, bandwidth: f64) -> Result<Self, ArgumentError> {
        if !(7..=12).contains(&spreading) {
            return Err(ArgumentError::new("spreading factor", spreading, "7 to 12"));
        }
        if ![125e3, 250e3, 500e3].contains(&bandwidth) {
            return Err(ArgumentError::new("bandwidth", bandwidth, "125e3, 250e3 or 500e3 Hz"));
        }
        Ok(Self {
            spreading,
            bandwidth,
            coding: 1,
            preamble: 8,
            duty_cycle: None,
        })
    }

    /// The same, where each node sends no more than this share of the time: after a frame that took `t` on air its next one begins `t / share`
    /// after the last began, or later. 0.01 in most bands of EU868.
    ///
    /// # Errors
    /// If `share` is not above 0 and at most 1.
    pub fn with_duty_cycle(self, share: f64) -> Result<Self, ArgumentError> {
        let duty_cycle = Some(checked_share(share)?);
        Ok(Self { duty_cycle, ..self })
    }

    /// Time from the beginning of a frame of this duration to that of the next, if there is a duty cycle.
    pub(crate) fn period(&self, on_air: Seconds) -> Option<Seconds> {
        self.duty_cycle.map(|share| Seconds::trusted(on_air.value() / share))
    }

    /// Duration of a symbol.
    pub(crate) fn symbol(&self) -> Seconds {
        Seconds::trusted(f64::from(1_u32 << self.spreading) / self.bandwidth)
    }

    /// Time on air of a frame of `bytes` bytes behind the preamble, LoRaWAN's own 13 included.
    pub fn time_on_air(&self, bytes: u64) -> Seconds {
        let symbol = self.symbol().value();
        let saved = if symbol >= SLOW_SYMBOL { 2.0 } else { 0.0 };
        let spreading = f64::from(self.spreading);
        let groups = ((8.0 * bytes as f64 - 4.0 * spreading + 44.0) / (4.0 * (spreading - saved)))
            .ceil()
            .max(0.0);
        let symbols = f64::from(self.preamble) + SYNC_SYMBOLS + FIRST_SYMBOLS + groups * f64::from(self.coding + 4);
        Seconds::trusted(symbols * symbol)
    }

    /// Largest application payload of a LoRaWAN frame in Europe (EU868).
    pub(crate) fn max_payload(&self) -> Bits {
        Bits(8 * EU868_PAYLOAD[(self.spreading - 7) as usize])
    }
}

fn checked_share(share: f64) -> Result<f64, ArgumentError> {
    if share > 0.0 && share <= 1.0 {
        Ok(share)
    } else {
        Err(ArgumentError::new("duty cycle", share, "above 0, at most 1"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Milliseconds at 125 kHz for spreading factors 7 to 12, as Semtech's and The Things Network's calculators give them for 10 and 51
    /// bytes of application payload, 13 of LoRaWAN besides.
    #[test]
    fn times_on_air_are_the_published_ones() {
        let published = [
            (23, [61.7, 113.2, 205.8, 370.7, 823.3, 1482.8]),
            (64, [118.0, 215.6, 390.1, 698.4, 1560.6, 2793.5]),
        ];
        for (bytes, times) in published {
            for (spreading, time) in (7..).zip(times) {
                let found = 1e3 * Lora::new(spreading, 125e3).unwrap().time_on_air(bytes).value();
                assert!((found - time).abs() < 0.06, "SF{spreading}, {bytes} bytes: {found} for {time}");
            }
        }
        assert!(Lora::new(6, 125e3).is_err() && Lora::new(7, 100e3).is_err());
    }
}
