//! The area above a threshold, with credible bands.

use super::common::{ALARM, B, CHAINS, DIFFUSIVITY, RATE, Scheme, Settings, fraction, median};
use crate::prelude::*;
use fewbits_diffusive::{Envelope as Area, SourceLikelihood};
use fewbits_models::diffusion::contour_radius;
use fewbits_numerics::ArgumentError;

parameters! {
    pub struct Parameters {
        trials: u64 [1..=100_000] = 200 => quick 8 => "Random deployments.",
        nodes: usize [1..=20] = 3 => "Nodes that have sampled.",
        time: f64 [1.0..=1e5] = 100.0 => "Time of the envelope after the release began, s.",
        threshold: f64 [1e-8..=1.0] = 1e-4 => "Threshold of the concentration, kg/m^3.",
    }
    cost |p| Cost::new(p.trials as f64 * 0.1, 1e6);
}

rows! {
    pub struct Rows {
        band: Vec<Band> => "The band of the first deployment, direction by direction, seen from the alarm node.",
        coverage: Vec<Coverage> => "How often the band holds the truth.",
        exceedance: Vec<Exceedance> => "Probability that the threshold is exceeded, on a grid, first deployment.",
    }

    struct Band {
        t: f64 ["s"] => "Time.",
        c_star: f64 ["kg/m^3"] => "Threshold.",
        direction_deg: f64 ["deg"] => "Direction from the alarm node.",
        r05: f64 ["m"] => "How far the area reaches: 5 per cent quantile.",
        r50: f64 ["m"] => "Median.",
        r95: f64 ["m"] => "95 per cent quantile.",
        truth: f64 ["m"] => "The truth.",
    }

    struct Coverage by "{edge}" {
        edge: &'static str => "Which edge.",
        coverage: Measured => "Share of the deployments whose 90 per cent band holds the true edge.",
        width_median: Measured ["m"] => "Median width of the band.",
        radius: f64 ["m"] => "True radius about the source.",
    }

    struct Exceedance {
        x: f64 ["m"] => "Place.",
        y: f64 ["m"] => "Place.",
        p_exceed: f64 => "Probability that the concentration exceeds the threshold.",
    }
}

pub struct Envelope;

impl Parameters {
    fn area(&self, stream: Stream) -> Result<Option<Area>, Error> {
        let settings = Settings::default();
        let outcome = Scheme::exact(self.nodes).run(&settings, stream)?;
        let Some(posterior) = outcome.posterior else {
            return Ok(None);
        };
        let likelihood = SourceLikelihood::new(outcome.records, settings.joint()?)?;
        Ok(Area::new(&posterior, &likelihood).map(Some)?)
    }

    /// A quantile of the reach. On the ground the threshold is exceeded next to the source, so that there is one.
    fn reach(&self, area: &Area, origin: &Vector2<f64>, angle: f64, level: f64) -> Result<f64, Error> {
        let reach = area.reach(origin, angle, self.time, self.threshold, level)?;
        let expected = "a threshold that is exceeded somewhere";
        reach.ok_or_else(|| Error::failed(ArgumentError::new("threshold", self.threshold, expected)))
    }
}

const GRID: usize = 50;

