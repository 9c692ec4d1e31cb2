//! The cases of `fixtures/geometry.json` as domains. Its `about` has the conventions.

use fewbits_diffusion::Divergence;
use fewbits_diffusion::{
    Boundary, CellKind, Domain, Flow, FluxRule, Grid, Patch, PerCell, Plan, PotentialFlow, Source, Steady, StepControl,
    TimedSource, Transient, Transport,
};
use serde_json::Value;

/// Width of the cells in which the fixture counts, m.
pub const SQUARE: f64 = 0.25;

/// The fixture file.
pub fn fixture() -> Value {
    serde_json::from_str(include_str!("../fixtures/geometry.json")).unwrap()
}

/// Entries and cases of the fixture.
pub struct Model {
    /// Case of the fixture.
    case: Value,
    split: usize,
    pub transport: Transport,
    flow: Flow,
    potential: Option<PotentialFlow>,
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn squares(value: &Value) -> Vec<usize> {
    value
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_u64().unwrap() as usize)
        .collect()
}

pub fn plan(all: &Value, name: &str) -> Plan {
    let lines: Vec<&str> = all["plans"][name]
        .as_array()
        .unwrap()
        .iter()
        .map(|line| line.as_str().unwrap())
        .collect();
    Plan::parse(&lines.join("\n")).unwrap()
}

fn domain(all: &Value, name: &str, split: usize) -> Domain {
    let case = &all["cases"][name];
    let leak = case["leak"].as_f64().unwrap_or(0.0);
    if let Some(plan_name) = case["plan"].as_str() {
        let plan = plan(all, plan_name);
        return match case["depth"].as_f64() {
            Some(depth) => plan
                .extruded(SQUARE, split, leak, (depth / SQUARE) as usize * split)
                .unwrap(),
            None => plan.domain(SQUARE, split, leak).unwrap(),
        };
    }
    let width = SQUARE / split as f64;
    if let Some(radius) = case["disc"].as_f64() {
        let grid = Grid::uniform(&[20 * split, 20 * split], width).unwrap();
        let law = if name == "disc-leak" {
            Boundary::Leaking(leak)
        } else {
            Boundary::Absorbing
        };
        let offset = |point: [f64; 3]| [point[0] - 10.0 * SQUARE, point[1] - 10.0 * SQUARE];
        let cells: Vec<CellKind> = (0..grid.cells())
            .map(|cell| {
                let [x, y] = offset(grid.centre(cell));
                if x.hypot(y) < radius {
                    CellKind::Free
                } else {
                    CellKind::Blocked(law)
                }
            })
            .collect();
        let round = |point: [f64; 3]| {
            let [x, y] = offset(point);
            [x / x.hypot(y), y / x.hypot(y), 0.0]
        };
        return Domain::new(grid, &cells, [[Boundary::Closed; 2]; 3])
            .unwrap()
            .with_wall_normals(round)
            .unwrap();
    }
    let counts: Vec<usize> = numbers(&case["size"])
        .iter()
        .map(|size| (size / width).round() as usize)
        .collect();
    let grid = Grid::uniform(&counts, width).unwrap();
    let mut sides = [[Boundary::Closed; 2]; 3];
    match name {
        "rect-leak" => sides[1][0] = Boundary::Leaking(leak),
        "box-floor" | "burst-absorbing" => sides[2][0] = Boundary::Absorbing,
        "duct-wind" => sides[0] = [Boundary::Inflow, Boundary::Outflow],
        "slab" => sides[0][0] = Boundary::Absorbing,
        "burst-ground" => {}
        other => panic!("unknown case {other}"),
    }
    let cells = vec![CellKind::Free; grid.cells()];
    Domain::new(grid, &cells, sides).unwrap()
}

