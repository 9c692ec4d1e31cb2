//! Receives what `firmware/cortex-m4` sends through a serial port and compares it with the samples:
//! `serial SAMPLES DELTA < PORT`. Ends with an error if a reconstruction is not within `DELTA`.

use fewbits_adaptive::{Config, Packet, Receiver};
use fewbits_core::{BitString, Message, Observation};
use fewbits_protocol::{Check, Frame, Kind, Slot};
use std::io::Read;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let [_, samples, delta] = &arguments[..] else {
        return Err("serial SAMPLES DELTA < PORT".into());
    };
    let delta: f64 = delta.parse()?;
    let bytes = std::fs::read(samples)?;
    let chunks: Vec<f64> = bytes
        .as_chunks::<8>()
        .0
        .iter()
        .map(|chunk| f64::from_le_bytes(*chunk))
        .collect();
    let mut port = std::io::stdin().lock();
    let mut receiver = Receiver::new(Config::new(delta)?.resilient(4, Some(500))?);
    let (mut reports, mut bits, mut frame_bytes, mut worst, mut slot) = (0, 0, 0, 0.0_f64, 0_u64);
    let mut step = |observation: &Observation<Packet>, slot: &mut u64| -> Result<(), Box<dyn std::error::Error>> {
        let tracked = receiver.receive(observation)?;
        let sample = chunks.get(*slot as usize).ok_or("more slots than samples")?;
        let error = tracked.value.map_or(f64::INFINITY, |value| (value - sample).abs());
        worst = worst.max(error);
        *slot += 1;
        Ok(())
    };
    loop {
        let mut length = [0];
        port.read_exact(&mut length)?;
        if length[0] == 0 {
            break;
        }
        let mut bytes = vec![0; usize::from(length[0])];
        port.read_exact(&mut bytes)?;
        let frame = Frame::decode(&bytes, Check::Whole).map_err(|error| format!("{error:?}"))?;
        if frame.kind != Kind::Report {
            continue;
        }
        // Every slot without a frame is silence.
        while Slot::of_count(slot) != frame.slot {
            step(&Observation::Nothing, &mut slot)?;
        }
        let packet = BitString::from_bytes(frame.payload.bytes().to_vec(), frame.payload.bits())?;
        step(&Observation::Received(Packet::from_bits(&(), &packet)?), &mut slot)?;
        (reports, bits, frame_bytes) = (reports + 1, bits + packet.bits(), frame_bytes + bytes.len());
    }
    let mut slots = [0; 4];
    port.read_exact(&mut slots)?;
    while slot < u64::from(u32::from_le_bytes(slots)) {
        step(&Observation::Nothing, &mut slot)?;
    }
    println!("{slot} slots, {reports} reports, {bits} bits, {frame_bytes} bytes of frames, largest error {worst}");
    if slot as usize != chunks.len() || worst > delta {
        return Err(format!("{slot} of {} slots, largest error {worst} for {delta}", chunks.len()).into());
    }
    Ok(())
}
