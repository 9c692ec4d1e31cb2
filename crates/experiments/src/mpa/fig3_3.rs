//! `mpa-fig3-3`: one trajectory.

use super::sweeps::SPEED;
use super::world::{Field, Method, Point, World, canonical};
use crate::prelude::*;
use fewbits_pf_mpa::Target;

parameters! {
    pub struct Parameters {
        /// Which trajectory of those that all figures share.
        #[garde(range(min = 0, max = 10_000))]
        trajectory: u64 = 0,
        /// Particles of message passing.
        #[garde(range(min = 3, max = 1000))]
        particles: usize = 40,
        /// Ratio of the powers of range and noise, in decibels.
        #[garde(range(min = 0.0, max = 80.0))]
        snr_db: f64 = 50.0,
        /// Levels of the quantizer.
        #[garde(range(min = 2, max = 65_536))]
        levels: usize = 4,
    }
}

rows! {
    pub struct Rows {
        /// True and estimated positions.
        track: Vec<Row>,
        /// Mean squared errors of this trajectory.
        errors: Vec<ErrorRow>,
    }

    struct Row {
        /// `truth`, or the tracker.
        method: String,
        /// Step, from 1.
        k: usize,
        /// Position.
        x: f64,
        /// Position.
        y: f64,
    }

    struct ErrorRow {
        /// Tracker.
        method: String,
        /// Mean squared position error.
        mse: f64,
    }
}

pub struct Fig33;

impl Figure for Fig33 {
    figure!(Parameters => Rows, "mpa-fig3-3", "One trajectory, six trackers", "particle message passing, Figure 3.3",
        "A manoeuvring target among five sensors that send two bits each per step. The naive filter and message passing \
         as published wander off; the grid filter stays on the track.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let (target, point) = (Target::printed()?, Point::published(p.snr_db, p.levels, SPEED)?);
        let network = point.network()?;
        let stream = context.stream("mpa-trajectories").indexed(p.trajectory);
        let world = World::draw(stream, &target, Field::Confined, network.sensors().len())?;
        let place = |method: &str, k: usize, x: f64, y: f64| Row {
            method: method.to_owned(),
            k: k + 1,
            x,
            y,
        };
        let mut track: Vec<Row> = world
            .track
            .iter()
            .enumerate()
            .map(|(k, s)| place("truth", k, s[0], s[1]))
            .collect();
        let mut errors = Vec::new();
        let methods = [
            Method::EKF_NAIVE,
            Method::TRANSFER,
            Method::GMPA,
            Method::published(p.particles)?,
            Method::improved(p.particles)?,
            Method::Grid(15),
        ];
        for method in methods {
            let run = method.run(&world, &network, &target, stream)?;
            let name = method.name();
            let of = run.estimates.iter().enumerate();
            track.extend(of.map(|(k, e)| place(&name, k, e.mean()[0], e.mean()[1])));
            errors.push(ErrorRow {
                mse: run.mse(&world),
                method: name,
            });
        }
        Ok(Rows { track, errors })
    }

    fn claims(&self, p: &Parameters, t: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let of = |method: &str| t.errors.iter().find(|e| e.method == method).map(|e| e.mse);
        here.at_most("grid", "the grid filter stays on the track", of("grid-15"), 0.3);
        here.at_most("improved", "so does improved message passing", of(&format!("improved-{}", p.particles)), 0.5);
    }

    fn plot(&self, _: &Parameters, t: &Rows) -> Plot {
        let names: Vec<&str> = t.errors.iter().map(|e| e.method.as_str()).collect();
        let line = |(i, name): (usize, &&str)| {
            Layer::points(*name, points(t.track.iter().filter(|r| r.method == **name), |r| (r.x, r.y))).coloured(i + 1)
        };
        let truth = points(t.track.iter().filter(|r| r.method == "truth"), |r| (r.x, r.y));
        let sensors = canonical().iter().map(|s| (s[0], s[1])).collect();
        let panel = Panel::new(
            "50 dB, four levels",
            Axis::linear("x / m").between(0.0, 20.0),
            Axis::linear("y / m").between(0.0, 20.0),
        )
        .with(Layer::unbroken("truth", truth))
        .with_all(names.iter().enumerate().map(line))
        .with(Layer::points("sensors", sensors).coloured(8));
        Plot::of(panel)
    }
}
