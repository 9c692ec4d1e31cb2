//! Discrete memoryless channels from quantizer levels to received symbols.

use crate::error::{Error, refuse};
use crate::labelling::Labelling;

use fewbits_numerics::normal;
use serde::{Deserialize, Serialize};

/// Largest number of entries of a transition matrix.
const MAX_ENTRIES: u64 = 1 << 24;
/// Columns may sum to one within this; they are not renormalised.
const SUM_TOLERANCE: f64 = 1e-9;

/// `P(received = t | sent = z)`, with any number of outputs: a matrix whose columns sum to one.
///
/// There may be more outputs than inputs, for soft decisions or erasures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Vec<Vec<f64>>", into = "Vec<Vec<f64>>")]
pub struct Channel {
    inputs: usize,
    outputs: usize,
    /// Row-major, outputs by inputs.
    transition: Vec<f64>,
}

impl From<Channel> for Vec<Vec<f64>> {
    /// The rows, one per received symbol.
    fn from(channel: Channel) -> Self {
        channel
            .transition
            .chunks_exact(channel.inputs)
            .map(<[f64]>::to_vec)
            .collect()
    }
}

impl TryFrom<Vec<Vec<f64>>> for Channel {
    type Error = Error;

    fn try_from(rows: Vec<Vec<f64>>) -> Result<Self, Error> {
        Self::from_rows(&rows)
    }
}

impl Channel {
    /// The channel that delivers every level as it was sent.
    ///
    /// # Errors
    /// If `levels < 2`; [`Error::TooLarge`] for more than 16 million entries, which holds for every constructor.
    pub fn ideal(levels: usize) -> Result<Self, Error> {
        Self::from_fn(levels, levels, |t, z| if t == z { 1.0 } else { 0.0 })
    }

    /// A channel from any matrix whose columns sum to one, given by rows: `rows[t][z]`.
    ///
    /// # Errors
    /// If the rows differ in length, there are fewer than two columns or no row, an entry is not in `[0, 1]`, or a column does
    /// not sum to 1 within 1e-9.
    pub fn from_rows(rows: &[Vec<f64>]) -> Result<Self, Error> {
        let inputs = rows.first().map_or(0, Vec::len);
        if let Some(t) = rows.iter().position(|r| r.len() != inputs) {
            return refuse("rows", format!("{} entries in row {t}", rows[t].len()), format!("{inputs} entries"));
        }
        Self::from_fn(inputs, rows.len(), |t, z| rows[t][z])
    }

    fn from_fn(inputs: usize, outputs: usize, p: impl Fn(usize, usize) -> f64) -> Result<Self, Error> {
        if inputs < 2 {
            return refuse("levels", inputs, "at least two channel inputs");
        }
        if outputs == 0 {
            return refuse("rows", "empty", "at least one channel output");
        }
        let needed = (inputs as u64).saturating_mul(outputs as u64);
        Error::at_most("transition matrix of a channel", needed, MAX_ENTRIES)?;
        // Fill the table, then check that entries are probabilities and columns sum to one.
        let transition: Vec<f64> = (0..outputs)
            .flat_map(|t| (0..inputs).map(move |z| (t, z)))
            .map(|(t, z)| p(t, z))
            .collect();
        if let Some(at) = transition.iter().position(|p| !(0.0..=1.0).contains(p)) {
            let place = format!("{} in row {}, column {}", transition[at], at / inputs, at % inputs);
            return refuse("channel", place, "probabilities in [0, 1]");
        }
        for z in 0..inputs {
            let sum: f64 = (0..outputs).map(|t| transition[t * inputs + z]).sum();
            if (sum - 1.0).abs() > SUM_TOLERANCE {
                return refuse("channel", format!("column {z} with sum {sum}"), "columns that sum to 1");
            }
        }
        Ok(Self {
            inputs,
            outputs,
            transition,
        })
    }

    /// A binary symmetric channel: each bit of the word is inverted with probability `crossover`, independently.
    ///
    /// `C[t, z] = eps^d (1 - eps)^(k - d)`, with `d` the Hamming distance of the words and `k` their bits. A crossover above 1/2 is
    /// accepted. A word that the labelling does not use is an output that no input maps to.
    ///
    /// # Errors
    /// If `crossover` is not in `[0, 1]`.
    pub fn binary_symmetric(labelling: &Labelling, crossover: f64) -> Result<Self, Error> {
        let eps = fewbits_numerics::error::within("crossover", crossover, 0.0, 1.0)?;
        let bits = labelling.bits();
        Self::from_fn(labelling.levels(), labelling.symbols(), |t, z| {
            // Every symbol has a word, so the second arm is never taken.
            let distance = match (labelling.word(t), labelling.word(z)) {
                (Some(a), Some(b)) => (a ^ b).count_ones(),
                _ => bits,
            };
            eps.powi(distance as i32) * (1.0 - eps).powi((bits - distance) as i32)
        })
    }

