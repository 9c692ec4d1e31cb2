//! Sensors of unequal noise, each of which sends one bit of a Gray code, and the exact errors of their assignments.

use crate::Error;
use fewbits_binary_patterns::{
    Bank, BinaryQuantizer, Nodes, PatternSensor, Source, Threshold, gray_basis, linear_pattern, uniform_cells,
};
use fewbits_core::Observation;
use fewbits_numerics::error::{entries, positive, refuse};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_quantizer_design::outcomes::{NodeWeights, Table, explained, moments};

/// The estimator whose exact error is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Estimator {
    /// The decoder that returns the centre of the cell: `O(N)` operations per node.
    CellCentre,
    /// The posterior mean: `2^N` outcomes per node.
    PosteriorMean,
}

/// Largest number of sensors: there are `2^N` cells.
const MAX_SENSORS: usize = 16;
/// Width of quadrature panels in noise standard deviations.
const PANEL: f64 = 2.0;

/// The first two moments of `u` at the nodes, for the decoder of centres.
pub type Moments = (Vec<f64>, Vec<f64>);

/// `N` sensors that send the `N` Gray code bits of `2^N` cells over `[-V, V]`, one bit each.
///
/// The constructor computes every bit's probabilities for every sensor's noise, so that errors of assignments take little time.
#[derive(Debug, Clone, PartialEq)]
pub struct CodedSensors {
    source: Source,
    half_width: f64,
    noise_deviations: Vec<f64>,
    quantizers: Vec<BinaryQuantizer>,
    /// Nodes on `[0, V]`, since the code is symmetric except for its first bit.
    #[doc(hidden)]
    pub nodes: Nodes,
    /// Probabilities of the bit's two values at the nodes: `[bit][sensor]`.
    #[doc(hidden)]
    pub probability: Vec<Vec<Table>>,
}

impl CodedSensors {
    /// The sensors from the half width of the uniform source and each sensor's noise VARIANCE.
    ///
    /// # Errors
    /// If the half width or a variance is not positive and finite, or the number of sensors is not in `1..=16`.
    pub fn with_variances(half_width: f64, variances: &[f64]) -> Result<Self, Error> {
        let noise_deviations = variances
            .iter()
            .map(|&v| positive("variance", v).map(f64::sqrt))
            .collect::<Result<Vec<_>, _>>()?;
        Self::with_deviations(half_width, &noise_deviations)
    }

    /// The sensors from the half width of the uniform source and each sensor's noise standard deviation.
    ///
    /// # Errors
    /// As [`CodedSensors::with_variances`].
    pub fn with_deviations(half_width: f64, deviations: &[f64]) -> Result<Self, Error> {
        let sensors = deviations.len();
        if !(1..=MAX_SENSORS).contains(&sensors) {
            return refuse("deviations", format!("{sensors} entries"), "1 to 16 entries");
        }
        for deviation in deviations {
            positive("deviation", *deviation)?;
        }
        let noise_deviations = deviations.to_vec();
        let source = Source::uniform(half_width)?;
        let grid = uniform_cells(half_width, sensors)?;
        let quantizers = gray_basis(sensors)?
            .into_iter()
            .map(|mask| linear_pattern(mask, sensors)?.on(&grid))
            .collect::<Result<Vec<_>, _>>()?;
        let thresholds = noise_deviations
            .iter()
            .flat_map(|&noise| Threshold::of(grid.breakpoints(), noise));
        let thresholds: Vec<Threshold> = thresholds.collect();
        // The problem is symmetric about zero: half of the axis is used with twice the weight.
        let mut nodes = Nodes::adapted(&source, 0.0, half_width, &thresholds, PANEL, gauss_legendre::<12>());
        nodes.weights.iter_mut().for_each(|w| *w *= 2.0);
        let of = |q: &BinaryQuantizer| {
            noise_deviations
                .iter()
                .map(|noise| q.probabilities_at(&nodes.points, *noise))
                .collect()
        };
        let probability = quantizers.iter().map(of).collect();
        Ok(Self {
            source,
            half_width,
            noise_deviations,
            quantizers,
            nodes,
            probability,
        })
    }

    /// Number of sensors, which is the number of bits.
    pub fn sensors(&self) -> usize {
        self.noise_deviations.len()
    }

    /// Half width `V` of the source.
    pub fn half_width(&self) -> f64 {
        self.half_width
    }

    /// Noise standard deviation of each sensor.
    pub fn noise_deviations(&self) -> &[f64] {
        &self.noise_deviations
    }

    /// The quantizer of each Gray bit, the most significant first.
    pub fn quantizers(&self) -> &[BinaryQuantizer] {
        &self.quantizers
    }

