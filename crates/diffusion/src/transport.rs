//! Diffusion, wind and decay on a domain: the matrix.

use crate::grid::LARGEST;
use crate::solver::{Direction, Solver};
use crate::{Boundary, Domain, Error, Flow, Patch};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, within};
use std::sync::{Arc, OnceLock};

/// How the flux through a face depends on the concentrations beside it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Scheme {
    /// The flux of the exact solution in one dimension between the two centres. Second order while the Peclet number `v h / D` of a
    /// cell is below about 3.
    #[default]
    ExponentialFitting,
    /// The wind carries the concentration that it comes from. First order: adds the diffusivity `v h / 2`.
    Upwind,
}

/// `x / (exp(x) - 1)`, with `B(-x) = B(x) + x` to rounding.
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

impl Scheme {
    /// Factors of the concentrations on both sides of a face with Peclet number `p`, where the air comes from first.
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
    /// The same in all.
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
/// Columns of `A` sum to what leaves the domain and decays: mass is kept to rounding. Off-diagonals are not positive and column sums
/// not negative, so that steady solutions and implicit Euler steps are never negative.
pub struct Transport {
    pub(crate) domain: Arc<Domain>,
    pub(crate) volumes: Vec<f64>,
    decay: Vec<f64>,
    /// Amount per concentration through each face, upwards and downwards.
    pub(crate) rates: Vec<[f64; 2]>,
    /// Amount per concentration out of each face at the edge, and in per concentration outside (inflows only).
    edge_rates: Vec<[f64; 2]>,
    pub(crate) diagonal: Vec<f64>,
    solver: OnceLock<Solver>,
}

/// Where a substance goes: amounts per second, or amounts.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Budget {
    /// Integral of the field, kg (kg s for a dose).
    pub mass: f64,
    /// What decays.
    pub decayed: f64,
    /// What absorbing walls take.
    pub absorbed: f64,
    /// What leaks through walls.
    pub leaked: f64,
    /// What leaves through inflows, against the wind.
    pub inflow: f64,
    /// What leaves through outflows.
    pub outflow: f64,
}

impl Budget {
    /// All that leaves or decays.
    pub fn removed(&self) -> f64 {
        self.decayed + self.absorbed + self.leaked + self.inflow + self.outflow
    }
}

impl Transport {
    /// The transport with the given diffusivity (m^2/s) and decay (1/s) in the free cells, by the given wind.
    ///
    /// # Errors
    /// If a diffusivity is not in `[1e-30, 1e30]`, a decay not in `[0, 1e30]`, their number or the flow is not that of the domain,
    /// [`Error::Divergence`], or [`Error::Backflow`].
    pub fn new(
        domain: impl Into<Arc<Domain>>,
        diffusivity: impl Into<PerCell>,
        flow: &Flow,
        decay: impl Into<PerCell>,
        scheme: Scheme,
    ) -> Result<Self, Error> {
        let domain = domain.into();
        flow.check(&domain)?;
        let diffusivity = values("diffusivity", diffusivity.into(), domain.free().len(), LARGEST.recip())?;
        let decay = values("decay", decay.into(), domain.free().len(), 0.0)?;
        let volumes = domain.volumes();
        let mut diagonal: Vec<f64> = decay.iter().zip(&volumes).map(|(decay, v)| decay * v).collect();
        let mut rates = Vec::with_capacity(domain.faces.len());
        for (face, flow) in domain.faces.iter().zip(&flow.inside) {
            let [low, high] = face.cells;
            // Two half cells in series.
            let conductance = face.area / (face.halves[0] / diffusivity[low] + face.halves[1] / diffusivity[high]);
            let rate = scheme.weights(flow / conductance).map(|weight| conductance * weight);
            diagonal[low] += rate[0];
            diagonal[high] += rate[1];
            rates.push(rate);
        }
        let (largest, mut edge_rates) = (flow.largest(), Vec::with_capacity(domain.edge_faces.len()));
        for (face, flow) in domain.edge_faces.iter().zip(&flow.edge) {
            let half_resistance = face.half / diffusivity[face.cell];
            let conductance = face.area / half_resistance;
            let rate = match face.boundary {
                Boundary::Closed | Boundary::Leaking(0.0) => [0.0; 2],
                Boundary::Absorbing => [conductance, 0.0],
                Boundary::Leaking(leak) => [face.area / (leak.recip() + half_resistance), 0.0],
                Boundary::Inflow => scheme.weights(flow / conductance).map(|weight| conductance * weight),
                Boundary::Outflow if largest == 0.0 => [conductance, 0.0],
                // Rounding may leave a flow just below zero.
                Boundary::Outflow if *flow >= -1e-10 * largest => [flow.max(0.0), 0.0],
                Boundary::Outflow => {
                    let cell = domain.grid().place(domain.free()[face.cell]);
                    return Err(Error::Backflow { cell, flow: *flow });
                }
            };
            diagonal[face.cell] += rate[0];
            edge_rates.push(rate);
        }
        Ok(Self {
            domain,
            volumes,
            decay,
            rates,
            edge_rates,
            diagonal,
            solver: OnceLock::new(),
        })
    }

    /// The domain.
    pub fn domain(&self) -> &Arc<Domain> {
        &self.domain
    }

