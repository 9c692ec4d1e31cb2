//! A finished design: cells and words of every sensor, the value of the criterion, a bound and a certificate.

use super::participant::{SensorDesign, WordedCells, missing, system_of};
use super::request::MAX_BITS;
use crate::bounds;
use crate::criterion::Criterion;
use crate::decoder::MmseDecoder;
use crate::design::Scope;
use crate::error::{Error, refuse};
use crate::newton::Certificate;
use crate::observation_model::ObservationModel;
use crate::system::System;
use fewbits_core::Link;
use fewbits_numerics::error::entries;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// The designs that a request found, best first.
#[derive(Debug, Clone, PartialEq)]
pub struct Solutions {
    pub(super) all: Vec<Solution>,
    /// Number of steps of the search. In each, cells and words of one sensor were improved with the other sensors fixed. The number
    /// depends only on the request, unless a time limit ended the search.
    pub steps: usize,
    /// Whether the time limit ended the search.
    pub is_cut_short: bool,
}

impl Solutions {
    /// The best design.
    pub fn best(&self) -> &Solution {
        // A successful request has at least one design.
        &self.all[0]
    }
}

/// A bound on the criterion over all designs with these bits and links.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bound {
    /// In the unit of the criterion: a lower bound on an error, an upper bound on information.
    pub value: f64,
    /// How the bound was obtained.
    pub kind: BoundKind,
}

/// How a bound was obtained.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum BoundKind {
    /// Quadratic Gaussian CEO problem: codes of any length at separate sensors, with the links' capacities as rates.
    Ceo,
    /// All sensors encoded together, with the links' capacities as rates.
    Together,
    /// The samples themselves, without quantization.
    Unquantised,
    /// The capacity of the links.
    Capacity,
}

/// One design: a complete result of a request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Solution {
    system: System,
    sensors: Vec<SensorDesign>,
    /// The criterion that was optimised.
    pub criterion: Criterion,
    /// Value of the criterion: squared units, nats, or a probability. The error is 1e-12. It is 1e-5 for designs with so many joint
    /// symbols and nodes that one evaluation would take seconds, and some parts in a thousand if, in addition, a time limit was reached.
    pub value: f64,
    /// A bound on the criterion over all designs with these bits and links, if one is known.
    pub bound: Option<Bound>,
    /// The conclusion from the second derivatives with respect to the breakpoints. Words, the number of cells and their order were
    /// searched; the certificate does not cover them.
    pub certificate: Certificate,
    /// The breakpoints over which the certificate holds.
    pub scope: Scope,
}

/// The stored form of [`Solution`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Stored {
    system: System,
    sensors: Vec<SensorDesign>,
    criterion: Criterion,
    value: f64,
    bound: Option<Bound>,
    certificate: Certificate,
    scope: Scope,
}

impl TryFrom<Stored> for Solution {
    type Error = Error;

    fn try_from(stored: Stored) -> Result<Self, Error> {
        let (system, sensors, value) = (stored.system, stored.sensors, stored.value);
        for sensor in &sensors {
            let bits = sensor.bits;
            let known = (1..=MAX_BITS).contains(&bits) && sensor.words.iter().all(|word| *word < 1 << bits);
            if !known || sensor.cells().check().is_err() {
                let expected = "increasing breakpoints, and a word of its bits for each cell";
                return refuse("sensors", format!("cells of sensor {}", sensor.sensor), expected);
            }
        }
        if sensors.is_empty() || system.model().sensors() != sensors.len() {
            return refuse("sensors", sensors.len(), format!("{}, as in the system", system.model().sensors()));
        }
        if !value.is_finite() {
            return refuse("value", value, "a finite number");
        }
        Ok(Self {
            system,
            sensors,
            criterion: stored.criterion,
            value,
            bound: stored.bound,
            certificate: stored.certificate,
            scope: stored.scope,
        })
    }
}

