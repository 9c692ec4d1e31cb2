//! A user's answer first: the design of a scene for a number of bits, with what it is worth and whether to believe it.

use super::joint::{Design, joint, multi_start};
use super::multi_interval::{Discovery, discover};
use super::separation::{Separation, separate};
use crate::bounds;
use crate::criterion::Criterion;
use crate::error::{Error, refuse};
use crate::newton::{Certificate, Newton};
use crate::scene::{Prior, Scene};
use crate::system::{SensorGroup, System};
use fewbits_quantizers::{Channel, Quantizer, lloyd_max};
use serde::{Deserialize, Serialize};

/// Most bits a sensor may take here; more need no joint design.
const MAX_BITS: u32 = 6;
/// Sensors are told apart as long as they have no more joint outcomes than this.
const APART: u64 = 1 << 10;
/// Folded cells are searched for up to this many joint outcomes of two sensors.
const FOLDED: u64 = 1 << 6;
/// Random starts.
const STARTS: usize = 8;

/// What a design is worth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// `E (X - E[X | T])^2`.
    pub mean_squared_error: f64,
    /// `I(X; T)` in nats.
    pub information: f64,
    /// Error probability of the best decision, for finitely many values of the unknown.
    pub bayes_error: Option<f64>,
    /// Least squared error that any codes of as many bits at separate sensors could have (quadratic Gaussian CEO), for a Gaussian
    /// prior, independent noise, clear channels and at most [`bounds::CEO_MAX_SENSORS`] sensors.
    pub ceo_bound: Option<f64>,
    /// Least squared error of any estimator from these symbols (Bayesian Cramer-Rao), for a Gaussian prior and independent noise.
    pub estimator_bound: Option<f64>,
    /// What the second derivatives prove of the design.
    pub certificate: Certificate,
}

impl Report {
    /// Squared error over the tightest bound there is: 1 would be perfect.
    pub fn excess(&self) -> Option<f64> {
        let tightest = self
            .ceo_bound
            .into_iter()
            .chain(self.estimator_bound)
            .reduce(f64::max)?;
        Some(self.mean_squared_error / tightest)
    }
}

impl Design {
    /// What the design is worth, and how far it is from what cannot be beaten.
    ///
    /// # Errors
    /// As [`System::value`] and [`bounds::ceo`].
    pub fn report(&self) -> Result<Report, Error> {
        let (system, scene) = (&self.system, self.system.scene());
        let independent = scene.is_independent();
        let ceo_bound = match scene.prior() {
            Prior::Gaussian { .. } if independent && scene.sensors() <= bounds::CEO_MAX_SENSORS => {
                let clear = system.groups().iter().all(|g| g.channel().is_ideal());
                let mut bits = vec![0.0; scene.sensors()];
                for group in system.groups() {
                    group
                        .sensors()
                        .iter()
                        .for_each(|n| bits[*n] = (group.quantizer().levels() as f64).log2());
                }
                if clear {
                    Some(bounds::ceo(scene.prior(), scene.noise(), &bits)?.lower())
                } else {
                    None
                }
            }
            _ => None,
        };
        let estimator_bound = match scene.prior() {
            Prior::Gaussian { .. } if independent => Some(bounds::bayesian_cramer_rao(system)?),
            _ => None,
        };
        Ok(Report {
            mean_squared_error: system.value(Criterion::MeanSquaredError)?,
            information: system.value(Criterion::MutualInformation)?,
            bayes_error: match scene.prior() {
                Prior::Discrete { .. } => Some(system.value(Criterion::BayesError)?),
                _ => None,
            },
            ceo_bound,
            estimator_bound,
            certificate: self.certificate,
        })
    }

    /// The design in units in which every number is `factor` times as large; its value is that of the rescaled system.
    ///
    /// # Errors
    /// If `factor` is not a positive number.
    pub fn rescaled(&self, factor: f64, criterion: Criterion) -> Result<Self, Error> {
        let system = self.system.rescaled(factor)?;
        let value = match criterion {
            Criterion::MeanSquaredError => self.value * factor * factor,
            Criterion::MutualInformation | Criterion::BayesError => self.value,
        };
        let curvature = match criterion {
            Criterion::MeanSquaredError => self.largest_curvature,
            Criterion::MutualInformation | Criterion::BayesError => self.largest_curvature / (factor * factor),
        };
        Ok(Self {
            system,
            value,
            largest_curvature: curvature,
            ..self.clone()
        })
    }
}

