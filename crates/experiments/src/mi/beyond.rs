//! Beyond the publication: folded cells, broken symmetry, words, bounds, effort.

use super::common::{MI, MSE, breakpoints, bsc, cell, exact, lloyd, lloyd_system, name, scene};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, Value, claim, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_quantizer_design::design::{self, Discovery};
use fewbits_quantizer_design::{Channel, Criterion, Group, Newton, Quantizer, System, bounds};
use serde::{Deserialize, Serialize};

/// Settings of the searches.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Random starts among contiguous quantizers.
    pub contiguous_starts: usize,
    /// Random label sequences among folded quantizers.
    pub folded_starts: usize,
    /// Grid cells a sensor in that search.
    pub grid: usize,
    /// Crossovers at which words are compared.
    pub crossovers: Vec<f64>,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            contiguous_starts: 20,
            folded_starts: 60,
            grid: 160,
            crossovers: vec![0.001, 0.01, 0.05, 0.1, 0.2],
        }
    }
}

/// A search: case, levels, noise, correlation, and by criterion the known best contiguous and folded values.
struct Search {
    case: &'static str,
    levels: usize,
    noise_sd: f64,
    rho: f64,
    criterion: Criterion,
    contiguous: f64,
    folded: f64,
}

const fn search(case: &'static str, setting: (usize, f64, f64), criterion: Criterion, known: (f64, f64)) -> Search {
    let (levels, noise_sd, rho) = setting;
    Search {
        case,
        levels,
        noise_sd,
        rho,
        criterion,
        contiguous: known.0,
        folded: known.1,
    }
}

const SEARCHES: [Search; 10] = [
    search("correlated-L4", (4, 1.0, 0.85), MI, (0.331_123_01, 0.344_953_45)),
    search("correlated-L4", (4, 1.0, 0.85), MSE, (0.516_272_61, 0.501_884_61)),
    search("correlated-L2", (2, 1.0, 0.85), MI, (0.260_949_86, 0.291_478_26)),
    search("correlated-L2", (2, 1.0, 0.85), MSE, (0.595_035_73, 0.559_245_99)),
    search("noise1-L4", (4, 1.0, 0.0), MI, (0.474_687_86, 0.474_687_86)),
    search("noise1-L4", (4, 1.0, 0.0), MSE, (0.388_403_07, 0.388_403_07)),
    search("noise0.5-L4", (4, 0.5, 0.0), MSE, (0.177_421_13, 0.167_628_31)),
    search("noise0.3-L4", (4, 0.3, 0.0), MSE, (0.109_841_91, 0.083_443_81)),
    search("noise0.5-L2", (2, 0.5, 0.0), MSE, (0.343_627_16, 0.311_541_35)),
    search("noise0.3-L2", (2, 0.3, 0.0), MSE, (0.256_870_07, 0.191_738_49)),
];

/// Where two sign quantizers stop being a local optimum: what varies, criterion, value.
const THRESHOLDS: [(&str, Criterion, f64); 4] = [
    ("noise_sd", MI, 0.555_828_51),
    ("noise_sd", MSE, 0.671_600_04),
    ("rho", MI, 0.423_726_70),
    ("rho", MSE, 0.378_315_47),
];

fn signs(noise_sd: f64, rho: f64) -> Result<System, fewbits_quantizer_design::Error> {
    let noise = fewbits_quantizer_design::Noise::equicorrelated(&[noise_sd; 2], rho)?;
    let scene = fewbits_quantizer_design::Scene::new(fewbits_quantizer_design::Prior::gaussian(1.0)?, noise)?;
    System::ideal(scene, vec![Quantizer::new(vec![0.0])?; 2])
}

fn labels(quantizer: &Quantizer) -> String {
    quantizer
        .labels()
        .iter()
        .map(usize::to_string)
        .collect::<Vec<_>>()
        .join(" ")
}

