//! From a request to solutions: single sensors, all sensors, finer grids, Newton's method.

use super::landscape::{Grid, Landscape, WordLaw, Words};
use super::polish::{Polished, polish};
use super::request::{Control, Request, Stage};
use super::search::{Point, WordedCells, cells_of, climb, grid_with, random_start, refine, spacing, start};
use super::solution::Solution;
use crate::criterion::{AllowedCells, Criterion};
use crate::error::Error;
use crate::scene::{Resolution, Scene};
use crate::system::OUTCOME_LIMIT;
use fewbits_core::Link;
use fewbits_monte_carlo::Stream;
use fewbits_quantizers::lloyd_max;

/// The joint search is left out where one round over the sensors takes more multiplications than this.
const MAX_JOINT_WORK: f64 = 2e10;
/// A round over the sensors of less than this is run after the time limit, too, to refine the best result.
const LATE_WORK: f64 = 1e8;
/// Starts of a single sensor that a time limit does not end: Gray words, natural words, fewer levels.
const FIRST_STARTS: usize = 3;
/// Above this the joint search goes over rough nodes.
const MAX_COARSE_WORK: f64 = 5e8;
/// Multiplications that the starts of the joint search may take together, as far as they can be foreseen.
const START_WORK: f64 = 6e8;
/// Results of single sensors that are combined, and joint results that are refined.
const KEPT: usize = 4;
/// Times that grids are refined, each by a factor of three: breakpoints end within 1e-3 of a standard deviation, from where
/// Newton's method takes over.
const REFINEMENTS: usize = 3;
/// Without Newton's method: within 1e-5.
const MORE_REFINEMENTS: usize = 7;
/// Results closer than this share of the criterion's size are one.
const SAME: f64 = 1e-6;

/// Results further from the best than this share of the criterion's size are not certified.
const CLOSE: f64 = 1e-3;

/// A sensor that takes part.
#[derive(Debug, Clone)]
pub(super) struct Participant {
    /// Number in the request's scene.
    pub(super) sensor: usize,
    pub(super) bits: u32,
    pub(super) link: Link,
}

impl Participant {
    /// What arrives of a word: the words, and that nothing arrived if that can be.
    pub(super) fn law(&self) -> WordLaw {
        let words = 1usize << self.bits;
        let missing = missing(&self.link);
        let outputs = words + usize::from(missing > 0.0);
        let mut transition = vec![0.0; outputs * words];
        for t in 0..words {
            for w in 0..words {
                let arrives = self.link.word_probability(w as u64, t as u64, self.bits);
                transition[t * words + w] = self.link.arrival() * arrives;
            }
        }
        if missing > 0.0 {
            transition[words * words..].fill(missing);
        }
        WordLaw {
            words,
            outputs,
            transition,
        }
    }
}

/// Probability that a word is not received. Whether that is noticed makes no difference: these sensors always report.
pub(super) fn missing(link: &Link) -> f64 {
    link.loss() + link.erasure()
}

pub(super) fn solve(request: &Request<'_>, bits: &[u32], control: &mut Control<'_>) -> Result<Vec<Solution>, Error> {
    let participants: Vec<Participant> = (0..bits.len())
        .filter(|n| bits[*n] > 0)
        .map(|n| Participant {
            sensor: n,
            bits: bits[n],
            link: request.links[n],
        })
        .collect();
    let sensors: Vec<usize> = participants.iter().map(|p| p.sensor).collect();
    let scene = request.scene.subset(&sensors)?;
    let given = request
        .start
        .as_ref()
        .map(|all| sensors.iter().map(|n| all[*n].clone()).collect::<Vec<_>>());
    let starts = (request.starts, given.as_deref());
    let mut searched = search(&scene, request.criterion, &participants, request.cells, starts, control)?;
    if request.criterion == Criterion::BayesError {
        // The error probability has kinks and many flat places: the design of most information is a good start.
        let cells = plain(&scene, &participants)?;
        let informed = polish(&scene, Criterion::MutualInformation, &participants, cells, false, control.stopped)?;
        searched.designs.push(informed.cells);
    }
    let parts = searched.designs.len();
    let mut found: Vec<Solution> = Vec::new();
    for (done, cells) in searched.designs.into_iter().enumerate() {
        control.report(Stage::Certificate, done, parts);
        let Polished {
            system,
            cells,
            certificate,
            scope,
        } = polish(&scene, request.criterion, &participants, cells, searched.apart, control.stopped)?;
        found.push(Solution::new(request, &participants, system, cells, certificate, scope)?);
    }
    control.report(Stage::Certificate, parts, parts);
    Ok(found)
}

/// Cells and words of the designs that are worth polishing, best first.
pub(super) struct Searched {
    pub(super) designs: Vec<Vec<WordedCells>>,
    /// The best value on coarse nodes, signed.
    pub(super) value: f64,
    /// Whether sensors may have different cells: there are few enough joint symbols.
    pub(super) apart: bool,
}