/// Quantizers of `bits` bits for every sensor of a scene, received as sent, for the estimate of least mean squared error. To
/// decide between the values of a discrete prior, use [`detection`].
///
/// Sensors that differ, or are few, are designed apart from Lloyd-Max quantizers and from random starts, and
/// two sensors of few levels also with folded cells; many equal sensors share one quantizer. The specialist's tools are in
/// [`design`](crate::design).
///
/// ```
/// use fewbits_quantizer_design::{Certificate, Scene, design};
/// let best = design::estimation(&Scene::gaussian_with_deviations(1.0, &[1.0, 1.0])?, 2)?;
/// let report = best.report()?;
/// assert!((report.mean_squared_error - 0.388_403_07).abs() < 1e-7);
/// assert_eq!(report.certificate, Certificate::LocalOptimum);
/// assert!(report.excess().is_some_and(|excess| excess < 1.09));
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
///
/// # Errors
/// Unless `bits` is in `1..=6`; [`Error::TooLarge`] if the sensors have more joint outcomes than can be enumerated;
/// [`Error::NotConverged`].
pub fn estimation(scene: &Scene, bits: u32) -> Result<Design, Error> {
    let levels = levels_of(bits)?;
    let criterion = Criterion::MeanSquaredError;
    let apart = System::lloyd_max(scene.clone(), levels)?;
    let newton = Newton::default();
    if apart.outcomes() > APART {
        return joint(&grouped(&apart)?, criterion, &newton);
    }
    let best = multi_start(&apart, criterion, STARTS, 1, &newton)?;
    if scene.sensors() != 2 || apart.outcomes() > FOLDED {
        return Ok(best);
    }
    let settings = Discovery {
        starts: STARTS,
        polished: 6,
        ..Discovery::default()
    };
    let folded = discover(&best.system, criterion, &settings)?;
    // Folded cells are harder to build: they must be worth it.
    Ok(if folded.value < best.value * (1.0 - 1e-6) {
        folded
    } else {
        best
    })
}

/// Quantizers of `bits` bits for every sensor of a scene, received as sent, for the decision between the values of a discrete
/// prior with the least error probability. To estimate an unknown whose density is given at nodes, use [`estimation`].
///
/// Starts from the design of most information and, for two hypotheses, from that of largest Matusita distance.
///
/// # Errors
/// As [`estimation`]; also if the prior is continuous.
pub fn detection(scene: &Scene, bits: u32) -> Result<Design, Error> {
    let levels = levels_of(bits)?;
    let newton = Newton::default();
    let apart = System::lloyd_max(scene.clone(), levels)?;
    let mut starts = vec![grouped(&apart)?];
    if let ([low, high], true) = (scene.values(), starts[0].groups().len() == 1) {
        // Two hypotheses and equal sensors: the quantizer that keeps the hypotheses apart at one of them.
        let (signal, sd) = (high - low, scene.noise().deviation(0));
        let spread = lloyd_max::gaussian(levels)?.affine(0.5 * signal, sd)?;
        let ideal = Channel::ideal(levels)?;
        if let Ok((q, _)) = separate(Separation::Matusita, signal, sd, &Quantizer::from(&spread), &ideal, &newton) {
            starts.push(starts[0].with_quantizer(0, q.affine(*low, 1.0)?)?);
        }
    }
    let mut best: Option<Result<Design, Error>> = None;
    for start in starts {
        let informed = joint(&start, Criterion::MutualInformation, &newton).map_or(start, |d| d.system);
        let found = joint(&informed, Criterion::BayesError, &newton);
        let better = match (&best, &found) {
            (Some(Ok(a)), Ok(b)) => b.value < a.value,
            (Some(Ok(_)), Err(_)) => false,
            _ => true,
        };
        if better {
            best = Some(found);
        }
    }
    best.unwrap_or_else(|| refuse("scene", "no start", "a scene with sensors"))
}

fn levels_of(bits: u32) -> Result<usize, Error> {
    if !(1..=MAX_BITS).contains(&bits) {
        return refuse("bits", bits, format!("1 to {MAX_BITS} bits"));
    }
    Ok(1 << bits)
}

/// The same quantizers with all sensors of one law in one group.
fn grouped(system: &System) -> Result<System, Error> {
    let scene = system.scene();
    let mut groups: Vec<(Quantizer, Channel, Vec<usize>)> = Vec::new();
    for group in system.groups() {
        let first = group.sensors()[0];
        match groups.iter_mut().find(|g| scene.interchangeable(g.2[0], first)) {
            Some(found) => found.2.extend(group.sensors()),
            None => groups.push((group.quantizer().clone(), group.channel().clone(), group.sensors().to_vec())),
        }
    }
    let groups = groups.into_iter().map(|(q, c, s)| SensorGroup::new(q, c, s));
    Ok(System::new(scene.clone(), groups.collect::<Result<_, _>>()?)?.with_outcome_limit(system.outcome_limit()))
}
