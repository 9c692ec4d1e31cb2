//! Any bytes are samples or an error, as a block and as a stream of words.

#![no_main]

use fewbits_adaptive::{Config, Receiver, Silence, StreamReader};
use fewbits_block_codec::BlockCodec;
use fewbits_block_codec::bytes::Bytes;

/// Slots that are read at most: a word may stand for many silent ones.
const MAX_SLOTS: usize = 2000;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(config) = Config::new(0.1) else {
        return;
    };
    let [rows, block @ ..] = bytes else {
        return;
    };
    let rows = 4 * usize::from(*rows);
    let Ok(within) = BlockCodec::new(0.1) else {
        return;
    };
    for codec in [within, BlockCodec::lossless()] {
        if let Ok(samples) = codec.decode(block, rows) {
            assert_eq!(samples.len(), rows);
        }
        let mut fields = Bytes(block);
        if let Ok(start) = codec.code_start(&mut fields, None)
            && let Ok(samples) = codec.decode_from(&start, fields.0, rows, &[])
        {
            assert_eq!(samples.len(), rows);
        }
    }
    let words: Vec<u32> = block.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect();
    if let Ok(mut stream) = StreamReader::new(&words, Silence::Coded) {
        let mut receiver = Receiver::new(config);
        for _ in 0..MAX_SLOTS {
            match receiver.read_after(1, &mut stream) {
                Ok(sample) => assert!(sample.is_finite()),
                Err(_) => break,
            }
        }
    }
});
