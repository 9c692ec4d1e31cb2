//! Cayenne's low-power payload (LPP), as many LoRaWAN devices send it: channel, type, and a fixed number of bytes for each reading.
//!
//! Beside the types of Cayenne's own description those that devices' libraries added are read, with the sizes and steps of the Arduino
//! library `CayenneLPP` (types follow from IPSO's objects: 3318, frequency, is 118). A list of positions (240) has no fixed length and is
//! refused.

use crate::error::Error;
use fewbits_numerics::error::refuse;

/// Types: number, name, unit, and per value its bytes, whether it is signed, and its step.
const TYPES: [(u8, &str, &str, usize, &[Part]); 26] = [
    (0, "digital_in", "", 1, &[(1, false, 1.0)]),
    (1, "digital_out", "", 1, &[(1, false, 1.0)]),
    (2, "analog_in", "", 2, &[(2, true, 0.01)]),
    (3, "analog_out", "", 2, &[(2, true, 0.01)]),
    (100, "generic", "", 4, &[(4, false, 1.0)]),
    (101, "illuminance", "lx", 2, &[(2, false, 1.0)]),
    (102, "presence", "", 1, &[(1, false, 1.0)]),
    (103, "temperature", "°C", 2, &[(2, true, 0.1)]),
    (104, "humidity", "%", 1, &[(1, false, 0.5)]),
    (113, "accelerometer", "g", 6, &[(2, true, 0.001); 3]),
    (115, "barometer", "hPa", 2, &[(2, false, 0.1)]),
    (116, "voltage", "V", 2, &[(2, false, 0.01)]),
    (117, "current", "A", 2, &[(2, false, 0.001)]),
    (118, "frequency", "Hz", 4, &[(4, false, 1.0)]),
    (120, "percentage", "%", 1, &[(1, false, 1.0)]),
    (121, "altitude", "m", 2, &[(2, true, 1.0)]),
    (125, "concentration", "ppm", 2, &[(2, false, 1.0)]),
    (128, "power", "W", 2, &[(2, false, 1.0)]),
    (130, "distance", "m", 4, &[(4, false, 0.001)]),
    (131, "energy", "kWh", 4, &[(4, false, 0.001)]),
    (132, "direction", "°", 2, &[(2, false, 1.0)]),
    (133, "time", "s", 4, &[(4, false, 1.0)]),
    (134, "gyrometer", "°/s", 6, &[(2, true, 0.01); 3]),
    (135, "colour", "", 3, &[(1, false, 1.0); 3]),
    (136, "gps", "", 9, &[(3, true, 1e-4), (3, true, 1e-4), (3, true, 0.01)]),
    (142, "switch", "", 1, &[(1, false, 1.0)]),
];

type Part = (usize, bool, f64);

/// One reading.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    /// Channel of the device.
    pub channel: u8,
    /// Name of the type, as `temperature`.
    pub kind: &'static str,
    /// Unit; empty if the type has none or several.
    pub unit: &'static str,
    /// One value; three for accelerometers (x, y, z), gyrometers (the same), colours (red, green, blue) and positions (latitude, longitude in degrees, altitude in m).
    pub values: Vec<f64>,
}

/// The readings of a payload, in its order.
///
/// # Errors
/// If a type is unknown, since its length is then unknown too, or the payload ends within a reading.
pub fn readings(payload: &[u8]) -> Result<Vec<Reading>, Error> {
    let (mut rest, mut readings) = (payload, Vec::new());
    while let [channel, kind, data @ ..] = rest {
        let Some((_, name, unit, length, parts)) = TYPES.iter().find(|(number, ..)| number == kind) else {
            return refuse(
                "type of a reading",
                kind,
                "a type of Cayenne LPP of known length: 0 to 3, 100 to 104, 113, 115 to 118, 120, 121, 125, 128, 130 to 136 or 142",
            );
        };
        let Some((data, after)) = data.split_at_checked(*length) else {
            return refuse("payload", format!("{} bytes of a {name}", data.len()), format!("{length} bytes"));
        };
        readings.push(Reading {
            channel: *channel,
            kind: name,
            unit,
            values: values(data, parts),
        });
        rest = after;
    }
    if !rest.is_empty() {
        return refuse("payload", "one byte at its end", "channel, type and data of each reading");
    }
    Ok(readings)
}