pub(super) fn search(
    scene: &Scene,
    criterion: Criterion,
    participants: &[Participant],
    shape: AllowedCells,
    (starts, given): (usize, Option<&[WordedCells]>),
    control: &mut Control<'_>,
) -> Result<Searched, Error> {
    let laws: Vec<WordLaw> = participants.iter().map(Participant::law).collect();
    let singles = single_sensors(scene, criterion, participants, &laws, shape, control)?;
    let best_alone = || singles.iter().map(|s| s[0].clone()).collect::<Vec<_>>();
    let outcomes: f64 = laws.iter().map(|l| l.outputs as f64).product();
    if outcomes > OUTCOME_LIMIT as f64 {
        return Ok(Searched {
            designs: vec![best_alone()],
            value: f64::NAN,
            apart: false,
        });
    }
    let mut landscape = Landscape::new(&[(1.0, scene)], criterion, laws.clone(), Resolution::Coarse)?;
    let cells: Vec<usize> = participants.iter().map(|p| grid_cells(p.bits)).collect();
    let largest = cells.iter().copied().max().unwrap_or(0);
    let mut work = landscape.work(largest);
    let work_is_large = work > MAX_COARSE_WORK;
    if work_is_large {
        landscape = Landscape::new(&[(1.0, scene)], criterion, laws, Resolution::Rough)?;
        work = landscape.work(largest);
    }
    if work > MAX_JOINT_WORK {
        return Ok(Searched {
            designs: vec![best_alone(), plain(scene, participants)?],
            value: f64::NAN,
            apart: true,
        });
    }
    let grids: Vec<Grid> = (0..cells.len())
        .map(|n| {
            let more = given.map_or(&[][..], |given| &given[n].breakpoints);
            grid_with(&landscape, n, cells[n], more)
        })
        .collect();
    // A climb takes some ten rounds.
    let starts = ((START_WORK / (10.0 * work)) as usize).clamp(2, starts.max(2));
    let mut points: Vec<Point> = Vec::new();
    if let Some(given) = given {
        let words = given.iter().zip(&grids).map(|(c, g)| c.on(&g.edges)).collect();
        points.push(climb(&landscape, grids.clone(), words, shape, &mut || control.step()));
    }
    for i in 0..starts {
        let words = joint_start(&landscape, &grids, participants, &singles, i);
        points.push(climb(&landscape, grids.clone(), words, shape, &mut || control.step()));
        control.report(Stage::AllSensors, i + 1, starts);
        if !control.go_on() {
            break;
        }
    }
    let unit = points
        .iter()
        .map(|p| landscape.unit(p.value))
        .fold(f64::MIN_POSITIVE, f64::max);
    let points = best_few(points, SAME * unit);
    // Newton's method needs a close start; where it is not affordable the grids alone do it.
    let refinements = if super::polish::is_affordable(scene, criterion, outcomes, control.stopped) {
        REFINEMENTS
    } else {
        MORE_REFINEMENTS
    };
    let parts = points.len() * refinements;
    let mut refined = Vec::new();
    for (p, mut point) in points.into_iter().enumerate() {
        let mut spacings: Vec<f64> = (0..cells.len()).map(|n| spacing(&landscape, n, cells[n])).collect();
        for r in 0..refinements {
            // The best result is refined whatever the time, if that is quick.
            let is_due = p == 0 && work <= LATE_WORK;
            if !is_due && !control.go_on() {
                break;
            }
            point = refine(&landscape, point, &mut spacings, shape, &mut || control.step() || is_due);
            control.report(Stage::Refinement, p * refinements + r + 1, parts);
        }
        refined.push(point);
    }
    let mut refined = best_few(refined, 1e-9 * unit);
    let best = refined.first().map_or(0.0, |p| p.value);
    refined.retain(|p| best - p.value <= CLOSE * unit);
    let value = refined.first().map_or(f64::NAN, |p| p.value);
    let mut designs: Vec<Vec<WordedCells>> = refined.iter().map(cells_of).collect();
    if work_is_large || control.stopped {
        // What the search has seen is rough or cut short: the exact values decide between its best and two plain designs.
        designs.truncate(1);
        designs.push(best_alone());
        designs.push(plain(scene, participants)?);
    }
    Ok(Searched {
        designs,
        value,
        apart: true,
    })
}

/// Lloyd-Max cells of a normal sample with Gray words.
fn plain(scene: &Scene, participants: &[Participant]) -> Result<Vec<WordedCells>, Error> {
    let of = |(n, participant): (usize, &Participant)| {
        let levels = 1usize << participant.bits;
        let lloyd = lloyd_max::gaussian(levels)?.affine(scene.sample_mean(), scene.sample_deviation(n))?;
        Ok(WordedCells {
            breakpoints: lloyd.breakpoints().to_vec(),
            words: (0..levels).map(|z| z ^ (z >> 1)).collect(),
        })
    };
    participants.iter().enumerate().map(of).collect()
}

