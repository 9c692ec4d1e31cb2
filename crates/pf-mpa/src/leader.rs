//! Which sensor leads the next step, what the leaders hand over, and how many bits both cost.

use crate::Error;
use fewbits_core::{BitReader, BitWriter, CodecError, Gaussian, Message, NumberFormat};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use nalgebra::{Matrix4, SMatrix, Vector2, Vector4};
use serde::{Deserialize, Serialize};

/// The outcome of an election among sensors, each with its own estimate.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Election {
    /// Sensors that are the nearest to their own estimate, in increasing order.
    pub claimants: Vec<usize>,
    /// The leader: the claimant of lowest number. Without a claimant, after a time-out, the sensor that is nearest to its own estimate.
    pub leader: usize,
}

/// Holds the election. Sensor `i` claims the lead if no sensor is nearer to its estimate `estimates[i]`; ties go to the lowest
/// number. Deterministic trackers on the same reports hold the same estimate, and exactly one sensor claims.
///
/// # Errors
/// If there is no sensor, or not one estimate per sensor, or a number is not finite.
pub fn elect(positions: &[Vector2<f64>], estimates: &[Vector2<f64>]) -> Result<Election, Error> {
    at_least_one("sensors", positions.len())?;
    if positions.len() != estimates.len() {
        let expected = format!("{}, one per sensor", positions.len());
        return refuse("estimates", format!("{} estimates", estimates.len()), expected);
    }
    for p in positions.iter().chain(estimates) {
        fewbits_numerics::error::all_finite("positions and estimates", p.as_slice())?;
    }
    let claims = |i: &usize| nearest(positions, &estimates[*i]) == *i;
    let claimants: Vec<usize> = (0..positions.len()).filter(claims).collect();
    let own = |i: usize| (positions[i] - estimates[i]).norm_squared();
    let timed_out = (1..positions.len()).fold(0, |best, i| if own(i) < own(best) { i } else { best });
    let leader = claimants.first().copied().unwrap_or(timed_out);
    Ok(Election { claimants, leader })
}

/// Index of the sensor nearest to a place, the lowest in a tie; 0 without sensors.
pub fn nearest(positions: &[Vector2<f64>], place: &Vector2<f64>) -> usize {
    let distance = |i: usize| (positions[i] - place).norm_squared();
    (1..positions.len()).fold(0, |best, i| if distance(i) < distance(best) { i } else { best })
}

/// What a leader hands over: mean and covariance, 14 numbers. The covariance is sent as its lower triangular factor, so that it is
/// positive semidefinite after rounding.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeaderMessage {
    mean: Vector4<f64>,
    lower: Matrix4<f64>,
}

impl LeaderMessage {
    /// The belief as it arrives in the given format.
    ///
    /// # Errors
    /// If a number is not finite or exceeds the format.
    pub fn new(belief: &Gaussian<4>, format: &NumberFormat) -> Result<Self, Error> {
        let lower = lower_factor(belief.covariance());
        let (mut mean, mut rounded) = (*belief.mean(), Matrix4::zeros());
        for x in mean.iter_mut() {
            *x = format.rounded(*x)?;
        }
        for (i, j) in triangle() {
            rounded[(i, j)] = format.rounded(lower[(i, j)])?;
        }
        Ok(Self { mean, lower: rounded })
    }

    /// The belief that all nodes hold after the handover.
    pub fn belief(&self) -> Gaussian<4> {
        Gaussian::from_trusted_parts(self.mean, self.lower * self.lower.transpose())
    }
}

/// Row and column of each entry of the lower triangle.
fn triangle() -> impl Iterator<Item = (usize, usize)> {
    (0..4).flat_map(|i| (0..=i).map(move |j| (i, j)))
}

/// Cholesky factor of a covariance. The columns of directions without variance are zero.
///
/// It does not pivot, so it is a continuous function of the covariance: a rounding error does not make draws jump.
pub fn lower_factor<const D: usize>(covariance: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    let mut lower = SMatrix::<f64, D, D>::zeros();
    for j in 0..D {
        let own = covariance[(j, j)];
        let pivot: f64 = own - (0..j).map(|k| lower[(j, k)] * lower[(j, k)]).sum::<f64>();
        if pivot <= 1e-12 * own {
            continue;
        }
        let root = f64::sqrt(pivot);
        lower[(j, j)] = root;
        for i in j + 1..D {
            let rest = covariance[(i, j)] - (0..j).map(|k| lower[(i, k)] * lower[(j, k)]).sum::<f64>();
            lower[(i, j)] = rest / root;
        }
    }
    lower
}

impl Message for LeaderMessage {
    type Format = NumberFormat;

    fn encode(&self, format: &NumberFormat, writer: &mut BitWriter) -> Result<(), CodecError> {
        self.mean.encode(format, writer)?;
        triangle().try_for_each(|at| format.write(self.lower[at], writer))
    }

