//! Encoding of what a centre received in a slot, for the sensors that follow its filter.

use fewbits_core::{BitReader, BitString, BitWriter, CodecError, Observation};
use serde::{Deserialize, Serialize};

/// Bits of a report's length in an echo, for [`ReportLength::Varying`].
const LENGTH_BITS: u32 = 16;

/// Length of a sensor's reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ReportLength {
    /// All reports have this many bits.
    Fixed(u32),
    /// Each report has its own length, up to 65,535 bits. In an echo the length stands before the report.
    Varying,
}

impl ReportLength {
    /// Whether a report may have this many bits.
    pub(crate) fn allows(self, bits: usize) -> bool {
        match self {
            Self::Fixed(expected) => bits == expected as usize,
            Self::Varying => bits < 1 << LENGTH_BITS,
        }
    }
}

/// The echo of a slot: for each sensor `0` for nothing, `100` for lost, `101` for no observation, `11` and the report.
///
/// # Errors
/// If a report has more than 65,535 bits.
pub fn echo(observed: &[Option<Observation<BitString>>], lengths: &[ReportLength]) -> Result<BitString, CodecError> {
    let mut writer = BitWriter::new();
    for (observation, length) in observed.iter().zip(lengths) {
        match observation {
            Some(Observation::Nothing) => writer.write(0, 1)?,
            Some(Observation::Lost) => writer.write(0b100, 3)?,
            None => writer.write(0b101, 3)?,
            Some(Observation::Received(report)) => {
                writer.write(0b11, 2)?;
                if *length == ReportLength::Varying {
                    writer.write(report.bits() as u64, LENGTH_BITS)?;
                }
                writer.append(report);
            }
        }
    }
    Ok(writer.finish())
}

/// Reads what [`echo`] wrote: one item per length. Any bits give items or an error.
///
/// # Errors
/// If bits are missing or left over.
pub fn reports_of(
    echo: &BitString,
    lengths: &[ReportLength],
) -> Result<Vec<Option<Observation<BitString>>>, CodecError> {
    let mut reader = BitReader::new(echo);
    let mut observed = Vec::with_capacity(lengths.len());
    for length in lengths {
        // Prefix code: 0 nothing arrived, 11 and a report, 100 known to be lost, 101 no observation.
        observed.push(if reader.read(1)? == 0 {
            Some(Observation::Nothing)
        } else if reader.read(1)? == 0 {
            (reader.read(1)? == 0).then_some(Observation::Lost)
        } else {
            let bits = match length {
                ReportLength::Fixed(bits) => *bits as usize,
                ReportLength::Varying => reader.read(LENGTH_BITS)? as usize,
            };
            Some(Observation::Received(reader.read_message(bits)?))
        });
    }
    reader.finish()?;
    Ok(observed)
}
