//! Steady concentrations.

use crate::solver::{Direction, Factor};
use crate::{Error, Patch, Transport};
use faer::Mat;
use fewbits_numerics::error::{all_finite, finite};

/// A source: a patch and its rate, kg/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Source {
    /// Where it releases.
    pub patch: Patch,
    /// Its rate, kg/s.
    pub rate: f64,
}

/// A factored transport without time.
pub struct Steady<'a> {
    transport: &'a Transport,
    factor: Factor<'a>,
}

/// Columns that are solved together: enough to use the factor well, few enough that scratch memory stays below that of the factor.
const COLUMNS: usize = 32;
/// Share of the largest concentration that rounding may leave below zero.
const ROUNDING: f64 = 1e-9;

impl<'a> Steady<'a> {
    /// Factors the transport.
    ///
    /// # Errors
    /// [`Error::NoSink`] if a part has no steady state; [`Error::Factorisation`] if memory runs out.
    pub fn new(transport: &'a Transport) -> Result<Self, Error> {
        transport.check_sinks()?;
        let factor = transport.solver()?.factor(&transport.diagonal, &transport.rates, 1.0)?;
        Ok(Self { transport, factor })
    }

    /// The concentration in each free cell, kg/m^3, with all sources on.
    ///
    /// # Errors
    /// If a rate is not finite, a patch is of another domain, or [`Error::Factorisation`].
    pub fn concentration(&self, sources: &[Source]) -> Result<Vec<f64>, Error> {
        let mut right = vec![0.0; self.transport.volumes.len()];
        for source in sources {
            finite("rate", source.rate)?;
            self.transport.check_patch(&source.patch)?;
            for (cell, share) in &source.patch.shares {
                right[*cell] += share * source.rate;
            }
        }
        self.from_amounts(&right)
    }

    /// The concentration with the given release in each free cell, kg/s.
    ///
    /// # Errors
    /// If there is not one release for each free cell, a release or a concentration is not finite, or [`Error::Factorisation`].
    pub fn from_amounts(&self, releases: &[f64]) -> Result<Vec<f64>, Error> {
        // The same conditions as for a field.
        self.transport.net_outflow(releases)?;
        let mut columns = Mat::from_fn(releases.len(), 1, |i, _| releases[i]);
        self.factor.solve(Direction::Forward, &mut columns);
        let mut found = columns.col_as_slice(0).to_vec();
        all_finite("concentration", &found)?;
        if releases.iter().all(|release| *release >= 0.0) {
            raise(&mut found)?;
        }
        Ok(found)
    }

    /// For each sensor the concentration that it measures, kg/m^3 per kg/s, of a source in each free cell: one adjoint solution.
    ///
    /// # Errors
    /// If a patch is of another domain, a response is not finite, or [`Error::Factorisation`].
    pub fn adjoint(&self, sensors: &[Patch]) -> Result<Vec<Vec<f64>>, Error> {
        let count = self.transport.volumes.len();
        let mut fields = Vec::with_capacity(sensors.len());
        for group in sensors.chunks(COLUMNS) {
            let mut columns = Mat::zeros(count, group.len());
            for (j, sensor) in group.iter().enumerate() {
                self.transport.check_patch(sensor)?;
                for (cell, share) in &sensor.shares {
                    columns[(*cell, j)] += share;
                }
            }
            self.factor.solve(Direction::Adjoint, &mut columns);
            for j in 0..group.len() {
                let mut found = columns.col_as_slice(j).to_vec();
                all_finite("response", &found)?;
                raise(&mut found)?;
                fields.push(found);
            }
        }
        Ok(fields)
    }
}

/// Sets to zero what rounding left below zero of a field that cannot be negative; refuses a field that is negative beyond rounding.
fn raise(field: &mut [f64]) -> Result<(), Error> {
    let rounding = -ROUNDING * field.iter().copied().fold(0.0, f64::max);
    if field.iter().any(|c| *c < rounding) {
        return Err(Error::Factorisation {
            unknowns: field.len(),
            singular: true,
        });
    }
    field.iter_mut().for_each(|c| *c = c.max(0.0));
    Ok(())
}
