//! Labelled tracks that are born, confirmed, missed and dropped.

use crate::association::{Weights, marginals};
use fewbits_core::{Error, Gaussian, GaussianDynamics, Likelihood};
use fewbits_densities::moment_matched;
use fewbits_numerics::error::{non_negative, within};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// Which target a track is: when it was born, and at which entrance.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Label {
    /// Number of the time update, from 1 on.
    pub born: u64,
    /// Index of the birth.
    pub entrance: usize,
}

/// One target that may exist.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Track<const D: usize> {
    /// Which target it is.
    pub label: Label,
    /// Probability that the target exists.
    pub existence: f64,
    /// The state, if it does.
    pub belief: Gaussian<D>,
}

/// The belief about all targets.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Tracks<const D: usize> {
    /// Number of time updates.
    pub time: u64,
    /// Targets that may exist.
    pub list: Vec<Track<D>>,
}

impl<const D: usize> Tracks<D> {
    /// Tracks whose existence exceeds `threshold`.
    pub fn confirmed(&self, threshold: f64) -> impl Iterator<Item = &Track<D>> {
        self.list.iter().filter(move |track| track.existence > threshold)
    }
}

/// Where targets appear.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Birth<const D: usize> {
    /// Probability that a target appears here in one time step.
    pub probability: f64,
    /// Its state then.
    pub belief: Gaussian<D>,
}

/// One report of a sensor that does not say of which target it is.
#[derive(Clone, Copy)]
pub struct Report<'a, const D: usize> {
    /// `p(report | state)` of the target that caused it.
    pub likelihood: &'a dyn Likelihood<D>,
    /// Expected number of false reports of this sensor at this instant times the probability (of a value: the density) of this one.
    pub clutter: f64,
}

/// Joint integrated probabilistic data association (Musicki and Evans 2004) over any likelihood, with births at known places.
///
/// ```text
/// predict   existence *= survival; belief by the dynamics; one new track per birth
/// update    of one sensor at one instant, with detection probability d of each track:
///           pair  = r d p(report | track)     missed = 1 - r d     unassigned = clutter
///           P = marginals of all joint associations
///           r' = sum_j P(i, j) + P(i missed) r (1 - d) / (1 - r d)
///           belief' = moments of the mixture of its updates by each report and of no update
/// ```
/// Sensors of one instant are processed one after the other. A pair whose report is explained by the track less than `gate` times as well
/// as by clutter is left out; this keeps clusters small. A report that is lost on its way is a missed detection: multiply the detection
/// probability by the link's arrival.
///
/// The belief is a product of Gaussians. Two targets that stay close for long share their reports, and their tracks draw together, as in
/// every method of this kind; labels may then change places.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts<D>")]
pub struct Tracker<const D: usize> {
    survival: f64,
    births: Vec<Birth<D>>,
    gate: f64,
    least: f64,
}

/// The stored form.
#[derive(Deserialize)]
#[serde(rename = "Tracker")]
#[serde(deny_unknown_fields)]
struct Parts<const D: usize> {
    survival: f64,
    births: Vec<Birth<D>>,
    gate: f64,
    least: f64,
}

impl<const D: usize> TryFrom<Parts<D>> for Tracker<D> {
    type Error = Error;

    fn try_from(parts: Parts<D>) -> Result<Self, Error> {
        Self::new(parts.survival, parts.births)?
            .with_gate(parts.gate)?
            .with_least(parts.least)
    }
}

impl<const D: usize> Tracker<D> {
    /// A tracker with a gate of 1e-4 that drops tracks of existence below 1e-3.
    ///
    /// `survival` is the probability that a target is still there after one time step.
    ///
    /// # Errors
    /// If a probability is outside `[0, 1]`.
    pub fn new(survival: f64, births: Vec<Birth<D>>) -> Result<Self, Error> {
        for birth in &births {
            within("probability", birth.probability, 0.0, 1.0)?;
        }
        Ok(Self {
            survival: within("survival", survival, 0.0, 1.0)?,
            births,
            gate: 1e-4,
            least: 1e-3,
        })
    }

    /// The same with another gate; 0 leaves no pair out.
    ///
    /// # Errors
    /// If `gate` is negative or not finite.
    pub fn with_gate(self, gate: f64) -> Result<Self, Error> {
        let gate = non_negative("gate", gate)?;
        Ok(Self { gate, ..self })
    }

