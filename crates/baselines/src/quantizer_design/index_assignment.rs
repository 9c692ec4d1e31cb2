//! Assignments of words to cells for sensors that report over a binary symmetric channel.
//!
//! On a symmetric channel nothing changes if the same bit of every word is inverted or two bit positions are exchanged. Without these
//! equivalents a short quantizer has few assignments of words to cells (three for four cells and two bits: natural, Gray and
//! one more), so all of them are designed and compared. Assignments with fewer cells than words are included: with a poor channel one of
//! them is the best, and a design of the full number of cells makes cells empty.

use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::Criterion;
use fewbits_quantizer_design::Error;
use fewbits_quantizer_design::Newton;
use fewbits_quantizer_design::design::{Design, joint};
use fewbits_quantizer_design::observation_model::ObservationModel;
use fewbits_quantizer_design::system::{SensorGroup, System};
use fewbits_quantizers::Channel;
use fewbits_quantizers::Labelling;
use fewbits_quantizers::Quantizer;
use fewbits_quantizers::lloyd_max;
use std::ops::RangeInclusive;

/// Longest word for which assignments are enumerated: `8! / 48` of them.
const MAX_BITS: u32 = 3;
/// Largest number of combinations of assignments over the sensors.
const MAX_COMBINATIONS: u64 = 20_000;

/// An assignment of words and its design.
#[derive(Debug, Clone, PartialEq)]
pub struct WordsDesign {
    /// Word of each cell from left to right, for each group of the design.
    pub words: Vec<Vec<u32>>,
    /// The joint design with these words.
    pub design: Design,
}

/// Whether the sensors may use different words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Words {
    /// All sensors use the same words.
    Shared,
    /// Each sensor may use words of its own.
    PerSensor,
}

/// One representative of every equivalence class of assignments of `bits`-bit words to `cells` cells: the smallest sequence that
/// inverting bits and exchanging bit positions can give.
///
/// # Errors
/// If `bits` is not in `1..=3` or `cells` is not in `2..=2^bits`.
fn word_classes(bits: u32, cells: usize) -> Result<Vec<Vec<u32>>, Error> {
    if !(1..=MAX_BITS).contains(&bits) {
        return refuse("bits", bits, format!("a word length from 1 to {MAX_BITS}"));
    }
    if !(2..=1usize << bits).contains(&cells) {
        return refuse("cells", cells, format!("2 to {} cells", 1 << bits));
    }
    let orders = arrangements(bits, bits as usize);
    let permuted = |w: u32, order: &[u32]| (0..).zip(order).map(|(to, from)| (w >> from & 1) << to).sum::<u32>();
    let is_smallest = |words: &Vec<u32>| {
        let image = |order: &Vec<u32>| words.iter().map(|w| permuted(w ^ words[0], order)).collect::<Vec<_>>();
        orders.iter().all(|order| image(order) >= *words)
    };
    // Inverting bits turns any first word into 0.
    let mut words = arrangements(1 << bits, cells);
    words.retain(|words| words[0] == 0 && is_smallest(words));
    Ok(words)
}

/// All sequences of `length` different numbers below `count`, in lexicographic order.
fn arrangements(count: u32, length: usize) -> Vec<Vec<u32>> {
    (0..length).fold(vec![Vec::new()], |lists: Vec<Vec<u32>>, _| {
        let longer = |list: Vec<u32>| {
            let free: Vec<u32> = (0..count).filter(|n| !list.contains(n)).collect();
            free.into_iter().map(move |n| [list.as_slice(), &[n]].concat())
        };
        lists.into_iter().flat_map(longer).collect()
    })
}

/// Designs the sensors of `model` for every equivalence class of assignments; results are sorted, best first.
///
/// Every sensor sends words of `bits` bits over its own binary symmetric channel of the given crossover. `cells` is the range of the
/// number of cells. Each design is the joint Newton optimum from Lloyd-Max quantizers of the samples. Assignments whose design loses a
/// cell or does not converge are left out; an assignment with fewer cells is in the list instead.
///
/// # Errors
/// [`Error::Argument`] if `bits` is not in `1..=3`, `cells` is not in `2..=2^bits`, or the crossover is not in `[0, 1/2]`;
/// [`Error::TooLarge`] for more than 20000 combinations of assignments.
pub fn assign_words(
    model: &ObservationModel,
    bits: u32,
    crossover: f64,
    cells: RangeInclusive<usize>,
    criterion: Criterion,
    words: Words,
) -> Result<Vec<WordsDesign>, Error> {
    let mut classes = Vec::new();
    for count in cells {
        classes.extend(word_classes(bits, count)?);
    }
    let sensors = model.sensors();
    let combinations: Vec<Vec<usize>> = if words == Words::PerSensor {
        let needed = (classes.len() as u64).saturating_pow(sensors as u32);
        Error::at_most("list of assignments", needed, MAX_COMBINATIONS)?;
        (0..sensors).fold(vec![Vec::new()], |lists: Vec<Vec<usize>>, n| {
            let longer = |list: &Vec<usize>| {
                // Sensors of equal noise may be exchanged, so their classes are kept in order.
                let first = if n > 0 && model.interchangeable(n - 1, n) {
                    list[n - 1]
                } else {
                    0
                };
                (first..classes.len())
                    .map(|c| [list.clone(), vec![c]].concat())
                    .collect::<Vec<_>>()
            };
            lists.iter().flat_map(longer).collect()
        })
    } else {
        (0..classes.len()).map(|c| vec![c; sensors]).collect()
    };
    let mut found = Vec::new();
    for combination in combinations {
        let mut groups = Vec::with_capacity(sensors);
        for (n, class) in combination.iter().enumerate() {
            let words = &classes[*class];
            let labelling = Labelling::with_words(bits, words.clone())?;
            let channel = Channel::binary_symmetric(&labelling, crossover)?;
            let sample = lloyd_max::gaussian(words.len())?.affine(model.prior().mean(), model.sample_deviation(n))?;
            groups.push(SensorGroup {
                quantizer: Quantizer::from(&sample),
                channel,
                sensors: vec![n],
            });
        }
        let words = combination.iter().map(|c| classes[*c].clone()).collect();
        if let Ok(design) = joint(&System::new(model.clone(), groups)?, criterion, &Newton::default()) {
            found.push(WordsDesign { words, design });
        }
    }
    found.sort_by(|a, b| (criterion.sense() * b.design.value).total_cmp(&(criterion.sense() * a.design.value)));
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn four_words_have_three_classes() {
        let classes = word_classes(2, 4).unwrap();
        assert_eq!(classes, [vec![0, 1, 2, 3], vec![0, 1, 3, 2], vec![0, 3, 1, 2]]);
        assert_eq!(word_classes(2, 2).unwrap(), [vec![0, 1], vec![0, 3]]);
        assert_eq!(word_classes(3, 8).unwrap().len(), 840);
        assert!(word_classes(4, 4).is_err());
        assert!(word_classes(2, 5).is_err());
    }
}
