//! The envelope in C, compiled and compared with that of the library byte by byte.

use fewbits_link::{Direction, Key, ReplayWindow};
use std::path::Path;
use std::process::{Command, Stdio};

/// Reads direction, counter, key and frame; prints the envelope in digits, what reading it gives, what a damaged one gives, and the window's answer.
const PROGRAM: &str = r#"
#include "envelope.h"
#include <stdio.h>
#include <string.h>
static size_t bytes_of(const char *text, uint8_t *bytes)
{
    size_t count = strlen(text) / 2;
    for (size_t i = 0; i < count; ++i) {
        unsigned byte;
        sscanf(text + 2 * i, "%2x", &byte);
        bytes[i] = (uint8_t)byte;
    }
    return count;
}
int main(void)
{
    static char key_text[512], frame_text[4096];
    static uint8_t key[256], frame[2048], out[2100];
    fewbits_replay_window window = {0, 0};
    int direction;
    unsigned sensor;
    unsigned long long counter;
    while (scanf("%d %u %llu %511s %4095s", &direction, &sensor, &counter, key_text, frame_text) == 5) {
        size_t key_bytes = bytes_of(key_text, key), frame_bytes = bytes_of(frame_text + 1, frame);
        int32_t count = fewbits_envelope_write(key, key_bytes, direction, sensor, counter, frame, frame_bytes, out, frame_bytes + 28);
        for (int32_t i = 0; i < count; ++i)
            printf("%02x", out[i]);
        uint32_t who = 0;
        uint64_t number = 0;
        int32_t read = fewbits_envelope_read(key, key_bytes, direction, out, (size_t)(count < 0 ? 0 : count), &who, &number);
        int32_t other = fewbits_envelope_read(key, key_bytes, 1 - direction, out, (size_t)(count < 0 ? 0 : count), &who, &number);
        printf(" %d %d %u %llu %d %d\n", read, other, who, (unsigned long long)number, fewbits_replay_take(&window, counter),
            fewbits_envelope_write(key, key_bytes, direction, sensor, counter, frame, frame_bytes, out, frame_bytes + 27));
    }
    return 0;
}
"#;

#[test]
fn envelopes_in_c_are_those_of_the_library() {
    let sources = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../firmware/c");
    if !sources.join("envelope.c").exists() || Command::new("cc").arg("--version").output().is_err() {
        eprintln!("no `cc` or no sources here: the envelope in C is not compiled");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let main = folder.path().join("main.c");
    std::fs::write(&main, PROGRAM).unwrap();
    let mut compiler = Command::new("cc");
    compiler
        .args(["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1", "-I"])
        .arg(&sources);
    let program = folder.path().join("main");
    let built = compiler
        .arg("-o")
        .arg(&program)
        .arg(&main)
        .arg(sources.join("envelope.c"))
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));

    let hex = |bytes: &[u8]| bytes.iter().map(|byte| format!("{byte:02x}")).collect::<String>();
    let mut state = 1_u32;
    let mut draw = |count: usize| -> Vec<u8> {
        let next = |_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        (0..count).map(next).collect()
    };
    let (mut input, mut expected, mut window) = (String::new(), String::new(), ReplayWindow::default());
    // Keys below, at and above the block of the hash; frames of every length about it; counters that jump, repeat and come late.
    for case in 0..200_u64 {
        let key = draw([32, 33, 63, 64, 65, 100][case as usize % 6]);
        let (frame, sensor) = (draw(case as usize), u32::from_be_bytes(draw(4).try_into().unwrap()));
        let counter = match case % 7 {
            3 => case.max(8) - 3,
            5 => case << 32,
            6 => (case << 32) - 100,
            _ => case + 1,
        };
        let (number, direction) = [(0, Direction::ToCentre), (1, Direction::ToSensor)][case as usize % 2];
        input += &format!("{number} {sensor} {counter} {} x{}\n", hex(&key), hex(&frame));
        let sealed = Key::new(&key).unwrap().seal(direction, sensor, counter, &frame);
        let taken = if window.take(counter).is_ok() { 0 } else { -1 };
        expected += &format!("{} {} -1 {sensor} {counter} {taken} -1\n", hex(&sealed), frame.len());
    }
    // A key that is too short, and counter 0.
    input += &format!("0 1 1 {} x00\n1 1 0 {} x00\n", hex(&draw(31)), hex(&draw(32)));
    expected += " -1 -1 0 0 -1 -1\n -1 -1 0 0 -1 -1\n";
    let mut child = Command::new(&program)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || std::io::Write::write_all(&mut stdin, input.as_bytes()).unwrap());
    let found = String::from_utf8(child.wait_with_output().unwrap().stdout).unwrap();
    writer.join().unwrap();
    for (number, (found, expected)) in found.lines().zip(expected.lines()).enumerate() {
        assert_eq!(found, expected, "case {number}");
    }
    assert_eq!(found.lines().count(), expected.lines().count());
}
