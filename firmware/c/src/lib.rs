//! The C interface of `fewbits-node`; `fewbits.h` documents it. All pointers may be null: the call is then refused.

#![no_std]

use core::panic::PanicInfo;
use core::slice;
use fewbits_node::adaptive::{Config, Encoder};
use fewbits_node::{
    Error, Sample, cell_of, censor, innovation_cell, innovation_cell_of_codes, range_level, range_level_of_codes,
    sign_bit, trigger,
};
use fewbits_protocol::{Check, Frame, Kind, Payload, Slot, digest};

unsafe extern "C" {
    /// Defined nowhere: a program in which a panic can be reached does not link.
    fn fewbits_a_panic_can_be_reached() -> !;
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    // SAFETY: never called; the linker refuses the program where it could be.
    unsafe { fewbits_a_panic_can_be_reached() }
}

/// `FEWBITS_REFUSED`.
const REFUSED: i32 = -1;

fn truth(value: Result<bool, Error>) -> i32 {
    value.map_or(REFUSED, i32::from)
}

fn index(value: Result<usize, Error>) -> i32 {
    value
        .ok()
        .and_then(|value| i32::try_from(value).ok())
        .unwrap_or(REFUSED)
}

/// # Safety
/// `start` is null or points to `count` numbers.
unsafe fn numbers<'a, T>(start: *const T, count: usize) -> Option<&'a [T]> {
    if start.is_null() || count > 1 << 16 {
        return None;
    }
    // SAFETY: the caller's promise.
    Some(unsafe { slice::from_raw_parts(start, count) })
}

