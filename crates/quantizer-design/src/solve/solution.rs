//! A finished design: cells and words of every sensor, the criterion's value, a bound and a certificate.

use super::participant::{Participant, WordedCells, missing, system_of};
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
use fewbits_quantizers::quantizer::cell_of;
use serde::Serialize;
use std::fmt::Write;

/// The designs that a request found, best first.
#[derive(Debug, Clone, PartialEq)]
pub struct Solutions {
    pub(super) all: Vec<Solution>,
    /// Steps of the search. In each, cells and words of one sensor were improved with the other sensors as they were. The number
    /// depends on the request alone, unless a time limit ended the search.
    pub steps: usize,
    /// Whether the time limit ended the search.
    pub is_cut_short: bool,
}

impl Solutions {
    /// The best design.
    pub fn best(&self) -> &Solution {
        // A request that runs returns one design at least.
        &self.all[0]
    }

    /// All designs, best first.
    pub fn all(&self) -> &[Solution] {
        &self.all
    }
}

/// Cells and words of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct SensorDesign {
    /// Number of the sensor in the request.
    pub sensor: usize,
    /// Bits of a word.
    pub bits: u32,
    /// Breakpoints between the cells, increasing.
    pub breakpoints: Vec<f64>,
    /// Word of each cell, one more than breakpoints.
    pub words: Vec<usize>,
    /// The link that the words cross.
    pub link: Link,
}

impl SensorDesign {
    /// The word for a sample.
    ///
    /// # Errors
    /// If the sample is NaN.
    pub fn encode(&self, sample: f64) -> Result<usize, Error> {
        Ok(self.words[cell_of(&self.breakpoints, sample)?])
    }

    /// Symbols that can be received: all words, and one more behind them, "nothing", if a word may be missing.
    pub fn symbols(&self) -> usize {
        (1 << self.bits) + usize::from(missing(&self.link) > 0.0)
    }
}

/// A bound on the criterion over all designs with these bits and links.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bound {
    /// In the unit of the criterion: a lower bound on an error, an upper bound on information.
    pub value: f64,
    /// How the bound was obtained.
    pub kind: BoundKind,
}

/// Where a bound comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum BoundKind {
    /// Quadratic Gaussian CEO problem: codes of any length at separate sensors, links at their capacity.
    Ceo,
    /// All sensors encoded together, links at their capacity.
    Together,
    /// The samples themselves.
    Unquantised,
    /// The links' capacity.
    Capacity,
}

/// One design: the whole answer to a request.
#[derive(Debug, Clone, PartialEq)]
pub struct Solution {
    system: System,
    sensors: Vec<SensorDesign>,
    /// What was optimised.
    pub criterion: Criterion,
    /// Value of the criterion: squared units, nats, or a probability. Exact to 1e-12, or to 1e-5 for a design with so many joint
    /// symbols and nodes that one evaluation would take seconds; to some parts in a thousand if, besides, a time limit is over.
    pub value: f64,
    /// A bound on the criterion over all designs with these bits and links, if one is known.
    pub bound: Option<Bound>,
    /// What the second derivatives with respect to the breakpoints prove. Words, the number of cells and their order were
    /// searched; nothing is proved about them.
    pub certificate: Certificate,
    /// The breakpoints over which the certificate holds.
    pub scope: Scope,
}

impl Solution {
    pub(super) fn new(
        criterion: Criterion,
        participants: &[Participant],
        system: System,
        cells: Vec<WordedCells>,
        certificate: Certificate,
        scope: Scope,
    ) -> Result<Self, Error> {
        let sensors = participants.iter().zip(cells).map(|(p, cells)| SensorDesign {
            sensor: p.sensor,
            bits: p.bits,
            breakpoints: cells.breakpoints,
            words: cells.words,
            link: p.link,
        });
        let sensors: Vec<SensorDesign> = sensors.collect();
        Ok(Self {
            value: system.value(criterion)?,
            bound: tightest_bound(&system, &sensors, criterion)?,
            system,
            sensors,
            criterion,
            certificate,
            scope,
        })
    }

    /// The sensors that take part.
    pub fn sensors(&self) -> &[SensorDesign] {
        &self.sensors
    }

    /// The sensors with their quantizers and channels, as the other tools of this crate take them. Symbol `t` is the received word
    /// `t`; the last symbol is "nothing received" if a word may be missing. Sensors without bits are not in it.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// `E (X - E[X | T])^2`, in squared units.
    ///
    /// # Errors
    /// As [`System::value`].
    pub fn mean_squared_error(&self) -> Result<f64, Error> {
        self.system.value(Criterion::MeanSquaredError)
    }

    /// How far the value is from the bound, relative to the bound: 0 would be perfect.
    pub fn gap(&self) -> Option<f64> {
        self.bound.map(|b| (self.value - b.value).abs() / b.value)
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
            .map(|(sensor, y)| sensor.encode(*y))
            .collect()
    }

