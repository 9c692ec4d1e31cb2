//! SenML against the examples of RFC 8428.

#![allow(clippy::unwrap_used)]
use super::*;

const NOW: f64 = 1_700_000_000.0;

/// RFC 8428, section 5.1.3, and the same in CBOR, written by an independent encoder with the labels of section 6.
const JSON_EXAMPLE: &str = r#"[{"bn": "urn:dev:ow:10e2073a0108006:", "bt": 1276020076.001, "bu": "A", "bver": 5, "n": "voltage", "u": "V", "v": 120.1}, {"n": "current", "t": -5, "v": 1.2}, {"n": "current", "t": -4, "v": 1.3}, {"n": "current", "t": -3, "v": 1.4}, {"n": "current", "t": -2, "v": 1.5}, {"n": "current", "t": -1, "v": 1.6}, {"n": "current", "v": 1.7}]"#;
const CBOR_EXAMPLE: &str = "87a721781b75726e3a6465763a6f773a3130653230373361303130383030363a22fb41d303a15b00106223614120050067766f6c7461676501615602fb405e066666666666a3006763757272656e74062402fb3ff3333333333333a3006763757272656e74062302fb3ff4cccccccccccda3006763757272656e74062202fb3ff6666666666666a3006763757272656e74062102fb3ff8000000000000a3006763757272656e74062002fb3ff999999999999aa2006763757272656e7402fb3ffb333333333333";

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2)
        .map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap())
        .collect()
}

#[test]
fn examples_of_the_rfc_are_resolved_and_come_back() {
    let records = from_json(JSON_EXAMPLE, NOW).unwrap();
    assert_eq!(records.len(), 7);
    assert_eq!(records[0], Record::new("urn:dev:ow:10e2073a0108006:voltage", "V", 120.1, 1.276020076001e9));
    assert_eq!(records[1], Record::new("urn:dev:ow:10e2073a0108006:current", "A", 1.2, 1.276020071001e9));
    assert_eq!(records[6], Record::new("urn:dev:ow:10e2073a0108006:current", "A", 1.7, 1.276020076001e9));
    assert_eq!(from_cbor(&bytes(CBOR_EXAMPLE), NOW).unwrap(), records);
    assert_eq!(from_json(&to_json(&records).unwrap(), NOW).unwrap(), records);
    assert_eq!(from_cbor(&to_cbor(&records).unwrap(), NOW).unwrap(), records);
}

/// Sections 5.1.1, 5.1.4 and 5.1.5: one value without a time, measurements of all kinds, relative times, sums.
#[test]
fn other_forms_are_read() {
    let one = from_json(r#"[{"n":"urn:dev:ow:10e2073a01080063","u":"Cel","v":23.1}]"#, NOW).unwrap();
    assert_eq!(one, [Record::new("urn:dev:ow:10e2073a01080063", "Cel", 23.1, NOW)]);
    let text = r#"[{"bn":"urn:dev:ow:10e2073a01080063:"},{"n":"temp","u":"Cel","v":23.1,"t":-60},
        {"n":"label","vs":"Machine Room"},{"n":"open","vb":false},{"n":"nfv","vd":"aGkgCg"},
        {"n":"meter","u":"J","s":5.5,"ut":30,"bs":1.5}]"#;
    let all = from_json(text, NOW).unwrap();
    assert_eq!((all.len(), all[0].time, all[4].sum, all[4].update_time), (5, NOW - 60.0, Some(7.0), Some(30.0)));
    assert_eq!(all[1].value, Value::Text("Machine Room".to_owned()));
    assert_eq!((&all[2].value, &all[3].value), (&Value::Truth(false), &Value::Data("aGkgCg".to_owned())));
    let again = from_cbor(&to_cbor(&all).unwrap(), NOW).unwrap();
    assert_eq!(again, all);
    // Bytes are bytes in CBOR: "hi \n".
    assert!(
        to_cbor(&all)
            .unwrap()
            .windows(6)
            .any(|w| w == [8, 0x44, b'h', b'i', b' ', b'\n'])
    );
}