    /// The sensors of an assignment as a bank, in the order of the bits.
    ///
    /// # Errors
    /// If the assignment is not a permutation.
    pub fn bank(&self, assignment: &[usize]) -> Result<Bank, Error> {
        check_permutation(assignment, self.sensors())?;
        let sensors = assignment
            .iter()
            .zip(&self.quantizers)
            .map(|(&n, quantizer)| PatternSensor::with_deviation(quantizer.clone(), self.noise_deviations[n]))
            .collect::<Result<_, _>>()?;
        Bank::new(self.source, sensors)
    }

    /// Exact mean squared error of an assignment under `estimator`.
    ///
    /// # Errors
    /// If the assignment is not a permutation.
    pub fn mse(&self, assignment: &[usize], estimator: Estimator) -> Result<f64, Error> {
        check_permutation(assignment, self.sensors())?;
        Ok(match estimator {
            Estimator::CellCentre => self.centre_mse(assignment),
            Estimator::PosteriorMean => self.mmse(assignment),
        })
    }

    /// Exact error of the posterior mean.
    fn mmse(&self, assignment: &[usize]) -> f64 {
        // The first bit last, so that its two values are neighbours.
        let tables: Vec<&Table> = (1..self.sensors())
            .chain([0])
            .map(|bit| &self.probability[bit][assignment[bit]])
            .collect();
        let sums = moments(&tables, &self.features());
        self.source.variance() - sums.chunks_exact(4).map(explained_by_pair).sum::<f64>()
    }

    /// Weights of probability and first moment. The nodes cover one side, with the weight of both.
    #[doc(hidden)]
    pub fn features(&self) -> [NodeWeights; 2] {
        let mass: Vec<f64> = self.nodes.weights.iter().map(|w| 0.5 * w).collect();
        let moment = mass.iter().zip(&self.nodes.points).map(|(w, x)| w * x).collect();
        [NodeWeights::of_all(mass), NodeWeights::of_all(moment)]
    }

    /// Exact error of the decoder that reads the Gray bits as a cell index and returns the cell's centre.
    ///
    /// With `t_k = E[(-1)^(z_k)|x]` the centre is `-V u_1`, where `u_k = (-1)^(z_k) (1/2 + u_{k+1}/2)`. The first two moments of
    /// `u` therefore follow by recursion from the last bit:
    ///
    /// ```text
    /// m1, m2 <- 0, 0
    /// for k = N, ..., 1:   m1, m2 <- t_k (1/2 + m1/2),  1/4 + m1/2 + m2/4
    /// MSE = E[x^2 + 2 V x m1 + V^2 m2]
    /// ```
    fn centre_mse(&self, assignment: &[usize]) -> f64 {
        let zeros = || (vec![0.0; self.nodes.points.len()], vec![0.0; self.nodes.points.len()]);
        let (mut moments, mut next) = (zeros(), zeros());
        for (bit, &sensor) in assignment.iter().enumerate().rev() {
            self.push_bit(bit, sensor, &moments, &mut next);
            std::mem::swap(&mut moments, &mut next);
        }
        self.centre_error(&moments)
    }

    /// The estimate from one observation per bit, the most significant first: the centre of the cell that the Gray bits give. The sensors
    /// always report, so a missing bit carries no information; if one is missing, the estimate is the posterior mean given the others.
    ///
    /// # Errors
    /// If the assignment is not a permutation, or there is not one observation per bit.
    pub fn decode(&self, assignment: &[usize], observations: &[Observation<bool>]) -> Result<f64, Error> {
        check_permutation(assignment, self.sensors())?;
        entries("observations", observations.len(), self.sensors())?;
        // From the last bit on, as in `centre_mse`.
        let centre = observations.iter().rev().try_fold(0.0, |u, o| {
            let sign = if *o.received()? { -1.0 } else { 1.0 };
            Some(sign * (0.5 + 0.5 * u))
        });
        match centre {
            Some(u) => Ok(-self.half_width * u),
            None => Ok(self.bank(assignment)?.posterior_mean(observations)?),
        }
    }

    /// One step of the recursion for the decoder of centres.
    #[inline]
    #[doc(hidden)]
    pub fn push_bit(&self, bit: usize, sensor: usize, (m1, m2): &Moments, next: &mut Moments) {
        let p = &self.probability[bit][sensor];
        let (p0, p1) = (p.row(0), p.row(1));
        let from = m1.iter().zip(m2).zip(p0.iter().zip(p1));
        for (((m1, m2), (p0, p1)), (next1, next2)) in from.zip(next.0.iter_mut().zip(&mut next.1)) {
            *next2 = 0.25 + 0.5 * m1 + 0.25 * m2;
            *next1 = (p0 - p1) * (0.5 + 0.5 * m1);
        }
    }

