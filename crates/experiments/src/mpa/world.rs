//! The canonical scenario, and every tracker on it.

use crate::prelude::*;
use fewbits_baselines::pf_mpa::{DynamicsWeight, KernelRule, MessagePassing, Ring, RingWeight};
use fewbits_baselines::pf_mpa::{
    Encoder, GuidedGaussian, IntervalRule, Linearised, Network, POSITION, Ranged, RaoBlackwellGuided, Reports, Target,
    Tracker, Velocity, WithManoeuvre,
};
use fewbits_filters::{BootstrapFilter, ResamplingRule};
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise, RangeSensor};

/// Steps of a trajectory.
pub(super) const STEPS: usize = 25;
/// Sensors of every layout.
pub(super) const SENSORS: usize = 5;
/// A trajectory with a larger mean squared error is lost.
pub(super) const LOST: f64 = 4.0;
/// Side of the field.
const SIDE: f64 = 20.0;

/// The canonical sensors.
pub(super) fn canonical() -> Vec<Vector2<f64>> {
    [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]]
        .map(Vector2::from)
        .to_vec()
}

/// Four further layouts, drawn once uniformly over the field by the program that made the references.
pub(super) fn layouts() -> Result<[Vec<Vector2<f64>>; 4], Error> {
    let mut layouts = [const { Vec::new() }; 4];
    let mut table = csv::Reader::from_reader(include_str!("../../references/mpa_layouts.csv").as_bytes());
    for row in table.deserialize() {
        let (layout, x, y): (usize, f64, f64) = row.map_err(Error::failed)?;
        layouts[layout].push(Vector2::new(x, y));
    }
    Ok(layouts)
}

pub(super) fn prior() -> Result<Gaussian<4>, Error> {
    let covariance = Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01));
    Ok(Gaussian::new(Vector4::new(13.0, 17.0, 0.0, -0.6), covariance)?)
}

/// Where trajectories may go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Field {
    /// Only those that stay in the field count.
    Confined,
    /// Anywhere.
    Free,
}

/// The world of one trial: a track and a standard normal for every sensor and step. The same for all methods and ratios.
pub(super) struct World {
    pub(super) track: Vec<Vector4<f64>>,
    normals: Vec<[f64; SENSORS]>,
}

impl World {
    pub(super) fn draw(stream: Stream, target: &Target, field: Field) -> Result<Self, Error> {
        let mut rng = stream.named("truth").rng();
        let prior = prior()?;
        let inside = |x: &Vector4<f64>| (0.0..=SIDE).contains(&x[0]) && (0.0..=SIDE).contains(&x[1]);
        let track = loop {
            let start = prior.sample(&mut rng);
            let track = target.simulate(&mut rng, &start, STEPS);
            if field == Field::Free || track.iter().all(inside) {
                break track;
            }
        };
        let mut noise = stream.named("noise").rng();
        let step = |_| std::array::from_fn(|_| noise.sample(StandardNormal));
        let normals = (0..STEPS).map(step).collect();
        Ok(Self { track, normals })
    }

    /// Mean squared position error.
    pub(super) fn mse(&self, estimates: &[Gaussian<4>]) -> f64 {
        let error = |(e, x): (&Gaussian<4>, &Vector4<f64>)| {
            let (dx, dy) = (e.mean()[0] - x[0], e.mean()[1] - x[1]);
            (dx * dx + dy * dy).min(1e12)
        };
        estimates.iter().zip(&self.track).map(error).sum::<f64>() / self.track.len() as f64
    }

    /// What the sensors measure at step `k`.
    pub(super) fn ranges(&self, network: &Network, k: usize) -> Vec<f64> {
        let (x, y) = (self.track[k][0], self.track[k][1]);
        let sensors = network.sensors().iter().zip(&self.normals[k]);
        let measure = |(s, normal): (&RangeSensor, &f64)| {
            let d = s.distance(x, y);
            d + s.noise().deviation(d) * normal
        };
        sensors.map(measure).collect()
    }
}

/// A tracker by its name.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Method {
    Linear(Linearised, Reports),
    Grid(usize),
    Guided(usize),
    Bootstrap(usize, Reports),
    RaoBlackwell(usize),
    Messages(MessagePassing),
}

/// What one trajectory gave: the estimate after every step.
pub(super) type Estimates = Vec<Gaussian<4>>;

