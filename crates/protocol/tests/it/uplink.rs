//! The decoder for LoRaWAN servers, in Node, against frames of this crate. Says so and passes where Node is missing.

use fewbits_protocol::{Check, Frame, Kind, Payload, Slot};
use std::fmt::Write as _;
use std::io::Write as _;
use std::process::{Command, Stdio};

const FRAMES: usize = 100_000;
/// Reads a frame in hexadecimal from each line and writes what the decoder returns.
const PROGRAM: &str = "const { decodeUplink } = require(process.argv[1]);
    const lines = require('fs').readFileSync(0, 'utf8').split('\\n').filter((line) => line.length > 0);
    console.log(lines.map((line) => JSON.stringify(decodeUplink({ bytes: [...Buffer.from(line.slice(1), 'hex')], fPort: 1 }))).join('\\n'));";

fn hex(bytes: &[u8]) -> String {
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}");
        text
    })
}

const KINDS: [Kind; 8] = [
    Kind::Feedback,
    Kind::Report,
    Kind::Echo,
    Kind::Snapshot,
    Kind::Request,
    Kind::Handover,
    Kind::Heartbeat,
    Kind::Acknowledgement,
];

/// What the decoder must return, but for the value.
fn expected(bytes: &[u8]) -> serde_json::Value {
    let Ok(frame) = Frame::decode(bytes, Check::Whole) else {
        return serde_json::Value::Null;
    };
    let (bits, payload) = (frame.payload.bits(), frame.payload.bytes());
    let mut data = serde_json::json!({
        "kind": format!("{:?}", frame.kind).to_lowercase(),
        "slot": frame.slot.number(),
        "digest": format!("{:08x}", frame.digest),
        "bits": bits,
        "payload": hex(payload),
    });
    if (1..=32).contains(&bits) {
        let word = payload.iter().fold(0_u64, |word, byte| word << 8 | u64::from(*byte));
        data["word"] = (word >> (8 * payload.len() - bits)).into();
    }
    data
}

/// The value of a payload of 64 bits, if it is a finite number.
fn value(bytes: &[u8]) -> Option<f64> {
    let frame = Frame::decode(bytes, Check::Whole).ok()?;
    let value = f64::from_be_bytes(frame.payload.bytes().try_into().ok()?);
    (frame.payload.bits() == 64 && value.is_finite()).then_some(value)
}

#[test]
fn lorawan_decoder_agrees_on_frames_of_all_kinds() {
    let mut state = 5_u64;
    let mut random = move |below: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below
    };
    // The example of docs/wire.md, and the longest frame of LoRaWAN at the slowest rates.
    let mut frames = vec![
        vec![0x4c, 1, 2, 3, 0xde, 0xad, 0xbe, 0xef, 0xb0, 0x6a, 0x0a],
        Vec::new(),
    ];
    while frames.len() < FRAMES {
        let length = if random(4) == 0 { 8 } else { random(42) };
        let mut content: Vec<u8> = (0..length).map(|_| random(256) as u8).collect();
        let bits = 8 * length - if length > 0 { random(8) } else { 0 };
        if let Some(last) = content.last_mut() {
            *last &= 0xff << (8 * length - bits);
        }
        let payload = Payload::new(&content, bits).unwrap();
        let kind = KINDS[random(8)];
        let mut frame = Frame::new(kind, Slot::of_count(random(1 << 25) as u64), random(1 << 31) as u32, payload);
        frame.destination = if kind == Kind::Handover {
            random(1 << 31) as u32
        } else {
            0
        };
        let mut bytes = frame.to_bytes(Check::Whole);
        match random(10) {
            0 => bytes.truncate(random(bytes.len())),
            1 => {
                let at = random(bytes.len());
                bytes[at] ^= 1 << random(8);
            }
            _ => {}
        }
        frames.push(bytes);
    }
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/lorawan/decode_uplink.js");
    let node = Command::new("node")
        .args(["-e", PROGRAM, script])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut node) = node else {
        println!("skipped: node is not installed");
        return;
    };
    // A mark before each frame, so that an empty one is a line too.
    let lines: String = frames.iter().map(|frame| format!("x{}\n", hex(frame))).collect();
    node.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let output = node.wait_with_output().unwrap();
    assert!(output.status.success());
    let text = String::from_utf8(output.stdout).unwrap();
    let (mut read, mut refused) = (0, 0);
    for (frame, line) in frames.iter().zip(text.lines()) {
        let mut found: serde_json::Value = serde_json::from_str(line).unwrap();
        let number = found["data"].as_object_mut().and_then(|data| data.remove("value"));
        assert_eq!(number.and_then(|number| number.as_f64()), value(frame), "{}: {line}", hex(frame));
        let expected = expected(frame);
        assert_eq!(found["data"].is_null(), expected.is_null(), "{}: {line}", hex(frame));
        assert_eq!(found["data"], expected, "{}: {line}", hex(frame));
        assert!(!expected.is_null() || found["errors"].is_array());
        *if expected.is_null() { &mut refused } else { &mut read } += 1;
    }
    assert!(read > FRAMES / 2 && refused > FRAMES / 20 && read + refused == FRAMES, "{read} and {refused}");
}
