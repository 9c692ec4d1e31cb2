//! The sensors that take part in a design, their cells and words, and the system that these make.

use super::landscape::{WordLaw, Words};
use crate::error::Error;
use crate::observation_model::ObservationModel;
use crate::system::{SensorGroup, System};
use fewbits_core::Link;
use fewbits_quantizers::{Channel, Quantizer};

/// A sensor that takes part.
#[derive(Debug, Clone)]
pub(super) struct Participant {
    /// Number in the request's model.
    pub(super) sensor: usize,
    pub(super) bits: u32,
    pub(super) link: Link,
}

impl Participant {
    /// The sensors that have bits.
    pub(super) fn all(bits: &[u32], links: &[Link]) -> Vec<Self> {
        let of = |n: usize| Self {
            sensor: n,
            bits: bits[n],
            link: links[n],
        };
        (0..bits.len()).filter(|n| bits[*n] > 0).map(of).collect()
    }

    /// Transition probabilities from words to received symbols: the words, and one more symbol "missing" if the link loses words.
    pub(super) fn law(&self) -> WordLaw {
        let words = 1usize << self.bits;
        let missing = missing(&self.link);
        let outputs = words + usize::from(missing > 0.0);
        let mut transition = vec![0.0; outputs * words];
        for t in 0..words {
            for w in 0..words {
                let arrives = self.link.word_probability(w as u64, t as u64, self.bits);
                transition[t * words + w] = self.link.arrival() * arrives;
            }
        }
        if missing > 0.0 {
            transition[words * words..].fill(missing);
        }
        WordLaw {
            words,
            outputs,
            transition,
        }
    }
}

/// Probability that a word is not received. Whether that is noticed makes no difference: these sensors always report.
pub(super) fn missing(link: &Link) -> f64 {
    link.loss() + link.erasure()
}

/// Breakpoints of the cells of a sensor, and the word of each.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct WordedCells {
    pub(super) breakpoints: Vec<f64>,
    pub(super) words: Vec<usize>,
}

impl WordedCells {
    /// Runs of equal words on a grid.
    pub(super) fn of(edges: &[f64], words: &[usize]) -> Self {
        let changes: Vec<usize> = (1..words.len()).filter(|c| words[*c] != words[c - 1]).collect();
        Self {
            breakpoints: changes.iter().map(|c| edges[c - 1]).collect(),
            words: std::iter::once(words[0])
                .chain(changes.iter().map(|c| words[*c]))
                .collect(),
        }
    }

    /// The words of the cells of a grid, each that of its middle.
    pub(super) fn on(&self, edges: &[f64]) -> Words {
        (0..=edges.len())
            .map(|c| {
                let middle = match (c.checked_sub(1).map(|i| edges[i]), edges.get(c)) {
                    (Some(low), Some(high)) => 0.5 * (low + high),
                    (Some(low), None) => low.next_up(),
                    (None, Some(high)) => high.next_down(),
                    (None, None) => 0.0,
                };
                self.words[self.breakpoints.partition_point(|b| *b <= middle)]
            })
            .collect()
    }
}

/// The system of these cells and words; symbols are the received words, and one more if a word may be missing.
pub(super) fn system_of(
    model: &ObservationModel,
    participants: &[Participant],
    cells: &[WordedCells],
    apart: bool,
) -> Result<System, Error> {
    let mut groups: Vec<(usize, Vec<usize>)> = Vec::new();
    for n in 0..participants.len() {
        let alike = groups.iter_mut().find(|(first, _)| {
            !apart
                && cells[*first] == cells[n]
                && participants[*first].law() == participants[n].law()
                && model.interchangeable(*first, n)
        });
        match alike {
            Some((_, sensors)) => sensors.push(n),
            None => groups.push((n, vec![n])),
        }
    }
    let groups = groups.into_iter().map(|(first, sensors)| {
        let (quantizer, channel) = parts_of(model, first, &participants[first], &cells[first])?;
        SensorGroup::new(quantizer, channel, sensors)
    });
    System::new(model.clone(), groups.collect::<Result<_, _>>()?)
}

/// Quantizer and channel of one sensor. A sensor with a single cell gets a second one that is sent as the same word.
fn parts_of(
    model: &ObservationModel,
    sensor: usize,
    participant: &Participant,
    cells: &WordedCells,
) -> Result<(Quantizer, Channel), Error> {
    let mut used: Vec<usize> = Vec::new();
    let mut labels: Vec<usize> = Vec::new();
    for word in &cells.words {
        let at = used.iter().position(|u| u == word).unwrap_or(used.len());
        if at == used.len() {
            used.push(*word);
        }
        labels.push(at);
    }
    let mut breakpoints = cells.breakpoints.clone();
    if used.len() == 1 {
        used.push(used[0]);
        (labels, breakpoints) = (vec![0, 1], vec![model.sample_mean()]);
        debug_assert!(sensor < model.sensors());
    }
    let law = participant.law();
    let rows: Vec<Vec<f64>> = law
        .transition
        .chunks_exact(law.words)
        .map(|row| used.iter().map(|w| row[*w]).collect())
        .collect();
    Ok((Quantizer::with_labels(breakpoints, labels)?, Channel::from_rows(&rows)?))
}
