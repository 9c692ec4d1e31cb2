//! Diffusion, wind and decay on a domain: the matrix.

use crate::domain::{Face, OUTSIDE};
use crate::grid::MAX_MAGNITUDE;
use crate::solver::{Direction, Factor, Solver};
use crate::{Boundary, Domain, Error, Flow, Patch};
use faer::Mat;
use fewbits_numerics::error::{all_finite, finite, refuse, within};
use std::sync::{Arc, OnceLock};

/// How the flux through a face depends on the concentrations beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FluxRule {
    /// The flux of the exact solution in one dimension between the two centres. Second order while the Peclet number `v h / D` of a
    /// cell is below about 3.
    #[default]
    ExponentialFitting,
    /// The flux uses the concentration of the upwind cell. First order: it adds the numerical diffusivity `v h / 2`.
    Upwind,
}

/// The Bernoulli function `x / (exp(x) - 1)`. `B(-x) = B(x) + x` holds to rounding.
fn bernoulli(x: f64) -> f64 {
    let size = x.abs();
    let positive = if size < 1e-3 {
        // The next term is below 1e-22.
        1.0 - 0.5 * size + size * size / 12.0 - size.powi(4) / 720.0
    } else {
        size * (-size).exp() / -(-size).exp_m1()
    };
    if x < 0.0 { positive + size } else { positive }
}

impl FluxRule {
    /// Coefficients of the concentrations below and above a face in the upward flux. The Peclet number `p` is positive for upward flow.
    fn weights(self, p: f64) -> [f64; 2] {
        match self {
            Self::ExponentialFitting => [bernoulli(-p), bernoulli(p)],
            Self::Upwind => [1.0 + p.max(0.0), 1.0 + (-p).max(0.0)],
        }
    }
}

/// A value for every free cell.
#[derive(Debug, Clone, PartialEq)]
pub enum PerCell {
    /// The same value in all cells.
    Constant(f64),
    /// One for each free cell, in the order of [`Domain::free`]. [`Domain::sample`] makes them from a function.
    Each(Vec<f64>),
}

impl From<f64> for PerCell {
    fn from(value: f64) -> Self {
        Self::Constant(value)
    }
}

impl From<Vec<f64>> for PerCell {
    fn from(values: Vec<f64>) -> Self {
        Self::Each(values)
    }
}

/// `dc/dt + div(v c - D grad c) + decay c = source` on a domain, discretised by finite volumes.
///
/// ```text
/// V dc/dt = source - A c         source in kg/s, c in kg/m^3, V volumes
/// flux through a face from L to R = area / h D (B(-p) c_L - B(p) c_R),   p = v h / D,   D harmonic mean
/// ```
///
/// The columns of `A` sum to what leaves the domain and decays, so mass is conserved to rounding. Off-diagonal entries are not positive and
/// column sums not negative. Therefore steady solutions and implicit Euler steps are never negative.
pub struct Transport {
    domain: Arc<Domain>,
    pub(crate) volumes: Vec<f64>,
    decay: Vec<f64>,
    /// Amount per concentration that crosses each face of the domain, upwards and downwards.
    rates: Vec<[f64; 2]>,
    pub(crate) diagonal: Vec<f64>,
    solver: OnceLock<Solver>,
}

/// Where a substance goes: amounts per second of a concentration, or amounts of a dose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Balance {
    /// Integral of the field, kg (kg s for a dose).
    pub mass: f64,
    /// Amount that decays.
    pub decayed: f64,
    /// Amount that absorbing walls take up.
    pub absorbed: f64,
    /// Amount that leaks through walls.
    pub leaked: f64,
    /// Amount that leaves through inflows by diffusion, against the wind.
    pub inflow: f64,
    /// Amount that leaves through outflows.
    pub outflow: f64,
}

impl Balance {
    /// Sum of all that leaves or decays.
    pub fn removed(&self) -> f64 {
        self.decayed + self.absorbed + self.leaked + self.inflow + self.outflow
    }
}

