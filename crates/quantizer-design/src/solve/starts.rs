//! The search over all sensors: single sensors first, then all together from several starts, then finer grids.

use super::control::{Control, Stage};
use super::landscape::{Grid, Landscape, Words};
use super::participant::{SensorDesign, WordedCells, gray, natural, plain, system_of};
use super::polish;
use super::search::{Point, best_of, cells_of, climb, gray_walk, grid_with, random_start, refine, spacing, start};
use crate::criterion::{AllowedCells, Criterion};
use crate::error::Error;
use crate::observation_model::{ObservationModel, Resolution};
use crate::system::OUTCOME_LIMIT;
use fewbits_monte_carlo::Stream;
use fewbits_quantizers::Channel;

/// The joint search is left out if one round over the sensors needs more multiplications than this.
const MAX_JOINT_WORK: f64 = 2e10;
/// Above this number the joint search uses rough nodes.
const MAX_COARSE_WORK: f64 = 5e8;
/// Approximate number of multiplications for all starts of the joint search together.
const START_WORK: f64 = 6e8;
/// Assumed number of rounds of a local search.
const CLIMB_ROUNDS: f64 = 10.0;
/// If fewer local searches than this fit into the time limit, rough nodes are used.
const MIN_CLIMBS: f64 = 4.0;
/// Number of refinements of the grids, each by a factor of three. Breakpoints are then within 1e-3 of a standard deviation, close enough
/// for Newton's method.
const REFINEMENTS: usize = 3;
/// The same if Newton's method is not used; breakpoints are then within 1e-5.
const MORE_REFINEMENTS: usize = 7;
/// Results closer than this fraction of the criterion's scale are treated as equal.
const SAME: f64 = 1e-6;
/// The same after refinement.
const SAME_REFINED: f64 = 1e-9;
/// Results worse than the best by more than this fraction of the criterion's scale are not certified.
const CLOSE: f64 = 1e-3;
/// Half-width of the range of the cells in folded starts, in standard deviations of a sample.
const FOLDED_REACH: f64 = 2.25;

/// Cells and words of the designs that Newton's method refines, best first.
pub(super) struct Searched {
    pub(super) designs: Vec<Vec<WordedCells>>,
    /// The best signed value on coarse nodes; NaN if the sensors were not searched together.
    pub(super) value: f64,
    /// Whether sensors may have different cells, that is, whether there are few enough joint symbols.
    pub(super) apart: bool,
}

/// A search problem.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    pub(super) model: &'a ObservationModel,
    pub(super) criterion: Criterion,
    pub(super) participants: &'a [SensorDesign],
    pub(super) shape: AllowedCells,
    /// Number of starts of all sensors together.
    pub(super) starts: usize,
    /// A given design as an additional start.
    pub(super) given: Option<&'a [WordedCells]>,
}

