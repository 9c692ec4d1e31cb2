//! Messages of other programs in and out of the command, and a centre that is handed over.

use crate::fleet::{free_place, key, measuring, rows, written};
use crate::{Running, fewbits, good, refused, start, text};
use std::process::Command;

/// Bytes in base64, by the program of the system: independent of the library's own.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let bits: String = bytes.iter().map(|byte| format!("{byte:08b}")).collect();
    let digit = |chunk: &[u8]| {
        let word = format!("{:0<6}", String::from_utf8_lossy(chunk));
        char::from(DIGITS[usize::from_str_radix(&word, 2).unwrap()])
    };
    let text: String = bits.as_bytes().chunks(6).map(digit).collect();
    let padding = "=".repeat(text.len().next_multiple_of(4) - text.len());
    text + &padding
}

#[test]
fn cayenne_payloads_of_a_lorawan_server_are_rows() {
    let folder = tempfile::tempdir().unwrap();
    let payload = base64(&[0x03, 0x67, 0x01, 0x10, 0x06, 0x71, 0x04, 0xd2, 0xfb, 0x2e, 0x00, 0x00]);
    let message = |eui: &str| {
        format!(
            "{{\"time\":\"2026-03-01T12:00:00Z\",\"deviceInfo\":{{\"devEui\":\"{eui}\"}},\"fPort\":2,\"data\":\"{payload}\"}}\n"
        )
    };
    let join = "{\"deviceInfo\":{\"devEui\":\"0101010101010101\"},\"devAddr\":\"00189440\"}\n\n";
    let input = message("0101010101010101") + join + &message("0202020202020202");
    let words = ["receive", "--format", "lorawan"];
    let found = text(&good(folder.path(), &words, input.as_bytes()));
    let lines: Vec<&str> = found.lines().collect();
    assert_eq!(
        lines[..3],
        [
            "time,name,value,unit",
            "2026-03-01T12:00:00Z,0101010101010101/3/temperature,27.2,°C",
            "2026-03-01T12:00:00Z,0101010101010101/6/accelerometer/x,1.234,g"
        ]
    );
    assert_eq!(lines.len(), 1 + 2 * 4);
    let one = [&words[..], &["--device", "0202020202020202"]].concat();
    assert_eq!(text(&good(folder.path(), &one, input.as_bytes())).lines().count(), 5);
    // A message that is none costs no other, and shows in the exit code.
    let output = fewbits(folder.path(), &words, (input + "{\n").as_bytes());
    assert_eq!((output.status.code(), text(&output.stdout).lines().count()), (Some(1), 9));
    assert!(text(&output.stderr).contains("1 messages were not used"), "{}", text(&output.stderr));
    let said = refused(folder.path(), &[&words[..], &["--udp", "127.0.0.1:0"]].concat(), b"");
    assert!(said.contains("cannot be used with"), "{said}");
}

