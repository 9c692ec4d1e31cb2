//! `mpa-fig3-3`: one trajectory.

use super::world::{Field, Method, Point, World, canonical};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::Target;

parameters! {
    pub struct Parameters {
        trajectory: u64 [0..=10_000] = 0 => "Which trajectory of those that all figures share.",
        particles: usize [3..=1000] = 40 => "Particles of message passing.",
        snr_db: f64 [0.0..=80.0] = 50.0 => "Ratio of the powers of range and noise, in decibels.",
        levels: usize [2..=65_536] = 4 => "Levels of the quantizer.",
    }
}

rows! {
    pub struct Rows {
        track: Vec<Row> => "True and estimated positions.",
        errors: Vec<ErrorRow> => "Mean squared errors of this trajectory.",
    }

    struct Row {
        method: String => "`truth`, or the tracker.",
        k: usize => "Step, from 1.",
        x: f64 => "Position.",
        y: f64 => "Position.",
    }

    struct ErrorRow {
        method: String => "Tracker.",
        mse: f64 => "Mean squared position error.",
    }
}

pub struct Fig33;

impl Figure for Fig33 {
    figure!(Parameters => Rows, "mpa-fig3-3", "One trajectory, six trackers", "particle message passing, Figure 3.3",
        "A manoeuvring target among five sensors that send two bits each per step. The naive filter and message passing \
         as published wander off; the grid filter stays on the track.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let (target, point) = (Target::printed()?, Point::published(p.snr_db, p.levels)?);
        let network = point.network()?;
        let stream = context.stream("mpa-trajectories").indexed(p.trajectory);
        let world = World::draw(stream, &target, Field::Confined)?;
        let (mut track, mut errors) = (Vec::new(), Vec::new());
        let mut add = |method: &str, places: &mut dyn Iterator<Item = &Vector4<f64>>| {
            track.extend(places.enumerate().map(|(k, state)| Row {
                method: method.to_owned(),
                k: k + 1,
                x: state[0],
                y: state[1],
            }));
        };
        add("truth", &mut world.track.iter());
        let methods = [
            Method::EKF_NAIVE,
            Method::TRANSFER,
            Method::GMPA,
            Method::published(p.particles)?,
            Method::improved(p.particles)?,
            Method::Grid(15),
        ];
        for method in methods {
            let estimates = method.run(&world, &network, &target, stream)?;
            let (method, mse) = (method.name(), world.mse(&estimates));
            add(&method, &mut estimates.iter().map(Gaussian::mean));
            errors.push(ErrorRow { method, mse });
        }
        Ok(Rows { track, errors })
    }

    fn claims(&self, p: &Parameters, t: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let of = |method: &str| first(&t.errors, |e| e.method == method).map(|e| e.mse);
        here.at_most("grid", "the grid filter stays on the track", of("grid-15"), 0.3);
        here.at_most("improved", "so does improved message passing", of(&format!("improved-{}", p.particles)), 0.5);
    }

    fn plot(&self, _: &Parameters, t: &Rows) -> Plot {
        let path = |method: &str| points(select(&t.track, |r| r.method == method), |r| (r.x, r.y));
        let marks = |(i, e): (usize, &ErrorRow)| Layer::points(&e.method, path(&e.method)).coloured(i + 1);
        let truth = path("truth");
        let sensors = canonical().iter().map(|s| (s[0], s[1])).collect();
        let square = |title, [x, y]: [(f64, f64); 2]| {
            let axis = |label, (low, high)| Axis::linear(label).between(low, high);
            Panel::new(title, axis("x / m", x), axis("y / m", y))
                .with(Layer::unbroken("truth", truth.clone()))
                .with_all(t.errors.iter().enumerate().map(marks))
        };
        // A quarter of the field's side, round the middle of the true track.
        let (x, y) = truth.get(truth.len() / 2).copied().unwrap_or((10.0, 10.0));
        let [(left, right), (low, high)] = [x, y].map(|centre| (centre - 2.5, centre + 2.5));
        let frame = vec![(left, low), (right, low), (right, high), (left, high), (left, low)];
        let field = square("50 dB, four levels", [(0.0, 20.0); 2])
            .with(Layer::points("sensors", sensors).coloured(8))
            .with(Layer::dashed("", frame).coloured(7))
            .without_legend();
        let close = square("the dashed square, four times as large", [(left, right), (low, high)]);
        Plot::grid(2, vec![field, close])
    }
}