impl Method {
    pub(super) const EKF_U: Self = Self::Linear(Linearised::EKF, Reports::Ranges);
    pub(super) const EKF_NAIVE: Self = Self::Linear(Linearised::EKF_NAIVE, Reports::Levels);
    pub(super) const EKF: Self = Self::Linear(Linearised::EKF, Reports::Levels);
    pub(super) const GMPA: Self = Self::Linear(Linearised::MESSAGE_PASSING, Reports::Levels);
    pub(super) const TRANSFER: Self = Self::Linear(Linearised::MESSAGE_PASSING_TRANSFER, Reports::Levels);

    pub(super) fn improved(n: usize) -> Result<Self, Error> {
        Ok(Self::Messages(MessagePassing::improved(n)?))
    }

    pub(super) fn published(n: usize) -> Result<Self, Error> {
        Ok(Self::Messages(MessagePassing::published(n)?))
    }

    /// Full rings and transferred velocities, but narrow kernels and equal weights.
    pub(super) fn narrow(n: usize) -> Result<Self, Error> {
        Ok(Self::Messages(MessagePassing {
            ring_weight: RingWeight::Uniform,
            dynamics_weight: DynamicsWeight::Uniform,
            kernel: KernelRule::Narrow,
            ..MessagePassing::published(n)?
        }))
    }

    /// Its kind.
    pub(super) fn family(&self) -> &'static str {
        match *self {
            Self::Linear(_, Reports::Ranges) => "EKF-U",
            Self::Linear(Linearised::EKF_NAIVE, _) => "EKF-Q-naive",
            Self::Linear(Linearised::EKF, _) => "EKF-Q",
            Self::Linear(l, _) if l.velocity == Velocity::Transfer => "GMPA-transfer",
            Self::Linear(..) => "GMPA",
            Self::Grid(_) => "grid",
            Self::Guided(_) => "guided",
            Self::Bootstrap(_, Reports::Levels) => "bootstrap",
            Self::Bootstrap(_, Reports::Ranges) => "unquantized",
            Self::RaoBlackwell(_) => "rao-blackwell",
            Self::Messages(m) if m.ring == Ring::Local => "improved",
            Self::Messages(m) if m.kernel == KernelRule::Narrow => "narrow",
            Self::Messages(_) => "published",
        }
    }

    /// Particles, draws or nodes an axis.
    pub(super) fn size(&self) -> Option<usize> {
        match self {
            Self::Linear(..) => None,
            Self::Grid(n) | Self::Guided(n) | Self::Bootstrap(n, _) | Self::RaoBlackwell(n) => Some(*n),
            Self::Messages(m) => Some(m.particles),
        }
    }

    /// The name in tables and keys: the family and the size.
    pub(super) fn name(&self) -> String {
        let family = self.family();
        self.size().map_or(family.to_owned(), |size| format!("{family}-{size}"))
    }

    pub(super) fn run(
        &self,
        world: &World,
        network: &Network,
        target: &Target,
        stream: Stream,
    ) -> Result<Estimates, Error> {
        let mut rng = stream.named(&self.name()).fast_rng();
        let under = |reports: Reports| (world, network, target, reports);
        let all = under(Reports::Levels);
        match self {
            Self::Linear(l, reports) => track(l, under(*reports), &mut rng),
            Self::Grid(n) => track(&GridFilter::new(POSITION)?.with_nodes(*n)?, all, &mut rng),
            Self::Guided(n) => track(&GuidedGaussian::new(*n)?, all, &mut rng),
            Self::RaoBlackwell(n) => track(&RaoBlackwellGuided::new(*n)?, all, &mut rng),
            Self::Messages(m) => track(m, all, &mut rng),
            Self::Bootstrap(n, reports) => {
                let cloud = WithManoeuvre::cloud(&mut rng, &prior()?, *n)?;
                let mut filter = BootstrapFilter::new(ResamplingRule::default(), *n)?;
                // A range of a state that holds the manoeuvre, too.
                let in_state = |r: &Ranged| Ok(Observed::new(r.sensing.on_axes::<6>(POSITION)?, r.factor.clone()));
                follow(under(*reports), cloud, WithManoeuvre::estimate, |k, cloud, observed| {
                    let observed = observed.iter().map(in_state);
                    let observed = observed.collect::<Result<Vec<_>, fewbits_pf_mpa::Error>>()?;
                    let motion = WithManoeuvre::at(*target, k);
                    filter.step_in_place(&mut rng, &motion, cloud, &[&observed])?;
                    Ok(())
                })
            }
        }
    }
}