/// What other programs send has no baud rate: it was advised to change it.
#[test]
fn messages_without_a_reading_are_said_to_have_none() {
    let folder = tempfile::tempdir().unwrap();
    let join = r#"{"deviceInfo":{"devEui":"0101010101010101"},"devAddr":"00189440"}"#;
    for (words, input, expected) in [
        (&["--format", "lorawan"][..], "not json\n", "no message had one"),
        (&["--format", "lorawan"], join, "no message had one"),
        (&["--format", "lorawan", "--device", "02"], join, "no message of device `02` had one"),
        (&["--format", "senml"], r#"[{"bver":11,"n":"a","v":1}]"#, "`SenML version` is 11: expected"),
        (&["--format", "senml"], r#"[{"bver":"x","n":"a","v":1}]"#, "`SenML version` is \"x\": expected"),
        (&["--format", "senml"], "[]", "no reading came"),
        (&["--format", "senml-cbor"], "", "no reading came"),
    ] {
        let output = fewbits(folder.path(), &[&["receive"], words].concat(), input.as_bytes());
        let said = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{input}: {said}");
        assert!(
            said.contains(expected) && said.contains("no reading came") && !said.contains("baud"),
            "{input}: {said}"
        );
    }
}

/// Lists of RFC 8428, section 5.1.3 in JSON, and the same as CBOR of section 6.
#[test]
fn senml_is_rows() {
    let folder = tempfile::tempdir().unwrap();
    let json = r#"[{"bn":"urn:dev:ow:10e2073a0108006:","bt":1.276020076001e+09,"bu":"A","bver":5,"n":"voltage","u":"V","v":120.1},{"n":"current","t":-5,"v":1.2},{"n":"open","vb":true}]"#;
    let found = text(&good(folder.path(), &["receive", "--format", "senml"], json.as_bytes()));
    let lines: Vec<&str> = found.lines().collect();
    assert_eq!(
        lines,
        [
            "time,name,value,unit",
            "1276020076.001,urn:dev:ow:10e2073a0108006:voltage,120.1,V",
            "1276020071.001,urn:dev:ow:10e2073a0108006:current,1.2,A",
            "1276020076.001,urn:dev:ow:10e2073a0108006:open,1,A"
        ]
    );
    // [{-2: "urn:dev:a:", -3: 1276020076, 0: "x", 2: 1.5, 1: "Cel"}]
    let mut cbor = vec![0x81, 0xa5, 0x21, 0x6a];
    cbor.extend(b"urn:dev:a:");
    cbor.extend([0x22, 0x1a]);
    cbor.extend(1_276_020_076_u32.to_be_bytes());
    cbor.extend([0x00, 0x61, b'x', 0x02, 0xf9, 0x3e, 0x00, 0x01, 0x63, b'C', b'e', b'l']);
    let found = text(&good(folder.path(), &["receive", "--format", "senml-cbor"], &cbor));
    assert_eq!(found.lines().nth(1), Some("1276020076,urn:dev:a:x,1.5,Cel"));
}

/// Lists and messages over several lines, behind a byte order mark, without line ends between, and rows of a centre as they are written.
#[test]
fn messages_need_no_line_of_their_own() {
    let folder = tempfile::tempdir().unwrap();
    let records = |input: &str| {
        let found = text(&good(folder.path(), &["receive", "--format", "senml"], input.as_bytes()));
        found.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
    };
    let expected = ["1276020076,urn:dev:a:x,1.5,", "1276020076,urn:dev:a:y,2,"];
    let one = r#"[{"bn":"urn:dev:a:","bt":1276020076,"n":"x","v":1.5},{"n":"y","v":2}]"#;
    assert_eq!(records(one), expected);
    let pretty = one.replace("},{", "},\n{").replace('[', "[\n").replace(']', "\n]\n");
    assert_eq!(records(&pretty), expected);
    assert_eq!(records(&pretty.replace('{', "  {\n    ")), expected);
    assert_eq!(records(&format!("\u{feff}{one}")), expected);
    assert_eq!(records(&format!("{one}{one}")), [expected, expected].concat());
    // A list that was cut off costs no other, and shows.
    let output =
        fewbits(folder.path(), &["receive", "--format", "senml"], format!("{}\n{one}\n", &one[..60]).as_bytes());
    assert_eq!(
        (output.status.code(), text(&output.stdout).lines().count()),
        (Some(1), 3),
        "{}",
        text(&output.stderr)
    );
    // [{0: "x", 2: 1.5, 6: 1276020076}], twice, and cut off.
    let mut cbor = vec![0x81, 0xa3, 0x00, 0x61, b'x', 0x02, 0xf9, 0x3e, 0x00, 0x06, 0x1a];
    cbor.extend(1_276_020_076_u32.to_be_bytes());
    let words = ["receive", "--format", "senml-cbor"];
    let two = [cbor.clone(), cbor.clone()].concat();
    assert_eq!(text(&good(folder.path(), &words, &two)).lines().count(), 3);
    let output = fewbits(folder.path(), &words, &two[..two.len() - 3]);
    assert_eq!((output.status.code(), text(&output.stdout).lines().count()), (Some(1), 2));
}

/// A centre that is asked to end does so after the step of its slot, which is stored; the next process goes on with the next slot.
#[test]
#[ignore = "slots of the wall clock: a busy machine is late by itself; `.ci/kills` runs it"]
fn a_centre_is_handed_over_without_losing_a_report() {
    let folder = tempfile::tempdir().unwrap();
    written(folder.path(), &free_place(), &key('b'));
    // Slots long enough for a process to start within one.
    for file in ["centre.toml", "sensor1.toml", "sensor2.toml"] {
        let path = folder.path().join(file);
        let content = std::fs::read_to_string(&path)
            .unwrap()
            .replace("period = 0.04", "period = 0.6");
        std::fs::write(&path, content).unwrap();
    }
    let mut centre = Running::new(start(folder.path(), &["centre", "centre.toml"]));
    let sensors = measuring(folder.path());
    let (mut all, mut first_with_both) = (Vec::new(), None);
    for _ in 0..3 {
        std::thread::sleep(std::time::Duration::from_millis(1900));
        let signal = Command::new("kill")
            .args(["-TERM", &centre.id().to_string()])
            .status()
            .unwrap();
        assert!(signal.success());
        let output = centre.output();
        centre = Running::new(start(folder.path(), &["centre", "centre.toml"]));
        let said = text(&output.stderr);
        assert!(output.status.success() && said.contains("stopping after this slot"), "{said}");
        all.extend(rows(text(&output.stdout).lines()));
    }
    centre.kill().unwrap();
    centre.wait().unwrap();
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    all.dedup_by_key(|row| row.0);
    for pair in all.windows(2) {
        assert_eq!(pair[1].0, pair[0].0 + 1, "{all:?}");
    }
    for (slot, reports, _) in &all {
        if *reports == 2 && first_with_both.is_none() {
            first_with_both = Some(*slot);
        }
        // The bit and the value of every slot from then on.
        assert!(first_with_both.is_none() || *reports == 2, "{all:?}");
    }
    assert!(first_with_both.is_some() && all.len() > 5, "{all:?}");
}