fn values(mut data: &[u8], parts: &[Part]) -> Vec<f64> {
    let mut values = Vec::with_capacity(parts.len());
    for (bytes, is_signed, step) in parts {
        let (own, rest) = data.split_at(*bytes);
        data = rest;
        let number = own.iter().fold(0_i64, |number, byte| number << 8 | i64::from(*byte));
        let bits = 8 * *bytes as u32;
        let number = if *is_signed && number >> (bits - 1) == 1 {
            number - (1 << bits)
        } else {
            number
        };
        // Divided by a whole number, so that 272 tenths are the double nearest to 27.2.
        values.push(number as f64 / (1.0 / step).round());
    }
    values
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    /// The examples of the published description (developers.mydevices.com, "Cayenne LPP").
    #[test]
    fn published_examples() {
        let two = readings(&[0x03, 0x67, 0x01, 0x10, 0x05, 0x67, 0x00, 0xff]).unwrap();
        assert_eq!(
            (two[0].channel, &two[0].values[..], two[1].channel, &two[1].values[..]),
            (3, &[27.2][..], 5, &[25.5][..])
        );
        assert_eq!(readings(&[0x01, 0x67, 0xff, 0xd7]).unwrap()[0].values, [-4.1]);
        let moved = readings(&[0x06, 0x71, 0x04, 0xd2, 0xfb, 0x2e, 0x00, 0x00]).unwrap();
        assert_eq!(moved[0].values, [1.234, -1.234, 0.0]);
        let place = readings(&[0x01, 0x88, 0x06, 0x76, 0x5f, 0xf2, 0x96, 0x0a, 0x00, 0x03, 0xe8]).unwrap();
        assert_eq!(place[0].values, [42.3519, -87.9094, 10.0]);
    }

    /// Defect: power (128) was read as a frequency of four bytes, and what libraries added was refused.
    #[test]
    fn types_of_libraries_are_read() {
        let payload = [
            [1, 116, 0x01, 0x4a].as_slice(),
            &[2, 128, 0xff, 0xfe],
            &[3, 121, 0xff, 0xfe],
            &[4, 118, 0x00, 0x01, 0x00, 0x01],
            &[5, 130, 0x00, 0x00, 0x04, 0xd2],
            &[6, 142, 1],
            &[7, 135, 255, 0, 128],
            &[8, 120, 93],
        ]
        .concat();
        let found = readings(&payload).unwrap();
        let all: Vec<_> = found
            .iter()
            .map(|r| (r.channel, r.kind, r.unit, &r.values[..]))
            .collect();
        assert_eq!(
            all,
            [
                (1, "voltage", "V", &[3.3][..]),
                (2, "power", "W", &[65534.0]),
                (3, "altitude", "m", &[-2.0]),
                (4, "frequency", "Hz", &[65537.0]),
                (5, "distance", "m", &[1.234]),
                (6, "switch", "", &[1.0]),
                (7, "colour", "", &[255.0, 0.0, 128.0]),
                (8, "percentage", "%", &[93.0]),
            ]
        );
        assert!(
            TYPES
                .iter()
                .all(|(.., length, parts)| *length == parts.iter().map(|part| part.0).sum::<usize>())
        );
        assert!(TYPES.is_sorted_by_key(|one| one.0) && readings(&[1, 240, 8, 0, 0, 0, 0, 0, 0, 0]).is_err());
    }

    #[test]
    fn any_bytes_are_read_or_refused() {
        for kind in 0..=255_u8 {
            for length in 0..16 {
                let payload: Vec<u8> = [vec![1, kind], vec![0xff; length]].concat();
                if let Ok(readings) = readings(&payload) {
                    assert!(!readings.is_empty() && readings.iter().flat_map(|r| &r.values).all(|v| v.is_finite()));
                }
            }
        }
        assert!(readings(&[]).unwrap().is_empty());
        assert!(readings(&[1]).is_err() && readings(&[1, 103, 0]).is_err() && readings(&[1, 99, 0, 0]).is_err());
    }
}
