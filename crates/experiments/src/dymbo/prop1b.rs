//! How normal the posterior of one bit is.

use crate::prelude::*;
use fewbits_baselines::dymbo::skew_normal::{distance_from_normal, posterior_density};
use fewbits_core::factor::{Factor, Levels};
use fewbits_numerics::normal::log_pdf_with;

parameters! {
    pub struct Parameters {
        sigma: Vec<f64> [1e-6..=1e6; 1..] = vec![1.0, 2.0, 4.0, 8.0, 16.0, 32.0] => "Measurement noise deviations.",
        sigma_theta: f64 [1e-6..=1e6] = 1.0 => "Prior deviation.",
    }
}

rows! {
    pub struct Rows {
        distances: Vec<Distance> => "Distance against noise.",
        densities: Vec<Density> => "Densities at the smallest noise.",
    }

    struct Distance by "{sigma}" {
        sigma: f64 => "Measurement noise deviation.",
        distance: f64 ["1/unit"] => "Largest difference of the densities.",
        cubed: f64 => "Distance times prior deviation times (sigma/prior deviation)^3.",
    }

    struct Density {
        theta: f64 ["unit"] as x("state") => "State.",
        exact: f64 ["1/unit"] as line("exact posterior") => "Posterior after a +1 at the prior mean.",
        normal: f64 ["1/unit"] as dashed("normal, same moments") => "Normal density of the same moments.",
        prior: f64 ["1/unit"] as dashed("prior") => "Density before.",
    }
}

pub struct PosteriorShape;

impl Figure for PosteriorShape {
    figure!(Parameters => Rows, "dymbo-prop1b", "The posterior of one bit is nearly normal", "Ribeiro and Giannakis, Proposition 1(b)",
        "Largest difference between the exact posterior density after one bit, which is skew-normal, and the normal \
         density of the same mean and variance. It falls with the cube of the noise (Proposition 1b, restated: erratum dymbo-11). \
         Right: both densities at the smallest noise, where they differ most.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let prior = Gaussian::scalar(0.0, p.sigma_theta * p.sigma_theta)?;
        let row = |sigma: &f64| {
            let distance = distance_from_normal(prior.covariance()[0], sigma * sigma)?;
            let cubed = distance * p.sigma_theta * (sigma / p.sigma_theta).powi(3);
            Ok(Distance {
                sigma: *sigma,
                distance,
                cubed,
            })
        };
        let noise = p.sigma.iter().copied().fold(f64::INFINITY, f64::min).powi(2);
        let after = Levels::sign(Sign::Above, 0.0, noise, &Link::PERFECT)?.tilted(&prior)?;
        let density = |i: i32| {
            let theta = p.sigma_theta * f64::from(i) / 50.0;
            Density {
                theta,
                exact: posterior_density(theta, &prior, noise, Sign::Above),
                normal: log_pdf_with(theta, after.mean[0], after.covariance[0]).exp(),
                prior: log_pdf_with(theta, 0.0, prior.covariance()[0]).exp(),
            }
        };
        Ok(Rows {
            distances: p.sigma.iter().map(row).collect::<Result<_, Error>>()?,
            densities: (-150..=200).map(density).collect(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let rows = &rows.distances;
        let what = "the posterior becomes normal as the noise grows";
        here.decreasing("converges", what, rows.iter().map(|r| r.distance));
        let ratio = rows.windows(2).last().map(|w| w[0].distance / w[1].distance);
        here.near("cubic", "twice the noise, an eighth of the difference (erratum dymbo-11)", ratio, 8.0, 0.01);
        let constant = rows.last().map(|r| r.cubed);
        here.near("constant", "constant of the cubic law", constant, 0.0200, 5e-5);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let law = |sigma: f64| (sigma, 0.02 / p.sigma_theta * (p.sigma_theta / sigma).powi(3));
        let x = "measurement noise deviation sigma";
        let distance = Panel::loglog("Distance from normal", x, "largest density difference")
            .with(Layer::dashed("0.02 / sigma^3", p.sigma.iter().map(|s| law(*s)).collect()).coloured(1))
            .with(Layer::points("exact", points(&rows.distances, |r| (r.sigma, r.distance))).coloured(0));
        let title = "Densities at the smallest noise";
        let densities = plotted(&rows.densities, title, &[("", "", &|title, x| Panel::linear(title, x, "density"))]);
        Plot::grid(2, [vec![distance], densities.panels].concat())
    }
}
