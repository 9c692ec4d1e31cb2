//! Worlds of several targets among range sensors, and what the sensors report.

use crate::prelude::*;
use fewbits_core::Cell;
use fewbits_core::factor::{Levels, Scalar, Value};
use fewbits_models::{AutoSensing, Differentiable, LinearGaussian, Number, constant_velocity_2d};
use fewbits_multi_target::{Birth, Tracker};

/// Steps of a run.
pub(super) const STEPS: usize = 40;
/// Side of the field.
const SIDE: f64 = 100.0;
/// Probability that a sensor reports a target.
pub(super) const DETECTION: f64 = 0.9;
/// Expected false reports of a sensor in a step.
const FALSE: f64 = 1.0;
/// False ranges are uniform up to this.
const FARTHEST: f64 = 115.0;
/// Where the sensors are.
const SENSORS: [[f64; 2]; 5] = [[20.0, 20.0], [80.0, 20.0], [50.0, 50.0], [20.0, 80.0], [80.0, 80.0]];

/// The distance from a sensor to `(x[0], x[2])`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Range([f64; 2]);

impl Differentiable<4, 1> for Range {
    fn at<N: Number>(&self, x: &[N; 4]) -> [N; 1] {
        let (dx, dy) = (x[0] - self.0[0], x[2] - self.0[1]);
        [(dx * dx + dy * dy).sqrt()]
    }
}

/// The two worlds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Scenario {
    /// Two targets whose paths cross in the middle of the run.
    Crossing,
    /// Five targets that appear one after the other; two of them leave.
    Appearing,
}

impl Scenario {
    pub(super) const ALL: [(&str, Self); 2] = [("two crossing", Self::Crossing), ("five appearing", Self::Appearing)];

    /// Where each target enters (x, y), its velocity, and its first step and the step after its last.
    fn targets(self) -> Vec<([f64; 4], [usize; 2])> {
        match self {
            Self::Crossing => {
                vec![
                    ([10.0, 2.0, 40.0, 0.5], [0, STEPS]),
                    ([10.0, 2.0, 60.0, -0.5], [0, STEPS]),
                ]
            }
            Self::Appearing => vec![
                ([10.0, 1.5, 10.0, 1.0], [0, STEPS]),
                ([90.0, -1.5, 10.0, 1.0], [4, 30]),
                ([10.0, 1.0, 90.0, -1.5], [8, STEPS]),
                ([90.0, -1.0, 90.0, -1.0], [12, 36]),
                ([10.0, 1.0, 10.0, 1.5], [16, STEPS]),
            ],
        }
    }

    /// Deviations of a target about its entrance.
    fn spread(place: [f64; 4]) -> Result<Gaussian<4>, Error> {
        let covariance = Matrix4::from_diagonal(&Vector4::new(25.0, 0.25, 25.0, 0.25));
        Ok(Gaussian::new(Vector4::from(place), covariance)?)
    }

    /// A tracker that knows the entrances and how often targets come.
    pub(super) fn tracker(self) -> Result<Tracker<4>, Error> {
        let mut births = Vec::new();
        for (place, _) in self.targets() {
            // The fifth enters where the first did.
            let known = |birth: &Birth<4>| (birth.belief.mean() - Vector4::from(place)).amax() < 1.0;
            if !births.iter().any(known) {
                births.push(Birth {
                    probability: 0.02,
                    belief: Self::spread(place)?,
                });
            }
        }
        Ok(Tracker::new(0.99, births)?)
    }
}

pub(super) fn motion() -> Result<LinearGaussian<4, 2>, Error> {
    Ok(constant_velocity_2d(1.0, 0.01)?)
}

/// One step of a world: the targets that are there, and the ranges that each sensor measured, false ones among them.
pub(super) struct Moment {
    pub(super) targets: Vec<Vector2<f64>>,
    pub(super) ranges: Vec<Vec<f64>>,
}

/// The sensors of all worlds, with this deviation of a range.
pub(super) fn sensors(noise: f64) -> Result<Vec<AutoSensing<Range, 1>>, Error> {
    let sensor = |place| Ok(AutoSensing::new(Range(place), Matrix1::new(noise * noise))?);
    SENSORS.map(sensor).into_iter().collect()
}