    /// Error of the centre decoder, given the moments of `u` after all bits.
    #[doc(hidden)]
    pub fn centre_error(&self, (m1, m2): &Moments) -> f64 {
        let v = self.half_width;
        let mut sum = 0.0;
        for (((m1, m2), x), w) in m1.iter().zip(m2).zip(&self.nodes.points).zip(&self.nodes.weights) {
            sum += w * (x * (x + 2.0 * v * m1) + v * v * m2);
        }
        sum
    }
}

/// What an outcome of the other bits explains, given probability and first moment with the first bit 0 and with it 1, from one side of the
/// axis. Reflecting `x` inverts the first bit and no other, so the two values are mirror images and explain the same.
pub fn explained_by_pair(sums: &[f64]) -> f64 {
    2.0 * explained(sums[0] + sums[2], sums[1] - sums[3])
}

/// An error if `assignment` is not a permutation of `0..size`.
pub(crate) fn check_permutation(assignment: &[usize], size: usize) -> Result<(), Error> {
    let mut seen = vec![false; size];
    let valid = assignment.len() == size
        && assignment
            .iter()
            .all(|&n| n < size && !std::mem::replace(&mut seen[n], true));
    if valid {
        Ok(())
    } else {
        refuse("assignment", format!("{assignment:?}"), format!("a permutation of 0..{size}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_recursion_agrees_with_all_outcomes() {
        let sensors = CodedSensors::with_variances(1.3, &[0.04, 0.2, 0.01, 0.08]).unwrap();
        let assignment = [2, 0, 3, 1];
        let bank = sensors.bank(&assignment).unwrap();
        let grid = uniform_cells(1.3, 4).unwrap();
        // The centre decoder as a table over outcomes.
        let mut exact = 0.0;
        let nodes = bank.fine_nodes();
        bank.for_outcomes(&nodes, |index, w| {
            let mut value = 0usize;
            let mut previous = 0;
            for at in (0..4).rev() {
                previous ^= index >> at & 1;
                value = 2 * value + previous;
            }
            let left = if value == 0 {
                -1.3
            } else {
                grid.breakpoints()[value - 1]
            };
            let centre = left + 1.3 / 16.0;
            exact += w
                .iter()
                .zip(&nodes.points)
                .map(|(w, x)| w * (x - centre) * (x - centre))
                .sum::<f64>();
        });
        assert_relative_eq!(sensors.mse(&assignment, Estimator::CellCentre).unwrap(), exact, max_relative = 1e-11);
        let mmse = sensors.mse(&assignment, Estimator::PosteriorMean).unwrap();
        assert!(mmse < exact);
        assert_relative_eq!(mmse, bank.mmse().unwrap(), max_relative = 1e-11);
    }

    #[test]
    fn the_bits_of_every_cell_decode_to_its_centre_and_a_missing_one_to_the_mean() {
        let sensors = CodedSensors::with_variances(2.0, &[1e-6, 1e-6, 1e-6]).unwrap();
        let order = [1, 0, 2];
        for cell in 0..8 {
            let centre = 2.0 * (2.0 * f64::from(cell) + 1.0 - 8.0) / 8.0;
            let mut seen: Vec<Observation<bool>> = sensors
                .quantizers()
                .iter()
                .map(|q| Observation::Received(q.encode(centre).unwrap()))
                .collect();
            assert!((sensors.decode(&order, &seen).unwrap() - centre).abs() < 1e-15);
            assert!(sensors.decode(&order, &seen[..2]).is_err());
            // Without the finest bit the two cells of a pair are one.
            seen[2] = Observation::Lost;
            let pair = 2.0 * (2.0 * f64::from(cell / 2) + 1.0 - 4.0) / 4.0;
            assert!((sensors.decode(&order, &seen).unwrap() - pair).abs() < 1e-2);
        }
    }

    #[test]
    fn one_bit_without_noise_leaves_half_a_cell() {
        let sensors = CodedSensors::with_variances(1.0, &[1e-8]).unwrap();
        assert_relative_eq!(sensors.mse(&[0], Estimator::CellCentre).unwrap(), 1.0 / 12.0, max_relative = 1e-3);
    }

    #[test]
    fn bad_input_is_refused() {
        assert!(CodedSensors::with_variances(0.0, &[0.1]).is_err());
        assert!(CodedSensors::with_variances(1.0, &[]).is_err());
        assert!(CodedSensors::with_variances(1.0, &[0.1; 17]).is_err());
        assert!(CodedSensors::with_variances(1.0, &[0.1, 0.0]).is_err());
        let sensors = CodedSensors::with_variances(1.0, &[0.1, 0.2]).unwrap();
        for bad in [vec![0], vec![0, 0], vec![0, 2]] {
            assert!(
                matches!(sensors.mse(&bad, Estimator::CellCentre), Err(Error::Argument(e)) if e.name == "assignment")
            );
            assert!(sensors.mse(&bad, Estimator::PosteriorMean).is_err());
        }
    }
}
