//! Radios under a duty cycle.

use super::radio::Radio;
use fewbits_numerics::ArgumentError;

impl Radio {
    /// This radio under a duty cycle: [`Lora::with_duty_cycle`](crate::Lora::with_duty_cycle). Frames that come too early wait;
    /// acknowledgements do not.
    ///
    /// # Errors
    /// If the radio has no modulation of LoRa, or `share` is not above 0 and at most 1.
    pub fn with_duty_cycle(self, share: f64) -> Result<Self, ArgumentError> {
        let Some(lora) = self.lora else {
            return Err(ArgumentError::new("radio", "without LoRa", "a LoRa radio"));
        };
        let lora = Some(lora.with_duty_cycle(share)?);
        Ok(Self { lora, ..self })
    }
}
