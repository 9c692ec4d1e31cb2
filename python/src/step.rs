//! The library's centre of one dimension, built from stored parts, and what its steps find.

use crate::error::{Outcome, refused};
use crate::instants::Instant;
use crate::model::{Moves, Remembering};
use crate::parts::Parts;
use crate::seat::{Seat, Sends};
use crate::table::{Table, doubles};
use arrow_array::builder::StringBuilder;
use arrow_array::{ArrayRef, Int64Array};
use fewbits_core::{BitString, Gaussian, Observation, SensorNode};
use fewbits_filters::centre::{CentreState, Event, Failures, FusionCentre, NoiseLearning, Slot};
use fewbits_filters::smoother::{Filtered, smooth};
use fewbits_filters::{Error, MomentFilter};
use fewbits_monte_carlo::Stream;
use nalgebra::{SMatrix, SVector, Vector1};
use rand_pcg::Pcg64Mcg;
use std::sync::Arc;

/// A centre with the sensors' halves.
pub(crate) struct Built<const D: usize> {
    centre: FusionCentre<D, MomentFilter>,
    model: Moves<D>,
    nodes: Vec<Box<dyn SensorNode<1>>>,
    seats: Vec<Seat>,
    /// Room for the slots of an instant.
    slots: Vec<Slot>,
    /// Moments and schemes draw nothing.
    rng: Pcg64Mcg,
}

/// What one instant gave.
pub(crate) struct Row {
    pub(crate) log_likelihood: f64,
    pub(crate) bits: i64,
    pub(crate) events: Vec<String>,
}

/// Which later rows a smoothed estimate takes in.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Smooth {
    No,
    /// All of them.
    All,
    /// Those of so many seconds.
    Within(f64),
}

impl<const D: usize> Built<D> {
    pub(crate) fn new(parts: &Parts) -> Outcome<Self> {
        let model = parts.model.typed::<D>()?;
        if (parts.mean.len(), parts.covariance.len()) != (D, D * D) {
            return refused("mean", "of another length", format!("{D} numbers"));
        }
        let covariance = SMatrix::from_column_slice(&parts.covariance);
        let prior = Gaussian::new(SVector::from_column_slice(&parts.mean), covariance)?;
        let mut rng = Stream::new(0).fast_rng();
        let failures = Failures {
            rate: parts.failures,
            ..Failures::default()
        };
        let mut centre = FusionCentre::new(&mut rng, Remembering::new(model), MomentFilter, &prior)?
            .with_health(parts.tests.health())
            .with_failures(failures)?
            .with_window(parts.window)?;
        if parts.learn_noise {
            centre = centre.learning_noise(NoiseLearning::DEFAULT)?;
        }
        let mut built = Self {
            centre,
            model,
            nodes: Vec::new(),
            seats: Vec::new(),
            slots: Vec::new(),
            rng,
        };
        for seat in &parts.seats {
            built.join(seat)?;
        }
        if let Some(state) = &parts.state {
            built.centre.restore(CentreState::from_bytes(state)?)?;
        }
        Ok(built)
    }

    pub(crate) fn join(&mut self, seat: &Seat) -> Outcome<()> {
        let (remote, node) = (seat.remote::<D>()?, seat.node::<D>()?);
        self.centre.join_boxed(self.seats.len() as u32, remote)?;
        self.nodes.push(node);
        self.seats.push(seat.clone());
        Ok(())
    }

    pub(crate) fn stored(&self) -> Outcome<Vec<u8>> {
        Ok(self.centre.state().to_bytes()?)
    }

    pub(crate) fn state(&self) -> CentreState<Gaussian<D>> {
        self.centre.state()
    }

    pub(crate) fn restore(&mut self, state: CentreState<Gaussian<D>>) -> Outcome<()> {
        Ok(self.centre.restore(state)?)
    }

    pub(crate) fn belief(&self) -> Gaussian<D> {
        self.centre.estimate()
    }

    pub(crate) fn time(&self) -> f64 {
        self.centre.time()
    }

    pub(crate) fn noise_scale(&self) -> f64 {
        self.centre.noise_scale()
    }

    /// Works, dead, excluded, of each sensor.
    pub(crate) fn sensors(&self) -> Outcome<Vec<(f64, bool, bool)>> {
        let numbers = 0..self.seats.len() as u32;
        let of = |number| {
            let state = self.centre.sensor(number)?;
            Ok((state.working, state.declared_dead, state.excluded))
        };
        numbers.map(of).collect()
    }

    /// Prediction to the instant, and update with its reports.
    pub(crate) fn step(&mut self, instant: &Instant) -> Outcome<Row> {
        if instant.seconds < self.centre.time() {
            return self.late(instant);
        }
        self.centre.advance(&mut self.rng, instant.seconds)?;
        let mut slots = std::mem::take(&mut self.slots);
        slots.clear();
        for (number, sample) in &instant.samples {
            // Sensors that send values are told nothing.
            let feedback = match self.seats[*number].send {
                Sends::Value => BitString::default(),
                _ => self.centre.feedback(*number as u32)?,
            };
            let observation = match sample {
                Some(sample) => {
                    let measurement = Vector1::new(sample - self.seats[*number].offset);
                    Observation::from(self.nodes[*number].report(&mut self.rng, &measurement, &feedback)?)
                }
                None => Observation::Nothing,
            };
            slots.push(Slot::new(*number as u32, feedback, observation));
        }
        let bits = bits_of(&slots);
        let received = self.centre.receive(&mut self.rng, &slots);
        self.slots = slots;
        match received {
            Ok(received) => Ok(Row {
                log_likelihood: received.info.log_likelihood,
                bits,
                events: received.events.iter().map(|event| self.named(event)).collect(),
            }),
            Err(Error::Impossible) => Ok(Row {
                log_likelihood: f64::NEG_INFINITY,
                bits,
                events: vec!["impossible".to_owned()],
            }),
            Err(other) => Err(other.into()),
        }
    }

