//! What the fusion centre heard in one step, as a likelihood for particles.

use crate::Error;
use crate::ellipsoid::GaussianInEllipsoid;
use crate::network::Network;
use crate::rule::CensoringRule;
use crate::silence::{SilentFactor, SilentTable, check_loss};
use fewbits_core::{Columns, Likelihood, Observation};
use fewbits_models::ScalarSensing;
use fewbits_numerics::error::finite;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};

/// Everything heard in one step from scalar sensors, linear or not: `ln p(values and silences | x)`.
///
/// ```text
/// ln w(x) = sum over received i of ln N(z_i; h_i(x), r_i)
///         + sum over silent i of ln pi_i(h_i(x) - prediction_i)
/// ```
/// Built anew each step in the memory of the last ([`clear`](Self::clear), then one call a sensor or group of identical
/// sensors). Clouds are swept in blocks that stay in the cache; silent factors come from a [`SilentTable`].
#[derive(Debug, Clone, Default)]
pub struct HeardScalars<S> {
    entries: Vec<Entry<S>>,
    tables: Vec<SilentTable>,
    tables_used: usize,
}

#[derive(Debug, Clone)]
struct Entry<S> {
    sensor: S,
    kind: Kind,
}

#[derive(Debug, Clone, Copy)]
enum Kind {
    /// `constant - half_precision (h - mean)^2`.
    Values {
        mean: f64,
        half_precision: f64,
        constant: f64,
    },
    Silence {
        table: usize,
        prediction: f64,
        count: f64,
    },
}

/// Particles swept at once.
const BLOCK: usize = 256;

impl<S: Clone> HeardScalars<S> {
    /// Nothing heard yet.
    pub fn new() -> Self {
        Self {
            entries: Vec::new(),
            tables: Vec::new(),
            tables_used: 0,
        }
    }

    /// Forgets what was heard and keeps the memory.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.tables_used = 0;
    }

    /// Values from sensors identical with `sensor`: one evaluation through their mean.
    ///
    /// # Errors
    /// A value that is not finite.
    pub fn values<const D: usize>(&mut self, sensor: &S, values: impl Iterator<Item = f64> + Clone) -> Result<(), Error>
    where
        S: ScalarSensing<D>,
    {
        let mut count = 0.0;
        let mut sum = 0.0;
        for value in values.clone() {
            sum += finite("measurement", value)?;
            count += 1.0;
        }
        if count == 0.0 {
            return Ok(());
        }
        let variance = sensor.noise_covariance()[(0, 0)];
        let mean = sum / count;
        let scatter: f64 = values.map(|z| (z - mean) * (z - mean)).sum();
        self.entries.push(Entry {
            sensor: sensor.clone(),
            kind: Kind::Values {
                mean,
                half_precision: 0.5 * count / variance,
                constant: -0.5 * scatter / variance - count * (LN_SQRT_2PI + 0.5 * variance.ln()),
            },
        });
        Ok(())
    }

    /// Silence of `count` sensors identical with `sensor`, which compared with `prediction` and an interval of half-width `c`
    /// and whose messages are lost with probability `loss`. `particles` is the size of the cloud that will be weighed.
    ///
    /// # Errors
    /// As [`SilentFactor::new`]; a prediction that is not finite.
    pub fn silence<const D: usize>(
        &mut self,
        sensor: &S,
        prediction: f64,
        half_width: f64,
        loss: f64,
        count: usize,
        particles: usize,
    ) -> Result<(), Error>
    where
        S: ScalarSensing<D>,
    {
        finite("prediction", prediction)?;
        let factor = SilentFactor::new(half_width, sensor.noise_covariance()[(0, 0)], loss)?;
        match self.tables.get_mut(self.tables_used) {
            Some(table) => table.prepare(factor, particles),
            None => self.tables.push(SilentTable::new(factor, particles)),
        }
        self.entries.push(Entry {
            sensor: sensor.clone(),
            kind: Kind::Silence {
                table: self.tables_used,
                prediction,
                count: count as f64,
            },
        });
        self.tables_used += 1;
        Ok(())
    }
}

impl<const D: usize, S: ScalarSensing<D> + Clone> Likelihood<D> for HeardScalars<S> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        self.entries
            .iter()
            .map(|entry| {
                let mean = entry.sensor.mean(state)[0];
                match entry.kind {
                    Kind::Values {
                        mean: centre,
                        half_precision,
                        constant,
                    } => constant - half_precision * (mean - centre) * (mean - centre),
                    Kind::Silence {
                        table,
                        prediction,
                        count,
                    } => count * self.tables[table].factor().log_probability(mean - prediction),
                }
            })
            .sum()
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        let mut means = [0.0; BLOCK];
        for (block, log_weights) in log_weights.chunks_mut(BLOCK).enumerate() {
            let count = log_weights.len();
            let range = block * BLOCK..block * BLOCK + count;
            let here: Columns<'_, D> = states.map(|column| &column[range.clone()]);
            let means = &mut means[..count];
            for entry in &self.entries {
                entry.sensor.mean_columns(&here, means);
                match entry.kind {
                    Kind::Values {
                        mean,
                        half_precision,
                        constant,
                    } => {
                        for (log_weight, h) in log_weights.iter_mut().zip(&*means) {
                            *log_weight += constant - half_precision * (h - mean) * (h - mean);
                        }
                    }
                    Kind::Silence {
                        table,
                        prediction,
                        count,
                    } => self.tables[table].add(count, prediction, means, log_weights),
                }
            }
        }
    }
}