fn searches(p: &Parameters) -> Result<Table, Error> {
    let mut table = Table::new([
        column("case", "", "noise, correlation and levels"),
        column("criterion", "", "criterion of the design"),
        column("cells", "", "contiguous cells, or any"),
        column("value", "", "the criterion: nats, or prior variances"),
        column("mi_nats", "nat", "mutual information"),
        column("mse", "", "squared error"),
        column("curvature", "", "largest eigenvalue of the Hessian"),
        column("ceo_bound", "", "least squared error of any codes at this rate, independent noise"),
        column("gamma1", "", "breakpoints of sensor 1"),
        column("labels1", "", "levels of its cells"),
        column("gamma2", "", "breakpoints of sensor 2"),
        column("labels2", "", "levels of its cells"),
    ]);
    for s in &SEARCHES {
        let scene = scene(&[s.noise_sd; 2], s.rho)?;
        let start = lloyd_system(&scene, s.levels, |n| scene.sample_sd(n))?;
        let contiguous = design::multi_start(&start, s.criterion, p.contiguous_starts, 1, &Newton::default())?;
        let settings = Discovery {
            grid: p.grid,
            starts: p.folded_starts,
            ..Discovery::default()
        };
        let folded = design::discover(&contiguous.system, s.criterion, &settings)?;
        let bits = (s.levels as f64).log2();
        let variance = s.noise_sd * s.noise_sd;
        let bound = if s.rho == 0.0 {
            Some(bounds::ceo(1.0, &[variance; 2], &[bits; 2])?)
        } else {
            None
        };
        for (cells, design) in [("contiguous", contiguous), ("any", folded)] {
            let q = design.quantizers();
            table.push(row![
                s.case,
                name(s.criterion),
                cells,
                design.value,
                design.system.value(MI)?,
                design.system.value(MSE)?,
                design.largest_curvature,
                bound,
                breakpoints(&q[0]),
                labels(&q[0]),
                breakpoints(&q[1]),
                labels(&q[1]),
            ])?;
        }
    }
    Ok(table)
}

fn thresholds() -> Result<Table, Error> {
    let mut table = Table::new([
        column("varied", "", "noise standard deviation (no correlation) or correlation (unit noise)"),
        column("criterion", "", "criterion"),
        column("threshold", "", "where two sign quantizers stop being a local optimum"),
    ]);
    for (varied, criterion, _) in THRESHOLDS {
        let found = match varied {
            "rho" => design::symmetry_breaking(0.1, 0.9, criterion, |rho| signs(1.0, rho)),
            _ => design::symmetry_breaking(0.2, 2.0, criterion, |sd| signs(sd, 0.0)),
        };
        table.push(row![varied, name(criterion), found?])?;
    }
    Ok(table)
}

fn words(p: &Parameters) -> Result<Table, Error> {
    let mut table = Table::new([
        column("crossover", "", "crossover probability"),
        column("criterion", "", "criterion of the design"),
        column("sensors", "", "same words at both sensors, or mixed"),
        column("rank", "", "1 is best"),
        column("words", "", "words of the cells, left to right, sensors separated by a bar"),
        column("value", "", "the criterion: nats, or prior variances"),
        column("mse", "", "squared error"),
    ]);
    let scene = scene(&[1.0; 2], 0.0)?;
    for &crossover in &p.crossovers {
        for criterion in [MI, MSE] {
            let mut kinds = vec![("same", false)];
            if crossover == 0.05 {
                kinds.push(("mixed", true));
            }
            for (kind, mixed) in kinds {
                let found = design::assign_words(&scene, 2, crossover, 2..=4, criterion, mixed)?;
                for (rank, assignment) in found.iter().enumerate().take(if mixed { 5 } else { usize::MAX }) {
                    let text = |w: &Vec<u32>| w.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
                    let text = assignment.words.iter().map(text).collect::<Vec<_>>().join(" | ");
                    let design = &assignment.design;
                    let mse = design.system.value(MSE)?;
                    table.push(row![crossover, name(criterion), kind, rank + 1, text, design.value, mse])?;
                }
            }
        }
    }
    Ok(table)
}