/// The best points, those of nearly equal value once.
fn best_few(mut points: Vec<Point>, same: f64) -> Vec<Point> {
    points.sort_by(|a, b| b.value.total_cmp(&a.value));
    points.dedup_by(|b, a| (a.value - b.value).abs() <= same);
    points.truncate(KEPT);
    points
}

/// The best designs of every sensor by itself, best first.
fn single_sensors(
    scene: &Scene,
    criterion: Criterion,
    participants: &[Participant],
    laws: &[WordLaw],
    shape: AllowedCells,
    control: &mut Control<'_>,
) -> Result<Vec<Vec<WordedCells>>, Error> {
    // A single sensor's decisions need few levels: what it tells is what counts beside other sensors.
    let criterion = match criterion {
        Criterion::BayesError if participants.len() > 1 => Criterion::MutualInformation,
        other => other,
    };
    let mut found: Vec<Vec<WordedCells>> = Vec::new();
    for n in 0..participants.len() {
        let alike = (0..n).find(|m| scene.interchangeable(*m, n) && laws[*m] == laws[n]);
        if let Some(m) = alike {
            found.push(found[m].clone());
            continue;
        }
        let own = scene.subset(&[n])?;
        let landscape = Landscape::new(&[(1.0, &own)], criterion, vec![laws[n].clone()], Resolution::Coarse)?;
        let bits = participants[n].bits;
        let cells = grid_cells(bits);
        let grid = grid_with(&landscape, 0, cells, &[]);
        let starts = match bits {
            ..=3 => 12,
            4 => 8,
            _ => 4,
        };
        let mut points = Vec::new();
        for i in 0..starts {
            let words = single_start(&landscape, 0, &grid, bits, i);
            // The first starts are run whatever the time.
            let mut go_on = || control.step() || i < FIRST_STARTS;
            points.push(climb(&landscape, vec![grid.clone()], vec![words], shape, &mut go_on));
            if i + 1 >= FIRST_STARTS && !control.go_on() {
                break;
            }
        }
        let unit = points
            .iter()
            .map(|p| landscape.unit(p.value))
            .fold(f64::MIN_POSITIVE, f64::max);
        let mut best = Vec::new();
        for mut point in best_few(points, SAME * unit) {
            let mut spacings = [spacing(&landscape, 0, cells)];
            for _ in 0..REFINEMENTS {
                point = refine(&landscape, point, &mut spacings, shape, &mut || control.step());
            }
            best.push(point);
        }
        found.push(
            best_few(best, 1e-9 * unit)
                .iter()
                .map(|p| cells_of(p).remove(0))
                .collect(),
        );
        control.report(Stage::SingleSensors, n + 1, participants.len());
    }
    Ok(found)
}

/// Start `i` of a sensor: Gray words, natural words, Gray words of three quarters of the levels, then random ones.
fn single_start(landscape: &Landscape, sensor: usize, grid: &Grid, bits: u32, i: usize) -> Words {
    let levels = 1usize << bits;
    let gray = |z: usize| z ^ (z >> 1);
    match i {
        0 => start(landscape, sensor, grid, &(0..levels).map(gray).collect::<Vec<_>>()),
        1 => start(landscape, sensor, grid, &(0..levels).collect::<Vec<_>>()),
        2 if bits > 1 => start(landscape, sensor, grid, &(0..levels * 3 / 4).map(gray).collect::<Vec<_>>()),
        _ => random_start(landscape, sensor, grid, stream(sensor, i)),
    }
}

fn stream(sensor: usize, i: usize) -> Stream {
    Stream::new(1)
        .named("design-starts")
        .indexed(sensor as u64)
        .indexed(i as u64)
}

/// Start `i` of all sensors: the best of each, Gray words, natural words, then mixed.
fn joint_start(
    landscape: &Landscape,
    grids: &[Grid],
    participants: &[Participant],
    singles: &[Vec<WordedCells>],
    i: usize,
) -> Vec<Words> {
    let of = |n: usize, kind: usize| match kind {
        0 | 3 | 4 => {
            // Later starts take other good designs of single sensors, a different one for each sensor.
            let rank = if kind == 0 { 0 } else { (n + kind) % singles[n].len() };
            singles[n][rank].on(&grids[n].edges)
        }
        1 => single_start(landscape, n, &grids[n], participants[n].bits, 0),
        2 => single_start(landscape, n, &grids[n], participants[n].bits, 1),
        _ => random_start(landscape, n, &grids[n], stream(n, i)),
    };
    (0..grids.len())
        .map(|n| match i {
            0..=4 => of(n, i),
            // One sensor random, the others good; or all random.
            _ if i % 2 == 1 && n != i % grids.len() => of(n, 0),
            _ => of(n, 5),
        })
        .collect()
}

/// Cells of a grid for words of so many bits.
fn grid_cells(bits: u32) -> usize {
    match bits {
        ..=3 => 64,
        4 => 96,
        _ => 200,
    }
}
