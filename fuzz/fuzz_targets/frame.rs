//! Any bytes are a frame or an error, and a frame is written as the bytes that it was read from.

#![no_main]

use fewbits_protocol::{Check, Frame};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _ = Frame::decode(bytes, Check::Whole);
    // No fuzzer guesses a checksum.
    let sum = crc::Crc::<u16>::new(&crc::CRC_16_XMODEM).checksum(bytes);
    let bytes = [bytes, &sum.to_be_bytes()].concat();
    if let Ok(frame) = Frame::decode(&bytes, Check::Whole) {
        let mut buffer = vec![0; frame.len()];
        assert_eq!(frame.encode(Check::Whole, &mut buffer), Some(bytes.as_slice()));
    }
});
