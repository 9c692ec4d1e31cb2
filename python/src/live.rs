//! The library's centre, whatever the number of coordinates of its state.

use crate::error::Outcome;
use crate::instants::{Instant, Instants};
use crate::model::with_dimension;
use crate::parts::Parts;
use crate::seat::Seat;
use crate::step::{Built, Row, Rows, Smooth};
use pyo3::prelude::*;

/// Rows between two looks at signals such as Ctrl-C.
const ROWS: usize = 1024;

/// A centre with the sensors' halves. A call that fails leaves it as it was.
pub(crate) trait Live: Send + Sync {
    /// Adds a sensor.
    fn join(&mut self, seat: &Seat) -> Outcome<()>;

    /// One instant.
    fn step(&mut self, instant: &Instant) -> Outcome<Row>;

    /// All instants, one after the other. Ctrl-C is heard.
    fn run(&mut self, instants: &Instants, smooth: Smooth) -> Outcome<Rows>;

    /// Mean and rows of the covariance.
    fn moments(&self) -> (Vec<f64>, Vec<Vec<f64>>);

    /// Works, dead, excluded, of each sensor.
    fn sensors(&self) -> Outcome<Vec<(f64, bool, bool)>>;

    /// The state as bytes.
    fn stored(&self) -> Outcome<Vec<u8>>;
}

/// The centre of these parts.
pub(crate) fn built(parts: &Parts) -> Outcome<Box<dyn Live>> {
    with_dimension!(parts.model.coordinates(), D => Ok(Box::new(Built::<D>::new(parts)?)))
}

impl<const D: usize> Live for Built<D> {
    fn join(&mut self, seat: &Seat) -> Outcome<()> {
        Built::join(self, seat)
    }

    fn step(&mut self, instant: &Instant) -> Outcome<Row> {
        let before = self.state();
        let done = Built::step(self, instant);
        if done.is_err() {
            self.restore(before)?;
        }
        done
    }

    fn run(&mut self, instants: &Instants, smooth: Smooth) -> Outcome<Rows> {
        let before = self.state();
        let done = over(self, instants, smooth);
        if done.is_err() {
            self.restore(before)?;
        }
        done
    }

    fn moments(&self) -> (Vec<f64>, Vec<Vec<f64>>) {
        let belief = self.belief();
        let covariance = belief.covariance();
        let rows = (0..D).map(|i| (0..D).map(|j| covariance[(i, j)]).collect()).collect();
        (belief.mean().as_slice().to_vec(), rows)
    }

    fn sensors(&self) -> Outcome<Vec<(f64, bool, bool)>> {
        Built::sensors(self)
    }

    fn stored(&self) -> Outcome<Vec<u8>> {
        Built::stored(self)
    }
}

fn over<const D: usize>(built: &mut Built<D>, instants: &Instants, smooth: Smooth) -> Outcome<Rows> {
    let mut rows = Rows::new::<D>(instants.len());
    let mut trail = Vec::new();
    let mut instant = Instant::default();
    for number in 0..instants.len() {
        instants.read(number, &mut instant);
        if number % ROWS == ROWS - 1 {
            Python::attach(|py| py.check_signals())?;
        }
        let (scale, row): (f64, Row) = (built.noise_scale(), Built::step(built, &instant)?);
        rows.push(&built.belief(), row);
        if smooth != Smooth::No {
            trail.push(built.filtered(scale, rows.restarted()));
        }
    }
    rows.smoothed = match smooth {
        Smooth::No => None,
        Smooth::All => Some(built.smoothed(&trail, None)?),
        Smooth::Within(lag) => Some(built.smoothed(&trail, Some(lag))?),
    };
    Ok(rows)
}
