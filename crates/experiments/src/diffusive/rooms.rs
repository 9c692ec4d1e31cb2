//! A leak in a building: sensors of few bits, the true geometry, and free space.

use super::building::{Building, CELL, Case, NEAR, Placement};
use super::common::{fraction, median};
use super::plan_belief::Report;
use crate::prelude::*;

/// Misfit above which a model is said to be wrong: one in a hundred, if it is right.
const WRONG: f64 = 2.6;

parameters! {
    pub struct Parameters {
        trials: u64 [2..=10_000] = 100 => quick 6 => "Random placements of source and sensors.",
        sensors: usize [4..=200] = 40 => "Sensors.",
        visit_trials: u64 [2..=10_000] = 20 => quick 3 => "Placements in which sensors are visited one after the other.",
        visit_sensors: usize [4..=1000] = 160 => quick 20 => "Sensors of such a placement.",
    }
    cost |p| {
        let (placements, visits) = (p.trials as f64 * p.sensors as f64, p.visit_trials as f64 * p.visit_sensors as f64);
        Cost::new(0.1 * placements + 0.03 * visits, 1e8)
    };
}

rows! {
    pub struct Rows {
        found: Vec<Found> => "How often the source is found, by air and report.",
        /// Errors over the sensors visited, in random order: wind, three bits, 5 per cent noise, five readings each.
        visits: Vec<Visit>,
        map: Vec<Square> => "Beliefs of one placement over the plan, as in the visits.",
    }

    struct Found {
        case: String as x("case") => "Air, noise, report and number of readings.",
        /// Share of the placements whose most probable cell is within two cells of the source.
        within_two_cells: Measured as points("true geometry") in shares,
        coverage: Measured as points("90 % regions that hold it") in shares => "Share of the 90 per cent credible regions that hold the source.",
        false_alarms: Measured => "Share of the placements in which the true geometry is said to be wrong.",
        free_within_two_cells: Measured as points("free space") in shares => "As the first, if free space is assumed.",
        /// Of the placements in which free space misses, the share in which it is said to be wrong.
        free_misses_flagged: Measured,
    }

    struct Visit {
        sensors: usize as x("sensors visited") => "Sensors visited.",
        error: Measured ["m"] as points("true geometry") in visits => "Median distance of the most probable cell from the source.",
        error_free: Measured ["m"] as points("free space") in visits => "The same if free space is assumed.",
    }

    struct Square {
        x: f64 ["m"] => "Centre of the cell.",
        y: f64 ["m"] => "Centre of the cell.",
        wall: bool => "Whether it is wall.",
        belief: f64 => "Probability under the true geometry, as a share of the largest.",
        belief_free: f64 => "Probability under free space, as a share of the largest.",
        sensor: bool => "Whether a sensor stands there.",
        source: bool => "Whether the source is there.",
    }
}

/// Noise, report and readings, in still air and in wind.
const CASES: [(f64, Report, usize); 4] = [
    (0.01, Report::Value, 1),
    (0.05, Report::Value, 1),
    (0.05, Report::Word, 1),
    (0.05, Report::Word, 5),
];
/// The case whose sensors are visited one after the other and whose beliefs are shown.
const VISITED: Case = Case {
    windy: true,
    noise: 0.05,
    report: Report::Word,
    readings: 5,
};
/// Where the source of the map is: in the large room, away from its door.
const SHOWN: [f64; 3] = [11.1, 8.1, 0.0];

/// What is kept of one belief.
struct Judged {
    error: f64,
    covered: bool,
    alarm: bool,
}

/// The number of sensors after which errors are shown.
const STOPS: [usize; 7] = [2, 5, 10, 20, 40, 80, 160];

pub struct Rooms;

