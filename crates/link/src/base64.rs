//! Base64 of RFC 4648: section 4, and section 5 for names and addresses.

use ::base64::Engine;
use ::base64::prelude::{BASE64_STANDARD, BASE64_STANDARD_NO_PAD, BASE64_URL_SAFE_NO_PAD};

/// The text of bytes, with padding.
pub(crate) fn encode(bytes: &[u8]) -> String {
    BASE64_STANDARD.encode(bytes)
}

/// The bytes of a text with or without padding. `None` if it is no base64, or not the one text of its bytes.
pub(crate) fn decode(text: &str) -> Option<Vec<u8>> {
    let is_padded = text.ends_with('=');
    let engine = if is_padded {
        &BASE64_STANDARD
    } else {
        &BASE64_STANDARD_NO_PAD
    };
    engine.decode(text).ok()
}

/// The text of bytes in the alphabet of section 5, without padding.
pub(crate) fn url(bytes: &[u8]) -> String {
    BASE64_URL_SAFE_NO_PAD.encode(bytes)
}

/// The bytes of a text in that alphabet, with or without padding.
pub(crate) fn of_url(text: &str) -> Option<Vec<u8>> {
    BASE64_URL_SAFE_NO_PAD.decode(text.trim_end_matches('=')).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The examples of RFC 4648, section 10.
    #[test]
    fn published_examples() {
        let examples = ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"];
        for (count, text) in examples.iter().enumerate() {
            let bytes = &b"foobar"[..count];
            assert_eq!((encode(bytes).as_str(), decode(text).as_deref()), (*text, Some(bytes)));
            assert_eq!(decode(text.trim_end_matches('=')).as_deref(), Some(bytes));
        }
        for bad in ["A", "AAAAA", "Zg=", "Z===", "Zh==", "Zm9=", "Zm 9", "=", "===="] {
            assert_eq!(decode(bad), None, "{bad}");
        }
        assert_eq!(decode(&encode(&[0xfb, 0xff, 0xfe])), Some(vec![0xfb, 0xff, 0xfe]));
    }
}