    /// Values of an earlier time: what other sensors would have sent depends on what they were told then.
    fn late(&mut self, instant: &Instant) -> Outcome<Row> {
        let mut slots = Vec::with_capacity(instant.samples.len());
        for (number, sample) in &instant.samples {
            let (seat, Some(sample)) = (&self.seats[*number], sample) else {
                continue;
            };
            if seat.send != Sends::Value {
                let given = format!("{} s before the last, of '{}'", self.centre.time() - instant.seconds, seat.name);
                return refused(
                    "time",
                    given,
                    "times that do not decrease, or late reports of sensors that send values",
                );
            }
            let feedback = self.centre.feedback(*number as u32)?;
            let measurement = Vector1::new(sample - seat.offset);
            let report = self.nodes[*number].report(&mut self.rng, &measurement, &feedback)?;
            slots.push(Slot::new(*number as u32, feedback, Observation::from(report)));
        }
        let used = self.centre.late(&mut self.rng, instant.seconds, &slots)?;
        Ok(Row {
            log_likelihood: 0.0,
            bits: bits_of(&slots),
            events: vec![if used { "late" } else { "too late" }.to_owned()],
        })
    }

    fn named(&self, event: &Event) -> String {
        let seat = event.sensor().and_then(|number| self.seats.get(number as usize));
        seat.map_or(event.name().to_owned(), |seat| format!("{} {}", seat.name, event.name()))
    }

    /// The present belief as smoothing takes it.
    pub(crate) fn filtered(&self, noise_scale: f64, is_new: bool) -> Filtered<D> {
        Filtered {
            seconds: self.time(),
            belief: self.belief(),
            noise_scale,
            is_new,
        }
    }

    /// Mean and deviation of each coordinate given later rows too, by columns.
    pub(crate) fn smoothed(&self, trail: &[Filtered<D>], lag: Option<f64>) -> Outcome<Vec<Vec<f64>>> {
        let beliefs = smooth(&self.model, trail, lag)?;
        let column = |i: usize| {
            let of = |belief: &Gaussian<D>| (belief.mean()[i], belief.covariance()[(i, i)].sqrt());
            let (means, deviations) = beliefs.iter().map(of).unzip();
            [means, deviations]
        };
        Ok((0..D).flat_map(column).collect())
    }
}

fn bits_of(slots: &[Slot]) -> i64 {
    let received = slots.iter().filter_map(|slot| slot.observation.received());
    received.map(|bits| bits.bits() as i64).sum()
}

/// What a run found, by columns.
pub(crate) struct Rows {
    states: Vec<Vec<f64>>,
    log_likelihoods: Vec<f64>,
    bits: Vec<i64>,
    events: StringBuilder,
    restarted: bool,
    pub(crate) smoothed: Option<Vec<Vec<f64>>>,
}

impl Rows {
    pub(crate) fn new<const D: usize>(rows: usize) -> Self {
        Self {
            states: vec![Vec::with_capacity(rows); 2 * D],
            log_likelihoods: Vec::with_capacity(rows),
            bits: Vec::with_capacity(rows),
            events: StringBuilder::with_capacity(rows, 0),
            restarted: false,
            smoothed: None,
        }
    }

    pub(crate) fn push<const D: usize>(&mut self, belief: &Gaussian<D>, row: Row) {
        for i in 0..D {
            self.states[2 * i].push(belief.mean()[i]);
            self.states[2 * i + 1].push(belief.covariance()[(i, i)].sqrt());
        }
        self.log_likelihoods.push(row.log_likelihood);
        self.bits.push(row.bits);
        self.restarted = row
            .events
            .iter()
            .any(|event| event == "reopened" || event == "reacquired");
        self.events.append_value(row.events.join("; "));
    }

    /// Whether the last belief does not follow from the one before.
    pub(crate) fn restarted(&self) -> bool {
        self.restarted
    }

    pub(crate) fn table(mut self, time: &str, times: ArrayRef) -> Outcome<Table> {
        let mut columns: Vec<(String, ArrayRef)> = vec![(time.to_owned(), times)];
        let named = |columns: &mut Vec<(String, ArrayRef)>, end: &str, states: Vec<Vec<f64>>| {
            for (i, state) in states.into_iter().enumerate() {
                let deviation = if i % 2 == 1 { "_sd" } else { "" };
                columns.push((format!("x{}{end}{deviation}", i / 2), doubles(state)));
            }
        };
        named(&mut columns, "", self.states);
        columns.push(("log_likelihood".to_owned(), doubles(self.log_likelihoods)));
        columns.push(("bits".to_owned(), Arc::new(Int64Array::from(self.bits))));
        columns.push(("events".to_owned(), Arc::new(self.events.finish())));
        if let Some(smoothed) = self.smoothed {
            named(&mut columns, "_smooth", smoothed);
        }
        Table::new(columns)
    }
}