impl Figure for Rooms {
    figure!(Parameters => Rows, "diffusive-rooms", "A leak in a building", "",
        "Three rooms and a corridor. 40 sensors at random places report steady concentrations; the source is in a \
         random cell, its rate is unknown. Beliefs over the cells by the true geometry (finite volumes, adjoint \
         solutions) and by free space, errors over the sensors visited, and how often either is right. Noise is a \
         share of the median concentration. Truth and model share their cells.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let buildings = [Building::new(false)?, Building::new(true)?];
        let mut found = Vec::new();
        for (windy, building) in [false, true].into_iter().zip(&buildings) {
            for (noise, report, readings) in CASES {
                let case = Case {
                    windy,
                    noise,
                    report,
                    readings,
                };
                let stream = context.stream("diffusive-rooms");
                let all = context.trials(stream, p.trials, |it| one(building, &case, p.sensors, it.stream))?;
                found.push(summary(case.name(), &all));
            }
        }
        let building = &buildings[usize::from(VISITED.windy)];
        let stops: Vec<usize> = STOPS.into_iter().filter(|stop| *stop <= p.visit_sensors).collect();
        let tracks = context.trials(context.stream("diffusive-rooms-visits"), p.visit_trials, |trial| {
            let placement = Placement::draw(building, &VISITED, p.visit_sensors, None, trial.stream)?;
            let after = |stop: &usize| -> Result<[f64; 2], Error> {
                let [belief, free] = [0, 1].map(|model| placement.belief(model, *stop));
                Ok([placement.error(&belief?), placement.error(&free?)])
            };
            stops.iter().map(after).collect::<Result<Vec<_>, _>>()
        })?;
        let mut visits = Vec::new();
        for (k, sensors) in stops.iter().enumerate() {
            let of = |model: usize| median(tracks.iter().filter_map(|t| Some(t.get(k)?[model])));
            if let (Some(error), Some(error_free)) = (of(0), of(1)) {
                visits.push(Visit {
                    sensors: *sensors,
                    error,
                    error_free,
                });
            }
        }
        Ok(Rows {
            found,
            visits,
            map: map(building, p, context)?,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let full = claims.at_defaults().at_full_trials();
        for row in &rows.found {
            let words = row.case.replace(['%', ','], "");
            let key = words.split_whitespace().collect::<Vec<_>>().join("-");
            let what = format!("the stated credible mass is true: {}", row.case);
            full.at_least(format!("calibrated/low/{key}"), what.clone(), row.coverage.value, 0.84);
            full.at_most(format!("calibrated/high/{key}"), what, row.coverage.value, 0.95);
            let what = format!("free space is said to be wrong in most of its failures: {}", row.case);
            full.above(format!("free-flagged/{key}"), what, row.free_misses_flagged.value, 0.5);
            let what = format!("the true geometry is hardly ever said to be wrong: {}", row.case);
            full.at_most(format!("false-alarms/{key}"), what, row.false_alarms.value, 0.06);
        }
        let share = |case: &str| first(&rows.found, |row| row.case == case).map(|row| row.within_two_cells.value);
        for case in ["still, 1 %, values", "wind, 1 %, values"] {
            let what = format!("nine in ten within two cells: {case}");
            full.at_least(format!("found/{}", &case[..5]), what, share(case), 0.9);
        }
        let order = [
            "still, 5 %, three bits",
            "still, 5 %, three bits, five readings",
            "still, 5 %, values",
            "still, 1 %, values",
        ];
        full.increasing("few-bits-want-more", "bits and readings find more sources", order.map(share));
        let (start, last) = (rows.visits.first(), rows.visits.last());
        // Medians of few placements: compared with one another on the same placements, not with a number.
        let what = "however many sensors are visited, the true geometry is nearer than free space";
        full.all("visits", what, &rows.visits, |v| v.error.value < v.error_free.value);
        let fall = over(last.map(|v| v.error), start.map(|v| v.error));
        full.at_most("visits-fall", "all sensors leave at most half of the distance that two leave", fall, 0.5);
        full.above("visits-free", "free space stays metres away", last.map(|v| v.error_free.value), 1.0);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let [columns, lines] = [60, 40];
        let centres = |count: usize| (0..count).map(|i| CELL * (i as f64 + 0.5)).collect::<Vec<_>>();
        let places = |chosen: fn(&Square) -> bool| -> Vec<(f64, f64)> {
            rows.map.iter().filter(|s| chosen(s)).map(|s| (s.x, s.y)).collect()
        };
        // Runs of wall along lines and along columns: where they overlap no seam between cells shows.
        let wall = |column: usize, line: usize| rows.map.get(line * columns + column).is_some_and(|s| s.wall);
        let along = runs(columns, lines, wall).map(|(line, from, to)| [from, to, line, line + 1]);
        let across = runs(lines, columns, |line, column| wall(column, line))
            .map(|(column, from, to)| [column, column + 1, from, to]);
        let walls = along
            .chain(across)
            .map(|sides| sides.map(|side| CELL * side as f64).into());
        let walls: Vec<(f64, f64, f64, f64)> = walls.collect();
        let panel = |title: &str, belief: fn(&Square) -> f64| {
            let values = rows.map.iter().map(belief);
            Panel::new(title, Axis::linear("x / m").between(0.0, 15.0), Axis::linear("y / m").between(0.0, 10.0))
                .with(Layer::heat("share of the largest", centres(columns), centres(lines), values))
                .with(Layer::boxes("wall", walls.clone()).coloured(7))
                .with(Layer::points("sensors", places(|s| s.sensor)).styled(1, Marker::Circle))
                .with(Layer::points("source", places(|s| s.source)).styled(3, Marker::Triangle))
        };
        let maps = [
            panel("True geometry", |s| s.belief),
            panel("Free space", |s| s.belief_free),
        ];
        let visits = |title, x| Panel::semilogx(title, x, "median distance / m");
        let shares = |title, x| Panel::linear(title, x, "share");
        let named: [Named<'_>; 2] = [
            ("visits", "Distance to the source", &visits),
            ("shares", "Within two cells", &shares),
        ];
        Plot::grid(2, maps.into_iter().chain(plotted(rows, "", &named).panels).collect())
    }
}

/// What the true geometry and free space make of one placement.
fn one(building: &Building, case: &Case, sensors: usize, stream: Stream) -> Result<[Judged; 2], Error> {
    let placement = Placement::draw(building, case, sensors, None, stream)?;
    let chance: f64 = stream.named("region").rng().random();
    let judge = |model| -> Result<Judged, Error> {
        let belief = placement.belief(model, sensors)?;
        Ok(Judged {
            error: placement.error(&belief),
            covered: belief.covers(placement.source, chance),
            alarm: belief.misfit > WRONG,
        })
    };
    Ok([judge(0)?, judge(1)?])
}

fn map(building: &Building, p: &Parameters, context: &Context<'_>) -> Result<Vec<Square>, Error> {
    let domain = building.domain();
    let source = domain.locate(SHOWN)?;
    let placement =
        Placement::draw(building, &VISITED, p.sensors, Some(source), context.stream("diffusive-rooms-map"))?;
    let share = |model: usize| -> Result<Vec<f64>, Error> {
        let belief = placement.belief(model, p.sensors)?;
        let largest = belief.weights[belief.mode];
        Ok(domain.spread(&belief.weights.iter().map(|weight| weight / largest).collect::<Vec<_>>(), 0.0))
    };
    let [belief, free] = [share(0)?, share(1)?];
    let square = |cell: usize| {
        let [x, y, _] = domain.grid().centre(cell);
        let number = domain.number(cell);
        Square {
            x,
            y,
            wall: number.is_none(),
            belief: belief[cell],
            belief_free: free[cell],
            sensor: number.is_some_and(|number| placement.sensors.contains(&number)),
            source: number == Some(source),
        }
    };
    Ok((0..domain.grid().cells()).map(square).collect())
}

/// In each of `lines` lines of `length` squares, the first and one past the last square of every run that holds `chosen`.
fn runs(
    length: usize,
    lines: usize,
    chosen: impl Fn(usize, usize) -> bool + Copy,
) -> impl Iterator<Item = (usize, usize, usize)> {
    (0..lines).flat_map(move |line| {
        let at = move |i: usize| i < length && chosen(i, line);
        let starts = (0..length).filter(move |i| at(*i) && (*i == 0 || !at(i - 1)));
        starts.map(move |from| (line, from, (from..length).find(|i| !at(*i)).unwrap_or(length)))
    })
}

fn summary(case: String, all: &[[Judged; 2]]) -> Found {
    let count = |holds: fn(&[Judged; 2]) -> bool| all.iter().filter(|result| holds(result)).count();
    let misses = count(|[_, free]| free.error > NEAR);
    Found {
        case,
        within_two_cells: fraction(count(|[own, _]| own.error <= NEAR), all.len()),
        coverage: fraction(count(|[own, _]| own.covered), all.len()),
        false_alarms: fraction(count(|[own, _]| own.alarm), all.len()),
        free_within_two_cells: fraction(count(|[_, free]| free.error <= NEAR), all.len()),
        free_misses_flagged: fraction(count(|[_, free]| free.error > NEAR && free.alarm), misses),
    }
}
