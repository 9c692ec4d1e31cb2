//! `fewbits receive --sensor`: frames of one sensor that reports by the clock: packets of the adaptive encoder of `fewbits-node`, or words and
//! values as they are.

use crate::Ending;
use crate::arguments::ReceiveOptions;
use crate::bounds::{self, Spec};
use crate::error::Error;
use crate::output::{Cell, Shape, Sheet};
use crate::say::say;
use fewbits_adaptive::{Config, Packet, Receiver};
use fewbits_core::{BitString, Message, Observation};
use fewbits_protocol::{Check, Frame, Kind, Payload, digest};
use fewbits_record::Bound;

/// Largest number of silent slots. A larger jump means that the sensor started again.
const MAX_SILENCE: u64 = 1 << 16;

/// Longest word in bits.
const MAX_WORD: u32 = 32;

/// What the reports of a sensor are.
#[derive(Clone, Copy)]
pub(crate) enum Coding {
    /// Packets of the adaptive encoder. Its refresh interval need not be known: reconstruction begins with the first refresh.
    Adaptive(Config),
    /// Words of so many bits: those of a quantizer, of a pattern, or a bit.
    Word(u32),
    /// Numbers in double precision.
    Value,
}

/// What `--sensor` says: `bit`, `word:3`, `value`, or the bound of an adaptive encoder.
pub(crate) fn coding(text: &str, sequence_bits: u32) -> Result<Coding, Error> {
    match text.strip_prefix("word:").map(str::parse) {
        None if text == "bit" => Ok(Coding::Word(1)),
        None if text == "value" => Ok(Coding::Value),
        None => adaptive(text, sequence_bits).map(Coding::Adaptive),
        Some(Ok(bits @ 1..=MAX_WORD)) => Ok(Coding::Word(bits)),
        Some(_) => Err(Error::option("--sensor", text, "`word:1` to `word:32`")),
    }
}

fn adaptive(bound: &str, sequence_bits: u32) -> Result<Config, Error> {
    const OPTION: &str = "--sensor";
    let expected = "`±0.05`, on a circle `±2@360`; `bit`, `word:1` to `word:32` or `value` for other schemes";
    let refused = || Error::option(OPTION, bound, expected);
    let Ok(Spec {
        bound: Bound::Absolute(delta),
        period,
    }) = bounds::parse_one(bound)
    else {
        return Err(refused());
    };
    let config = Config::new(delta).and_then(|config| config.resilient(sequence_bits, None));
    let config = config.and_then(|config| period.map_or(Ok(config), |period| config.circular(period)));
    config.map_err(Error::refused(OPTION))
}

/// Writes a row `slot,value` per slot, until there are no more frames. From a detected loss to the next refresh there are gaps.
/// The result is a failure if no frame was of such a sensor.
pub(crate) fn receive(
    options: &ReceiveOptions,
    coding: Coding,
    name: &str,
    mut next: impl FnMut() -> std::io::Result<Option<Vec<u8>>>,
) -> Result<Ending, Error> {
    let names = ["slot", "value"].map(str::to_owned).to_vec();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::Csv, names)?;
    let mut sensor = Slots::new(coding);
    let mut understood = false;
    while let Some(bytes) = next().map_err(Error::io(name, "read"))? {
        match sensor.frame(&bytes) {
            Ok(rows) => {
                understood = true;
                for (slot, value) in rows {
                    sheet.write([Cell::Text(slot.to_string()), Cell::Number(value)])?;
                }
                // A row is out as soon as it is known.
                sheet.flush()?;
            }
            Err(reason) => say!("warning: {name}: a frame was refused: {reason}"),
        }
    }
    if !understood {
        return Ok(Ending::no_frame(name));
    }
    sheet.finish().map(|()| Ending::Good)
}

/// Count of a slot, and its value.
type Row = (u64, Option<f64>);

/// Conversion of frames to slots. Frames arrive in order; a slot without a frame was silent if no frame was lost.
struct Slots {
    coding: Coding,
    /// Of the adaptive encoder.
    receiver: Option<Receiver>,
    /// Count of the last known slot.
    last: Option<u64>,
    /// Counter of the next packet if none is lost.
    sequence: Option<u32>,
}