impl Model {
    pub fn new(all: &Value, name: &str, split: usize, scheme: FluxRule) -> Self {
        let case = all["cases"][name].clone();
        let domain = domain(all, name, split);
        let everywhere = case["diffusivity"].as_f64().unwrap();
        let diffusivity = match case["regions"].as_array() {
            None => PerCell::Constant(everywhere),
            Some(regions) => {
                let columns = squares(&regions[0]["columns"]);
                let inside = columns[0] as f64 * SQUARE..(columns[1] + 1) as f64 * SQUARE;
                let other = regions[0]["diffusivity"].as_f64().unwrap();
                domain
                    .sample(|[x, ..]| if inside.contains(&x) { other } else { everywhere })
                    .into()
            }
        };
        let potential = case["flow"]
            .as_f64()
            .map(|total| PotentialFlow::new(&domain, total).unwrap());
        let flow = match (&potential, case["wind"].as_array()) {
            (Some(potential), _) => potential.flow.clone(),
            (None, Some(wind)) => {
                let speed = wind[0].as_f64().unwrap();
                Flow::from_velocity(&domain, |_| [speed, 0.0, 0.0], Divergence::Refuse).unwrap()
            }
            (None, None) => Flow::still(&domain),
        };
        let decay = case["decay"].as_f64().unwrap();
        let transport = Transport::new(domain, diffusivity, &flow, decay, scheme).unwrap();
        Self {
            case,
            split,
            transport,
            flow,
            potential,
        }
    }

    /// The patch of one square of the fixture.
    pub fn square(&self, at: &Value) -> Patch {
        let mut lower = [0.0; 3];
        for (lower, square) in lower.iter_mut().zip(squares(at)) {
            *lower = square as f64 * SQUARE;
        }
        self.transport.domain().block(lower, lower.map(|x| x + SQUARE)).unwrap()
    }

    fn patches(&self, list: &Value) -> Vec<Patch> {
        list.as_array().unwrap().iter().map(|at| self.square(at)).collect()
    }

    fn concentration(&self, source: &Value) -> Vec<f64> {
        let source = Source {
            patch: self.square(source),
            rate: 1.0,
        };
        Steady::new(&self.transport).unwrap().concentration(&[source]).unwrap()
    }

    /// The values of an entry, row by row.
    pub fn values(&self, entry: &Value) -> Vec<f64> {
        let domain = self.transport.domain();
        match entry["quantity"].as_str().unwrap() {
            "concentration" => {
                let field = self.concentration(&entry["source"]);
                self.patches(&entry["sensors"])
                    .iter()
                    .map(|sensor| sensor.mean(&field))
                    .collect()
            }
            "adjoint_row" => {
                let field = &Steady::new(&self.transport)
                    .unwrap()
                    .adjoint(&[self.square(&entry["sensor"])])
                    .unwrap()[0];
                self.patches(&entry["sources"])
                    .iter()
                    .map(|source| source.mean(field))
                    .collect()
            }
            "reciprocity" => {
                let (there, back) = (&entry["cells"][0], &entry["cells"][1]);
                let seen = |from: &Value, to: &Value| self.square(to).mean(&self.concentration(from));
                vec![seen(there, back), seen(back, there)]
            }
            "budget" => {
                let balance = self.transport.balance(&self.concentration(&entry["source"])).unwrap();
                assert!((balance.removed() - 1.0).abs() < 1e-10, "{} of 1 is accounted for", balance.removed());
                let part = |name: &Value| match name.as_str().unwrap() {
                    "mass" => balance.mass,
                    "decayed" => balance.decayed,
                    "leak" => balance.leaked,
                    "I" => balance.inflow,
                    "O" => balance.outflow,
                    other => panic!("unknown part {other}"),
                };
                entry["parts"].as_array().unwrap().iter().map(part).collect()
            }
            "potential_difference" => vec![self.potential.as_ref().unwrap().difference],
            "potential" => {
                let potential = &self.potential.as_ref().unwrap().potential;
                self.patches(&entry["cells"])
                    .iter()
                    .map(|cell| cell.mean(potential))
                    .collect()
            }
            "face_flow" => entry["faces"]
                .as_array()
                .unwrap()
                .iter()
                .map(|face| self.face_flow(face))
                .collect(),
            "burst" => {
                let mut initial = vec![0.0; domain.free().len()];
                let source = self.square(&entry["source"]);
                let at: Vec<usize> = (0..initial.len())
                    .filter(|i| {
                        let mut one = vec![0.0; initial.len()];
                        one[*i] = 1.0;
                        source.mean(&one) > 0.0
                    })
                    .collect();
                at.iter()
                    .for_each(|i| initial[*i] = 1.0 / (at.len() as f64 * domain.volumes()[*i]));
                let mut run = self.in_time(entry);
                let end = run.run(&initial, &[], &[entry["time"].as_f64().unwrap()]).unwrap();
                self.patches(&entry["sensors"])
                    .iter()
                    .map(|sensor| sensor.mean(&end[0].concentration))
                    .collect()
            }
            "release" | "mass" => {
                let stop = entry["stop"].as_f64().unwrap();
                let release = TimedSource {
                    patch: self.square(&entry["source"]),
                    rate: 1.0,
                    start: 0.0,
                    stop,
                };
                let mut run = self.in_time(entry);
                let initial = vec![0.0; domain.free().len()];
                let snapshots = run.run(&initial, &[release], &numbers(&entry["times"])).unwrap();
                if entry["quantity"] == "mass" {
                    let mass = |field: &[f64]| self.transport.balance(field).unwrap().mass;
                    return snapshots.iter().map(|snapshot| mass(&snapshot.concentration)).collect();
                }
                let sensors = self.patches(&entry["sensors"]);
                snapshots
                    .iter()
                    .flat_map(|snapshot| sensors.iter().map(|sensor| sensor.mean(&snapshot.concentration)))
                    .collect()
            }
            other => panic!("unknown quantity {other}"),
        }
    }