impl Solution {
    pub(super) fn new(
        criterion: Criterion,
        participants: &[SensorDesign],
        system: System,
        cells: Vec<WordedCells>,
        certificate: Certificate,
        scope: Scope,
    ) -> Result<Self, Error> {
        let sensors = participants.iter().zip(cells).map(|(p, cells)| SensorDesign {
            breakpoints: cells.breakpoints,
            words: cells.words,
            ..p.clone()
        });
        let sensors: Vec<SensorDesign> = sensors.collect();
        Ok(Self {
            // Rounding may leave less than nothing.
            value: system.value(criterion)?.max(0.0),
            bound: tightest_bound(&system, &sensors, criterion)?,
            system,
            sensors,
            criterion,
            certificate,
            scope,
        })
    }

    /// The sensors that take part, with their cells and words.
    pub fn sensors(&self) -> &[SensorDesign] {
        &self.sensors
    }

    /// The sensors with their quantizers and channels, for the other functions of this crate. Symbol `t` is the received word
    /// `t`; the last symbol is "nothing received" if a word may be missing. Sensors without bits are left out.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Relative distance of the value from the bound; 0 is optimal. `None` without a bound, and of a value above a bound of 0.
    pub fn gap(&self) -> Option<f64> {
        let bound = self.bound?.value;
        let unit = match self.criterion {
            Criterion::MeanSquaredError => self.system.model().prior().deviation().powi(2),
            Criterion::MutualInformation | Criterion::BayesError => 1.0,
        };
        let apart = (self.value - bound).abs();
        if apart <= VALUE_ERROR * unit {
            return Some(0.0);
        }
        (bound > 0.0).then(|| apart / bound)
    }

    /// The word of each sensor for one sample per sensor, in the order of [`Solution::sensors`].
    ///
    /// # Errors
    /// If there is not one sample per sensor, or one is NaN.
    pub fn encode(&self, samples: &[f64]) -> Result<Vec<usize>, Error> {
        entries("samples", samples.len(), self.sensors.len())?;
        self.sensors
            .iter()
            .zip(samples)
            .map(|(sensor, sample)| sensor.encode(*sample))
            .collect()
    }

    /// The decoder of least squared error, a table of at most `limit` entries.
    ///
    /// # Errors
    /// As [`MmseDecoder::new`].
    pub fn decoder(&self, limit: usize) -> Result<MmseDecoder, Error> {
        MmseDecoder::new(&self.system, limit)
    }

    pub(super) fn with_cells(&self, cells: Vec<WordedCells>) -> Result<Self, Error> {
        cells.iter().try_for_each(WordedCells::check)?;
        let apart = self.system.groups().len() == self.sensors.len();
        let system = system_of(self.system.model(), &self.sensors, &cells, apart)?;
        Self::new(self.criterion, &self.sensors, system, cells, Certificate::Unproved, self.scope)
    }

    /// The system of these cells and words under another model of as many sensors.
    pub(super) fn system_in(&self, model: &ObservationModel) -> Result<System, Error> {
        if model.sensors() != self.sensors.len() {
            let expected = format!("{}, those that take part", self.sensors.len());
            return refuse("model", format!("{} sensors", model.sensors()), expected);
        }
        system_of(model, &self.sensors, &self.cells(), true)
    }

    /// Cells and words of every sensor.
    pub(super) fn cells(&self) -> Vec<WordedCells> {
        self.sensors.iter().map(SensorDesign::cells).collect()
    }

