//! The sensors that take part in a design, their cells and words, and the system that they form.

use super::landscape::Words;
use crate::error::Error;
use crate::observation_model::ObservationModel;
use crate::system::{SensorGroup, System};
use fewbits_core::Link;
use fewbits_numerics::error::entries;
use fewbits_quantizers::quantizer::{cell_of, check_increasing};
use fewbits_quantizers::{Channel, Quantizer, lloyd_max};
use serde::{Deserialize, Serialize};

/// Cells and words of one sensor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorDesign {
    /// Number of the sensor in the request.
    pub sensor: usize,
    /// Bits of a word.
    pub bits: u32,
    /// Breakpoints between the cells, increasing.
    pub breakpoints: Vec<f64>,
    /// Word of each cell, one more than breakpoints.
    pub words: Vec<usize>,
    /// The link over which the words are sent.
    pub link: Link,
}

impl SensorDesign {
    /// The word for a sample.
    ///
    /// # Errors
    /// If the sample is NaN.
    pub fn encode(&self, sample: f64) -> Result<usize, Error> {
        Ok(self.words[cell_of(&self.breakpoints, sample)?])
    }

    /// Number of symbols that can be received: all words, and one more after them, "nothing", if a word may be missing.
    pub fn symbols(&self) -> usize {
        (1 << self.bits) + usize::from(missing(&self.link) > 0.0)
    }

    /// The sensors with at least one bit, of a single cell each.
    pub(super) fn all(bits: &[u32], links: &[Link]) -> Vec<Self> {
        let pairs = bits.iter().zip(links).enumerate().filter(|(_, (bits, _))| **bits > 0);
        pairs
            .map(|(sensor, (bits, link))| Self {
                sensor,
                bits: *bits,
                breakpoints: Vec::new(),
                words: vec![0],
                link: *link,
            })
            .collect()
    }

    /// Its cells and words.
    pub(super) fn cells(&self) -> WordedCells {
        WordedCells {
            breakpoints: self.breakpoints.clone(),
            words: self.words.clone(),
        }
    }

    /// The channels of several sensors.
    pub(super) fn laws(sensors: &[Self]) -> Result<Vec<Channel>, Error> {
        sensors.iter().map(Self::law).collect()
    }

    /// The channel from words to received symbols: the words, and one more symbol "missing" if the link can lose words.
    fn law(&self) -> Result<Channel, Error> {
        let words = 1u64 << self.bits;
        let received = |t: u64| {
            let arrives = |w: u64| self.link.arrival() * self.link.word_probability(w, t, self.bits);
            (0..words).map(arrives).collect()
        };
        let mut rows: Vec<Vec<f64>> = (0..words).map(received).collect();
        let missing = missing(&self.link);
        if missing > 0.0 {
            rows.push(vec![missing; words as usize]);
        }
        Channel::from_rows(&rows)
    }
}

/// Probability that a word is not received. It does not matter whether the loss is noticed, since these sensors always report.
pub(super) fn missing(link: &Link) -> f64 {
    link.loss() + link.erasure()
}

/// The cells of a sensor with their words.
#[derive(Debug, Clone, PartialEq)]
pub struct WordedCells {
    /// Breakpoints between the cells, increasing.
    pub breakpoints: Vec<f64>,
    /// Word of each cell, one more than breakpoints.
    pub words: Vec<usize>,
}

impl WordedCells {
    /// An error unless breakpoints increase and there is a word for each cell.
    pub(super) fn check(&self) -> Result<(), Error> {
        check_increasing(&self.breakpoints)?;
        Ok(entries("words", self.words.len(), self.breakpoints.len() + 1)?)
    }

    /// The cells of a grid, with runs of equal words joined.
    pub(super) fn of(edges: &[f64], words: &[usize]) -> Self {
        let changes: Vec<usize> = (1..words.len()).filter(|c| words[*c] != words[c - 1]).collect();
        Self {
            breakpoints: changes.iter().map(|c| edges[c - 1]).collect(),
            words: std::iter::once(words[0])
                .chain(changes.iter().map(|c| words[*c]))
                .collect(),
        }
    }

    /// The words of the cells of a grid, each the word at the middle of the grid cell.
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

/// Lloyd-Max cells of a normal sample, with a word for each level.
pub(super) fn plain(
    model: &ObservationModel,
    participants: &[SensorDesign],
    word: fn(usize) -> usize,
) -> Result<Vec<WordedCells>, Error> {
    let of = |(n, participant): (usize, &SensorDesign)| {
        let levels = 1usize << participant.bits;
        let lloyd = lloyd_max::gaussian(levels)?.affine(model.prior().mean(), model.sample_deviation(n))?;
        Ok(WordedCells {
            breakpoints: lloyd.breakpoints().to_vec(),
            words: (0..levels).map(word).collect(),
        })
    };
    participants.iter().enumerate().map(of).collect()
}

/// Gray code word of a level.
pub(super) fn gray(level: usize) -> usize {
    level ^ (level >> 1)
}

/// The word equal to the level's number.
pub(super) fn natural(level: usize) -> usize {
    level
}

/// The system of these cells and words. Symbols are the received words, and one more if a word may be missing.
pub(super) fn system_of(
    model: &ObservationModel,
    participants: &[SensorDesign],
    cells: &[WordedCells],
    apart: bool,
) -> Result<System, Error> {
    let laws = SensorDesign::laws(participants)?;
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for n in 0..participants.len() {
        // Sensors of equal design, link and noise form a group, whose outcomes are counts.
        let alike = groups.iter_mut().find(|group| {
            let first = group[0];
            !apart && cells[first] == cells[n] && laws[first] == laws[n] && model.interchangeable(first, n)
        });
        match alike {
            Some(group) => group.push(n),
            None => groups.push(vec![n]),
        }
    }
    let groups = groups.into_iter().map(|sensors| {
        let (quantizer, channel) = parts_of(model, &laws[sensors[0]], &cells[sensors[0]])?;
        Ok(SensorGroup {
            quantizer,
            channel,
            sensors,
        })
    });
    System::new(model.clone(), groups.collect::<Result<_, Error>>()?)
}

/// Quantizer and channel of one sensor. A sensor with a single cell gets a second cell with the same word.
fn parts_of(model: &ObservationModel, law: &Channel, cells: &WordedCells) -> Result<(Quantizer, Channel), Error> {
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
    // A quantizer has at least two cells: a sensor with one cell gets two with the same word.
    if used.len() == 1 {
        used.push(used[0]);
        (labels, breakpoints) = (vec![0, 1], vec![model.prior().mean()]);
    }
    let rows = (0..law.outputs()).map(|t| used.iter().map(|w| law.probability(t, *w)).collect());
    let rows: Vec<Vec<f64>> = rows.collect();
    Ok((Quantizer::with_labels(breakpoints, labels)?, Channel::from_rows(&rows)?))
}