impl Slots {
    fn new(coding: Coding) -> Self {
        Self {
            coding,
            receiver: match coding {
                Coding::Adaptive(config) => Some(Receiver::joining(config)),
                _ => None,
            },
            last: None,
            sequence: None,
        }
    }

    /// The slots that become known by this frame: those since the last frame, and its own. The loss of a report is detected by the counter
    /// of the next one.
    fn frame(&mut self, bytes: &[u8]) -> Result<Vec<Row>, String> {
        let frame = match Frame::decode(bytes, Check::Whole) {
            Ok(frame) => frame,
            Err(error) => {
                // The damaged frame may have been a report.
                self.receive(&Observation::Lost)?;
                return Err(error.to_string());
            }
        };
        if !matches!(frame.kind, Kind::Report | Kind::Heartbeat) {
            return Err(format!("kind is {:?}: expected a report or a heartbeat", frame.kind));
        }
        if frame.digest != digest(frame.slot, Payload::EMPTY) {
            return Err("digest is that of feedback: expected a sensor that reports by the clock".to_owned());
        }
        let count = frame.slot.nearest_count(self.last.unwrap_or(0));
        let silent = match self.last.map(|last| count.checked_sub(last)) {
            // A heartbeat in a slot with a report, or a repeated frame.
            Some(Some(0)) => return Ok(Vec::new()),
            Some(Some(steps)) if steps <= MAX_SILENCE => steps - 1,
            Some(_) => {
                *self = Self::new(self.coding);
                0
            }
            None => 0,
        };
        let mut rows: Vec<Row> = Vec::new();
        for slot in count - silent..count {
            rows.push((slot, self.receive(&Observation::Nothing)?));
        }
        let value = match frame.kind {
            Kind::Heartbeat => self.receive(&Observation::Nothing)?,
            _ => match self.coding {
                Coding::Adaptive(config) => self.report(config, &frame, &mut rows)?,
                Coding::Word(bits) => plain(&frame, bits)?.map(|word| (word >> (64 - bits)) as f64),
                Coding::Value => plain(&frame, u64::BITS)?.map(f64::from_bits),
            },
        };
        rows.push((count, value));
        self.last = Some(count);
        Ok(rows)
    }

    /// The value of a slot with a report. If a packet was lost before it, the values of the slots between are unknown.
    fn report(&mut self, config: Config, frame: &Frame<'_>, rows: &mut [Row]) -> Result<Option<f64>, String> {
        let bits = BitString::from(frame.payload);
        let packet = Packet::from_bits(&(), &bits).map_err(|error| error.to_string())?;
        // A packet begins with its counter, of at most 16 bits, highest bit first.
        let two = |i| u32::from(bits.bytes().get(i).copied().unwrap_or(0));
        let sequence = (two(0) << 8 | two(1)) >> (16 - config.sequence_bits());
        if self.sequence.is_some_and(|expected| expected != sequence) {
            // Any of the slots without a frame may be that of the lost packet.
            rows.iter_mut().for_each(|(_, value)| *value = None);
        }
        self.sequence = Some((sequence + 1) & ((1 << config.sequence_bits()) - 1));
        match self.receive(&Observation::Received(packet)) {
            // No sensor of this configuration sent the packet: the two ends have different configurations.
            Err(reason) => {
                say!("warning: a packet was refused: {reason}");
                self.receive(&Observation::Lost)
            }
            value => value,
        }
    }

    /// Processes one slot. Returns its value if it is known to be within the bound.
    fn receive(&mut self, observation: &Observation<Packet>) -> Result<Option<f64>, String> {
        let Some(receiver) = &mut self.receiver else {
            return Ok(None);
        };
        let tracked = receiver.receive(observation).map_err(|error| error.to_string())?;
        Ok(tracked.value.filter(|_| tracked.synchronised))
    }
}

/// The first bits of a report that has so many, at the upper end; nothing, and a warning, if it has another number of them.
fn plain(frame: &Frame<'_>, bits: u32) -> Result<Option<u64>, String> {
    let found = frame.payload.bits();
    if found != bits as usize {
        say!("warning: a report was refused: it has {found} bits, `--sensor` says {bits}");
        return Ok(None);
    }
    let mut bytes = [0; 8];
    bytes
        .iter_mut()
        .zip(frame.payload.bytes())
        .for_each(|(to, from)| *to = *from);
    Ok(Some(u64::from_be_bytes(bytes)))
}