    /// The ordering of the matrix, made when it is first needed.
    pub(crate) fn solver(&self) -> Result<&Solver, Error> {
        if let Some(solver) = self.solver.get() {
            return Ok(solver);
        }
        let solver = Solver::new(self.diagonal.len(), &self.domain.faces, &self.rates)?;
        Ok(self.solver.get_or_init(|| solver))
    }

    /// Whether the matrix is symmetric after scaling (no wind, or potential flow with one diffusivity), so that Cholesky serves.
    ///
    /// # Errors
    /// If memory runs out.
    pub fn is_symmetric(&self) -> Result<bool, Error> {
        Ok(self.solver()?.is_symmetric())
    }

    /// Writes `A x`, or `A' x`, to `out`.
    pub(crate) fn apply(&self, direction: Direction, x: &[f64], out: &mut [f64]) {
        for ((out, x), diagonal) in out.iter_mut().zip(x).zip(&self.diagonal) {
            *out = diagonal * x;
        }
        for (face, rate) in self.domain.faces.iter().zip(&self.rates) {
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
    /// If there is not one concentration for each free cell.
    pub fn net_outflow(&self, concentration: &[f64]) -> Result<Vec<f64>, Error> {
        self.check_field(concentration)?;
        let mut out = vec![0.0; concentration.len()];
        self.apply(Direction::Forward, concentration, &mut out);
        Ok(out)
    }

    /// What the inflows bring into each free cell if the air outside has the given concentration, kg/s.
    pub fn inflow(&self, outside: f64) -> Vec<f64> {
        let mut source = vec![0.0; self.diagonal.len()];
        for (face, rate) in self.domain.edge_faces.iter().zip(&self.edge_rates) {
            source[face.cell] += rate[1] * outside;
        }
        source
    }

    /// Mass, and what leaves per second, of a concentration; or of a dose (kg s/m^3), all that has left.
    ///
    /// # Errors
    /// If there is not one number for each free cell, or a part of the budget is beyond the range of numbers.
    pub fn budget(&self, concentration: &[f64]) -> Result<Budget, Error> {
        self.check_field(concentration)?;
        let contents = || self.volumes.iter().zip(concentration).map(|(volume, c)| volume * c);
        let mut budget = Budget {
            mass: contents().sum(),
            decayed: contents().zip(&self.decay).map(|(amount, decay)| amount * decay).sum(),
            ..Budget::default()
        };
        for (face, rate) in self.domain.edge_faces.iter().zip(&self.edge_rates) {
            let leaves = rate[0] * concentration[face.cell];
            match face.boundary {
                Boundary::Closed => {}
                Boundary::Absorbing => budget.absorbed += leaves,
                Boundary::Leaking(_) => budget.leaked += leaves,
                Boundary::Inflow => budget.inflow += leaves,
                Boundary::Outflow => budget.outflow += leaves,
            }
        }
        let Budget {
            mass,
            decayed,
            absorbed,
            leaked,
            inflow,
            outflow,
        } = budget;
        all_finite("budget", &[mass, decayed, absorbed, leaked, inflow, outflow])?;
        Ok(budget)
    }

    fn check_field(&self, field: &[f64]) -> Result<(), Error> {
        if field.len() != self.volumes.len() {
            let expected = format!("{}, one for each free cell", self.volumes.len());
            return Err(ArgumentError::new("concentration", field.len(), expected).into());
        }
        Ok(all_finite("concentration", field)?)
    }

    /// Refuses a domain with a part that nothing leaves and where nothing decays.
    pub(crate) fn check_sinks(&self) -> Result<(), Error> {
        let (part, parts) = self.domain.parts();
        let mut drained = vec![false; parts];
        for (cell, decay) in self.decay.iter().enumerate() {
            drained[part[cell]] |= *decay > 0.0;
        }
        for (face, rate) in self.domain.edge_faces.iter().zip(&self.edge_rates) {
            drained[part[face.cell]] |= rate[0] > 0.0;
        }
        match part.iter().position(|part| !drained[*part]) {
            None => Ok(()),
            Some(cell) => Err(Error::NoSink {
                cell: self.domain.grid().place(self.domain.free()[cell]),
            }),
        }
    }

    /// Checks that a patch is of this domain.
    pub(crate) fn check_patch(&self, patch: &Patch) -> Result<(), Error> {
        match patch.shares.iter().find(|share| share.0 >= self.volumes.len()) {
            None => Ok(()),
            Some((cell, _)) => {
                let expected = format!("cells below {}: the patch is of another domain", self.volumes.len());
                Err(ArgumentError::new("patch", cell, expected).into())
            }
        }
    }
}

fn values(name: &'static str, given: PerCell, count: usize, least: f64) -> Result<Vec<f64>, Error> {
    let values = match given {
        PerCell::Constant(value) => vec![value; count],
        PerCell::Each(values) => values,
    };
    if values.len() != count {
        let (given, expected) = (format!("{} values", values.len()), format!("{count}, one for each free cell"));
        return Err(ArgumentError::new(name, given, expected).into());
    }
    for value in &values {
        within(name, *value, least, LARGEST)?;
    }
    Ok(values)
}
