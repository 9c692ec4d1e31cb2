//! A total number of bits shared out among sensors.
//!
//! ```text
//! bits <- 0 for every sensor
//! repeat until all are given
//!     one bit more to the sensor where the design gains most
//! repeat while that gains
//!     one bit from one sensor to another
//! ```
//!
//! Each step is a short search over all sensors; equal sensors are tried once.

use super::pipeline::{Participant, search};
use super::request::{Control, MAX_BITS, Request};
use crate::criterion::AllowedCells;
use crate::error::Error;
use std::collections::BTreeMap;

/// Moves of single bits after which the shares stay.
const MAX_MOVES: usize = 20;

/// Bits of every sensor.
pub(super) fn shared_out(request: &Request<'_>, total: u32, control: &mut Control<'_>) -> Result<Vec<u32>, Error> {
    let sensors = request.scene.sensors();
    let mut known = BTreeMap::new();
    let mut bits = vec![0; sensors];
    for _ in 0..total {
        let longer = (0..sensors).filter(|n| bits[*n] < MAX_BITS).map(|n| {
            let mut bits = bits.clone();
            bits[n] += 1;
            bits
        });
        let Some((_, best)) = best_of(request, longer.collect(), &mut known, control)? else {
            break;
        };
        bits = best;
    }
    let Some((mut value, _)) = best_of(request, vec![bits.clone()], &mut known, control)? else {
        return Ok(bits);
    };
    for _ in 0..MAX_MOVES {
        let pairs = (0..sensors).flat_map(|from| (0..sensors).map(move |to| (from, to)));
        let moved = pairs
            .filter(|(from, to)| from != to && bits[*from] > 0 && bits[*to] < MAX_BITS)
            .map(|(from, to)| {
                let mut bits = bits.clone();
                bits[from] -= 1;
                bits[to] += 1;
                bits
            });
        match best_of(request, moved.collect(), &mut known, control)? {
            Some((better, other)) if better > value => (value, bits) = (better, other),
            _ => break,
        }
        if !control.go_on() {
            break;
        }
    }
    Ok(bits)
}

/// The best of some shares, with its signed value.
fn best_of(
    request: &Request<'_>,
    shares: Vec<Vec<u32>>,
    known: &mut BTreeMap<Vec<u32>, f64>,
    control: &mut Control<'_>,
) -> Result<Option<(f64, Vec<u32>)>, Error> {
    let mut best: Option<(f64, Vec<u32>)> = None;
    for bits in shares {
        let value = match known.get(&bits) {
            Some(value) => *value,
            None => {
                let value = value_of(request, &bits, control)?;
                known.insert(bits.clone(), value);
                value
            }
        };
        if best.as_ref().is_none_or(|b| value > b.0) {
            best = Some((value, bits));
        }
    }
    Ok(best)
}

fn value_of(request: &Request<'_>, bits: &[u32], control: &mut Control<'_>) -> Result<f64, Error> {
    let sensors: Vec<usize> = (0..bits.len()).filter(|n| bits[*n] > 0).collect();
    let participants: Vec<Participant> = sensors
        .iter()
        .map(|n| Participant {
            sensor: *n,
            bits: bits[*n],
            link: request.links[*n],
        })
        .collect();
    let scene = request.scene.subset(&sensors)?;
    let found = search(&scene, request.criterion, &participants, AllowedCells::Intervals, (2, None), control)?;
    // Too many joint symbols to compare: such a share is not taken.
    Ok(if found.value.is_nan() {
        f64::NEG_INFINITY
    } else {
        found.value
    })
}
