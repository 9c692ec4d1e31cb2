//! Which sensor leads the next step, what the leaders hand over, and how many bits both cost.

use fewbits_core::{Gaussian, Message, NumberFormat, RoundedGaussian};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::Error;
use nalgebra::{Vector2, Vector4};
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

/// Numbers of bits of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct StepBits {
    /// Levels of all sensors together.
    pub reports: u64,
    /// Mean and covariance from leader to leader, a [`RoundedGaussian`] of fourteen numbers. Not needed if all nodes receive all levels and
    /// run the same deterministic tracker.
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
        let known = RoundedGaussian::new(&Gaussian::known(Vector4::zeros())?, format)?;
        let handover = known.to_bits(format)?.bits();
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