    /// The symbol is lost with probability `erasure`, and the receiver knows it: output `levels` is the erasure.
    ///
    /// # Errors
    /// If `levels < 2` or `erasure` is not in `[0, 1]`.
    pub fn symbol_erasure(levels: usize, erasure: f64) -> Result<Self, Error> {
        fewbits_numerics::error::within("erasure", erasure, 0.0, 1.0)?;
        Self::from_fn(levels, levels.saturating_add(1), |t, z| match t {
            t if t == levels => erasure,
            t if t == z => 1.0 - erasure,
            _ => 0.0,
        })
    }

    /// Pulse amplitude modulation with hard decisions: equidistant amplitudes, unit-variance noise, thresholds midway between amplitudes.
    ///
    /// Half the distance of two amplitudes is `sqrt(3 snr / (levels^2 - 1))` noise standard deviations, `snr` being mean signal
    /// power over noise power (10 dB is 10).
    ///
    /// # Errors
    /// If `levels < 2` or `snr` is not a positive number.
    pub fn pulse_amplitude(levels: usize, snr: f64) -> Result<Self, Error> {
        fewbits_numerics::error::positive("snr", snr)?;
        // Amplitudes -(L-1), .., L-1 in steps of 2 have mean square (L^2 - 1) / 3 in units of half their distance.
        let half = (3.0 * snr / (levels as f64 * levels as f64 - 1.0)).sqrt();
        Self::from_fn(levels, levels, |t, z| {
            let offset = 2.0 * (t as f64 - z as f64);
            let lower = if t == 0 {
                f64::NEG_INFINITY
            } else {
                (offset - 1.0) * half
            };
            let upper = if t + 1 == levels {
                f64::INFINITY
            } else {
                (offset + 1.0) * half
            };
            normal::interval(lower, upper)
        })
    }

    /// Number of levels that can be sent.
    pub fn inputs(&self) -> usize {
        self.inputs
    }

    /// Number of symbols that can be received.
    pub fn outputs(&self) -> usize {
        self.outputs
    }

    /// `P(received = output | sent = input)`; 0 if there is no such symbol.
    pub fn probability(&self, output: usize, input: usize) -> f64 {
        if input < self.inputs && output < self.outputs {
            self.transition[output * self.inputs + input]
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_clean_binary_channel_is_the_identity_for_any_labelling() {
        for labelling in [Labelling::gray(8).unwrap(), Labelling::new(vec![0, 3, 1, 2]).unwrap()] {
            assert_eq!(Channel::binary_symmetric(&labelling, 0.0), Channel::ideal(labelling.levels()));
        }
    }

    #[test]
    fn what_is_no_channel_is_refused() {
        assert!(
            Channel::from_rows(&[vec![0.5, 1.0], vec![0.4, 0.0]])
                .unwrap_err()
                .to_string()
                .contains("column 0")
        );
        assert!(Channel::from_rows(&[vec![1.5, 1.0], vec![-0.5, 0.0]]).is_err());
        assert!(Channel::from_rows(&[vec![0.5, 1.0], vec![0.5]]).is_err());
        assert!(Channel::from_rows(&[]).is_err());
        // A word without a level is never received where no bit is inverted.
        let three = Channel::binary_symmetric(&Labelling::natural(3).unwrap(), 0.0).unwrap();
        assert_eq!((three.inputs(), three.outputs(), three.probability(3, 2)), (3, 4, 0.0));
        assert!(Channel::binary_symmetric(&Labelling::natural(4).unwrap(), -0.1).is_err());
        assert!(Channel::symbol_erasure(4, f64::NAN).is_err());
        assert!(Channel::pulse_amplitude(4, 0.0).is_err());
        assert!(serde_json::from_str::<Channel>("[[0.5,1.0],[0.4,0.0]]").is_err());
    }

    #[test]
    fn a_channel_too_large_for_memory_is_a_typed_error() {
        for levels in [1 << 40, usize::MAX] {
            assert!(matches!(Channel::ideal(levels), Err(Error::TooLarge { .. })));
            assert!(matches!(Channel::symbol_erasure(levels, 0.1), Err(Error::TooLarge { .. })));
            assert!(matches!(Channel::pulse_amplitude(levels, 10.0), Err(Error::TooLarge { .. })));
        }
        let four = Channel::pulse_amplitude(4, 10.0).unwrap();
        assert_eq!(four.probability(usize::MAX, 3), 0.0);
        assert_eq!(four.probability(1, usize::MAX), 0.0);
        assert_eq!(serde_json::from_str::<Channel>(&serde_json::to_string(&four).unwrap()).unwrap(), four);
    }
}
