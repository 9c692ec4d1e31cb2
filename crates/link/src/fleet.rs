//! Keys of many sensors from one secret.

use crate::envelope::Key;
use crate::error::Error;
use fewbits_numerics::error::refuse;
use hkdf::Hkdf;
use sha2::Sha256;
use std::fmt;

const SALT: &[u8] = b"fewbits fleet";
const PURPOSE: &[u8] = b"fewbits sensor";
const KEY_BYTES: usize = 32;

/// The secret of a fleet, from which the key of each sensor follows. It stays at the centre: a sensor gets its own key only, and from that
/// follows neither the secret nor another sensor's key.
///
/// Key of sensor `n` in version `v`: HKDF-SHA256 (RFC 5869) of the secret, salt `fewbits fleet`, info `fewbits sensor`, `n` and `v` as 32-bit
/// big-endian numbers. A sensor whose key or state was lost gets the next version. `Debug` does not print the secret.
#[derive(Clone)]
pub struct FleetKey(Hkdf<Sha256>);

impl fmt::Debug for FleetKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("FleetKey")
    }
}

impl FleetKey {
    /// A secret of 32 bytes or more from a random source.
    ///
    /// # Errors
    /// If there are fewer than 32 bytes.
    pub fn new(bytes: &[u8]) -> Result<Self, Error> {
        if bytes.len() < KEY_BYTES {
            return refuse("fleet key", format!("{} bytes", bytes.len()), format!("{KEY_BYTES} bytes or more"));
        }
        Ok(Self(Hkdf::new(Some(SALT), bytes)))
    }

    /// The secret written as hexadecimal digits; spaces are ignored.
    ///
    /// # Errors
    /// As [`Key::from_hex`].
    pub fn from_hex(text: &str) -> Result<Self, Error> {
        Self::new(&crate::envelope::bytes_of_hex(text)?)
    }

    /// The key of a sensor as 64 hexadecimal digits, for its configuration.
    ///
    /// # Errors
    /// Never for keys of this length; the type is that of the derivation.
    pub fn hex_of(&self, sensor: u32, version: u32) -> Result<String, Error> {
        let bytes = self.bytes_of(sensor, version)?;
        Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
    }

    /// The key of a sensor.
    ///
    /// # Errors
    /// As [`hex_of`](Self::hex_of).
    pub fn key_of(&self, sensor: u32, version: u32) -> Result<Key, Error> {
        Key::new(&self.bytes_of(sensor, version)?)
    }

    fn bytes_of(&self, sensor: u32, version: u32) -> Result<[u8; KEY_BYTES], Error> {
        let mut key = [0; KEY_BYTES];
        let info = [PURPOSE, &sensor.to_be_bytes(), &version.to_be_bytes()];
        match self.0.expand_multi_info(&info, &mut key) {
            Ok(()) => Ok(key),
            Err(_) => refuse("key length", KEY_BYTES, "at most 8160"),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn keys_are_those_of_the_rfc() {
        let fleet = FleetKey::new(&[7; 32]).unwrap();
        // Computed with Python's hmac by the formulas of RFC 5869, section 2.
        let expected = "c159b9682f36f3dc271c96f13e0b59c4822b6ae2562aba2a9ab9a51e108764e6";
        assert_eq!(fleet.hex_of(3, 1).unwrap(), expected);
        let others = [(3, 2), (4, 1), (1, 3)].map(|(sensor, version)| fleet.hex_of(sensor, version).unwrap());
        assert!(others.iter().all(|other| other != expected) && others[0] != others[1] && others[1] != others[2]);
        let key = FleetKey::from_hex(&"07".repeat(32)).unwrap().key_of(3, 1).unwrap();
        assert_eq!(key.fingerprint(), Key::from_hex(expected).unwrap().fingerprint());
        assert!(FleetKey::new(&[7; 31]).is_err() && FleetKey::from_hex("7").is_err());
    }
}
