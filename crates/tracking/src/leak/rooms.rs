//! Rooms in which a substance escapes, and the sensors in them.

use crate::error::Error;
use crate::rows::instant::Qualifier;
use fewbits_diffusion::{
    Flow, FluxRule, LeakBelief, LeakPrior, Plan, PotentialFlow, Reading, SensorField, StepControl, Transport,
};
use fewbits_table::Side;
use serde::Deserialize;

/// Ages of a response: so many between the longest and this share of it, each larger than the one before by the same factor.
const AGES: usize = 20;
const SHORTEST: f64 = 0.005;
/// Largest number of cells times sensors: the belief of these takes 1 to 3 GiB.
const MOST_CELLS: usize = 200_000;
/// A sensor of values counts as so many of words: what its values share is kept for each hypothesis.
const OF_VALUES: usize = 4;

/// Rooms, air, sensors and what is known of a leak. Its stored form is the file of rooms of `fewbits leak`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rooms {
    /// The plan, drawn with letters: [`Plan`].
    pub plan: String,
    /// Side of a square of the plan in metres.
    pub square: f64,
    /// Number of cells along a side of a square.
    #[serde(default = "two")]
    pub split: usize,
    /// Height of the rooms in metres.
    pub height: f64,
    /// Of the substance, with the turbulence of the air, in m^2/s.
    pub diffusivity: f64,
    /// Air through the rooms in m^3/s.
    #[serde(default)]
    pub flow: f64,
    /// Of the substance, per second.
    #[serde(default)]
    pub decay: f64,
    /// Concentration without a leak.
    #[serde(default)]
    pub background: f64,
    /// Smallest and largest rate of the leak.
    pub rate: [f64; 2],
    /// Seconds after the first row between which it began. Default: as long before the first row as the readings last, to the last row.
    pub start: Option<[f64; 2]>,
    /// Standard deviation of the responses' error, as a share of them.
    #[serde(default = "tenth")]
    pub model_error: f64,
    /// Probability that a reading says nothing.
    #[serde(default = "thousandth")]
    pub faults: f64,
    /// The sensors.
    pub sensor: Vec<RoomSensor>,
}

/// A sensor in the rooms.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RoomSensor {
    /// Its name.
    pub name: String,
    /// Where it stands, in metres from the plan's first corner.
    pub place: [f64; 2],
    /// Standard deviation of its noise.
    pub noise: f64,
    /// Concentrations between which it reports words; none if it reports values.
    #[serde(default)]
    pub thresholds: Vec<f64>,
}

fn two() -> usize {
    2
}

fn tenth() -> f64 {
    0.1
}

fn thousandth() -> f64 {
    0.001
}

impl Rooms {
    /// The plan, if it and all numbers are as they should be.
    ///
    /// # Errors
    /// If the plan is none, two sensors have one name, or a number is out of its range.
    pub fn check(&self) -> Result<Plan, Error> {
        let rooms = self;
        let wrong = |problem: &dyn std::fmt::Display| Error::Rooms {
            problem: problem.to_string(),
        };
        let names: Vec<&str> = rooms.names().collect();
        if let Some(name) = names
            .iter()
            .find(|name| names.iter().filter(|other| other == name).count() > 1)
        {
            return Err(wrong(&format_args!("two sensors `{name}`: each needs a name of its own")));
        }
        let positive = [("square", rooms.square), ("height", rooms.height)];
        if let Some((name, value)) = positive.iter().find(|(_, value)| !(*value > 0.0 && value.is_finite())) {
            return Err(wrong(&format_args!("{name} = {value}: metres above 0 are expected")));
        }
        if !(rooms.flow >= 0.0 && rooms.background.is_finite()) {
            let problem = format!(
                "flow = {}, background = {}: m^3/s of 0 or more and a finite concentration are expected",
                rooms.flow, rooms.background
            );
            return Err(wrong(&problem));
        }
        for RoomSensor {
            name,
            noise,
            thresholds,
            ..
        } in &rooms.sensor
        {
            if !(*noise > 0.0 && noise.is_finite()) {
                let problem = format_args!("noise = {noise} of `{name}`: a deviation above 0 is expected");
                return Err(wrong(&problem));
            }
            let is_rising = thresholds.windows(2).all(|pair| pair[0] < pair[1]);
            if !(is_rising && thresholds.iter().all(|edge| edge.is_finite())) {
                let problem = format_args!("thresholds = {thresholds:?} of `{name}`: increasing numbers are expected");
                return Err(wrong(&problem));
            }
        }
        Plan::parse(&self.plan).map_err(|fault| wrong(&fault))
    }