/// # Safety
/// As [`numbers`].
unsafe fn cell<T: Sample>(thresholds: *const T, count: usize, sample: T) -> i32 {
    // SAFETY: the caller's promise.
    match unsafe { numbers(thresholds, count) } {
        Some(thresholds) => index(cell_of(thresholds, sample)),
        None => REFUSED,
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_sign_bit_f64(sample: f64, threshold: f64) -> i32 {
    truth(sign_bit(sample, threshold))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_sign_bit_f32(sample: f32, threshold: f32) -> i32 {
    truth(sign_bit(sample, threshold))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_sign_bit_i32(sample: i32, threshold: i32) -> i32 {
    truth(sign_bit(sample, threshold))
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_cell_f64(thresholds: *const f64, count: usize, sample: f64) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { cell(thresholds, count, sample) }
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_cell_f32(thresholds: *const f32, count: usize, sample: f32) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { cell(thresholds, count, sample) }
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_cell_u16(thresholds: *const u16, count: usize, sample: u16) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { cell(thresholds, count, sample) }
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_cell_i32(thresholds: *const i32, count: usize, sample: i32) -> i32 {
    // SAFETY: the caller's promise.
    unsafe { cell(thresholds, count, sample) }
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_innovation_cell_f64(
    thresholds: *const f64,
    count: usize,
    sample: f64,
    mean: f64,
    deviation: f64,
) -> i32 {
    // SAFETY: the caller's promise.
    match unsafe { numbers(thresholds, count) } {
        Some(thresholds) => index(innovation_cell(thresholds, sample, mean, deviation)),
        None => REFUSED,
    }
}

/// # Safety
/// `thresholds` is null or points to `count` numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_innovation_cell_i32(
    thresholds: *const i32,
    count: usize,
    sample: i32,
    mean: i32,
    deviation: u32,
) -> i32 {
    // SAFETY: the caller's promise.
    match unsafe { numbers(thresholds, count) } {
        Some(thresholds) => index(Ok(innovation_cell_of_codes(thresholds, sample, mean, deviation))),
        None => REFUSED,
    }
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_range_level_f64(range: f64, centre: f64, half_width: f64, levels: u32) -> i32 {
    index(range_level(range, centre, half_width, levels).map(|level| level as usize))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_range_level_i32(range: i32, centre: i32, half_width: u32, levels: u16) -> i32 {
    index(Ok(range_level_of_codes(range, centre, half_width, levels) as usize))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_censor_f64(sample: f64, prediction: f64, half_width: f64) -> i32 {
    truth(censor::speaks(sample, prediction, half_width))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_censor_i32(sample: i32, prediction: i32, half_width: u32) -> i32 {
    i32::from(censor::speaks_of_codes(sample, prediction, half_width))
}

/// # Safety
/// `row` is null or points to two numbers, `covariance` to four.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_censor_half_width_2(
    row: *const [f64; 2],
    covariance: *const [[f64; 2]; 2],
    noise_variance: f64,
    threshold: f64,
) -> f64 {
    // SAFETY: the caller's promise.
    match unsafe { (row.as_ref(), covariance.as_ref()) } {
        (Some(row), Some(covariance)) => {
            censor::half_width(row, covariance, noise_variance, threshold).unwrap_or(f64::NAN)
        }
        _ => f64::NAN,
    }
}

/// `fewbits_own_filter_2`.
#[repr(C)]
pub struct OwnFilter2 {
    transition: [[f64; 2]; 2],
    row: [f64; 2],
    estimate: [f64; 2],
}

/// # Safety
/// `filter` is null or points to a filter, `gain` to two numbers.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_own_filter_2_speaks(
    filter: *mut OwnFilter2,
    sample: f64,
    gain: *const [f64; 2],
    half_width: f64,
) -> i32 {
    // SAFETY: the caller's promise.
    let (Some(filter), Some(gain)) = (unsafe { (filter.as_mut(), gain.as_ref()) }) else {
        return REFUSED;
    };
    let own = censor::OwnFilter::new(filter.transition, filter.row, filter.estimate);
    truth(own.and_then(|mut own| {
        let report = own.speaks(sample, gain, half_width)?;
        filter.estimate = *own.estimate();
        Ok(report)
    }))
}

#[unsafe(no_mangle)]
pub extern "C" fn fewbits_trigger(sample: f64, prediction: f64, precision: f64, uniform: f64) -> i32 {
    truth(trigger::speaks(sample, prediction, precision, uniform))
}

/// Words of `fewbits_encoder`.
const ENCODER_WORDS: usize = 472;
const _: () = assert!(size_of::<Encoder>() <= 8 * ENCODER_WORDS && align_of::<Encoder>() <= 8);

/// # Safety
/// `encoder` is null or points to a `fewbits_encoder`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_encoder_init(
    encoder: *mut Encoder,
    delta: f64,
    period: f64,
    sequence_bits: u32,
    refresh_every: u32,
) -> i32 {
    let make = || {
        let mut config = Config::new(delta)?;
        if period != 0.0 {
            config = config.circular(period)?;
        }
        if sequence_bits != 0 {
            let every = (refresh_every != 0).then_some(u64::from(refresh_every));
            config = config.resilient(sequence_bits, every)?;
        }
        Ok::<_, Error>(config)
    };
    match make() {
        Ok(config) if !encoder.is_null() => {
            // SAFETY: the caller's promise; what was there before needs no care.
            unsafe { encoder.write(Encoder::new(config)) };
            0
        }
        _ => REFUSED,
    }
}

/// # Safety
/// `encoder` is null or was initialised, `bytes` is null or points to 16 bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_encoder_encode(
    encoder: *mut Encoder,
    elapsed: u32,
    sample: f64,
    bytes: *mut [u8; 16],
) -> i32 {
    // SAFETY: the caller's promise.
    let (Some(encoder), Some(bytes)) = (unsafe { (encoder.as_mut(), bytes.as_mut()) }) else {
        return REFUSED;
    };
    match encoder.encode_after(elapsed, sample) {
        Ok(Some(report)) => {
            *bytes = report.packet.to_bytes();
            report.packet.bits() as i32
        }
        Ok(None) => 0,
        Err(_) => REFUSED,
    }
}

/// # Safety
/// `encoder` is null or was initialised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_encoder_request_refresh(encoder: *mut Encoder) {
    // SAFETY: the caller's promise.
    if let Some(encoder) = unsafe { encoder.as_mut() } {
        encoder.request_refresh();
    }
}

/// # Safety
/// `encoder` is null or was initialised.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_encoder_reconstruction(encoder: *const Encoder) -> f64 {
    // SAFETY: the caller's promise.
    unsafe { encoder.as_ref() }
        .and_then(Encoder::reconstruction)
        .unwrap_or(f64::NAN)
}

/// # Safety
/// `start` is null, with `bits` 0, or points to the bytes of `bits` bits.
unsafe fn payload<'a>(start: *const u8, bits: usize) -> Option<Payload<'a>> {
    if bits == 0 {
        return Some(Payload::EMPTY);
    }
    // SAFETY: the caller's promise.
    Payload::new(unsafe { numbers(start, bits.div_ceil(8)) }?, bits)
}

/// # Safety
/// As [`payload`]; `sum` is null or points to a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_frame_digest(slot: u32, start: *const u8, bits: usize, sum: *mut u32) -> i32 {
    // SAFETY: the caller's promise.
    let (Some(payload), Some(sum)) = (unsafe { (payload(start, bits), sum.as_mut()) }) else {
        return REFUSED;
    };
    *sum = digest(Slot::of_count(u64::from(slot)), payload);
    0
}

/// `fewbits_frame`.
#[repr(C)]
pub struct CFrame {
    kind: u32,
    slot: u32,
    digest: u32,
    payload: *const u8,
    bits: usize,
}

/// # Safety
/// `frame` is null or points to a frame whose payload is as for [`payload`], `bytes` is null or points to `room` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_frame_write(frame: *const CFrame, bytes: *mut u8, room: usize) -> i32 {
    // SAFETY: the caller's promise.
    let Some(frame) = (unsafe { frame.as_ref() }) else {
        return REFUSED;
    };
    let kind = match frame.kind {
        0 => Kind::Feedback,
        1 => Kind::Report,
        4 => Kind::Request,
        6 => Kind::Heartbeat,
        7 => Kind::Acknowledgement,
        _ => return REFUSED,
    };
    // SAFETY: the caller's promise.
    let Some(payload) = (unsafe { payload(frame.payload, frame.bits) }) else {
        return REFUSED;
    };
    if bytes.is_null() || room > 1 << 16 {
        return REFUSED;
    }
    // SAFETY: the caller's promise.
    let buffer = unsafe { slice::from_raw_parts_mut(bytes, room) };
    let frame = Frame::new(kind, Slot::of_count(u64::from(frame.slot)), frame.digest, payload);
    frame
        .encode(Check::Whole, buffer)
        .map_or(REFUSED, |written| written.len() as i32)
}

/// # Safety
/// `bytes` is null or points to `count` bytes, `frame` is null or points to a frame.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn fewbits_frame_read(bytes: *const u8, count: usize, frame: *mut CFrame) -> i32 {
    // SAFETY: the caller's promise.
    let (Some(bytes), Some(frame)) = (unsafe { (numbers(bytes, count), frame.as_mut()) }) else {
        return REFUSED;
    };
    let Ok(found) = Frame::decode(bytes, Check::Whole) else {
        return REFUSED;
    };
    *frame = CFrame {
        kind: found.kind as u32,
        slot: found.slot.number(),
        digest: found.digest,
        payload: found.payload.bytes().as_ptr(),
        bits: found.payload.bits(),
    };
    0
}
