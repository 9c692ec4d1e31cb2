//! Bytes until the threshold is reached.

use super::common::{B, CHAINS, Scheme, Settings, tracks};
use super::summary::{Summary, summary};
use crate::prelude::*;
use fewbits_diffusive::message::SampleCode;

const SCHEMES: [&str; 8] = [
    "raw-64-bit",
    "raw-9-bit",
    "raw-6-bit",
    "gmm-4",
    "gaussian-9",
    "gaussian known rate",
    "gmm-4 known rate",
    "lpg-2x5 known rate",
];

/// The scheme of this name, its raw samples in so many bits.
fn scheme(name: &'static str) -> Scheme {
    let mut scheme = Scheme::new(name, B, 15.0);
    scheme.wire.samples = match name {
        "raw-9-bit" => Some(SampleCode { bits: 9, step: 1.0 }),
        "raw-6-bit" => Some(SampleCode { bits: 6, step: 8.0 }),
        _ => scheme.wire.samples,
    };
    scheme
}

pub struct Bytes;

impl Figure for Bytes {
    figure!(Settings => Vec<Summary>, "diffusive-bytes", "Bytes to the threshold", "",
        "What all messages of a search cost together (120 deployments of example B, numbers in single precision, messages of raw \
         records grow with every node): on a short route the samples themselves, quantised to the noise, are the \
         cheapest message and lose nothing."; loglog("error at the end (m, median)"));

    fn world(&self) -> Option<&'static str> {
        Some(CHAINS)
    }

    fn run(&self, p: &Settings, context: &Context<'_>) -> Result<Vec<Summary>, Error> {
        let of = |scheme: Scheme| summary(&scheme, p, &tracks(context, p, &scheme)?);
        SCHEMES.into_iter().map(scheme).map(of).collect()
    }

    fn claims(&self, _: &Settings, rows: &Vec<Summary>, claims: &mut Claims) {
        let full = claims.at_full_trials();
        let find = |name: &str| rows.iter().find(|r| r.scheme == name);
        let bytes = |name: &str| find(name).and_then(|r| r.bytes_median).map(|m| m.value);
        for other in ["gmm-4", "gaussian-9", "lpg-2x5 known rate"] {
            let ratio = over(bytes("raw-9-bit"), bytes(other));
            let what = format!("samples of nine bits cost less than a third of {other}");
            full.below(format!("raw-is-cheapest/{}", other.replace(' ', "-")), what, ratio, 1.0 / 3.0);
        }
        let nodes = |name: &str| find(name).and_then(|r| r.nodes_median).map(|m| m.value);
        let more = minus(nodes("raw-9-bit"), nodes("raw-64-bit"));
        full.at_most("quantising-is-free", "nine bits a sample need no more nodes than exact samples", more, 0.0);
    }
}