/// Other channels: name, channel, known outer breakpoint and error of the information design.
fn other_channels() -> Result<[(&'static str, Channel, f64, f64); 2], Error> {
    Ok([
        ("erasure 0.1", Channel::symbol_erasure(4, 0.1)?, 1.362_746_3, 0.425_253_60),
        ("4-PAM 10 dB", Channel::pulse_amplitude(4, 10.0)?, 1.045_916_9, 0.442_037_75),
    ])
}

fn channels() -> Result<Table, Error> {
    let mut table = Table::new([
        column("channel", "", "channel of both sensors"),
        column("outer", "", "outer breakpoint of the joint information design"),
        column("mi_nats", "nat", "mutual information"),
        column("mse", "", "squared error"),
    ]);
    let scene = scene(&[1.0; 2], 0.0)?;
    for (label, channel, _, _) in other_channels()? {
        let start = lloyd_system(&scene, 4, |_| 1.4)?.with_channels(vec![channel; 2])?;
        let design = design::joint(&start, MI, &Newton::default())?;
        let outer = design.quantizers()[0].breakpoints()[2];
        table.push(row![label, outer, design.value, design.system.value(MSE)?])?;
    }
    Ok(table)
}

/// Sensors, levels, crossover, known bound.
const LIMITS: [(usize, usize, f64, f64); 7] = [
    (2, 2, 0.0, 0.444_444_44),
    (2, 4, 0.0, 0.358_273_31),
    (2, 8, 0.0, 0.339_401_90),
    (9, 4, 0.0, 0.107_764_26),
    (2, 4, 0.001, 0.359_10),
    (2, 4, 0.01, 0.364_82),
    (2, 4, 0.05, 0.390_97),
];

fn limits() -> Result<Table, Error> {
    let mut table = Table::new([
        column("sensors", "", "equal sensors in unit noise"),
        column("levels", "", "levels of each"),
        column("crossover", "", "crossover probability of the bits"),
        column("ceo_bound", "", "least squared error of any codes within the channels' capacity"),
        column("van_trees", "", "van Trees bound of the design, clean channels only"),
        column("achieved", "", "squared error of the joint design, natural words"),
        column("unquantized", "", "squared error from samples"),
    ]);
    for (sensors, levels, crossover, _) in LIMITS {
        let scene = scene(&vec![1.0; sensors], 0.0)?;
        let flips = if crossover > 0.0 {
            -(crossover * crossover.log2() + (1.0 - crossover) * (-crossover).ln_1p() / std::f64::consts::LN_2)
        } else {
            0.0
        };
        let bits = (levels as f64).log2() * (1.0 - flips);
        let words: Vec<u32> = (0..levels as u32).collect();
        let group = Group::new(lloyd(levels, scene.sample_sd(0))?, bsc(&words, crossover)?, (0..sensors).collect())?;
        let best = design::joint(&System::new(scene, vec![group])?, MSE, &Newton::default())?;
        let trees = if crossover == 0.0 {
            Some(bounds::van_trees(&best.system)?)
        } else {
            None
        };
        let bound = bounds::ceo(1.0, &vec![1.0; sensors], &vec![bits; sensors])?;
        table.push(row![
            sensors,
            levels,
            crossover,
            bound,
            trees,
            best.value,
            1.0 / (1.0 + sensors as f64)
        ])?;
    }
    Ok(table)
}

fn effort() -> Result<Table, Error> {
    let mut table = Table::new([
        column("levels", "", "levels of one sensor in unit noise, from Lloyd-Max of the unknown"),
        column("newton", "", "iterations of Newton's method to 1e-12"),
        column("alternating", "", "steps of alternating maximisation until within 1e-8 of the same breakpoints"),
    ]);
    for levels in [4usize, 8] {
        let start = lloyd_system(&scene(&[1.0], 0.0)?, levels, |_| 1.0)?;
        let fast = design::joint(
            &start,
            MI,
            &Newton {
                tolerance: 1e-12,
                ..Newton::default()
            },
        )?;
        let limit = fast.quantizers();
        let (mut current, mut steps) = (start, 0usize);
        let far = |s: &System| {
            let pairs = s.groups()[0]
                .quantizer()
                .breakpoints()
                .iter()
                .zip(limit[0].breakpoints());
            claim::largest(pairs.map(|(a, b)| (a - b).abs())) > 1e-8
        };
        while far(&current) && steps < 1000 {
            current = current.with_quantizer(0, design::alternating_step(&current, 0, MI)?)?;
            steps += 1;
        }
        // The last iteration only confirms that the step vanished.
        table.push(row![levels, fast.iterations - 1, steps])?;
    }
    Ok(table)
}

fn grouping() -> Result<Table, Error> {
    let mut table = Table::new([
        column("levels", "", "levels of each of nine sensors in unit noise"),
        column("groups", "", "sizes of the groups that may differ"),
        column("criterion", "", "criterion"),
        column("value", "", "its value at the end"),
        column("identical", "", "its value with identical quantizers"),
        column("spread", "", "largest difference of the same breakpoint between groups"),
    ]);
    let scene = scene(&[1.0; 9], 0.0)?;
    for (levels, sizes) in [
        (4usize, vec![3usize, 3, 3]),
        (4, vec![5, 4]),
        (2, vec![3, 3, 3]),
        (2, vec![1; 9]),
    ] {
        for criterion in [MI, MSE] {
            let same = lloyd(levels, 1.4)?;
            let reference =
                design::joint(&System::identical(scene.clone(), same.clone())?, criterion, &Newton::default())?;
            let mut first = 0;
            let mut groups = Vec::new();
            for (g, size) in sizes.iter().enumerate() {
                // Pushed apart at the start: groups shifted and stretched differently.
                let shift = 0.5 * (g as f64 / (sizes.len() - 1) as f64 - 0.5);
                let quantizer = same.affine(shift, 1.0 + 0.4 * shift)?;
                groups.push(Group::new(quantizer, Channel::ideal(levels)?, (first..first + size).collect())?);
                first += size;
            }
            let end = design::joint(&System::new(scene.clone(), groups)?, criterion, &Newton::default())?;
            let quantizers = end.quantizers();
            let differences = quantizers.iter().flat_map(|q| {
                let pairs = q.breakpoints().iter().zip(quantizers[0].breakpoints());
                pairs.map(|(a, b)| (a - b).abs()).collect::<Vec<_>>()
            });
            let sizes = sizes.iter().map(usize::to_string).collect::<Vec<_>>().join("+");
            table.push(row![
                levels,
                sizes,
                name(criterion),
                end.value,
                reference.value,
                claim::largest(differences)
            ])?;
        }
    }
    Ok(table)
}

/// Everything the publication does not have.
pub struct Beyond;

impl Figure for Beyond {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-beyond",
            title: "Beyond the publication",
            caption: "Levels made of several intervals beat every contiguous design found once noise is shared or small: a quarter \
                      of the squared error at a noise of 0.3. With them: where identical quantizers lose their optimality, which \
                      words suit which channel, bounds that no design can beat, and the iterations each algorithm takes.",
            source: "",
        }
    }

    fn quicken(&self, p: &mut Parameters) {
        p.contiguous_starts = 8;
        p.folded_starts = 24;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        Ok(Tables::from(searches(p)?)
            .with("symmetry", thresholds()?)
            .with("words", words(p)?)
            .with("channels", channels()?)
            .with("bounds", limits()?)
            .with("effort", effort()?)
            .with("grouping", grouping()?))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        for s in &SEARCHES {
            let at = |cells: &str, column: &str| {
                let keys = [
                    ("case", Value::from(s.case)),
                    ("criterion", name(s.criterion).into()),
                    ("cells", cells.into()),
                ];
                cell(&tables.main, &keys, column)
            };
            let sense = s.criterion.sense();
            for (cells, known) in [("contiguous", s.contiguous), ("any", s.folded)] {
                let id = format!("{}-{}-{cells}", s.case, name(s.criterion));
                let what = format!("{}, {} cells: at least as good as the best known ({known})", s.case, cells);
                let gain = sense * (at(cells, "value")? - known);
                claims.push(Claim::at_least(id.clone(), what, gain, -2e-8).at_defaults());
                let what = "a local optimum, not a saddle";
                claims.push(Claim::below(format!("{id}-curvature"), what, at(cells, "curvature")?, 1e-8));
            }
            if s.rho == 0.0 {
                let above = at("any", "mse")? - at("any", "ceo_bound")?;
                claims.push(Claim::above(
                    format!("{}-{}-ceo", s.case, name(s.criterion)),
                    "above the CEO bound",
                    above,
                    0.0,
                ));
            }
        }
        let symmetry = tables.named("symmetry")?;
        for (varied, criterion, known) in THRESHOLDS {
            let found =
                cell(symmetry, &[("varied", varied.into()), ("criterion", name(criterion).into())], "threshold")?;
            let what = format!("{varied} at which two sign quantizers lose their optimality for {}", name(criterion));
            claims.push(exact(format!("symmetry-{varied}-{}", name(criterion)), what, found, known, 2e-8));
        }
        let words = tables.named("words")?;
        let winner = |crossover: f64, criterion: &str, kind: &str| -> Result<(String, f64), Error> {
            let rows = words.only("crossover", crossover)?.only("criterion", criterion)?;
            let rows = rows.only("sensors", kind)?.only("rank", 1usize)?;
            match (rows.texts("words")?.as_slice(), rows.numbers("value")?.as_slice()) {
                ([words], [value]) => Ok((words.clone(), *value)),
                _ => Err(Error::Table(format!("no best words at {crossover}"))),
            }
        };
        let (gray, natural, three) = ("0 1 3 2 | 0 1 3 2", "0 1 2 3 | 0 1 2 3", "0 1 3 | 0 1 3");
        for (crossover, criterion, best) in [
            (0.001, "mi", gray),
            (0.01, "mi", gray),
            (0.05, "mi", gray),
            (0.1, "mi", three),
            (0.2, "mi", three),
            (0.001, "mse", gray),
            (0.01, "mse", gray),
            (0.05, "mse", natural),
            (0.1, "mse", three),
            (0.2, "mse", three),
        ] {
            if p.crossovers.contains(&crossover) {
                let wrong = usize::from(winner(crossover, criterion, "same")?.0 != best);
                let what = format!("best words for {criterion} at {crossover}: {best}");
                claims.push(Claim::never(format!("words-{criterion}-{crossover}"), what, wrong));
            }
        }
        if p.crossovers.contains(&0.05) {
            for (criterion, sense) in [("mi", 1.0), ("mse", -1.0)] {
                let gain = sense * (winner(0.05, criterion, "mixed")?.1 - winner(0.05, criterion, "same")?.1);
                let what = "different words at the two sensors gain nothing at 0.05";
                claims.push(Claim::at_most(format!("mixed-{criterion}"), what, gain, 1e-10));
            }
        }
        if p.crossovers.contains(&0.1) {
            let found = winner(0.1, "mse", "same")?.1;
            claims.push(exact("three-words", "three words at 0.1: squared error", found, 0.560_803_08, 1e-8));
        }
        for (label, _, outer, mse) in other_channels()? {
            let at = |column: &str| cell(tables.named("channels")?, &[("channel", label.into())], column);
            claims.push(exact(
                format!("{label}-outer"),
                format!("{label}: outer breakpoint"),
                at("outer")?,
                outer,
                1e-7,
            ));
            claims.push(exact(format!("{label}-mse"), format!("{label}: squared error"), at("mse")?, mse, 1e-8));
        }
        let limits = tables.named("bounds")?;
        let mut crossed = 0;
        for ((sensors, levels, crossover, known), row) in LIMITS.iter().zip(limits.rows()) {
            let number = |at: usize| row[at].as_number().unwrap_or(f64::NEG_INFINITY);
            let what = format!("{sensors} sensors of {levels} levels, crossover {crossover}: CEO bound");
            let tolerance = if *crossover > 0.0 { 1e-5 } else { 1e-8 };
            claims.push(exact(format!("ceo-{sensors}-{levels}-{crossover}"), what, number(3), *known, tolerance));
            crossed += usize::from(number(5) <= number(3).max(number(4)));
        }
        claims.push(Claim::never("bounds", "no design beats a bound", crossed));
        for (levels, newton, alternating) in [(4usize, 5.0, 35.0), (8, 7.0, 137.0)] {
            let at = |column: &str| cell(tables.named("effort")?, &[("levels", levels.into())], column);
            claims.push(Claim::at_most(format!("newton-{levels}"), "Newton iterations", at("newton")?, newton));
            claims.push(exact(
                format!("alternating-{levels}"),
                "alternating steps",
                at("alternating")?,
                alternating,
                1.0,
            ));
        }
        let grouping = tables.named("grouping")?;
        let spread = claim::largest(grouping.numbers("spread")?);
        let what = "nine sensors, designed in groups from different starts, all return to one quantizer";
        claims.push(Claim::at_most("identical", what, spread, 1e-6));
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let rows = tables.main.only("criterion", "mse")?;
        let cases = rows.only("cells", "any")?.texts("case")?;
        let place = |i: usize| -(i as f64);
        let names = cases.iter().enumerate().map(|(i, c)| (place(i), c.clone()));
        let series = |cells: &str, column: &str| -> Result<Vec<(f64, f64)>, Error> {
            let at = rows.only("cells", cells)?;
            let column = at.points("value", column)?.into_iter().map(|p| p.1);
            Ok(column.enumerate().map(|(i, y)| (y, place(i))).collect())
        };
        let bound: Vec<(f64, f64)> = rows
            .only("cells", "any")?
            .rows()
            .iter()
            .enumerate()
            .filter_map(|(i, r)| Some((r[7].as_number()?, place(i))))
            .collect();
        let y = Axis::linear("").named(names).between(0.6 - cases.len() as f64, 0.6);
        let errors = Panel::new("best squared error found", Axis::linear("mean squared error"), y)
            .with(Layer::points("contiguous cells", series("contiguous", "mse")?))
            .with(Layer::points("any cells", series("any", "mse")?).marked(Marker::Triangle))
            .with(Layer::points("CEO bound", bound).marked(Marker::Cross))
            .legend(Legend::Outside);
        let folded = rows.only("cells", "any")?.only("case", "noise0.3-L4")?;
        Ok(Plot::grid(1, vec![errors, cells_panel(&folded)?]))
    }
}