impl Search<'_> {
    pub(super) fn run(&self, control: &mut Control<'_>) -> Result<Searched, Error> {
        let (model, participants) = (self.model, self.participants);
        let laws = SensorDesign::laws(participants)?;
        let singles = self.single_sensors(&laws, control)?;
        let mut first = singles.iter().map(|s| s[0].clone()).collect::<Vec<_>>();
        let outcomes: f64 = laws.iter().map(|l| l.outputs() as f64).product();
        if outcomes > OUTCOME_LIMIT as f64 {
            return Ok(Searched {
                designs: vec![first],
                value: f64::NAN,
                apart: false,
            });
        }
        let mut landscape = Landscape::new(&[(1.0, model)], self.criterion, laws.clone(), Resolution::COARSE)?;
        let mut cells: Vec<usize> = participants.iter().map(|p| grid_cells(p.bits)).collect();
        let largest = |cells: &[usize]| cells.iter().copied().max().unwrap_or(0);
        let mut work = landscape.work(largest(&cells));
        control.enter(Stage::AllSensors, 1);
        let is_short = control.deadline().is_short_for(MIN_CLIMBS * CLIMB_ROUNDS * work);
        control.is_cut_short |= is_short;
        let work_is_large = work > MAX_COARSE_WORK || is_short;
        let mut search = *self;
        if is_short {
            for (cells, p) in cells.iter_mut().zip(participants) {
                *cells = grid_cells(p.bits).min((4 << p.bits).max(16));
            }
        }
        if work_is_large {
            let rough = model.at(Resolution::ROUGH)?;
            landscape = Landscape::new(&[(1.0, model)], self.criterion, laws, Resolution::ROUGH)?;
            work = landscape.work(largest(&cells));
            // If only few local searches are possible, the first one starts from the best design available.
            first = self.best_at_hand(&rough, first, outcomes, control)?;
            search.given = self.given.or(Some(&first));
        }
        let points = if work > MAX_JOINT_WORK {
            Vec::new()
        } else {
            search.joint_points(&landscape, &cells, &singles, work, control)
        };
        control.enter(Stage::Refinement, 1);
        // Newton's method needs a start that is close; if it is not affordable, the grids are refined further.
        let refinements = if polish::is_affordable(model, self.criterion, outcomes) {
            REFINEMENTS
        } else {
            MORE_REFINEMENTS
        };
        let mut refined = self.refined(&landscape, &cells, points, refinements, control, Some(Stage::Refinement));
        let best = refined.first().map_or(f64::NAN, |p| p.value);
        let unit = size_of(&landscape, &refined);
        refined.retain(|p| best - p.value <= CLOSE * unit);
        let mut designs: Vec<Vec<WordedCells>> = refined.iter().map(cells_of).collect();
        if designs.is_empty() || work_is_large || control.is_cut_short {
            // The values from the search are rough or incomplete: exact values decide between its best design and plain ones.
            designs.truncate(1);
            if designs.is_empty() {
                designs.push(first.clone());
            }
            if polish::is_quick(model, self.criterion, outcomes)? {
                designs.push(plain(model, participants, gray)?);
                designs.push(plain(model, participants, natural)?);
            }
        }
        Ok(Searched {
            designs,
            value: best,
            apart: true,
        })
    }

    /// The best of a design and the plain ones on rough nodes, as far as there is time to evaluate them.
    fn best_at_hand(
        &self,
        rough: &ObservationModel,
        design: Vec<WordedCells>,
        outcomes: f64,
        control: &mut Control<'_>,
    ) -> Result<Vec<WordedCells>, Error> {
        let [gray, natural] = [gray, natural].map(|word| plain(self.model, self.participants, word));
        let work = polish::evaluation_work(rough, self.criterion, outcomes);
        let mut best = (f64::NEG_INFINITY, design.clone());
        for cells in [design, gray?, natural?] {
            if !control.go_on() || control.deadline().is_short_for(work) {
                break;
            }
            let value = system_of(rough, self.participants, &cells, true)?.value(self.criterion)?;
            if self.criterion.sense() * value > best.0 {
                best = (self.criterion.sense() * value, cells);
            }
        }
        Ok(best.1)
    }

    /// Results of the local searches from all starts, as many as there is time for.
    fn joint_points(
        &self,
        landscape: &Landscape,
        cells: &[usize],
        singles: &[Vec<WordedCells>],
        work: f64,
        control: &mut Control<'_>,
    ) -> Vec<Point> {
        let grids: Vec<Grid> = (0..cells.len())
            .map(|n| {
                let more = self.given.map_or(&[][..], |given| &given[n].breakpoints);
                grid_with(landscape, n, cells[n], more)
            })
            .collect();
        let on_grids = |cells: &[WordedCells]| cells.iter().zip(&grids).map(|(c, g)| c.on(&g.edges)).collect();
        let folded = match self.shape {
            AllowedCells::Intervals => Vec::new(),
            AllowedCells::Any => folded_starts(landscape, self.participants, singles),
        };
        let affordable = (START_WORK / (CLIMB_ROUNDS * work)) as usize;
        let starts = affordable.clamp(2, self.starts.max(2) + folded.len());
        let mut points = Vec::new();
        if let Some(given) = self.given {
            points.extend(climb(landscape, grids.clone(), on_grids(given), self.shape, control));
        }
        for i in 0..starts {
            // The best single sensors first, then folded cells, then the rest.
            let words = match i.checked_sub(1).and_then(|at| folded.get(at)) {
                Some(cells) => on_grids(cells),
                None => self.joint_start(landscape, &grids, singles, if i == 0 { 0 } else { i - folded.len() }),
            };
            points.extend(climb(landscape, grids.clone(), words, self.shape, control));
            control.report(Stage::AllSensors, i + 1, starts);
            if !control.go_on() {
                break;
            }
        }
        points
    }

    /// The best points refined on finer grids, as far as there is time. The best one is first and gets more time.
    fn refined(
        &self,
        landscape: &Landscape,
        cells: &[usize],
        points: Vec<Point>,
        refinements: usize,
        control: &mut Control<'_>,
        shown_as: Option<Stage>,
    ) -> Vec<Point> {
        let unit = size_of(landscape, &points);
        // Refine the grids of each different point in turn; afterwards points that have become equal are dropped again.
        let points = best_of(points, SAME * unit);
        let parts = points.len() * refinements;
        let mut refined = Vec::new();
        for (p, mut point) in points.into_iter().enumerate() {
            let mut spacings: Vec<f64> = (0..cells.len()).map(|n| spacing(landscape, n, cells[n])).collect();
            for r in 0..refinements {
                if !control.go_on() {
                    break;
                }
                point = refine(landscape, point, &mut spacings, self.shape, control);
                if let Some(stage) = shown_as {
                    control.report(stage, p * refinements + r + 1, parts);
                }
            }
            refined.push(point);
        }
        best_of(refined, SAME_REFINED * unit)
    }

    /// The best designs of every sensor alone, best first.
    fn single_sensors(&self, laws: &[Channel], control: &mut Control<'_>) -> Result<Vec<Vec<WordedCells>>, Error> {
        let (model, participants) = (self.model, self.participants);
        // The decision of a single sensor needs few levels only. Beside other sensors the information of its word matters.
        let criterion = match self.criterion {
            Criterion::BayesError if participants.len() > 1 => Criterion::MutualInformation,
            other => other,
        };
        let mut found: Vec<Vec<WordedCells>> = Vec::new();
        for n in 0..participants.len() {
            let alike = (0..n).find(|m| model.interchangeable(*m, n) && laws[*m] == laws[n]);
            if let Some(m) = alike {
                found.push(found[m].clone());
                continue;
            }
            control.enter(Stage::SingleSensors, participants.len() - n);
            let own = model.subset(&[n])?;
            let landscape = Landscape::new(&[(1.0, &own)], criterion, vec![laws[n].clone()], Resolution::COARSE)?;
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
                let words = single_start(&landscape, 0, &grid, bits, i, self.shape);
                points.extend(climb(&landscape, vec![grid.clone()], vec![words], self.shape, control));
                if !control.go_on() {
                    break;
                }
            }
            let best = self.refined(&landscape, &[cells], points, REFINEMENTS, control, None);
            found.push(if best.is_empty() {
                plain(&own, &participants[n..=n], gray)?
            } else {
                best.iter().flat_map(cells_of).collect()
            });
            control.report(Stage::SingleSensors, n + 1, participants.len());
        }
        Ok(found)
    }

    /// Start `i` of all sensors: first the best designs of each, Gray words, natural words and mixtures of these, then random ones.
    fn joint_start(&self, landscape: &Landscape, grids: &[Grid], singles: &[Vec<WordedCells>], i: usize) -> Vec<Words> {
        let of = |n: usize, kind: usize| match kind {
            0 | 3 | 4 => {
                // Later starts use other good designs of single sensors, a different one for each sensor.
                let rank = if kind == 0 { 0 } else { (n + kind) % singles[n].len() };
                singles[n][rank].on(&grids[n].edges)
            }
            1 | 2 => single_start(landscape, n, &grids[n], self.participants[n].bits, kind - 1, self.shape),
            5 => random_start(landscape, n, &grids[n], self.shape, stream(n, i)),
            _ => start(landscape, n, &grids[n], &gray_walk(landscape.laws[n].inputs(), stream(n, i))),
        };
        (0..grids.len())
            .map(|n| match i {
                0..=4 => of(n, i),
                // Other Gray codes; or one sensor random and the others good; or all random.
                _ if i % 2 == 1 => of(n, 6),
                _ if i.is_multiple_of(4) && n != i % grids.len() => of(n, 0),
                _ => of(n, 5),
            })
            .collect()
    }
}