    fn decode(format: &NumberFormat, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        let (mean, mut lower) = (Vector4::decode(format, reader)?, Matrix4::zeros());
        for at in triangle() {
            lower[at] = format.read(reader)?;
        }
        Ok(Self { mean, lower })
    }
}

/// Numbers of bits of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepBits {
    /// Levels of all sensors together.
    pub reports: u64,
    /// Mean and covariance from leader to leader. Not needed if all nodes receive all levels and run the same deterministic
    /// tracker.
    pub handover: u64,
    /// Ranges of all sensors as unquantized numbers, for comparison.
    pub raw: u64,
}

impl StepBits {
    /// Bits of a step of `sensors` sensors with `levels` levels, numbers in `format`.
    ///
    /// # Errors
    /// If there is no sensor or there are fewer than two levels.
    pub fn new(sensors: usize, levels: usize, format: &NumberFormat) -> Result<Self, Error> {
        at_least_one("sensors", sensors)?;
        let word = fewbits_quantizers::Labelling::natural(levels)?.bits();
        let known = LeaderMessage::new(&Gaussian::known(Vector4::zeros())?, format);
        let handover = known.and_then(|h| Ok(h.to_bits(format)?.bits()))?;
        Ok(Self {
            reports: sensors as u64 * u64::from(word),
            handover: handover as u64,
            raw: sensors as u64 * u64::from(format.bits()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::laws::message::{decoding_is_total, round_trip};

    #[test]
    fn a_handover_is_fourteen_numbers_and_stays_a_covariance() {
        let root = Matrix4::from_fn(|i, j| (i * 4 + j) as f64 * 0.1 - 0.5);
        for scale in [1e-4, 1.0, 1e4] {
            // Rank two, so that rounding the covariance itself would lose definiteness.
            let mut thin = root * scale;
            thin.column_mut(2).fill(0.0);
            thin.column_mut(3).fill(0.0);
            let belief = Gaussian::new(Vector4::repeat(scale / 3.0), thin * thin.transpose()).unwrap();
            let sent = LeaderMessage::new(&belief, &NumberFormat::Single).unwrap();
            assert_eq!(round_trip(&sent, &NumberFormat::Single), Ok(448));
            let arrived = sent.belief();
            assert!(Gaussian::new(*arrived.mean(), *arrived.covariance()).is_ok());
            assert!((arrived.covariance() - belief.covariance()).amax() < 1e-5 * scale * scale);
        }
        let bits = LeaderMessage::new(&Gaussian::known(Vector4::zeros()).unwrap(), &NumberFormat::Double).unwrap();
        let bits = bits.to_bits(&NumberFormat::Double).unwrap();
        assert!(
            (0..bits.bits())
                .step_by(7)
                .all(|i| decoding_is_total::<LeaderMessage>(&bits.clone().with_flipped(i), &NumberFormat::Double))
        );
    }

    /// Counted by hand: five sensors of two and of four bits, fourteen numbers of 32 bits, five ranges of 32 bits.
    #[test]
    fn published_protocol_costs_more_than_plain_ranges() {
        for (levels, reports) in [(4, 10), (16, 20)] {
            let bits = StepBits::new(5, levels, &NumberFormat::Single).unwrap();
            assert_eq!((bits.reports, bits.handover, bits.raw), (reports, 448, 160));
        }
        for levels in [2, 256] {
            let bits = StepBits::new(5, levels, &NumberFormat::Single).unwrap();
            assert!(bits.reports + bits.handover > bits.raw);
        }
    }

    #[test]
    fn elections_break_ties_and_time_out() {
        let sensors = [Vector2::new(0.0, 0.0), Vector2::new(2.0, 0.0), Vector2::new(4.0, 0.0)];
        let all = |x: f64| vec![Vector2::new(x, 0.0); 3];
        let of = |estimates: Vec<Vector2<f64>>| elect(&sensors, &estimates).unwrap();
        assert_eq!(of(all(1.9)).claimants, [1]);
        assert_eq!(of(all(1.0)).claimants, [0], "a tie goes to the lowest number");
        // Each believes the target near another: none claims, the one with the smallest distance of its own leads.
        let none = of(vec![Vector2::new(2.2, 0.0), Vector2::new(4.0, 0.0), Vector2::new(0.1, 0.0)]);
        assert!(none.claimants.is_empty());
        assert_eq!(none.leader, 1);
        let several = of(vec![Vector2::new(0.1, 0.0), Vector2::new(2.1, 0.0), Vector2::new(0.1, 0.0)]);
        assert_eq!((several.claimants, several.leader), (vec![0, 1], 0));
        assert!(elect(&sensors, &[]).is_err() && elect(&[], &[]).is_err());
    }
}