/// One trajectory of a tracker.
fn track<T: Tracker>(
    tracker: &T,
    all: (&World, &Network, &Target, Reports),
    rng: &mut impl Rng,
) -> Result<Estimates, Error> {
    let belief = tracker.start(rng, all.2, &prior()?)?;
    let mut workspace = T::Workspace::default();
    let estimate = |belief: &T::Belief| tracker.estimate(belief);
    follow(all, belief, estimate, |k, belief, observed| {
        tracker.step_in_place(rng, all.2, k, belief, observed, &mut workspace)?;
        Ok(())
    })
}

/// One trajectory. Where a step fails (a lost cloud in a region of probability zero, points without spread), the belief stays.
fn follow<B>(
    (world, network, target, reports): (&World, &Network, &Target, Reports),
    mut belief: B,
    estimate: impl Fn(&B) -> Gaussian<4>,
    mut step: impl FnMut(usize, &mut B, &[Ranged]) -> Result<(), fewbits_pf_mpa::Error>,
) -> Result<Estimates, Error> {
    let mut estimates = Vec::with_capacity(STEPS);
    for k in 0..world.track.len() {
        let ranges = world.ranges(network, k);
        let observed = network.observe(target, k, &estimate(&belief), &ranges, reports);
        let _ = observed.and_then(|o| step(k, &mut belief, &o));
        estimates.push(estimate(&belief));
    }
    Ok(estimates)
}

/// The speed of the canonical scenario.
pub(super) const SPEED: f64 = 3.0;

/// Where a comparison is held.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Point {
    /// What tables call it.
    pub(super) name: String,
    pub(super) snr_db: f64,
    pub(super) levels: usize,
    pub(super) encoder: Encoder,
    pub(super) sensors: Vec<Vector2<f64>>,
    pub(super) interval: IntervalRule,
}

impl Point {
    /// The canonical sensors and the published encoder of the canonical speed, named after noise and levels.
    pub(super) fn published(snr_db: f64, levels: usize) -> Result<Self, Error> {
        Ok(Self {
            name: format!("{snr_db}dB-L{levels}"),
            snr_db,
            levels,
            encoder: Encoder::published(SPEED)?,
            sensors: canonical(),
            interval: IntervalRule::Correct,
        })
    }

    pub(super) fn network(&self) -> Result<Network, Error> {
        let noise = RangeNoise::from_snr_db(self.snr_db)?;
        let scheme = QuantizedRange::new(self.levels, noise)?;
        Ok(Network::new(&self.sensors, scheme, self.encoder)?.with_interval(self.interval))
    }
}

rows! {
    /// What a method did on many trajectories.
    #[derive(Clone)]
    pub(super) struct Score {
        pub(super) mse: Measured as points("mean") => "Mean squared position error, averaged over trajectories.",
        pub(super) median: Measured as points("median") => "Median over trajectories of their mean squared error.",
        pub(super) lost: f64 => "Share of trajectories with a mean squared error above 4.",
        pub(super) trajectories: u64 => "Trajectories.",
    }
}

impl Score {
    /// From each trajectory's error.
    pub(super) fn of(mut errors: Vec<f64>) -> Self {
        let mse = errors.iter().copied().collect();
        errors.sort_by(f64::total_cmp);
        let n = errors.len() as f64;
        // Ranks beyond an end count as that end.
        let last = errors.len().saturating_sub(1);
        let at = |rank: f64| errors.get((rank as usize).min(last)).copied().unwrap_or(f64::NAN);
        // Ranks: half the trajectories are below the median, give or take sqrt(n) / 2.
        let (middle, give) = (0.5 * n - 0.5, 0.5 * n.sqrt());
        let error = 0.5 * (at((middle + give).ceil()) - at((middle - give).floor()));
        Self {
            mse,
            median: Measured::new(0.5 * (at(middle.floor()) + at(middle.ceil())), (n > 1.0).then_some(error)),
            lost: errors.iter().filter(|e| **e > LOST).count() as f64 / n,
            trajectories: errors.len() as u64,
        }
    }
}
