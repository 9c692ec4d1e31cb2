//! Bits against the guaranteed bound, beside codecs that exist as crates.

use super::bits::{geometric_mean, largest};
use super::recordings::{Recording, Source, each};
use crate::prelude::*;
use fewbits_block_codec::BlockCodec;
use pco::ChunkConfig;
use pco::standalone::simple_compress;

parameters! {
    pub struct Parameters {
        #[serde(flatten)]
        source: Source = Source::default() => quick Source { samples: 800, ..Source::default() },
        /// Bounds in percent of the range.
        percent: Vec<f64> [1e-4..=10.0; 1..=20] = vec![1e-4, 0.01, 0.25, 0.5, 1.0, 2.0] => quick vec![0.25, 1.0],
    }
    cost |p| Cost::new(2e-5 * (p.source.samples * p.percent.len()) as f64, 1e4 * p.source.samples as f64);
}

rows! {
    pub struct Rows {
        signals: Vec<Row> => "Every signal at every bound.",
        references: Vec<Reference> => "Means over 75 recorded series, measured elsewhere.",
    }

    struct Row {
        column: String as panel => "Signal.",
        percent: f64 as x("largest error, percent of the range") => "Largest error in percent of the range.",
        adaptive: f64 ["bit"] as line("adaptive") in signals => "Block of the adaptive codec, without container.",
        worst: f64 => "Largest error of its restored samples over the bound.",
        /// pco 1 on the indices of a lattice of twice the bound, its delta order found by itself.
        pco: f64 ["bit"] as line("pco") in signals,
        /// zstd, level 19, on those indices as 32-bit numbers; without the feature `zstd` of this crate not run.
        zstd: Option<f64> ["bit"] as line("zstd") in signals,
    }

    struct Reference {
        percent: f64 as x("largest error, percent of the range") => "Largest error in percent of the range.",
        codec: &'static str as key => "Program.",
        bits: f64 ["bit"] as dashed in others => "Mean bits per sample.",
    }
}

/// Bits per sample of other programs at equal guaranteed maximum error: means over 75 series of gas, temperature, humidity, wind, ranges,
/// positions, server metrics and electricity (`docs/record.md`, "Comparison", has the table and how they were run). The initial weights of our blocks were fitted on these series.
const REFERENCES: [(&str, [(f64, f64); 4]); 3] = [
    ("SZ3", [(0.25, 4.105), (0.5, 3.304), (1.0, 2.593), (2.0, 1.886)]),
    ("lattice + PPMd", [(0.25, 3.505), (0.5, 2.763), (1.0, 2.048), (2.0, 1.417)]),
    ("SerfQT", [(0.25, 4.417), (0.5, 3.418), (1.0, 2.605), (2.0, 1.989)]),
];

pub struct Codecs;

fn measured(recording: &Recording, percent: f64) -> Result<Row, Error> {
    let (samples, count) = (&recording.samples, recording.samples.len());
    // A signal that stands still has no range.
    let bound = (0.01 * percent * recording.range()).max(f64::MIN_POSITIVE);
    let per_sample = |bytes: usize| 8.0 * bytes as f64 / count as f64;
    let codec = BlockCodec::new(bound).map_err(Error::failed)?;
    let block = codec.encode(samples).map_err(Error::failed)?;
    let restored = codec.decode(&block, count).map_err(Error::failed)?;
    let errors = samples.iter().zip(&restored).map(|(a, b)| (a - b).abs() / bound);
    let indices: Vec<i64> = samples.iter().map(|x| (x / (2.0 * bound)).round() as i64).collect();
    let packed = simple_compress(&indices, &ChunkConfig::default()).map_err(Error::failed)?;
    Ok(Row {
        column: recording.name.clone(),
        percent,
        adaptive: per_sample(block.len()),
        worst: largest(errors).unwrap_or(0.0),
        pco: per_sample(packed.len()),
        zstd: zstd_bytes(&indices).map(per_sample),
    })
}

#[cfg(feature = "zstd")]
fn zstd_bytes(indices: &[i64]) -> Option<usize> {
    let bytes: Vec<u8> = indices.iter().flat_map(|index| (*index as i32).to_le_bytes()).collect();
    zstd::bulk::compress(&bytes, 19).ok().map(|packed| packed.len())
}

#[cfg(not(feature = "zstd"))]
fn zstd_bytes(_: &[i64]) -> Option<usize> {
    None
}

impl Figure for Codecs {
    figure!(Parameters => Rows, "real-codecs", "Bits against the bound, beside other codecs", "our own comparison",
        "Bits per sample against the guaranteed largest error, on signals with the traits of recordings, or on the columns of a \
         file: a block of the adaptive codec, pco on lattice indices, and with the feature `zstd` zstd on them. Dashed: means of \
         programs that are no crates over recorded series, from the page of recordings.";
        { signals: loglog("bits per sample"), others: loglog("bits per sample", "Recorded series") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let recordings = p.source.load("real-codecs", context)?;
        let references = REFERENCES.iter().flat_map(|(codec, bits)| {
            bits.iter().map(move |(percent, bits)| Reference {
                percent: *percent,
                codec,
                bits: *bits,
            })
        });
        Ok(Rows {
            signals: each(&recordings, &p.percent, measured)?,
            references: references.collect(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let worst = largest(rows.signals.iter().map(|row| row.worst));
        // The quotient of the error is rounded; the bound itself is checked exactly by the tests of the codec.
        claims.at_most("bounded", "no error exceeds the bound", worst, 1.0 + 1e-9);
        let ratio = geometric_mean(rows.signals.iter().map(|row| row.adaptive / row.pco));
        claims.at_most("pco", "fewer bits than pco on lattice indices, in the geometric mean", ratio, 1.0);
    }
}
