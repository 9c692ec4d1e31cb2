//! A sensor: reads samples (doubles, little-endian) from the host's file `samples.bin`, one per slot, encodes them within `DELTA` and sends
//! what there is to say in frames of `fewbits-protocol` through the serial port, as `fewbits receive --sensor ±0.05` reads them. After
//! `HEARTBEAT` silent slots, and in the last slot, a heartbeat says that the sensor works.

#![no_std]
#![no_main]

use core::mem::MaybeUninit;
use core::num::NonZeroU64;
use fewbits_cortex_m4::{exit, open, read_eight, serial_begin, serial_frame};
use fewbits_node::adaptive::{Config, Encoder};
use fewbits_protocol::{
    Check, Feedback, Frame, Kind, Payload, Schedule, Sensor, SensorSettings, SensorTimer, Task, digest,
};

/// Every reconstruction is within this of its sample; the receiver is told the same.
const DELTA: f64 = 0.05;
/// Silent slots up to a heartbeat.
const HEARTBEAT: u32 = 100;
/// A slot, in nanoseconds.
const PERIOD: NonZeroU64 = NonZeroU64::MIN.saturating_add(999_999);

static mut ENCODER: MaybeUninit<Encoder> = MaybeUninit::uninit();

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    serial_begin();
    let config = Config::new(DELTA).and_then(|config| config.resilient(4, Some(500)));
    let (Ok(config), Some(samples)) = (config, open(b"samples.bin\0")) else {
        exit(false)
    };
    // SAFETY: nothing else touches it.
    let encoder = unsafe {
        (&raw mut ENCODER).cast::<Encoder>().write(Encoder::new(config));
        &mut *(&raw mut ENCODER).cast::<Encoder>()
    };
    let mut settings = SensorSettings::new(Feedback::Clock);
    settings.schedule = Some(Schedule::new(PERIOD));
    settings.heartbeat_after = HEARTBEAT;
    let mut sensor = Sensor::new(settings);
    let (mut now, mut last) = (0_u64, None);
    while let Some(bytes) = read_eight(samples) {
        if let Task::Sample { slot, .. } = sensor.on_timer(now, SensorTimer::SlotBegins).task {
            let Ok(report) = encoder.encode(f64::from_le_bytes(bytes)) else {
                exit(false)
            };
            let packet = report.map(|report| report.packet);
            let data = packet.map(|packet| (packet.to_bytes(), packet));
            let payload = data
                .as_ref()
                .and_then(|(bytes, packet)| Payload::new(bytes.get(..packet.byte_count())?, packet.bits() as usize));
            if let Task::Send(frame) = sensor.on_sample(now, payload).task {
                send(frame);
            }
            last = Some(slot);
        }
        now += PERIOD.get();
    }
    if let Some(slot) = last {
        send(Frame::new(Kind::Heartbeat, slot, digest(slot, Payload::EMPTY), Payload::EMPTY));
    }
    exit(true)
}

fn send(frame: Frame<'_>) {
    let mut buffer = [0; 32];
    if let Some(bytes) = frame.encode(Check::Whole, &mut buffer) {
        serial_frame(bytes);
    }
}
