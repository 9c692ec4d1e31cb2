//! Any bits are a mixture or an error, and a mixture is written as the bits that it was read from.

#![no_main]

use fewbits_core::{BitString, Message};
use fewbits_mixture_codec::wire::{CodedMixture, WireFormat};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(format) = WireFormat::<2>::around_origin(1.0, 0.25) else {
        return;
    };
    let Ok(bits) = BitString::from_bytes(bytes.to_vec(), 8 * bytes.len()) else {
        return;
    };
    if let Ok(mixture) = CodedMixture::from_bits(&format, &bits) {
        assert!(mixture.to_bits(&format).is_ok_and(|again| again == bits));
    }
});