    /// Steps whose error, of which some tens add up, stays well below a tenth of the tolerance at this size of cells.
    fn in_time(&self, entry: &Value) -> Transient<'_> {
        let tolerance = entry["tolerance"]["exp"][self.split.ilog2() as usize].as_f64().unwrap();
        Transient::new(&self.transport)
            .with_control(StepControl::Tolerance(3e-4 * tolerance))
            .unwrap()
    }

    fn face_flow(&self, face: &Value) -> f64 {
        let domain = self.transport.domain();
        let axis = if face[2] == "x" { 0 } else { 1 };
        let at = [face[0].as_u64().unwrap() as usize, face[1].as_u64().unwrap() as usize];
        (0..self.split)
            .map(|k| {
                let mut cell = [at[0] * self.split, at[1] * self.split, 0];
                cell[axis] += self.split - 1;
                cell[1 - axis] += k;
                self.flow
                    .above(domain, domain.number(domain.grid().index(cell)).unwrap(), axis)
            })
            .sum()
    }

    #[allow(dead_code, reason = "documents the case in messages of failing tests")]
    pub fn case(&self) -> &Value {
        &self.case
    }
}

/// Errors of values in an entry's own measure, relative to `1`: they meet a tolerance if all are at most that.
pub fn errors(entry: &Value, got: &[f64]) -> Vec<f64> {
    let rows: Vec<Vec<f64>> = match entry["value"][0].is_array() {
        true => entry["value"].as_array().unwrap().iter().map(numbers).collect(),
        false => vec![numbers(&entry["value"])],
    };
    assert_eq!(got.len(), rows.iter().map(Vec::len).sum::<usize>());
    let mut got = got.iter();
    let mut errors = Vec::new();
    for row in rows {
        let largest = row.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
        for value in row {
            let scale = match entry["measure"].as_str().unwrap() {
                "floor" => value.abs().max(largest / 100.0),
                "largest" => largest,
                "part" => value.abs().max(0.01),
                other => panic!("unknown measure {other}"),
            };
            errors.push((got.next().unwrap() - value).abs() / scale);
        }
    }
    errors
}