    /// The decoder of least squared error, as a table of at most `limit` entries.
    ///
    /// # Errors
    /// As [`MmseDecoder::new`].
    pub fn decoder(&self, limit: usize) -> Result<MmseDecoder, Error> {
        MmseDecoder::new(&self.system, limit)
    }

    /// The same sensors with other breakpoints; the certificate is void.
    ///
    /// # Errors
    /// If there is not one list per sensor, or a list has another length or is not increasing.
    pub fn with_breakpoints(&self, breakpoints: Vec<Vec<f64>>) -> Result<Self, Error> {
        entries("breakpoints", breakpoints.len(), self.sensors.len())?;
        let mut cells = self.cells();
        cells
            .iter_mut()
            .zip(breakpoints)
            .for_each(|(cells, b)| cells.breakpoints = b);
        self.with_cells(cells)
    }

    pub(super) fn with_cells(&self, cells: Vec<WordedCells>) -> Result<Self, Error> {
        for cells in &cells {
            fewbits_quantizers::quantizer::check_increasing(&cells.breakpoints)?;
            entries("breakpoints", cells.breakpoints.len(), cells.words.len() - 1)?;
        }
        let participants = self.participants();
        let apart = self.system.groups().len() == self.sensors.len();
        let system = system_of(self.system.model(), &participants, &cells, apart)?;
        Self::new(self.criterion, &participants, system, cells, Certificate::Unproved, self.scope)
    }

    pub(super) fn participants(&self) -> Vec<Participant> {
        let parts = self.sensors.iter().map(|s| Participant {
            sensor: s.sensor,
            bits: s.bits,
            link: s.link,
        });
        parts.collect()
    }

    /// The system of these cells and words in another model of as many sensors.
    pub(super) fn system_in(&self, model: &ObservationModel) -> Result<System, Error> {
        if model.sensors() != self.sensors.len() {
            let expected = format!("{}, those that take part", self.sensors.len());
            return refuse("model", format!("{} sensors", model.sensors()), expected);
        }
        system_of(model, &self.participants(), &self.cells(), true)
    }

    /// Cells and words of every sensor.
    pub(super) fn cells(&self) -> Vec<WordedCells> {
        let cells = self.sensors.iter().map(|s| WordedCells {
            breakpoints: s.breakpoints.clone(),
            words: s.words.clone(),
        });
        cells.collect()
    }

    /// The design as a table for reading: sensors, cells, words, value, bound and certificate.
    pub fn table(&self) -> String {
        let mut text = String::new();
        let unit = match self.criterion {
            Criterion::MeanSquaredError => "mean squared error",
            Criterion::MutualInformation => "information (nats)",
            Criterion::BayesError => "error probability",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{unit:<20} {:.9}", self.value);
        if let (Some(bound), Some(gap)) = (self.bound, self.gap()) {
            let _ = writeln!(text, "bound ({:?})    {:.9}   gap {:.2} %", bound.kind, bound.value, 100.0 * gap);
        }
        let _ = writeln!(
            text,
            "certificate          {:?} over {:?}; words and cells were searched",
            self.certificate, self.scope
        );
        for sensor in &self.sensors {
            let _ = writeln!(text, "sensor {}: {} bits, {} cells", sensor.sensor, sensor.bits, sensor.words.len());
            let _ = writeln!(text, "  {:>16} {:>16}  word", "from", "to");
            for (cell, word) in sensor.words.iter().enumerate() {
                let edge = |i: Option<usize>, open: &str| {
                    i.and_then(|i| sensor.breakpoints.get(i))
                        .map_or(open.to_owned(), |b| format!("{b:.9}"))
                };
                let (from, to) = (edge(cell.checked_sub(1), "-inf"), edge(Some(cell), "inf"));
                let _ = writeln!(text, "  {from:>16} {to:>16}  {word:0width$b}", width = sensor.bits as usize);
            }
        }
        text
    }
}

/// The tightest of the bounds that hold for a system.
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
            let prior = model.prior_variance();
            let left = 1.0 / (1.0 / prior + model.noise().precision_of_mean());
            found.push((left + (prior - left) * (-2.0 * total).exp2(), BoundKind::Together));
            // Not for correlated noise or too many sensors; a bound that does not converge is no bound.
            let ceo = bounds::ceo(model.prior(), model.noise(), &capacities);
            found.extend(ceo.ok().map(|bound| (bound.lower(), BoundKind::Ceo)));
        }
        _ => {}
    }
    let sense = criterion.sense();
    let tightest = found.into_iter().min_by(|a, b| (sense * a.0).total_cmp(&(sense * b.0)));
    Ok(tightest.map(|(value, kind)| Bound { value, kind }))
}

/// Bits per word that a link can carry: words arrive with their bits inverted, or not at all.
fn capacity(link: &Link, bits: u32) -> f64 {
    let share = |p: f64| if p > 0.0 { -p * p.log2() } else { 0.0 };
    let flips = share(link.crossover()) + share(1.0 - link.crossover());
    f64::from(bits) * (1.0 - flips) * (1.0 - missing(link))
}