impl Transport {
    /// A transport with the given diffusivity (m^2/s) and decay (1/s) in the free cells and the given wind.
    ///
    /// # Errors
    /// If a diffusivity is not in `[1e-30, 1e30]`, a decay not in `[0, 1e30]`, their number or the flow is not that of the domain,
    /// [`Error::Divergence`], or [`Error::Backflow`].
    pub fn new(
        domain: impl Into<Arc<Domain>>,
        diffusivity: impl Into<PerCell>,
        flow: &Flow,
        decay: impl Into<PerCell>,
        scheme: FluxRule,
    ) -> Result<Self, Error> {
        let domain = domain.into();
        flow.check(&domain)?;
        let mut diffusivity = values("diffusivity", diffusivity.into(), &domain, MAX_MAGNITUDE.recip())?;
        let decay = values("decay", decay.into(), &domain, 0.0)?;
        let volumes = domain.volumes();
        let mut diagonal: Vec<f64> = decay.iter().zip(&volumes).map(|(decay, v)| decay * v).collect();
        // The outside has half width zero, so any diffusivity serves.
        diffusivity.extend([1.0; OUTSIDE]);
        diagonal.extend([0.0; OUTSIDE]);
        let (largest, mut rates) = (flow.largest(), Vec::with_capacity(domain.faces.len()));
        for (face, flow) in domain.faces.iter().zip(&flow.upwards) {
            // Resistance of the two half cells in series.
            let [below, above] = [0, 1].map(|side| face.halves[side] / diffusivity[face.cells[side]]);
            let conductance = face.area / (below + above);
            let outwards = if face.side() == 0 { *flow } else { -flow };
            let rate = match face.boundary {
                None | Some(Boundary::Inflow) => scheme.weights(flow / conductance).map(|weight| conductance * weight),
                Some(Boundary::Closed | Boundary::Leaking(0.0)) => [0.0; 2],
                Some(Boundary::Leaking(leak)) => [face.area / (leak.recip() + (below + above)); 2],
                Some(Boundary::Absorbing) => [conductance; 2],
                Some(Boundary::Outflow) if largest == 0.0 => [conductance; 2],
                // A flow slightly below zero is a rounding error.
                Some(Boundary::Outflow) if outwards >= -1e-10 * largest => [outwards.max(0.0); 2],
                Some(Boundary::Outflow) => {
                    let cell = domain.place(face.cell());
                    return Err(Error::Backflow { cell, flow: outwards });
                }
            };
            diagonal[face.cells[0]] += rate[0];
            diagonal[face.cells[1]] += rate[1];
            rates.push(rate);
        }
        diagonal.truncate(volumes.len());
        let solver = OnceLock::new();
        Ok(Self {
            domain,
            volumes,
            decay,
            rates,
            diagonal,
            solver,
        })
    }

    /// The domain.
    pub fn domain(&self) -> &Arc<Domain> {
        &self.domain
    }

    /// The ordering of the matrix, computed at its first use.
    fn solver(&self) -> Result<&Solver, Error> {
        if let Some(solver) = self.solver.get() {
            return Ok(solver);
        }
        let solver = Solver::new(&self.domain, &self.rates)?;
        Ok(self.solver.get_or_init(|| solver))
    }

