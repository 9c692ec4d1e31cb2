//! Measures a frame of the protocol with its check around a report of 13 bits.

#![no_std]
#![no_main]

use fewbits_protocol::{Check, Frame, Kind, Payload, Slot, digest};

fewbits_cortex_m4::measure!(|input| {
    let bytes = (input.code as u16).to_be_bytes();
    let slot = Slot::of_count(u64::from(input.other as u32));
    let mut buffer = [0; 32];
    let frame =
        Payload::new(&bytes, 13).map(|report| Frame::new(Kind::Report, slot, digest(slot, Payload::EMPTY), report));
    let sent = frame.as_ref().and_then(|frame| frame.encode(Check::Whole, &mut buffer));
    sent.map_or(0, |bytes| bytes.iter().map(|byte| u32::from(*byte)).sum())
});