/// Scale of the criterion at some points.
fn size_of(landscape: &Landscape, points: &[Point]) -> f64 {
    let sizes = points.iter().map(|p| landscape.unit(p.value));
    sizes.fold(f64::MIN_POSITIVE, f64::max)
}

/// Start `i` of a sensor: Gray words, natural words, Gray words of three quarters of the levels, then random ones.
fn single_start(landscape: &Landscape, sensor: usize, grid: &Grid, bits: u32, i: usize, shape: AllowedCells) -> Words {
    let levels = 1usize << bits;
    let words: Vec<usize> = match i {
        0 => (0..levels).map(gray).collect(),
        1 => (0..levels).collect(),
        2 if bits > 1 => (0..levels * 3 / 4).map(gray).collect(),
        _ => return random_start(landscape, sensor, grid, shape, stream(sensor, i)),
    };
    start(landscape, sensor, grid, &words)
}

fn stream(sensor: usize, i: usize) -> Stream {
    Stream::new(1)
        .named("design-starts")
        .indexed(sensor as u64)
        .indexed(i as u64)
}

/// Starts with one sensor folded and the others as they are best alone. Each sensor in turn has one to `levels + 1` more cells than levels,
/// whose levels repeat cyclically or back and forth. Most of these cannot be reached from intervals by improving steps.
fn folded_starts(
    landscape: &Landscape,
    participants: &[SensorDesign],
    singles: &[Vec<WordedCells>],
) -> Vec<Vec<WordedCells>> {
    let mut starts = Vec::new();
    for (folded, participant) in participants.iter().enumerate() {
        let levels = 1usize << participant.bits;
        let turn = 2 * levels - 2;
        let sample = landscape.sample(folded);
        // Evenly spaced cells over the range; the levels repeat cyclically, or go up and down.
        for cells in levels + 1..=2 * levels + 1 {
            let share = |cut: usize| 2.0 * cut as f64 / cells as f64 - 1.0;
            let breakpoints: Vec<f64> = (1..cells)
                .map(|cut| sample.mean + FOLDED_REACH * sample.deviation * share(cut))
                .collect();
            let round = (0..cells).map(|c| gray(c % levels)).collect();
            let to_and_fro = (0..cells).map(|c| gray((c % turn).min(turn - c % turn))).collect();
            for words in [round, to_and_fro] {
                let mut start: Vec<WordedCells> = singles.iter().map(|s| s[0].clone()).collect();
                start[folded] = WordedCells {
                    breakpoints: breakpoints.clone(),
                    words,
                };
                if !starts.contains(&start) {
                    starts.push(start);
                }
            }
        }
    }
    starts
}

/// Number of grid cells for words of `bits` bits.
fn grid_cells(bits: u32) -> usize {
    match bits {
        ..=3 => 64,
        4 => 96,
        _ => 200,
    }
}
