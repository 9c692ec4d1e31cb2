//! Distribution of a total number of bits over the sensors.
//!
//! ```text
//! bits <- 0 for every sensor
//! repeat until all bits are distributed
//!     one bit more to the sensor for which the design gains most
//! repeat while that gains
//!     move one bit from one sensor to another
//! ```
//!
//! Each step is a short search over all sensors. If the time for this stage is over, each remaining bit goes to the sensor
//! with the largest signal-to-noise ratio, which is halved for each bit that a sensor has.

use super::control::Control;
use super::participant::SensorDesign;
use super::request::{MAX_BITS, Request};
use super::starts::Search;
use crate::criterion::AllowedCells;
use crate::error::Error;
use std::collections::BTreeMap;

/// Largest fraction of the time limit for this stage.
const SHARE: f64 = 0.4;
/// Largest number of moves of single bits.
const MAX_MOVES: usize = 20;

/// Number of bits of every sensor.
pub(super) fn shared_out(request: &Request<'_>, total: u32, control: &mut Control<'_>) -> Result<Vec<u32>, Error> {
    control.end_with(SHARE);
    let sensors = request.model.sensors();
    let mut tried = Tried {
        request,
        values: BTreeMap::new(),
    };
    let (mut bits, mut value) = (vec![0; sensors], f64::NEG_INFINITY);
    // Greedy: each bit goes to the sensor where it helps most.
    for _ in 0..total {
        let more: Vec<Vec<u32>> = (0..sensors)
            .filter(|n| bits[*n] < MAX_BITS)
            .map(|n| moved(&bits, None, n))
            .collect();
        (value, bits) = match tried.best_of(&more, control)? {
            Some(best) => best,
            None => (value, moved(&bits, None, next_sensor(request, &bits))),
        };
    }
    // Then bits move from one sensor to another as long as that helps.
    for _ in 0..MAX_MOVES {
        let pairs = (0..sensors).flat_map(|from| (0..sensors).map(move |to| (from, to)));
        let exchanged: Vec<Vec<u32>> = pairs
            .filter(|(from, to)| from != to && bits[*from] > 0 && bits[*to] < MAX_BITS)
            .map(|(from, to)| moved(&bits, Some(from), to))
            .collect();
        match tried.best_of(&exchanged, control)? {
            Some((better, other)) if better > value => (value, bits) = (better, other),
            _ => break,
        }
    }
    control.end_with(1.0);
    Ok(bits)
}

/// The bits with one more for sensor `to`, and one less for sensor `from` if it is given.
fn moved(bits: &[u32], from: Option<usize>, to: usize) -> Vec<u32> {
    let mut bits = bits.to_vec();
    if let Some(from) = from {
        bits[from] -= 1;
    }
    bits[to] += 1;
    bits
}

/// The sensor with the largest signal-to-noise ratio, halved once for each bit that it has.
fn next_sensor(request: &Request<'_>, bits: &[u32]) -> usize {
    let model = &request.model;
    let left = |n: usize| {
        let ratio = model.prior().deviation() / model.noise().deviation(n);
        ratio.ln() - f64::from(bits[n]) * std::f64::consts::LN_2
    };
    let open = (0..bits.len()).filter(|n| bits[*n] < MAX_BITS);
    open.max_by(|a, b| left(*a).total_cmp(&left(*b))).unwrap_or(0)
}

/// The distributions that were tried, with their signed values.
struct Tried<'a, 'b> {
    request: &'a Request<'b>,
    values: BTreeMap<Vec<u32>, f64>,
}

impl Tried<'_, '_> {
    /// The best of some distributions, with its signed value; `None` if there is none or the time limit is reached.
    fn best_of(&mut self, shares: &[Vec<u32>], control: &mut Control<'_>) -> Result<Option<(f64, Vec<u32>)>, Error> {
        let mut best: Option<(f64, Vec<u32>)> = None;
        for bits in shares {
            if !control.go_on() {
                return Ok(None);
            }
            let value = match self.values.get(bits) {
                Some(value) => *value,
                None => {
                    let value = self.value_of(bits, control)?;
                    self.values.insert(bits.clone(), value);
                    value
                }
            };
            if best.as_ref().is_none_or(|b| value > b.0) {
                best = Some((value, bits.clone()));
            }
        }
        Ok(best)
    }

    fn value_of(&self, bits: &[u32], control: &mut Control<'_>) -> Result<f64, Error> {
        let participants = SensorDesign::all(bits, &self.request.links);
        let sensors: Vec<usize> = participants.iter().map(|p| p.sensor).collect();
        let search = Search {
            model: &self.request.model.subset(&sensors)?,
            criterion: self.request.criterion,
            participants: &participants,
            shape: AllowedCells::Intervals,
            starts: 2,
            given: None,
        };
        let value = search.run(control)?.value;
        // Too many joint symbols: this distribution is not used.
        Ok(if value.is_nan() { f64::NEG_INFINITY } else { value })
    }
}