    /// The design as a text table: sensors, cells, words, value, bound and certificate.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let unit = match self.criterion {
            Criterion::MeanSquaredError => "mean squared error",
            Criterion::MutualInformation => "information (nats)",
            Criterion::BayesError => "error probability",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{unit:<20} {}", shown(self.value));
        if let Some(bound) = self.bound {
            let gap = self
                .gap()
                .map_or(String::new(), |gap| format!("   gap {:.2} %", 100.0 * gap));
            let _ = writeln!(text, "bound ({:?})    {}{gap}", bound.kind, shown(bound.value));
        }
        let _ = writeln!(
            text,
            "certificate          {:?} over {:?}; words and cells were searched",
            self.certificate, self.scope
        );
        for (place, sensor) in self.sensors.iter().enumerate() {
            let deviation = self.system.model().sample_deviation(place);
            let _ = writeln!(text, "sensor {}: {} bits, {} cells", sensor.sensor, sensor.bits, sensor.words.len());
            let _ = writeln!(text, "  {:>16} {:>16}  word", "from", "to");
            for (cell, word) in sensor.words.iter().enumerate() {
                let edge = |i: Option<usize>, open: &str| {
                    i.and_then(|i| sensor.breakpoints.get(i))
                        .map_or(open.to_owned(), |b| edge_shown(*b, deviation))
                };
                let (from, to) = (edge(cell.checked_sub(1), "-inf"), edge(Some(cell), "inf"));
                let _ = writeln!(text, "  {from:>16} {to:>16}  {word:0width$b}", width = sensor.bits as usize);
            }
        }
        text
    }
}

/// Error of a value, in prior variances or nats.
const VALUE_ERROR: f64 = 1e-12;

/// Relative to the deviation of the samples.
const SHOWN_EDGE: f64 = 1e-5;

/// A breakpoint, with all digits if fewer would hide how samples of this deviation differ.
fn edge_shown(number: f64, deviation: f64) -> String {
    let short = shown(number);
    let is_close = |read: f64| (read - number).abs() <= SHOWN_EDGE * deviation;
    if short.parse().is_ok_and(is_close) {
        short
    } else {
        format!("{number}")
    }
}

/// Nine decimals, or as many digits and an exponent where decimals would hide the number.
fn shown(number: f64) -> String {
    if number == 0.0 || (1e-4..1e9).contains(&number.abs()) {
        format!("{number:.9}")
    } else {
        format!("{number:.8e}")
    }
}

/// The tightest bound that is valid for a system.
fn tightest_bound(system: &System, sensors: &[SensorDesign], criterion: Criterion) -> Result<Option<Bound>, Error> {
    let model = system.model();
    let capacities: Vec<f64> = sensors.iter().map(|s| capacity(&s.link, s.bits)).collect();
    let total: f64 = capacities.iter().sum();
    let mut found = Vec::new();
    if let Some(value) = bounds::unquantised(model, criterion)? {
        found.push((value, BoundKind::Unquantised));
    }
    match criterion {
        Criterion::MutualInformation => found.push((total * std::f64::consts::LN_2, BoundKind::Capacity)),
        Criterion::MeanSquaredError if model.prior().is_normal() => {
            let together = bounds::remote_distortion_rate(model.prior(), model.noise(), total);
            found.extend(together.ok().map(|bound| (bound, BoundKind::Together)));
            // No CEO bound for correlated noise, too many sensors, or if it does not converge.
            let ceo = bounds::ceo(model.prior(), model.noise(), &capacities);
            found.extend(
                ceo.ok()
                    .map(|bound| (bound.distortion * (-bound.gap).exp(), BoundKind::Ceo)),
            );
        }
        _ => {}
    }
    let sense = criterion.sense();
    let tightest = found.into_iter().min_by(|a, b| (sense * a.0).total_cmp(&(sense * b.0)));
    Ok(tightest.map(|(value, kind)| Bound { value, kind }))
}

/// Capacity of a link in bits per word: the bits of a word are inverted at random, or the word does not arrive.
fn capacity(link: &Link, bits: u32) -> f64 {
    let share = |p: f64| if p > 0.0 { -p * p.log2() } else { 0.0 };
    let flips = share(link.crossover()) + share(1.0 - link.crossover());
    f64::from(bits) * (1.0 - flips) * (1.0 - missing(link))
}
