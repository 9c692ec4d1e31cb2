//! The building of `diffusive-rooms`, its air, and the sensors and readings of one placement.

use super::plan_belief::{Instrument, PlanBelief, Report, THRESHOLDS};
use crate::Error;
use fewbits_diffusion::{Domain, Flow, FluxRule, Plan, PotentialFlow, SensorField, Transport};
use fewbits_models::diffusion::{Air, Ground};
use fewbits_monte_carlo::Stream;
use nalgebra::Vector3;
use rand::RngExt;
use rand_distr::StandardNormal;

/// Three rooms and a corridor, 15 m by 10 m; a window at the right of the first line of rooms, a door to the left of the corridor.
const PLAN: &str = include_str!("rooms.plan");
/// Width of a square of the plan, and of a cell, m.
pub(super) const CELL: f64 = 0.25;
/// Nearer than this a source is found: two cells and a rounding.
pub(super) const NEAR: f64 = 2.0 * CELL + 1e-9;
/// Diffusivity, m^2/s.
const DIFFUSIVITY: f64 = 0.05;
/// Wind from door to window, m^2/s.
const WIND: f64 = 0.15;
/// Rates that the source may have, kg/s per metre of height.
pub(super) const RATES: [f64; 2] = [0.5, 1.5];
/// Rates that fit free space: its concentrations are of another size.
const FREE_RATES: [f64; 2] = [0.3, 30.0];

/// One way to report.
#[derive(Debug, Clone, Copy)]
pub(super) struct Case {
    pub(super) windy: bool,
    /// Standard deviation of the noise as a share of the typical concentration.
    pub(super) noise: f64,
    pub(super) report: Report,
    pub(super) readings: usize,
}

impl Case {
    /// Air, noise, report and number of readings in words.
    pub(super) fn name(&self) -> String {
        let air = if self.windy { "wind" } else { "still" };
        let report = match (self.report, self.readings) {
            (Report::Value, _) => "values",
            (Report::Word, 1) => "three bits",
            (Report::Word, _) => "three bits, five readings",
        };
        format!("{air}, {} %, {report}", 100.0 * self.noise)
    }
}

/// Air in the building, and the free space that an estimator without a plan assumes: the same mean wind, no walls.
pub(super) struct Building {
    pub(super) transport: Transport,
    pub(super) free: Air,
}

impl Building {
    pub(super) fn new(windy: bool) -> Result<Self, Error> {
        let domain = Plan::parse(PLAN)?.domain(CELL, 1, 0.0)?;
        let flow = match windy {
            true => PotentialFlow::new(&domain, WIND)?.flow,
            false => Flow::still(&domain),
        };
        let velocities: Vec<Vector3<f64>> = flow.velocities(&domain).into_iter().map(Vector3::from).collect();
        let mean = velocities.iter().sum::<Vector3<f64>>() / velocities.len() as f64;
        let transport = Transport::new(domain, DIFFUSIVITY, &flow, 0.0, FluxRule::default())?;
        let free = Air::new(DIFFUSIVITY, mean, Ground::None)?.with_closest(0.5 * CELL)?;
        Ok(Self { transport, free })
    }

    pub(super) fn domain(&self) -> &Domain {
        self.transport.domain()
    }

    pub(super) fn centre(&self, number: usize) -> [f64; 3] {
        self.domain().grid().centre(self.domain().free()[number])
    }
}

/// Sensors, a source, and the readings.
pub(super) struct Placement<'a> {
    building: &'a Building,
    report: Report,
    pub(super) sensors: Vec<usize>,
    pub(super) source: usize,
    /// Responses of each sensor to a source in each cell: of the building, and of free space.
    pub(super) responses: [Vec<Vec<f64>>; 2],
    /// Concentrations with noise, of each sensor several.
    pub(super) readings: Vec<Vec<f64>>,
    pub(super) instrument: Instrument,
}

impl<'a> Placement<'a> {
    pub(super) fn draw(
        building: &'a Building,
        case: &Case,
        count: usize,
        source: Option<usize>,
        stream: Stream,
    ) -> Result<Self, Error> {
        let cells = building.domain().free().len();
        let mut rng = stream.named("places").rng();
        let source = source.unwrap_or_else(|| rng.random_range(0..cells));
        let mut sensors = Vec::with_capacity(count);
        while sensors.len() < count {
            let cell = rng.random_range(0..cells);
            if !sensors.contains(&cell) {
                sensors.push(cell);
            }
        }
        let points: Vec<[f64; 3]> = sensors.iter().map(|cell| building.centre(*cell)).collect();
        let field = SensorField::steady(&building.transport, &points)?;
        let indoors = (0..count).filter_map(|sensor| field.response(sensor, 0).map(<[f64]>::to_vec));
        let indoors: Vec<Vec<f64>> = indoors.collect();
        let centres: Vec<Vector3<f64>> = (0..cells).map(|cell| building.centre(cell).into()).collect();
        let free = |point: &[f64; 3]| -> Vec<f64> {
            let concentration = |cell| building.free.concentration(&Vector3::from(*point), cell, 1e9);
            centres.iter().map(concentration).collect()
        };
        let free = points.iter().map(free).collect();
        // The typical concentration and the thresholds: quantiles over all sensors and places of the source at rate one.
        let mut all: Vec<f64> = indoors.concat();
        all.sort_by(f64::total_cmp);
        let quantile = |share: f64| all[((all.len() - 1) as f64 * share) as usize];
        let thresholds = std::array::from_fn(|k| quantile((k + 1) as f64 / (THRESHOLDS + 1) as f64));
        let instrument = Instrument::new(case.noise * quantile(0.5), thresholds, RATES[1] * quantile(1.0));
        let mut noise = stream.named("noise").rng();
        let rate = rng.random_range(RATES[0]..RATES[1]);
        let mut read = |clean: f64| -> Vec<f64> {
            let one = |_| clean + instrument.noise * noise.sample::<f64, _>(StandardNormal);
            (0..case.readings).map(one).collect()
        };
        let readings = indoors.iter().map(|row| read(rate * row[source])).collect();
        Ok(Self {
            building,
            report: case.report,
            sensors,
            source,
            responses: [indoors, free],
            readings,
            instrument,
        })
    }

    /// The belief after the first `count` sensors, in the building (0) or in free space (1).
    pub(super) fn belief(&self, model: usize, count: usize) -> Result<PlanBelief, Error> {
        let sensed = (&self.responses[model][..count], &self.readings[..count]);
        Ok(PlanBelief::new(&self.instrument, self.report, [RATES, FREE_RATES][model], sensed)?)
    }

    /// Distance of the most probable cell from the source.
    pub(super) fn error(&self, belief: &PlanBelief) -> f64 {
        let [a, b] = [self.source, belief.mode].map(|cell| self.building.centre(cell));
        (a[0] - b[0]).hypot(a[1] - b[1])
    }
}