/// A run of the scenario.
pub(super) fn draw(scenario: Scenario, noise: f64, stream: Stream) -> Result<Vec<Moment>, Error> {
    let (mut rng, motion, sensors) = (stream.named("truth").rng(), motion()?, sensors(noise)?);
    let mut targets = Vec::new();
    for (place, times) in scenario.targets() {
        targets.push((Scenario::spread(place)?.sample(&mut rng), times));
    }
    let mut moments = Vec::new();
    for k in 0..STEPS {
        let mut ranges = vec![Vec::new(); SENSORS.len()];
        let mut there = Vec::new();
        for (state, [from, to]) in &mut targets {
            if !(*from..*to).contains(&k) {
                continue;
            }
            *state = motion.propagate(&mut rng, state);
            there.push(Vector2::new(state[0], state[2]));
            for (sensor, ranges) in sensors.iter().zip(&mut ranges) {
                let z = sensor.sample(&mut rng, state)[0];
                if rng.random::<f64>() < DETECTION {
                    ranges.push(z.max(0.0));
                }
            }
        }
        for ranges in &mut ranges {
            // Poisson of mean `FALSE`, by the product of uniform numbers.
            let mut left = rng.random::<f64>();
            while left > (-FALSE).exp() {
                ranges.push(rng.random::<f64>() * FARTHEST);
                left *= rng.random::<f64>();
            }
        }
        moments.push(Moment { targets: there, ranges });
    }
    Ok(moments)
}

/// What a sensor sends of a range.
pub(super) enum Reporting {
    /// The range.
    Full,
    /// The index of one of `2^bits` cells: the edges of each sensor in even and in odd steps.
    Cells(Vec<[Vec<f64>; 2]>),
}

impl Reporting {
    /// Cells for targets that may be anywhere in the field: their density is the cube root of that of the range, which for many cells has
    /// the least distortion (Panter and Dite 1951). In odd steps the edges lie half a cell beside those of even ones, so that no target
    /// stays in the middle of a wide cell.
    pub(super) fn cells(bits: u32) -> Self {
        let edges = |place: &[f64; 2]| {
            const NODES: usize = 100;
            let at = |i: usize| (i as f64 + 0.5) * SIDE / NODES as f64;
            // How often a range lies in each metre, and the cumulative cube root.
            let mut counts = vec![0.0; FARTHEST as usize];
            for i in 0..NODES * NODES {
                let range = (at(i / NODES) - place[0]).hypot(at(i % NODES) - place[1]);
                if let Some(count) = counts.get_mut(range as usize) {
                    *count += 1.0;
                }
            }
            let mut sums = vec![0.0];
            for count in counts {
                sums.push(sums[sums.len() - 1] + f64::cbrt(count));
            }
            let cells = f64::from(1_u32 << bits);
            let edge = |share: f64| {
                let wanted = share * sums[sums.len() - 1];
                let above = sums.partition_point(|sum| *sum < wanted).max(1);
                above as f64 - (sums[above] - wanted) / (sums[above] - sums[above - 1])
            };
            [-0.25, 0.25].map(|shift| {
                (1..1_u32 << bits)
                    .map(|k| edge((f64::from(k) + shift) / cells))
                    .collect()
            })
        };
        Self::Cells(SENSORS.iter().map(edges).collect())
    }

    /// The factor of a report of a sensor in a step, and the intensity of false reports at it.
    pub(super) fn report(&self, step: usize, sensor: usize, range: f64, noise: f64) -> Result<(Scalar, f64), Error> {
        match self {
            Self::Full => Ok((Value::scalar(range, noise * noise)?.into(), FALSE / FARTHEST)),
            Self::Cells(edges) => {
                let edges = &edges[sensor][step % 2];
                let index = edges.partition_point(|edge| *edge <= range);
                let lower = if index == 0 {
                    f64::NEG_INFINITY
                } else {
                    edges[index - 1]
                };
                let upper = edges.get(index).copied().unwrap_or(f64::INFINITY);
                let share = (upper.min(FARTHEST) - lower.max(0.0)) / FARTHEST;
                let factor = Levels::certain(Cell::new(lower, upper)?, noise * noise)?;
                Ok((factor.into(), FALSE * share))
            }
        }
    }
}

/// A report as the tracker takes it.
pub(super) type Seen = Observed<AutoSensing<Range, 1>, Scalar, 1>;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Context;

    #[test]
    #[ignore = "prints the worlds that references/targets.py reads"]
    fn worlds_are_written() {
        for (name, scenario) in Scenario::ALL {
            let stream = Context::new(1).stream("targets-gospa").named(name);
            let trials = Context::new(1)
                .trials(stream, 60, |trial| draw(scenario, 6.0, trial.stream))
                .unwrap();
            assert!(trials.iter().all(|moments| moments.len() == STEPS));
            for moments in trials {
                let moment = |m: &Moment| serde_json::json!({ "targets": m.targets, "ranges": m.ranges });
                let moments: Vec<_> = moments.iter().map(moment).collect();
                println!("{}", serde_json::json!({ "scenario": name, "moments": moments }));
            }
        }
    }
}
