//! `fewbits receive --sensor`: frames of one sensor that runs the adaptive encoder of `fewbits-node` and reports by the clock.

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

/// The configuration of the sensor. Its refresh interval need not be known: reconstruction begins with the first refresh.
pub(crate) fn config(bound: &str, sequence_bits: u32) -> Result<Config, Error> {
    const OPTION: &str = "--sensor";
    let refused = || Error::option(OPTION, bound, "`±0.05`, on a circle `±2@360`");
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
    config: Config,
    name: &str,
    mut next: impl FnMut() -> std::io::Result<Option<Vec<u8>>>,
) -> Result<Ending, Error> {
    let names = ["slot", "value"].map(str::to_owned).to_vec();
    let mut sheet = Sheet::new(options.output.as_deref(), Shape::Csv, names)?;
    let mut sensor = Slots::new(config);
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
    config: Config,
    receiver: Receiver,
    /// Count of the last known slot.
    last: Option<u64>,
    /// Counter of the next packet if none is lost.
    sequence: Option<u32>,
}

impl Slots {
    fn new(config: Config) -> Self {
        Self {
            config,
            receiver: Receiver::joining(config),
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
                *self = Self::new(self.config);
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
            _ => self.report(&frame, &mut rows)?,
        };
        rows.push((count, value));
        self.last = Some(count);
        Ok(rows)
    }

    /// The value of a slot with a report. If a packet was lost before it, the values of the slots between are unknown.
    fn report(&mut self, frame: &Frame<'_>, rows: &mut [Row]) -> Result<Option<f64>, String> {
        let bits = BitString::from(frame.payload);
        let packet = Packet::from_bits(&(), &bits).map_err(|error| error.to_string())?;
        // A packet begins with its counter, of at most 16 bits, highest bit first.
        let two = |i| u32::from(bits.bytes().get(i).copied().unwrap_or(0));
        let sequence = (two(0) << 8 | two(1)) >> (16 - self.config.sequence_bits());
        if self.sequence.is_some_and(|expected| expected != sequence) {
            // Any of the slots without a frame may be that of the lost packet.
            rows.iter_mut().for_each(|(_, value)| *value = None);
        }
        self.sequence = Some((sequence + 1) & ((1 << self.config.sequence_bits()) - 1));
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
        let tracked = self.receiver.receive(observation).map_err(|error| error.to_string())?;
        Ok(tracked.value.filter(|_| tracked.synchronised))
    }
}
