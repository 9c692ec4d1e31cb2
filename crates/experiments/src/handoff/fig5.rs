//! Figure 5: beliefs along the way, and what would travel.

use super::filters::{PARTICLES, SENSORS, STEPS, Smoothing, Truth, VARIANCE, posteriors, single, uncompressed};
use super::world::World;
use crate::prelude::*;
use fewbits_densities::{KernelEstimate, ellipse};
use fewbits_mixture_codec::Reduction;

parameters! {
    pub struct Parameters {
        time: Vec<usize> [1..=10; 1..=3] = vec![2, 5, 8] => "Times shown.",
        components: usize [1..=60] = 5 => "Components of the mixture that would be sent.",
        trials: u64 [2..=10_000] = 20 => "Worlds for the mean distance from a Gaussian.",
    }
}

rows! {
    pub struct Rows {
        particles: Vec<Particle> => "The particles of one world.",
        ellipses: Vec<Outline> => "The components that would be sent: ellipses of half the mass.",
        gaussian: Vec<Distance> => "How far from Gaussian the beliefs are, over all worlds.",
    }

    struct Particle {
        t: usize => "Time.",
        i: usize => "Number.",
        x: f64 ["r0"] => "Position.",
        y: f64 ["r0"] => "Position.",
        weight: f64 => "Weight.",
    }

    struct Outline {
        t: usize => "Time.",
        component: usize => "Component.",
        x: f64 ["r0"] => "Point of the outline.",
        y: f64 ["r0"] => "Point of the outline.",
    }

    struct Distance {
        kl: Measured ["nat"] => "KL from the estimate to the Gaussian of its moments.",
    }
}

pub struct Fig5;

impl Figure for Fig5 {
    figure!(Parameters => Rows, "handoff-fig5", "Beliefs along the way", "compressed particle filter, Section 6, Figure 5",
        "Particles of an uncompressed filter in the world of Figure 4, and the half-mass ellipses of the five Gaussians \
         that would travel. The beliefs are bent and far from Gaussian.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let stream = context.stream("handoff-fig4");
        let world = World::draw(&mut stream.rng(), SENSORS, STEPS, VARIANCE)?;
        let filter = Smoothing::Silverman.filter(PARTICLES)?;
        let clouds = uncompressed(&world, stream)?;
        let (mut particles, mut ellipses) = (Vec::new(), Vec::new());
        for (t, cloud) in (1..).zip(&clouds).filter(|(t, _)| p.time.contains(t)) {
            let [x, y] = cloud.columns();
            let points = x.iter().zip(y).zip(cloud.weights()).enumerate();
            particles.extend(points.map(|(i, ((&x, &y), &weight))| Particle { t, i, x, y, weight }));
            let sent = Reduction::default().reduce(&filter.estimate(cloud)?, p.components)?;
            for (component, c) in sent.components().iter().enumerate() {
                let outline = ellipse(&c.gaussian(), 0.5, 40)?;
                let closed = outline.iter().chain(outline.first());
                ellipses.extend(closed.map(|&[x, y]| Outline { t, component, x, y }));
            }
        }
        let far = |trial: Trial| -> Result<Vec<f64>, Error> {
            let kl = |estimate: &KernelEstimate<2>| Ok(Truth::new(estimate).kl(&single(estimate)?));
            posteriors(trial.stream)?.iter().map(kl).collect()
        };
        let distances = context.trials(stream.named("worlds"), p.trials, far)?;
        Ok(Rows {
            particles,
            ellipses,
            gaussian: vec![Distance {
                kl: distances.into_iter().flatten().collect(),
            }],
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let paper = claims.at_defaults().at_full_trials();
        for t in &p.time {
            let total: f64 = rows.particles.iter().filter(|r| r.t == *t).map(|r| r.weight).sum();
            claims.near(format!("weights-t{t}"), "weights sum to one", total, 1.0, 1e-9);
        }
        let distance = rows.gaussian.first().map(|d| d.kl.value);
        let what = "the beliefs are far from Gaussian: KL 0.12 nat to the Gaussian of their moments";
        paper.near("gaussian", what, distance, 0.12, 0.03);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let panel = |t: &usize| {
            let cloud =
                points(select(&rows.particles, |r| r.t == *t && r.weight > 0.1 / PARTICLES as f64), |r| (r.x, r.y));
            let outlines = (0..p.components).map(|k| {
                let outline = points(rows.ellipses.iter().filter(|r| r.t == *t && r.component == k), |r| (r.x, r.y));
                Layer::line("", outline).coloured(1)
            });
            Panel::linear(format!("time {t}"), "x / r0", "y / r0")
                .with(Layer::points("particles", cloud).coloured(0))
                .with_all(outlines)
                .without_legend()
        };
        Plot::grid(2, p.time.iter().map(panel).collect())
    }
}