    /// The same that drops tracks whose existence falls below `least`.
    ///
    /// # Errors
    /// If `least` is outside `[0, 1]`.
    pub fn with_least(self, least: f64) -> Result<Self, Error> {
        let least = within("least", least, 0.0, 1.0)?;
        Ok(Self { least, ..self })
    }

    /// Time update; every birth adds a track.
    ///
    /// # Errors
    /// [`Error::NotANumber`] if a predicted belief is not finite. The tracks are then unchanged.
    pub fn predict(&self, dynamics: &dyn GaussianDynamics<D>, tracks: &mut Tracks<D>) -> Result<(), Error> {
        let mut next = tracks.clone();
        next.time += 1;
        for track in &mut next.list {
            track.existence *= self.survival;
            track.belief = dynamics.predict(&track.belief, 1.0);
            if !track.belief.is_finite() {
                return Err(Error::NotANumber {
                    what: "a predicted track",
                });
            }
        }
        let new = self.births.iter().enumerate().map(|(entrance, birth)| Track {
            label: Label {
                born: next.time,
                entrance,
            },
            existence: birth.probability,
            belief: birth.belief,
        });
        next.list.extend(new);
        *tracks = next;
        Ok(())
    }

    /// Measurement update with all reports of one sensor at one instant. `detection(x)` is the probability that the sensor reports a target
    /// in state `x`; it is taken at the mean of each track. Returns `ln p(reports | past)`, up to the law of the number of false
    /// reports.
    ///
    /// # Errors
    /// If a detection probability is outside `[0, 1]` or a clutter intensity is negative; [`Error::Impossible`] if no joint association is
    /// possible; errors of the likelihoods; [`marginals`]' of clusters that are too large. The tracks are then unchanged.
    pub fn update(
        &self,
        tracks: &mut Tracks<D>,
        detection: impl Fn(&SVector<f64, D>) -> f64,
        reports: &[Report<'_, D>],
    ) -> Result<f64, Error> {
        let mut weights = Weights::default();
        for report in reports {
            weights.unassigned.push(non_negative("clutter", report.clutter)?.ln());
        }
        // The updates of each track by each report that its gate lets through.
        let (mut updates, mut seen) = (Vec::new(), Vec::new());
        for track in &tracks.list {
            let detected = within("detection", detection(track.belief.mean()), 0.0, 1.0)?;
            let (mut row, mut posteriors) = (Vec::new(), Vec::new());
            for (report, false_one) in reports.iter().zip(&weights.unassigned) {
                let mut posterior = track.belief;
                let evidence = match report.likelihood.condition(&mut posterior) {
                    Ok(evidence) => evidence.log_likelihood,
                    Err(Error::Impossible) => f64::NEG_INFINITY,
                    Err(error) => return Err(error),
                };
                let log = (track.existence * detected).ln() + evidence;
                let passes = log > f64::NEG_INFINITY && log >= self.gate.ln() + false_one;
                row.push(if passes { log } else { f64::NEG_INFINITY });
                posteriors.push(posterior);
            }
            weights.pairs.push(row);
            weights.missed.push((-track.existence * detected).ln_1p());
            updates.push(posteriors);
            seen.push(detected);
        }
        let shares = marginals(&weights)?;
        let mut list = Vec::new();
        for (i, track) in tracks.list.iter().enumerate() {
            // Of a missed target: the probability that it exists none the less.
            let unseen = track.existence * (1.0 - seen[i]) / (1.0 - track.existence * seen[i]).max(f64::MIN_POSITIVE);
            let missed = shares.missed[i] * unseen;
            let parts = || {
                let updated = shares.assigned[i].iter().copied().zip(&updates[i]);
                updated
                    .chain([(missed, &track.belief)])
                    .filter(|(share, _)| *share > 0.0)
            };
            let existence: f64 = parts().map(|(share, _)| share).sum();
            if existence < self.least || existence == 0.0 {
                continue;
            }
            let belief =
                moment_matched(parts().map(|(share, part)| (share / existence, *part.mean(), *part.covariance())));
            if !belief.is_finite() {
                return Err(Error::NotANumber {
                    what: "an updated track",
                });
            }
            list.push(Track {
                existence: existence.min(1.0),
                belief,
                ..*track
            });
        }
        tracks.list = list;
        Ok(shares.log_evidence)
    }
}