/// The cells of both sensors of the only row, one lane a sensor, coloured by level.
fn cells_panel(row: &Table) -> Result<Panel, Error> {
    let reach = 3.0;
    let lanes = Axis::linear("")
        .named([(1.0, "sensor 1".to_owned()), (0.0, "sensor 2".to_owned())])
        .between(-0.6, 1.6);
    let x = Axis::linear("sample, in prior standard deviations").between(-reach, reach);
    let mut panel = Panel::new("levels of the best pair found at a noise of 0.3", x, lanes).legend(Legend::Outside);
    for level in 0..4usize {
        let mut boxes = Vec::new();
        for (lane, gamma, labels) in [(1.0, "gamma1", "labels1"), (0.0, "gamma2", "labels2")] {
            let numbers = |column: &str| -> Result<Vec<f64>, Error> {
                Ok(row
                    .texts(column)?
                    .join(" ")
                    .split(' ')
                    .filter_map(|t| t.parse().ok())
                    .collect())
            };
            let (edges, labels) = (numbers(gamma)?, numbers(labels)?);
            let edge = |i: usize| edges.get(i).copied().unwrap_or(reach).clamp(-reach, reach);
            for (c, label) in labels.iter().enumerate() {
                let left = if c == 0 { -reach } else { edge(c - 1) };
                if *label == level as f64 {
                    boxes.push((left, edge(c), lane - 0.35, lane + 0.35));
                }
            }
        }
        panel = panel.with(Layer::boxes(format!("level {level}"), boxes));
    }
    Ok(panel)
}