/// Everything heard in one step from linear sensors of `M` components each.
#[derive(Debug, Clone)]
pub struct HeardVectors<const D: usize, const M: usize> {
    values: Vec<VectorValue<D, M>>,
    silences: Vec<VectorSilence<D, M>>,
}

#[derive(Debug, Clone)]
struct VectorValue<const D: usize, const M: usize> {
    /// `L^-1 H` and `L^-1 z` with `R = L L'`.
    matrix: SMatrix<f64, M, D>,
    value: SVector<f64, M>,
    constant: f64,
}

#[derive(Debug, Clone)]
struct VectorSilence<const D: usize, const M: usize> {
    matrix: SMatrix<f64, M, D>,
    prediction: SVector<f64, M>,
    region: GaussianInEllipsoid<M>,
    loss: f64,
}

impl<const D: usize, const M: usize> HeardVectors<D, M> {
    /// What `heard` says, one observation a sensor, under these rules and this broadcast state prediction.
    ///
    /// # Errors
    /// As [`Network::audit`].
    pub fn new(
        network: &Network<D, M>,
        rules: &[CensoringRule<M>],
        broadcast: &SVector<f64, D>,
        heard: &[Observation<SVector<f64, M>>],
    ) -> Result<Self, Error> {
        network.audit(rules, broadcast, heard)?;
        let loss = check_loss(network.loss())?;
        let (mut values, mut silences) = (Vec::new(), Vec::new());
        for ((sensor, rule), observation) in network.sensors().iter().zip(rules).zip(heard) {
            match observation {
                Observation::Received(value) => {
                    let factor = sensor.noise_factor();
                    let white = |m: &SMatrix<f64, M, D>| factor.solve_lower_triangular(m);
                    let log_determinant: f64 = factor.diagonal().iter().map(|d| d.ln()).sum();
                    if let (Some(matrix), Some(value)) = (white(sensor.matrix()), factor.solve_lower_triangular(value))
                    {
                        values.push(VectorValue {
                            matrix,
                            value,
                            constant: -log_determinant - M as f64 * LN_SQRT_2PI,
                        });
                    }
                }
                Observation::Silent => silences.push(VectorSilence {
                    matrix: *sensor.matrix(),
                    prediction: sensor.matrix() * broadcast,
                    region: rule.region().under(sensor.noise_covariance())?,
                    loss,
                }),
                Observation::Lost => {}
            }
        }
        Ok(Self { values, silences })
    }
}

impl<const D: usize, const M: usize> Likelihood<D> for HeardVectors<D, M> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        let values: f64 = self
            .values
            .iter()
            .map(|v| v.constant - 0.5 * (v.value - v.matrix * state).norm_squared())
            .sum();
        let silences: f64 = self
            .silences
            .iter()
            .map(|s| {
                let inside = s.region.log_probability(&(s.matrix * state - s.prediction));
                if s.loss == 0.0 {
                    inside
                } else {
                    (s.loss + (1.0 - s.loss) * inside.exp()).ln()
                }
            })
            .sum();
        values + silences
    }
}

impl<const D: usize> Network<D, 1> {
    /// Fills `likelihood` with what was heard from scalar linear sensors, identical ones together.
    ///
    /// # Errors
    /// As [`Network::audit`].
    pub fn hear(
        &self,
        rules: &[CensoringRule<1>],
        broadcast: &SVector<f64, D>,
        heard: &[Observation<SVector<f64, 1>>],
        particles: usize,
        likelihood: &mut HeardScalars<fewbits_models::LinearSensor<D, 1>>,
    ) -> Result<(), Error> {
        self.audit(rules, broadcast, heard)?;
        likelihood.clear();
        for (i, sensor) in self.sensors().iter().enumerate() {
            if self.twin(i) == i {
                let values = heard
                    .iter()
                    .enumerate()
                    .filter(|(j, _)| self.twin(*j) == i)
                    .filter_map(|(_, o)| o.received().map(|z| z[0]));
                likelihood.values(sensor, values)?;
            }
            let count = self.heard_together(rules, heard, i);
            if count > 0 {
                let prediction = (sensor.matrix() * broadcast)[0];
                likelihood.silence(sensor, prediction, rules[i].half_width(), self.loss(), count, particles)?;
            }
        }
        Ok(())
    }
}
