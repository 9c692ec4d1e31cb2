//! pco: the smaller code where a sample is worth many bits.

use super::Target;
use super::plain::{Steps, push_short_double, read_short_double};
use crate::bound::{Promise, TENS};
use crate::error::Damage;
use crate::wire::Bytes;
use pco::ChunkConfig;
use pco::data_types::Number;
use pco::wrapped::{FileCompressor, FileDecompressor};

/// The step of the lattice is this much shorter than `2 delta`, so that rounding does not leave the bound.
const SLACK: f64 = 1.0 / (1_u64 << 30) as f64;
/// Indices above this size are no exact doubles.
const LARGEST: f64 = (1_u64 << 52) as f64;

fn pack<T: Number>(numbers: &[T], bytes: &mut Vec<u8>) -> Option<()> {
    let file = FileCompressor::default();
    let mut chunk = file
        .chunk_compressor(numbers, &ChunkConfig::default().with_compression_level(LEVEL))
        .ok()?;
    if chunk.n_per_page().len() != 1 {
        return None;
    }
    file.write_header(&mut *bytes).ok()?;
    chunk.write_meta(&mut *bytes).ok()?;
    chunk.write_page(0, &mut *bytes).ok()?;
    Some(())
}

/// pco's default.
const LEVEL: usize = 8;

fn unpack<T: Number + Default>(bytes: &[u8], count: usize) -> Result<Vec<T>, Damage> {
    let damaged = |_| Damage::Content("packed numbers");
    let (file, rest) = FileDecompressor::new(bytes).map_err(damaged)?;
    let (mut chunk, rest) = file.chunk_decompressor::<T, _>(rest).map_err(damaged)?;
    let mut page = chunk.page_decompressor(rest, count).map_err(damaged)?;
    let mut numbers = vec![T::default(); count];
    let progress = page.read(&mut numbers).map_err(damaged)?;
    if progress.n_processed == count && progress.finished {
        Ok(numbers)
    } else {
        Err(Damage::Content("packed numbers"))
    }
}

pub(super) fn encode_doubles(samples: &[f64]) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    pack(samples, &mut bytes)?;
    Some(bytes)
}

pub(super) fn decode_doubles(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    unpack(bytes, count)
}

/// Points `origin + step j`, around the circle if there is one.
struct Lattice {
    origin: f64,
    step: f64,
    circle: Option<(f64, i64)>,
    /// For decimals: points are `j / ten`.
    ten: Option<f64>,
}

impl Lattice {
    fn new(target: &Target, origin: f64) -> Option<Self> {
        let (step, ten) = match target.promise {
            Promise::Exact => return None,
            Promise::Within(delta) => (2.0 * delta * (1.0 - SLACK), None),
            Promise::Decimals(places) => {
                let ten = *TENS.get(usize::from(places))?;
                (1.0 / ten, Some(ten))
            }
        };
        let circle = target.circle().map(|period| (period, (period / step).ceil().max(1.0)));
        Some(Self {
            origin: if ten.is_some() { 0.0 } else { origin },
            step: circle.map_or(step, |(period, cells)| period / cells),
            circle: circle.map(|(period, cells)| (period, cells as i64)),
            ten,
        })
    }

    fn index(&self, sample: f64) -> Option<i64> {
        let sample = self.circle.map_or(sample, |(period, _)| sample.rem_euclid(period));
        let offset = match self.ten {
            Some(ten) => (sample * ten).round(),
            None => ((sample - self.origin) / self.step).round(),
        };
        (offset.abs() < LARGEST).then_some(offset as i64)
    }

    fn value(&self, index: i64) -> f64 {
        let value = match self.ten {
            Some(ten) => index as f64 / ten,
            None => self.origin + self.step * index as f64,
        };
        self.circle.map_or(value, |(period, _)| {
            let wrapped = value.rem_euclid(period);
            if wrapped < period { wrapped } else { 0.0 }
        })
    }
}

pub(super) fn encode_lattice(samples: &[f64], target: &Target) -> Option<Vec<u8>> {
    let lattice = Lattice::new(target, *samples.first()?)?;
    let mut last = 0;
    let mut indices = Vec::with_capacity(samples.len());
    for sample in samples {
        // Around the circle the index goes on the shortest way.
        let index = lattice.index(*sample).map_or(last, |index| match lattice.circle {
            None => index,
            Some((_, cells)) => {
                let ahead = (index - last).rem_euclid(cells);
                last + if 2 * ahead > cells { ahead - cells } else { ahead }
            }
        });
        indices.push(index);
        last = index;
    }
    let mut bytes = Vec::new();
    push_short_double(&mut bytes, lattice.origin);
    pack(&indices, &mut bytes)?;
    Some(bytes)
}

pub(super) fn decode_lattice(bytes: &[u8], count: usize, target: &Target) -> Result<Vec<f64>, Damage> {
    let mut reader = Bytes(bytes);
    let origin = read_short_double(&mut reader)?;
    let lattice = Lattice::new(target, origin).ok_or(Damage::Content("bound"))?;
    let indices: Vec<i64> = unpack(reader.0, count)?;
    Ok(indices.into_iter().map(|index| lattice.value(index)).collect())
}

pub(super) fn encode_steps(steps: &Steps) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    steps.push_head(&mut bytes);
    pack(&steps.multiples, &mut bytes)?;
    Some(bytes)
}

pub(super) fn decode_steps(bytes: &[u8], count: usize) -> Result<Vec<f64>, Damage> {
    let mut reader = Bytes(bytes);
    let steps = Steps::read_head(&mut reader)?;
    let multiples: Vec<i64> = unpack(reader.0, count)?;
    Ok(multiples.into_iter().map(|multiple| steps.value(multiple)).collect())
}
