//! Steady concentrations.

use crate::solver::{Direction, Factor};
use crate::{Error, Patch, Transport};
use faer::Mat;
use fewbits_numerics::error::all_finite;

/// A source: where it releases, and at which rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Where it releases.
    pub patch: Patch,
    /// Its rate, kg/s.
    pub rate: f64,
}

/// The factored matrix of a transport in steady state.
pub struct Steady<'a> {
    transport: &'a Transport,
    factor: Factor<'a>,
}

/// Number of columns solved together: many make good use of the factor, few keep the buffers smaller than the factor.
const COLUMNS: usize = 32;
/// Negative concentrations up to this share of the largest one are taken as rounding errors.
const ROUNDING: f64 = 1e-9;

impl<'a> Steady<'a> {
    /// Factors the transport.
    ///
    /// # Errors
    /// [`Error::NoSink`] if a connected part has no steady state; [`Error::Factorisation`] if memory runs out.
    pub fn new(transport: &'a Transport) -> Result<Self, Error> {
        transport.check_sinks()?;
        let factor = transport.factor(0.0, 1.0)?;
        Ok(Self { transport, factor })
    }

    /// The concentration in each free cell, kg/m^3, caused by all sources together.
    ///
    /// # Errors
    /// If a rate is not finite, a patch is of another domain, or [`Error::Factorisation`].
    pub fn concentration(&self, sources: &[Source]) -> Result<Vec<f64>, Error> {
        let mut releases = vec![0.0; self.transport.volumes.len()];
        for source in sources {
            self.transport.release(&source.patch, source.rate, &mut releases)?;
        }
        self.from_amounts(&releases)
    }

    /// The concentration with the given release in each free cell, kg/s.
    ///
    /// # Errors
    /// If there is not one release for each free cell, a release or a concentration is not finite, or [`Error::Factorisation`].
    pub fn from_amounts(&self, releases: &[f64]) -> Result<Vec<f64>, Error> {
        self.transport.check_field("releases", releases)?;
        let mut columns = Mat::from_fn(releases.len(), 1, |i, _| releases[i]);
        self.factor.solve(Direction::Forward, &mut columns);
        checked(columns.col_as_slice(0), releases.iter().all(|release| *release >= 0.0))
    }

    /// For each sensor the concentration that it measures, kg/m^3 per kg/s, for a source in each free cell: one adjoint solution per
    /// sensor.
    ///
    /// # Errors
    /// If a patch is of another domain, a response is not finite, or [`Error::Factorisation`].
    pub fn adjoint(&self, sensors: &[Patch]) -> Result<Vec<Vec<f64>>, Error> {
        let mut fields = Vec::with_capacity(sensors.len());
        for group in sensors.chunks(COLUMNS) {
            let mut columns = self.transport.columns(group)?;
            self.factor.solve(Direction::Adjoint, &mut columns);
            for j in 0..group.len() {
                fields.push(checked(columns.col_as_slice(j), true)?);
            }
        }
        Ok(fields)
    }
}

/// Checks that a field is finite. If `positive`, negative values up to rounding become zero, and larger ones are an error.
fn checked(field: &[f64], positive: bool) -> Result<Vec<f64>, Error> {
    all_finite("concentration", field)?;
    if !positive {
        return Ok(field.to_vec());
    }
    let rounding = -ROUNDING * field.iter().copied().fold(0.0, f64::max);
    if field.iter().any(|c| *c < rounding) {
        let unknowns = field.len();
        return Err(Error::Factorisation {
            unknowns,
            singular: true,
        });
    }
    Ok(field.iter().map(|c| c.max(0.0)).collect())
}
