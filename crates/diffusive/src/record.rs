//! What one node sampled, tabulated for quick likelihoods.

use crate::rate::{Intervals, RateRange, RateSums, log_sample_marginal, log_sample_uncut};
use crate::{Error, SourceSensor};
use fewbits_models::diffusion::{ImpulseResponse, Profile};
use fewbits_numerics::error::positive;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::Vector2;

/// More panels than this are not tabulated.
const MOST_PANELS: f64 = 2000.0;

/// The samples of one node, bias removed, with what is needed to say how likely they are for each position of the source.
///
/// Nothing changes along the ground, so the responses depend on the horizontal distance alone, times
/// `exp((v . d - V rho) / 2 kappa)` with wind. The sums over the instants are tabulated over the distance once: every look-up
/// costs two polynomials however many samples there are.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    sensor: SourceSensor,
    node: Vector2<f64>,
    samples: Vec<f64>,
    noise: f64,
    energy: f64,
    log_noise: f64,
    /// `rho^2 sum f_j^2 / sigma^2` and `rho sum f_j y_j / sigma^2` straight downwind.
    table: Option<Profile<2>>,
    /// Largest `|y|` (at least the noise), and largest `|y| 2 / (4 kappa t)`, both over the noise: how fast the response changes.
    steepness: [f64; 2],
    /// Wind speed over diffusivity, 1/m.
    drift: f64,
}

impl Record {
    pub(crate) fn new(
        sensor: &SourceSensor,
        node: &Vector2<f64>,
        samples: Vec<f64>,
        noise: f64,
    ) -> Result<Self, Error> {
        positive("noise", noise)?;
        let mut steepness = [0.0_f64; 2];
        for (y, t) in samples.iter().zip(sensor.instants()) {
            let size = y.abs().max(noise) / noise;
            let age = t - sensor.start();
            if age > 0.0 {
                steepness[0] = steepness[0].max(size);
                steepness[1] = steepness[1].max(size * 2.0 / (4.0 * sensor.air().diffusivity() * age));
            }
        }
        let mut record = Self {
            sensor: sensor.clone(),
            node: *node,
            energy: samples.iter().map(|y| (y / noise) * (y / noise)).sum(),
            log_noise: samples.len() as f64 * (noise.ln() + LN_SQRT_2PI),
            samples,
            noise,
            table: None,
            steepness,
            drift: sensor.air().wind().norm() / sensor.air().diffusivity(),
        };
        record.table = record.tabulate()?;
        Ok(record)
    }

    fn tabulate(&self) -> Result<Option<Profile<2>>, Error> {
        let drop = self.sensor.drop();
        let width = 0.25 * self.sensor.shortest_length();
        let width = if drop > 0.0 { width.min(0.5 * drop) } else { width };
        if self.sensor.reach() / width > MOST_PANELS {
            return Ok(None);
        }
        let wind = self.sensor.air().wind();
        let speed = wind.xy().norm();
        let downwind = if speed > 0.0 { wind.xy() / speed } else { Vector2::x() };
        let profile = Profile::new(self.sensor.reach(), width, |distance| {
            let rho = distance.max(self.sensor.air().closest());
            let (mut a, mut b) = (0.0, 0.0);
            for (j, y) in self.samples.iter().enumerate() {
                let f = rho * self.sensor.response(j, &(downwind * rho)) / self.noise;
                a += f * f;
                b += f * y / self.noise;
            }
            [a, b]
        })?;
        Ok(Some(profile))
    }

    /// Where the node stands, m.
    pub fn node(&self) -> &Vector2<f64> {
        &self.node
    }

    /// Samples without bias, kg/m^3.
    pub fn samples(&self) -> &[f64] {
        &self.samples
    }

    /// Standard deviation of their noise, kg/m^3.
    pub fn noise(&self) -> f64 {
        self.noise
    }

    /// The sensor that sampled.
    pub fn sensor(&self) -> &SourceSensor {
        &self.sensor
    }

    /// The sums that say how likely the samples are with the source at `position`.
    #[inline]
    pub fn sums(&self, position: &Vector2<f64>) -> RateSums {
        let [response, correlation] = self.response_sums(&(self.node - position));
        RateSums {
            response,
            correlation,
            energy: self.energy,
            log_noise: self.log_noise,
        }
    }

    #[inline]
    fn response_sums(&self, offset: &Vector2<f64>) -> [f64; 2] {
        let rho = offset.norm().max(self.sensor.air().closest());
        match &self.table {
            Some(table) if rho <= table.end() => {
                let [a, b] = table.at(rho);
                let wind = self.sensor.air().wind();
                let inverse = rho.recip();
                if wind.x == 0.0 && wind.y == 0.0 {
                    return [a.max(0.0) * inverse * inverse, b * inverse];
                }
                let speed = wind.x.hypot(wind.y);
                let lag = (wind.x * offset.x + wind.y * offset.y - speed * offset.norm())
                    / (2.0 * self.sensor.air().diffusivity());
                let scale = lag.exp() * inverse;
                [a.max(0.0) * scale * scale, b * scale]
            }
            _ => {
                let (mut a, mut b) = (0.0, 0.0);
                for (j, y) in self.samples.iter().enumerate() {
                    let f = self.sensor.response(j, offset) / self.noise;
                    a += f * f;
                    b += f * y / self.noise;
                }
                [a, b]
            }
        }
    }

    /// The sums, and by which share the information of the samples is discounted over a cell of the given half width: the noise
    /// variance is raised by the square of the change of the response across the cell.
    #[inline]
    pub(crate) fn blurred_sums(&self, position: &Vector2<f64>, half_width: f64) -> (RateSums, f64) {
        let air = self.sensor.air();
        let offset = self.node - position;
        let drop = self.sensor.drop();
        let rho = (offset.norm_squared() + drop * drop).sqrt();
        let near = (rho - 1.4 * half_width).max(0.6 * half_width).max(air.closest());
        let change = half_width * (self.steepness[0] * (near.recip() + self.drift) + self.steepness[1] * rho);
        let [response, correlation] = self.response_sums(&offset);
        let sums = RateSums {
            response,
            correlation,
            energy: self.energy,
            log_noise: self.log_noise,
        };
        (sums, (1.0 + change * change).recip())
    }

    /// The log likelihood with a new rate for every sample.
    pub(crate) fn log_sample_wise(&self, position: &Vector2<f64>, range: &RateRange) -> f64 {
        let offset = self.node - position;
        let terms = self
            .samples
            .iter()
            .enumerate()
            .map(|(j, y)| log_sample_marginal(*y, self.sensor.response(j, &offset), self.noise, range));
        terms.sum()
    }

    /// Adds the same to the numbers at `place` of two lists, to the second with the noise variance raised by `1 / share` but not
    /// its normalisation; the intervals are noted for later.
    pub(crate) fn add_sample_wise(
        &self,
        position: &Vector2<f64>,
        range: &RateRange,
        share: f64,
        place: usize,
        [plain, blurred]: [(&mut f64, &mut Intervals); 2],
    ) {
        let offset = self.node - position;
        let wider = self.noise / share.sqrt();
        for (j, y) in self.samples.iter().enumerate() {
            let response = self.sensor.response(j, &offset);
            let (log, cut) = log_sample_uncut(*y, response, self.noise, range);
            *plain.0 += log;
            plain.1.push(place, cut);
            let (log, cut) = log_sample_uncut(*y, response, wider, range);
            *blurred.0 += log - 0.5 * share.ln();
            blurred.1.push(place, cut);
        }
    }
}
