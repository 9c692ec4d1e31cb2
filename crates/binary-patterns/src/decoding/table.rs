//! Estimates for every outcome of a bank, as a table.

use super::sums::squared_error;
use crate::{Bank, Error};
use fewbits_core::Observation;
use fewbits_numerics::error::{all_finite, entries};

/// Estimates for every outcome of a bank.
#[derive(Debug, Clone, PartialEq)]
pub struct LookupTable {
    bank: Bank,
    estimates: Vec<f64>,
}

impl LookupTable {
    /// The table of these estimates, one per outcome in the order of [`Bank::for_outcomes`].
    ///
    /// # Errors
    /// If there are more than `2^26` outcomes, not one estimate per outcome, or one is not finite.
    pub fn new(bank: Bank, estimates: Vec<f64>) -> Result<Self, Error> {
        all_finite("estimates", &estimates)?;
        entries("estimates", estimates.len(), bank.checked_outcomes()?)?;
        Ok(Self { bank, estimates })
    }

    /// Exact mean squared error of the estimates.
    pub fn mse(&self) -> f64 {
        let nodes = self.bank.fine_nodes();
        let mut error = 0.0;
        self.bank
            .for_outcomes(&nodes, |index, w| error += squared_error(w, &nodes.points, self.estimates[index]));
        error
    }

    /// The estimate from one observation per sensor. The sensors always report, so a missing bit carries no information. If one is missing,
    /// the estimate is the posterior mean given the others, for every decoder.
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors.
    pub fn decode(&self, observations: &[Observation<bool>]) -> Result<f64, Error> {
        let bits: Vec<bool> = observations.iter().filter_map(|o| o.received().copied()).collect();
        if bits.len() == observations.len() {
            return self.estimate(&bits);
        }
        self.bank.posterior_mean(observations)
    }

    /// The estimate of [`decode`](Self::decode), and its mean squared error given the observations, in squared units of the source.
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors.
    pub fn decode_with_error(&self, observations: &[Observation<bool>]) -> Result<(f64, f64), Error> {
        let estimate = self.decode(observations)?;
        Ok((estimate, self.bank.posterior_squared_error(observations, estimate)?))
    }

    /// The estimate from one bit per sensor.
    ///
    /// # Errors
    /// If the number of bits is not the number of sensors.
    pub fn estimate(&self, bits: &[bool]) -> Result<f64, Error> {
        Ok(self.estimates[self.bank.index_of(bits)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{BinaryQuantizer, Source};

    #[test]
    fn a_missing_bit_leaves_the_posterior_of_the_others() {
        let q = |b: &[f64]| BinaryQuantizer::new(b.to_vec()).unwrap();
        let all = vec![q(&[0.0]), q(&[-0.5, 0.5]), q(&[0.25])];
        let bank = |quantizers: Vec<BinaryQuantizer>| {
            Bank::homogeneous_with_deviation(Source::uniform(1.0).unwrap(), quantizers, 0.2).unwrap()
        };
        let table = bank(all.clone()).table().unwrap();
        let others = bank(all[..2].to_vec()).table().unwrap();
        for bits in [[false, true], [true, true], [true, false]] {
            let mut seen = bits.map(Observation::Received).to_vec();
            seen.push(Observation::Lost);
            assert!((table.decode(&seen).unwrap() - others.estimate(&bits).unwrap()).abs() < 1e-12);
            assert!(table.decode(&seen[..2]).is_err());
            seen[2] = Observation::Received(true);
            let full = [bits[0], bits[1], true];
            assert_eq!(table.decode(&seen).unwrap(), table.estimate(&full).unwrap());
        }
    }

    /// The mean squared error of every outcome, weighted by its probability, is the mean squared error of the table.
    #[test]
    fn errors_given_the_bits_average_to_the_mse() {
        let quantizers = [vec![0.0], vec![-0.5, 0.5], vec![0.25]].map(|edges| BinaryQuantizer::new(edges).unwrap());
        let source = Source::uniform(1.0).unwrap();
        let bank = Bank::homogeneous_with_deviation(source, quantizers.to_vec(), 0.2).unwrap();
        let means = bank.table().unwrap();
        let others = LookupTable::new(bank.clone(), means.estimates.iter().map(|e| 0.9 * e).collect()).unwrap();
        for table in [means, others] {
            let mut average = 0.0;
            for word in 0..8 {
                let bits = [word & 4 != 0, word & 2 != 0, word & 1 != 0];
                // P(bits) by the trapezoidal rule over the source, which is uniform on [-1, 1].
                let steps = 4000;
                let probability: f64 = (0..=steps)
                    .map(|i| {
                        let x = -1.0 + 2.0 * f64::from(i) / f64::from(steps);
                        let end = if i == 0 || i == steps { 0.5 } else { 1.0 };
                        let given = |n: usize| bank.sensor(n).quantizer().probabilities(x, 0.2)[usize::from(bits[n])];
                        end * given(0) * given(1) * given(2) / f64::from(steps)
                    })
                    .sum();
                let seen = bits.map(Observation::Received);
                let (estimate, error) = table.decode_with_error(&seen).unwrap();
                assert_eq!(estimate, table.estimate(&bits).unwrap());
                average += probability * error;
            }
            let mse = table.mse();
            assert!((average / mse - 1.0).abs() < 1e-6, "{average} for {mse}");
        }
    }
}
