//! The adaptive stream of `fewbits-adaptive`, from its first sample, once per column and block.

use super::Target;
use super::plain::Steps;
use crate::bound::Promise;
use crate::error::Damage;
use crate::wire::Bytes;
use fewbits_adaptive::{Config, Receiver, Sensor, Silence, StreamReader, StreamWriter};

fn config(target: &Target) -> Option<Config> {
    let config = match target.promise {
        Promise::Exact => None,
        Promise::Within(delta) => Config::new(delta).ok(),
        Promise::Decimals(places) => Config::exact(10_f64.powi(-i32::from(places))).ok(),
    }?;
    match target.circle() {
        Some(period) => config.circular(period).ok(),
        None => Some(config),
    }
}

/// Whole numbers return exactly.
fn whole_numbers() -> Option<Config> {
    Config::exact(1.0).ok()
}

/// The words of a stream as bytes, highest first, without the zeros at the end.
fn stream(config: Config, samples: impl Iterator<Item = f64>, bytes: &mut Vec<u8>) -> Option<()> {
    let (mut sensor, mut writer) = (Sensor::new(config), StreamWriter::new(Silence::Coded));
    for sample in samples {
        sensor.write_after(1, sample, &mut writer).ok()?;
    }
    let start = bytes.len();
    bytes.extend(writer.finish().into_iter().flat_map(u32::to_be_bytes));
    let kept = bytes[start..].iter().rposition(|byte| *byte != 0);
    bytes.truncate(start + kept.map_or(0, |last| last + 1));
    Some(())
}

fn read(config: Config, bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let word = |chunk: &[u8]| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_be_bytes(word)
    };
    let words: Vec<u32> = bytes.chunks(4).map(word).collect();
    let damaged = |_| Damage::Content("adaptive stream");
    let mut reader = StreamReader::new(&words, Silence::Coded).map_err(|_| Damage::Content("adaptive stream"))?;
    let mut receiver = Receiver::new(config);
    (0..count)
        .map(|_| receiver.read_after(1, &mut reader).map_err(damaged))
        .collect()
}

pub(super) fn encode(samples: &[f64], target: &Target) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    stream(config(target)?, samples.iter().copied(), &mut bytes)?;
    Some(bytes)
}

pub(super) fn decode(bytes: &[u8], count: usize, target: &Target) -> Result<Vec<f64>, Damage> {
    read(config(target).ok_or(Damage::Content("bound"))?, bytes, count)
}

pub(super) fn encode_steps(steps: &Steps) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    steps.push_head(&mut bytes);
    stream(whole_numbers()?, steps.multiples.iter().map(|m| *m as f64), &mut bytes)?;
    Some(bytes)
}

pub(super) fn decode_steps(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let mut reader = Bytes(bytes);
    let steps = Steps::read_head(&mut reader)?;
    let whole = read(whole_numbers().ok_or(Damage::Content("bound"))?, reader.0, count)?;
    Ok(whole.into_iter().map(|multiple| steps.value(multiple as i64)).collect())
}
