//! How normal the posterior of one bit is.

use super::common::{bad, not_empty};
use crate::legacy::claim::not_decreasing;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_core::{Gaussian, Sign};
use fewbits_dymbo::bit_update;
use fewbits_dymbo::skew_normal::{distance_from_normal, posterior_density};
use fewbits_numerics::normal::log_pdf_with;
use serde::{Deserialize, Serialize};

const ID: &str = "dymbo-prop1b";

/// Noise deviations, and that of the prior.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Parameters {
    sigma: Vec<f64>,
    sigma_theta: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            sigma: vec![1.0, 2.0, 4.0, 8.0, 16.0, 32.0],
            sigma_theta: 1.0,
        }
    }
}

pub(super) struct PosteriorShape;

impl Figure for PosteriorShape {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: ID,
            title: "The posterior of one bit is nearly normal",
            caption: "Largest difference between the exact posterior density after one bit, which is skew-normal, and the normal \
                      density of the same mean and variance. It falls with the cube of the noise (Proposition 1b, restated: E11). \
                      Right: both densities at the smallest noise, where they differ most.",
            source: "Ribeiro and Giannakis, Proposition 1(b)",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        not_empty(ID, "sigma", &p.sigma)?;
        for (name, value) in p
            .sigma
            .iter()
            .map(|s| ("sigma", *s))
            .chain([("sigma_theta", p.sigma_theta)])
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(bad(ID, name, value, "a finite number above 0"));
            }
        }
        Ok(())
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("sigma", "", "measurement noise deviation"),
            column("distance", "1/unit", "largest difference of the densities"),
            column("cubed", "", "distance times prior deviation times (sigma/prior deviation)^3"),
        ]);
        let prior = Gaussian::scalar(0.0, p.sigma_theta * p.sigma_theta)?;
        for &sigma in &p.sigma {
            let distance = distance_from_normal(prior.covariance()[0], sigma * sigma)?;
            let ratio = sigma / p.sigma_theta;
            table.push(row![sigma, distance, distance * p.sigma_theta * ratio.powi(3)])?;
        }
        let mut densities = Table::new([
            column("theta", "unit", "state"),
            column("exact", "1/unit", "posterior after a +1 at the prior mean"),
            column("normal", "1/unit", "normal density of the same moments"),
            column("prior", "1/unit", "density before"),
        ]);
        let noise = p.sigma.iter().copied().fold(f64::INFINITY, f64::min).powi(2);
        let (posterior, _) = bit_update(&prior, noise, Sign::Above, 0.0, 0.0)?;
        let pdf = |x: f64, belief: &Gaussian<1>| log_pdf_with(x, belief.mean()[0], belief.covariance()[0]).exp();
        for i in -150..=200 {
            let theta = p.sigma_theta * f64::from(i) / 50.0;
            let exact = posterior_density(theta, &prior, noise, Sign::Above);
            densities.push(row![theta, exact, pdf(theta, &posterior), pdf(theta, &prior)])?;
        }
        Ok(Tables::from(table).with("densities", densities))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let distances = tables.main.numbers("distance")?;
        let falls = "the posterior becomes normal as the noise grows";
        let mut claims = vec![Claim::never("converges", falls, not_decreasing(&distances)).at_defaults()];
        let expected = [
            1.637705785e-2,
            2.3852864e-3,
            3.090157e-4,
            3.896153e-5,
            4.880716e-6,
            6.104214e-7,
        ];
        for ((sigma, distance), value) in tables.main.points("sigma", "distance")?.into_iter().zip(expected) {
            let statement = format!("largest difference at sigma = {sigma}");
            claims.push(Claim::near(format!("distance-{sigma}"), statement, distance, value, 1e-9).at_defaults());
        }
        let last = distances.len() - 1;
        let ratio = if last > 0 {
            distances[last - 1] / distances[last]
        } else {
            f64::NAN
        };
        let statement = "twice the noise, an eighth of the difference";
        claims.push(Claim::near("cubic", statement, ratio, 8.0, 0.01).at_defaults());
        let constant = tables.main.numbers("cubed")?[last];
        claims.push(Claim::near("constant", "constant of the cubic law", constant, 0.0200, 5e-5).at_defaults());
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let law = |sigma: f64| (sigma, 0.02 / p.sigma_theta * (p.sigma_theta / sigma).powi(3));
        let x = Axis::log("measurement noise deviation sigma");
        let distance = Panel::new("Distance from normal", x, Axis::log("largest density difference"))
            .with(Layer::dashed("0.02 / sigma^3", p.sigma.iter().map(|s| law(*s)).collect()).coloured(1))
            .with(Layer::points("exact", tables.main.points("sigma", "distance")?).coloured(0));
        let rows = tables.named("densities")?;
        let title = "Densities at the smallest noise";
        let densities = Panel::new(title, Axis::linear("theta"), Axis::linear("density"))
            .with(Layer::dashed("prior", rows.points("theta", "prior")?).coloured(2))
            .with(Layer::line("exact posterior", rows.points("theta", "exact")?).coloured(0))
            .with(Layer::dashed("normal, same moments", rows.points("theta", "normal")?).coloured(1))
            .legend(Legend::TopLeft);
        Ok(Plot::grid(2, vec![distance, densities]))
    }
}