#[test]
fn what_must_be_understood_is_refused() {
    for bad in [
        "{}",
        "[1]",
        r#"[{"n":"a","v":"x"}]"#,
        r#"[{"n":"a","v":1,"vs":"x"}]"#,
        r#"[{"n":"a","v":1,"new_":2}]"#,
        r#"[{"bver":11,"n":"a","v":1}]"#,
        r#"[{"n":"ä","v":1}]"#,
        r#"[{"v":1}]"#,
        r#"[{"n":"a","v":1e999}]"#,
    ] {
        assert!(from_json(bad, NOW).is_err(), "{bad}");
    }
    assert!(to_json(&[Record::new("a", "", f64::NAN, NOW)]).is_err());
}

#[test]
fn any_bytes_are_read_or_refused() {
    let good = bytes(CBOR_EXAMPLE);
    for at in 0..good.len() {
        assert!(from_cbor(&good[..at], NOW).is_err());
        for bit in 0..8 {
            let mut bad = good.clone();
            bad[at] ^= 1 << bit;
            let _ = from_cbor(&bad, NOW);
        }
    }
    assert!(from_cbor(&[0x9f; 100_000], NOW).is_err());
    // Lengths far beyond the bytes that follow: bytes, text, a list, fields.
    for kind in [0x5b, 0x7b, 0x9b, 0xbb] {
        assert!(from_cbor(&[kind, 0x7f, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff], NOW).is_err());
    }
    // Half and single precision, indefinite lengths: 1.5 each.
    let short = [
        0x9f, 0xbf, 0, 0x61, b'a', 2, 0xf9, 0x3e, 0, 0xff, 0xa2, 0, 0x61, b'b', 2, 0xfa, 0x3f, 0xc0, 0, 0, 0xff,
    ];
    let read = from_cbor(&short, NOW).unwrap();
    assert_eq!(read, [Record::new("a", "", 1.5, NOW), Record::new("b", "", 1.5, NOW)]);
}

/// Forms of CBOR that other encoders write: decimal fractions, tags, strings in chunks, labels and values that are not known.
#[test]
fn legal_forms_of_cbor_are_read() {
    let expected = [Record::new("ab", "Cel", -27.35, NOW)];
    let forms: [&[u8]; 6] = [
        // [{0: "ab", 1: "Cel", 2: 4([-2, -2735])}], plain, and all of it under the tag that says "this is CBOR".
        &[
            0x81, 0xa3, 0, 0x62, b'a', b'b', 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82, 0x21, 0x39, 0x0a, 0xae,
        ],
        &[
            0xd9, 0xd9, 0xf7, 0x81, 0xa3, 0, 0x62, b'a', b'b', 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82, 0x21, 0x39,
            0x0a, 0xae,
        ],
        // The name in two chunks.
        &[
            0x81, 0xa3, 0, 0x7f, 0x61, b'a', 0x61, b'b', 0xff, 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82, 0x21, 0x39,
            0x0a, 0xae,
        ],
        // A field of a number that is not known, another with a list of lists, a third without a value.
        &[
            0x81, 0xa4, 0x18, 99, 5, 0, 0x62, b'a', b'b', 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82, 0x21, 0x39, 0x0a,
            0xae,
        ],
        &[
            0x81, 0xa4, 0x61, b'x', 0x81, 0x81, 0x80, 0, 0x62, b'a', b'b', 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82,
            0x21, 0x39, 0x0a, 0xae,
        ],
        &[
            0x81, 0xa4, 0x61, b'x', 0xf6, 0, 0x62, b'a', b'b', 1, 0x63, b'C', b'e', b'l', 2, 0xc4, 0x82, 0x21, 0x39,
            0x0a, 0xae,
        ],
    ];
    for form in forms {
        assert_eq!(from_cbor(form, NOW).unwrap(), expected, "{form:x?}");
        // Lists one behind the other are told apart.
        let two = [form, form].concat();
        assert_eq!(cbor_length(&two), Some(form.len()));
        assert!(from_cbor(&two, NOW).is_err());
    }
    // Numbers beyond a double, fractions of other things, an endless string.
    for bad in [
        &[0x81, 0xa2, 0, 0x61, b'a', 2, 0xc4, 0x82, 0x19, 0x01, 0x90, 1][..],
        &[
            0x81, 0xa2, 0, 0x61, b'a', 2, 0xc4, 0x82, 0x1b, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1,
        ],
        &[0x81, 0xa2, 0, 0x61, b'a', 2, 0xc4, 0x01],
        &[0x81, 0xa2, 0, 0x7f, 0x61, b'a', 2, 0x01],
        &[0xc1; 100_000],
    ] {
        assert!(from_cbor(bad, NOW).is_err() && cbor_length(&[]).is_none());
    }
}
