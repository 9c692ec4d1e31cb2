//! Luo's universal scheme (2005): half of the sensors send the most significant binary digit, a quarter the next, and so on.

use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::Nodes;
use fewbits_binary_patterns::engine::Kind;
use fewbits_binary_patterns::engine::bits_in_range;
use fewbits_binary_patterns::{
    Bank, BinaryQuantizer, PatternSensor, Source, linear_pattern, natural_basis, uniform_cells,
};
use fewbits_numerics::error::{positive, refuse};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_quantizer_design::outcomes::Table;

/// The allocation of sensors to binary digits, for a uniform source.
#[derive(Debug, Clone, PartialEq)]
pub struct Luo {
    source: Source,
    half_width: f64,
    noise_deviation: f64,
    quantizers: Vec<BinaryQuantizer>,
    allocation: Vec<usize>,
}

/// Mean squared errors of three ways to estimate from Luo's bits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LuoErrors {
    /// `V sum_b 2^-b (2 mean_b - 1)`, with `mean_b` the mean of the bits for digit `b`.
    pub soft: f64,
    /// The same with each mean replaced by the majority; ties are decided at random with equal probability.
    pub majority: f64,
    /// Posterior mean of the same bits.
    pub mmse: f64,
}

impl Luo {
    /// Allocates `floor(N/2)` sensors to bit 1, `floor(N/4)` to bit 2, ..., and the rest to the last: 4, 2, 2 for eight sensors and
    /// three bits.
    ///
    /// # Errors
    /// If the source is not uniform, `bits` is out of range, a bit would have no sensor, or the noise is not positive.
    pub fn new(source: Source, noise_deviation: f64, bits: usize, sensors: usize) -> Result<Self, Error> {
        let Kind::Uniform { half_width } = source.kind() else {
            return refuse("source", "Gaussian", "a uniform source");
        };
        let bits = bits_in_range(bits)?;
        let noise_deviation = positive("noise_deviation", noise_deviation)?;
        // Half of the sensors for the first bit, a quarter for the second, and so on; the rest for the last.
        let mut allocation: Vec<usize> = (1..bits).map(|b| sensors.checked_shr(b as u32).unwrap_or(0)).collect();
        allocation.push(sensors - allocation.iter().sum::<usize>());
        if allocation.contains(&0) {
            return refuse("sensors", sensors, format!("at least {} sensors", 1usize << (bits - 1)));
        }
        let grid = uniform_cells(half_width, bits)?;
        let quantizers = natural_basis(bits)?
            .into_iter()
            .map(|mask| linear_pattern(mask, bits)?.on(&grid))
            .collect::<Result<_, _>>()?;
        Ok(Self {
            source,
            half_width,
            noise_deviation,
            quantizers,
            allocation,
        })
    }

    /// Number of sensors for each bit.
    pub fn allocation(&self) -> &[usize] {
        &self.allocation
    }

    /// The sensors as a bank, ordered by bit.
    ///
    /// # Errors
    /// As [`Bank::new`].
    pub fn bank(&self) -> Result<Bank, Error> {
        let mut sensors = Vec::new();
        for (quantizer, &count) in self.quantizers.iter().zip(&self.allocation) {
            for _ in 0..count {
                sensors.push(PatternSensor::with_deviation(quantizer.clone(), self.noise_deviation)?);
            }
        }
        Bank::new(self.source, sensors)
    }

    /// Exact errors: `int p(x) [(x - E xhat)^2 + Var xhat] dx`; the bits are independent given `x`.
    ///
    /// # Errors
    /// If the bank has too many outcomes.
    pub fn errors(&self) -> Result<LuoErrors, Error> {
        let (bank, v) = (self.bank()?, self.half_width);
        let nodes = Nodes::adapted(&self.source, -v, v, &bank.thresholds(), 1.0, gauss_legendre::<12>());
        let (mut soft, mut majority) = (0.0, 0.0);
        for (&x, &w) in nodes.points.iter().zip(&nodes.weights) {
            // (mean, variance) of both estimates given x.
            let (mut by_mean, mut by_vote) = ((0.0, 0.0), (0.0, 0.0));
            // Digit `b` weighs `V / 2^b`, and the bits of different digits are independent given `x`.
            let mut weight = self.half_width;
            for (quantizer, &count) in self.quantizers.iter().zip(&self.allocation) {
                weight *= 0.5;
                let p = quantizer.probabilities(x, self.noise_deviation);
                by_mean.0 += weight * (p[1] - p[0]);
                by_mean.1 += 4.0 * weight * weight * p[0] * p[1] / count as f64;
                let vote = votes(p, count);
                by_vote.0 += weight * (vote[1] - vote[0]);
                by_vote.1 += 4.0 * weight * weight * vote[0] * vote[1];
            }
            soft += w * ((x - by_mean.0) * (x - by_mean.0) + by_mean.1);
            majority += w * ((x - by_vote.0) * (x - by_vote.0) + by_vote.1);
        }
        Ok(LuoErrors {
            soft,
            majority,
            mmse: bank.mmse()?,
        })
    }
}

/// Probabilities that the majority of `count` bits is 0 and 1.
fn votes(p: [f64; 2], count: usize) -> [f64; 2] {
    let mut votes = [0.0; 2];
    for (k, row) in Table::new(p.to_vec(), 1).of_counts(count).iter().enumerate() {
        match (2 * k).cmp(&count) {
            std::cmp::Ordering::Less => votes[0] += row[0],
            std::cmp::Ordering::Greater => votes[1] += row[0],
            std::cmp::Ordering::Equal => votes.iter_mut().for_each(|v| *v += 0.5 * row[0]),
        }
    }
    votes
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_last_bit_gets_the_rest() {
        let source = Source::uniform(1.0).unwrap();
        assert_eq!(Luo::new(source, 0.1, 3, 8).unwrap().allocation(), [4, 2, 2]);
        assert_eq!(Luo::new(source, 0.1, 3, 10).unwrap().allocation(), [5, 2, 3]);
        assert!(Luo::new(source, 0.1, 3, 3).is_err());
        assert!(Luo::new(Source::gaussian_with_deviation(1.0).unwrap(), 0.1, 3, 8).is_err());
    }

    #[test]
    fn the_posterior_mean_beats_both_fixed_rules() {
        let source = Source::uniform(1.0).unwrap();
        for noise in [0.02, 0.1, 0.5] {
            let errors = Luo::new(source, noise, 3, 8).unwrap().errors().unwrap();
            assert!(errors.mmse < errors.soft && errors.mmse < errors.majority);
        }
    }
}