    /// The factor of `share V + weight A`.
    pub(crate) fn factor(&self, share: f64, weight: f64) -> Result<Factor<'_>, Error> {
        let pairs = self.volumes.iter().zip(&self.diagonal);
        let diagonal = pairs.map(|(volume, rate)| share * volume + weight * rate).collect();
        self.solver()?
            .factor(diagonal, &self.rates[..self.domain.inner], weight)
    }

    /// Whether the scaled matrix is symmetric (no wind, or potential flow with one diffusivity), so that Cholesky is used.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn is_symmetric(&self) -> Result<bool, Error> {
        Ok(self.solver()?.is_symmetric())
    }

    /// Writes `A x`, or `A' x` for the adjoint direction, to `out`.
    pub(crate) fn apply(&self, direction: Direction, x: &[f64], out: &mut [f64]) {
        for ((out, x), diagonal) in out.iter_mut().zip(x).zip(&self.diagonal) {
            *out = diagonal * x;
        }
        let inner = &self.domain.faces[..self.domain.inner];
        for (face, rate) in inner.iter().zip(&self.rates) {
            let [low, high] = face.cells;
            let forward = direction == Direction::Forward;
            let [up, down] = if forward { *rate } else { [rate[1], rate[0]] };
            out[high] -= up * x[low];
            out[low] -= down * x[high];
        }
    }

    /// `A x`, kg/s: what leaves each free cell at the concentrations `x`.
    ///
    /// # Errors
    /// If there is not one concentration for each free cell, or one is not finite.
    pub fn net_outflow(&self, concentration: &[f64]) -> Result<Vec<f64>, Error> {
        self.check_field("concentration", concentration)?;
        let mut out = vec![0.0; concentration.len()];
        self.apply(Direction::Forward, concentration, &mut out);
        Ok(out)
    }

    /// The amount that inflows bring into each free cell, kg/s, if the air outside has the given concentration, kg/m^3.
    pub fn inflow(&self, outside: f64) -> Vec<f64> {
        let mut source = vec![0.0; self.diagonal.len()];
        for (face, rate) in self.edge().filter(|edge| edge.0.boundary == Some(Boundary::Inflow)) {
            source[face.cell()] += rate[1 - face.side()] * outside;
        }
        source
    }

    /// Faces to the outside and to walls that are not closed, with their rates upwards and downwards.
    fn edge(&self) -> impl Iterator<Item = (&Face, &[f64; 2])> {
        self.domain.faces.iter().zip(&self.rates).skip(self.domain.inner)
    }

    /// Mass, and amounts that leave per second, for a concentration (kg/m^3); or the amounts that have left, for a dose (kg s/m^3).
    ///
    /// # Errors
    /// If there is not one number per free cell, or mass or the sum of what leaves overflows.
    pub fn balance(&self, concentration: &[f64]) -> Result<Balance, Error> {
        self.check_field("concentration", concentration)?;
        let contents = || self.volumes.iter().zip(concentration).map(|(volume, c)| volume * c);
        let mut balance = Balance {
            mass: contents().sum(),
            decayed: contents().zip(&self.decay).map(|(amount, decay)| amount * decay).sum(),
            ..Balance::default()
        };
        for (face, rate) in self.edge() {
            let part = match face.boundary {
                None | Some(Boundary::Closed) => continue,
                Some(Boundary::Absorbing) => &mut balance.absorbed,
                Some(Boundary::Leaking(_)) => &mut balance.leaked,
                Some(Boundary::Inflow) => &mut balance.inflow,
                Some(Boundary::Outflow) => &mut balance.outflow,
            };
            *part += rate[face.side()] * concentration[face.cell()];
        }
        all_finite("balance", &[balance.mass, balance.removed()])?;
        Ok(balance)
    }

    /// Checks that a field has one finite number per free cell.
    pub(crate) fn check_field(&self, name: &'static str, field: &[f64]) -> Result<(), Error> {
        self.domain.check_count(name, field.len())?;
        Ok(all_finite(name, field)?)
    }

    /// Checks that every connected part has an exit or decay.
    pub(crate) fn check_sinks(&self) -> Result<(), Error> {
        let mut drained: Vec<bool> = self.decay.iter().map(|decay| *decay > 0.0).collect();
        for (face, rate) in self.edge() {
            drained[face.cell()] |= rate[face.side()] > 0.0;
        }
        for part in self.domain.walk() {
            if !part.iter().any(|(cell, _)| drained[*cell]) {
                let cell = self.domain.place(part[0].0);
                return Err(Error::NoSink { cell });
            }
        }
        Ok(())
    }

    /// Adds a release of `rate` in a patch to the amounts in the cells.
    pub(crate) fn release(&self, patch: &Patch, rate: f64, amounts: &mut [f64]) -> Result<(), Error> {
        finite("rate", rate)?;
        for (cell, share) in &patch.shares {
            match amounts.get_mut(*cell) {
                Some(amount) => *amount += share * rate,
                None => return refuse("patch", format!("of cell {cell}"), "a patch of this domain"),
            }
        }
        Ok(())
    }

    /// One column per sensor with the shares of its cells.
    pub(crate) fn columns(&self, sensors: &[Patch]) -> Result<Mat<f64>, Error> {
        let mut columns = Mat::zeros(self.volumes.len(), sensors.len());
        for (j, sensor) in sensors.iter().enumerate() {
            self.release(sensor, 1.0, columns.col_as_slice_mut(j))?;
        }
        Ok(columns)
    }
}

fn values(name: &'static str, given: PerCell, domain: &Domain, least: f64) -> Result<Vec<f64>, Error> {
    let values = match given {
        PerCell::Constant(value) => vec![value; domain.free().len()],
        PerCell::Each(values) => values,
    };
    domain.check_count(name, values.len())?;
    for value in &values {
        within(name, *value, least, MAX_MAGNITUDE)?;
    }
    Ok(values)
}