impl Figure for Envelope {
    figure!(Parameters => Rows, "diffusive-envelope", "The area above a threshold", "",
        "Where the concentration on the ground exceeds 1e-4 kg/m^3 after 100 s, as a belief of three nodes sees it \
         (example B, rate unknown): probability of exceedance, and how often the 90 per cent band of the eastern \
         edge holds the true edge.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let radius = contour_radius(RATE, p.threshold, p.time, DIFFUSIVITY)?;
        let source = B.source();
        let edges = [("east", 0.0), ("north", 90.0_f64)];
        let all = context.trials(context.stream(CHAINS), p.trials, |trial| {
            let Some(area) = p.area(trial.stream)? else {
                return Ok(None);
            };
            let quantile = |angle: f64, level| p.reach(&area, &Vector2::zeros(), angle.to_radians(), level);
            let bands = edges.map(|(_, angle)| Ok((quantile(angle, 0.05)?, quantile(angle, 0.95)?)));
            let bands = bands.into_iter().collect::<Result<Vec<_>, Error>>()?;
            Ok(Some(bands))
        })?;
        let known: Vec<&Vec<(f64, f64)>> = all.iter().flatten().collect();
        let coverage = edges.iter().enumerate().filter_map(|(i, (edge, angle))| {
            let truth = radius + source.x * angle.to_radians().cos() + source.y * angle.to_radians().sin();
            let hits = select(&known, |bands| (bands[i].0..=bands[i].1).contains(&truth)).count();
            let widths = known.iter().map(|bands| bands[i].1 - bands[i].0);
            Some(Coverage {
                edge,
                coverage: fraction(hits, known.len()),
                width_median: median(widths)?,
                radius,
            })
        });
        let coverage = coverage.collect();
        let first = p.area(context.stream(CHAINS).indexed(0))?;
        let (mut band, mut exceedance) = (Vec::new(), Vec::new());
        if let Some(area) = first {
            let origin = Vector2::from(ALARM);
            for direction in (0..360).step_by(15) {
                context.check()?;
                let angle = f64::from(direction).to_radians();
                let at = |level| p.reach(&area, &origin, angle, level);
                band.push(Band {
                    t: p.time,
                    c_star: p.threshold,
                    direction_deg: f64::from(direction),
                    r05: at(0.05)?,
                    r50: at(0.5)?,
                    r95: at(0.95)?,
                    truth: radius + (source - origin).dot(&Vector2::new(angle.cos(), angle.sin())),
                });
            }
            let cell = |i: usize| {
                let place = Vector2::new((i % GRID) as f64 + 0.5, (i / GRID) as f64 + 0.5) * (100.0 / GRID as f64);
                let p_exceed = area.exceedance(&place, p.time, p.threshold)?;
                let [x, y] = place.into();
                Ok(Exceedance { x, y, p_exceed })
            };
            exceedance = (0..GRID * GRID).map(cell).collect::<Result<_, Error>>()?;
        }
        Ok(Rows {
            band,
            coverage,
            exceedance,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let full = claims.at_full_trials();
        claims.all("ordered", "quantiles are ordered", &rows.band, |b| b.r05 <= b.r50 && b.r50 <= b.r95);
        claims.all("probabilities", "exceedances are probabilities", &rows.exceedance, |e| {
            (0.0..=1.0 + 1e-9).contains(&e.p_exceed)
        });
        for c in &rows.coverage {
            let what = format!("nine bands in ten hold the true edge: {}", c.edge);
            full.within(format!("calibrated/{}", c.edge), what, c.coverage, 0.9, 4.0);
        }
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let at = |i: usize| (i as f64 + 0.5) * (100.0 / GRID as f64);
        let centres: Vec<f64> = (0..GRID).map(at).collect();
        let values = rows.exceedance.iter().map(|e| e.p_exceed);
        let radius = rows.coverage.first().map_or(0.0, |c| c.radius);
        let circle = (0..=72).map(|i| {
            let angle = f64::from(i * 5).to_radians();
            (B.source[0] + radius * angle.cos(), B.source[1] + radius * angle.sin())
        });
        let map = Panel::new(
            "Probability of exceedance",
            Axis::linear("x / m").between(0.0, 100.0),
            Axis::linear("y / m").between(0.0, 100.0),
        )
        .with(Layer::heat("P(c > threshold)", centres.clone(), centres, values))
        .with(Layer::dashed("true edge", circle.collect()).coloured(3));
        let of = |f: fn(&Band) -> f64| rows.band.iter().map(|b| (b.direction_deg, f(b))).collect::<Vec<_>>();
        let limits = rows.band.iter().map(|b| (b.direction_deg, b.r05, b.r95)).collect();
        let band =
            Panel::linear(format!("Reach from the alarm node after {} s", p.time), "direction / deg", "reach / m")
                .with(Layer::band("90 % band", limits).coloured(0))
                .with(Layer::line("median", of(|b| b.r50)).coloured(0))
                .with(Layer::dashed("truth", of(|b| b.truth)).coloured(3));
        Plot::grid(2, vec![map, band])
    }
}