    /// Names of the sensors.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.sensor.iter().map(|sensor| sensor.name.as_str())
    }

    /// Whether reports of a sensor are values.
    pub(crate) fn sends_values(&self, sensor: usize) -> bool {
        self.sensor[sensor].thresholds.is_empty()
    }

    /// The belief before readings whose times end at `last`, seconds after the first, and the area of each cell.
    pub(crate) fn belief(&self, plan: &Plan, last: f64) -> Result<(LeakBelief, Transport), Error> {
        let refused = |source: fewbits_diffusion::Error| Error::Refused {
            what: "the rooms are refused",
            source: source.into(),
        };
        let start = match self.start {
            Some(start) => start,
            None if last > 0.0 => [-last, last],
            None => {
                return Err(Error::Needed {
                    argument: "start",
                    reason: "the readings have one time only, which does not say when the leak may have begun",
                });
            }
        };
        if !start[0].is_finite() || start[0] >= last {
            let problem =
                format!("start = {start:?}: the first is expected before the last reading, {last} s after the first");
            return Err(Error::Rooms { problem });
        }
        let domain = plan.domain(self.square, self.split, 0.0).map_err(refused)?;
        let count = |sensor: &RoomSensor| if sensor.thresholds.is_empty() { OF_VALUES } else { 1 };
        let sensors: usize = self.sensor.iter().map(count).sum();
        if domain.free().len().saturating_mul(sensors) > MOST_CELLS {
            let problem = format!(
                "{} cells and {} sensors: the product may be {MOST_CELLS} at most, where a sensor of values counts as {OF_VALUES}; \
                 take larger squares or split = 1",
                domain.free().len(),
                self.sensor.len()
            );
            return Err(Error::Rooms { problem });
        }
        let wind = match self.flow {
            0.0 => Flow::still(&domain),
            flow => PotentialFlow::new(&domain, flow / self.height).map_err(refused)?.flow,
        };
        let transport =
            Transport::new(domain, self.diffusivity, &wind, self.decay, FluxRule::default()).map_err(refused)?;
        let points: Vec<[f64; 3]> = self
            .sensor
            .iter()
            .map(|sensor| [sensor.place[0], sensor.place[1], 0.0])
            .collect();
        let longest = last - start[0];
        let age = |i: usize| longest * SHORTEST.powf(1.0 - (i + 1) as f64 / AGES as f64);
        let ages: Vec<f64> = (0..AGES).map(age).collect();
        let field =
            SensorField::transient(&transport, &points, &ages, StepControl::Tolerance(1e-3)).map_err(refused)?;
        let prior = LeakPrior {
            start,
            rate: self.rate,
            model_error: self.model_error,
            faults: self.faults,
        };
        Ok((LeakBelief::new(field, &prior).map_err(refused)?, transport))
    }

    /// What a cell of the table says, and the deviation of its noise. The responses of a plane are amounts per area: a concentration times the
    /// height.
    pub(crate) fn reading(&self, sensor: usize, cell: f64, qualifier: Qualifier) -> Result<(Reading, f64), String> {
        let RoomSensor {
            name,
            noise,
            thresholds,
            ..
        } = &self.sensor[sensor];
        let amount = |concentration: f64| (concentration - self.background) * self.height;
        let reading = match (qualifier.limit, thresholds.as_slice()) {
            (Some(side), _) => Reading::Word {
                edges: vec![amount(cell)],
                word: usize::from(side == Side::Above),
            },
            (None, []) => Reading::Value(amount(cell)),
            (None, thresholds) => {
                let most = thresholds.len();
                if !(cell.fract() == 0.0 && (0.0..=most as f64).contains(&cell)) {
                    return Err(format!(
                        "{name} reports {cell}: a whole number from 0 to {most} is expected, as it has {most} thresholds"
                    ));
                }
                Reading::Word {
                    edges: thresholds.iter().map(|edge| amount(*edge)).collect(),
                    word: cell as usize,
                }
            }
        };
        Ok((reading, noise * self.height))
    }

    /// The plan as it is drawn, without the names of rooms, with a `*` in some squares, given by column and line of cells.
    pub(crate) fn drawn(&self, cells: impl Iterator<Item = [usize; 3]>) -> Vec<String> {
        let lines = self
            .plan
            .lines()
            .filter(|line| !line.trim().is_empty() && !line.contains('='));
        let indent = lines
            .clone()
            .map(|line| line.len() - line.trim_start().len())
            .min()
            .unwrap_or(0);
        let mut squares: Vec<Vec<char>> = lines.map(|line| line.chars().skip(indent).collect()).collect();
        for [column, line, _] in cells {
            squares[line / self.split][column / self.split] = '*';
        }
        squares.into_iter().map(String::from_iter).collect()
    }
}
