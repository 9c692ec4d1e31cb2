//! Beyond the publication: folded cells, broken symmetry, words, bounds, effort.

use super::common::{MI, MSE, breakpoints, bsc, lloyd, lloyd_system, name, scene};
use crate::prelude::*;
use fewbits_core::Link;
use fewbits_quantizer_design::design::Design;
use fewbits_quantizer_design::{
    AllowedCells, Bits, Channel, Criterion, Newton, Quantizer, Request, Scene, SensorGroup, System, bounds, design,
    published,
};

parameters! {
    pub struct Parameters {
        /// Random starts among contiguous quantizers.
        #[garde(range(min = 1, max = 10_000))]
        contiguous_starts: usize = 20 => quick 8,
        /// Starts among folded quantizers, besides those with one sensor's cells running round or to and fro.
        #[garde(range(min = 1, max = 10_000))]
        folded_starts: usize = 60 => quick 24,
        /// Crossovers at which words are compared.
        #[garde(length(min = 1, max = 20), inner(range(min = 0.0, max = 0.45)))]
        crossovers: Vec<f64> = vec![0.001, 0.01, 0.05, 0.1, 0.2],
    }
}

rows! {
    pub struct Rows {
        /// Best designs found.
        searches: Vec<Search>,
        /// Where identical quantizers lose their optimality.
        symmetry: Vec<Threshold>,
        /// Words for a binary symmetric channel.
        words: Vec<Words>,
        /// Other channels.
        channels: Vec<Other>,
        /// Bounds.
        bounds: Vec<Limit>,
        /// Iterations of each algorithm.
        effort: Vec<Effort>,
        /// Groups of sensors that may differ.
        grouping: Vec<Grouping>,
    }

    struct Search {
        /// Noise, correlation and levels.
        case: &'static str,
        /// Criterion of the design.
        criterion: &'static str,
        /// Contiguous cells, or any.
        cells: &'static str,
        /// The criterion: nats, or prior variances.
        value: f64,
        /// Mutual information.
        mi_nats: f64 ["nat"],
        /// Squared error.
        mse: f64,
        /// Largest eigenvalue of the Hessian.
        curvature: f64,
        /// Least squared error of any codes at this rate, independent noise.
        ceo_bound: Option<f64>,
        /// Breakpoints of sensor 1.
        gamma1: String,
        /// Levels of its cells.
        labels1: String,
        /// Breakpoints of sensor 2.
        gamma2: String,
        /// Levels of its cells.
        labels2: String,
    }

    struct Threshold {
        /// Noise standard deviation (no correlation) or correlation (unit noise).
        varied: &'static str,
        /// Criterion.
        criterion: &'static str,
        /// Where two sign quantizers stop being a local optimum.
        threshold: f64,
    }

    struct Words {
        /// Crossover probability.
        crossover: f64,
        /// Criterion of the design.
        criterion: &'static str,
        /// Same words at both sensors, or mixed.
        sensors: &'static str,
        /// 1 is best.
        rank: usize,
        /// Words of the cells, left to right, sensors separated by a bar.
        words: String,
        /// The criterion: nats, or prior variances.
        value: f64,
        /// Squared error.
        mse: f64,
    }

    struct Other {
        /// Channel of both sensors.
        channel: &'static str,
        /// Outer breakpoint of the joint information design.
        outer: f64,
        /// Mutual information.
        mi_nats: f64 ["nat"],
        /// Squared error.
        mse: f64,
    }

    struct Limit {
        /// Equal sensors in unit noise.
        sensors: usize,
        /// Levels of each.
        levels: usize,
        /// Crossover probability of the bits.
        crossover: f64,
        /// Least squared error of any codes within the channels' capacity.
        ceo_bound: f64,
        /// Van Trees bound of the design, clean channels only.
        van_trees: Option<f64>,
        /// Squared error of the joint design, natural words.
        achieved: f64,
        /// Squared error from samples.
        unquantized: f64,
    }

    struct Effort {
        /// Levels of one sensor in unit noise, from Lloyd-Max of the unknown.
        levels: usize,
        /// Iterations of Newton's method to 1e-12.
        newton: usize,
        /// Steps of alternating maximisation until within 1e-8 of the same breakpoints.
        alternating: usize,
    }

    struct Grouping {
        /// Levels of each of nine sensors in unit noise.
        levels: usize,
        /// Sizes of the groups that may differ.
        groups: String,
        /// Criterion.
        criterion: &'static str,
        /// Its value at the end.
        value: f64,
        /// Its value with identical quantizers.
        identical: f64,
        /// Largest difference of the same breakpoint between groups.
        spread: f64,
    }
}

/// Case, levels, noise deviation, correlation, criteria.
const SEARCHES: [(&str, usize, f64, f64, &[Criterion]); 7] = [
    ("correlated-L4", 4, 1.0, 0.85, &[MI, MSE]),
    ("correlated-L2", 2, 1.0, 0.85, &[MI, MSE]),
    ("noise1-L4", 4, 1.0, 0.0, &[MI, MSE]),
    ("noise0.5-L4", 4, 0.5, 0.0, &[MSE]),
    ("noise0.3-L4", 4, 0.3, 0.0, &[MSE]),
    ("noise0.5-L2", 2, 0.5, 0.0, &[MSE]),
    ("noise0.3-L2", 2, 0.3, 0.0, &[MSE]),
];

fn signs(noise_sd: f64, rho: f64) -> Result<System, fewbits_quantizer_design::Error> {
    let noise = fewbits_quantizer_design::Noise::equicorrelated_with_deviations(&[noise_sd; 2], rho)?;
    let scene =
        fewbits_quantizer_design::Scene::new(fewbits_quantizer_design::Prior::gaussian_with_deviation(1.0)?, noise)?;
    System::ideal(scene, vec![Quantizer::new(vec![0.0])?; 2])
}

/// Numbers with blanks between them.
fn listed<T: ToString>(numbers: impl IntoIterator<Item = T>, by: &str) -> String {
    numbers.into_iter().map(|n| n.to_string()).collect::<Vec<_>>().join(by)
}

/// The best quantizers found when levels need not be intervals.
fn folded(scene: &Scene, levels: usize, criterion: Criterion, starts: usize) -> Result<Design, Error> {
    let request = Request::estimation(scene.clone(), Bits::Each(levels.ilog2()), Link::PERFECT)
        .with_cells(AllowedCells::Any)
        .with_starts(starts);
    let request = match criterion {
        Criterion::MutualInformation => request.by_information(),
        Criterion::MeanSquaredError | Criterion::BayesError => request,
    };
    // Newton's method stays where it is, and has the curvature.
    Ok(design::joint(request.run()?.best().system(), criterion, &Newton::default())?)
}

fn searches(p: &Parameters, context: &Context<'_>) -> Result<Vec<Search>, Error> {
    let mut rows = Vec::new();
    for (case, levels, noise_sd, rho, criteria) in SEARCHES {
        for &criterion in criteria {
            context.check()?;
            let scene = scene(&[noise_sd; 2], rho)?;
            let start = lloyd_system(&scene, levels, |n| scene.sample_deviation(n))?;
            let contiguous = design::multi_start(&start, criterion, p.contiguous_starts, 1, &Newton::default())?;
            let folded = folded(&scene, levels, criterion, p.folded_starts)?;
            let bits = (levels as f64).log2();
            let bound = match rho {
                0.0 => Some(bounds::ceo(scene.prior(), scene.noise(), &[bits; 2])?.distortion),
                _ => None,
            };
            for (cells, design) in [("contiguous", contiguous), ("any", folded)] {
                let q = design.quantizers();
                rows.push(Search {
                    case,
                    criterion: name(criterion),
                    cells,
                    value: design.value,
                    mi_nats: design.system.value(MI)?,
                    mse: design.system.value(MSE)?,
                    curvature: design.largest_curvature,
                    ceo_bound: bound,
                    gamma1: breakpoints(&q[0]),
                    labels1: listed(q[0].labels(), " "),
                    gamma2: breakpoints(&q[1]),
                    labels2: listed(q[1].labels(), " "),
                });
            }
        }
    }
    Ok(rows)
}

fn thresholds() -> Result<Vec<Threshold>, Error> {
    let mut rows = Vec::new();
    for (varied, criterion) in [("noise_sd", MI), ("noise_sd", MSE), ("rho", MI), ("rho", MSE)] {
        let threshold = match varied {
            "rho" => published::symmetry_breaking(0.1, 0.9, criterion, |rho| signs(1.0, rho)),
            _ => published::symmetry_breaking(0.2, 2.0, criterion, |sd| signs(sd, 0.0)),
        }?;
        rows.push(Threshold {
            varied,
            criterion: name(criterion),
            threshold,
        });
    }
    Ok(rows)
}

fn words(p: &Parameters, context: &Context<'_>) -> Result<Vec<Words>, Error> {
    let mut rows = Vec::new();
    let scene = scene(&[1.0; 2], 0.0)?;
    for &crossover in &p.crossovers {
        for criterion in [MI, MSE] {
            context.check()?;
            let kinds: &[_] = if crossover == 0.05 {
                &[("same", false), ("mixed", true)]
            } else {
                &[("same", false)]
            };
            for &(sensors, mixed) in kinds {
                let found = published::assign_words(
                    &scene,
                    2,
                    crossover,
                    2..=4,
                    criterion,
                    if mixed {
                        published::Words::PerSensor
                    } else {
                        published::Words::Shared
                    },
                )?;
                for (rank, assignment) in found.iter().enumerate().take(if mixed { 5 } else { usize::MAX }) {
                    rows.push(Words {
                        crossover,
                        criterion: name(criterion),
                        sensors,
                        rank: rank + 1,
                        words: listed(assignment.words.iter().map(|w| listed(w, " ")), " | "),
                        value: assignment.design.value,
                        mse: assignment.design.system.value(MSE)?,
                    });
                }
            }
        }
    }
    Ok(rows)
}

fn channels() -> Result<Vec<Other>, Error> {
    let mut rows = Vec::new();
    let scene = scene(&[1.0; 2], 0.0)?;
    let erasure = Channel::symbol_erasure(4, 0.1)?;
    for (label, channel) in [
        ("erasure 0.1", erasure),
        ("4-PAM 10 dB", Channel::pulse_amplitude(4, 10.0)?),
    ] {
        let start = lloyd_system(&scene, 4, |_| 1.4)?.with_channels(vec![channel; 2])?;
        let design = design::joint(&start, MI, &Newton::default())?;
        let (outer, mse) = (design.quantizers()[0].breakpoints()[2], design.system.value(MSE)?);
        rows.push(Other {
            channel: label,
            outer,
            mi_nats: design.value,
            mse,
        });
    }
    Ok(rows)
}

fn limits() -> Result<Vec<Limit>, Error> {
    let mut rows = Vec::new();
    let settings = [
        (2, 2, 0.0),
        (2, 4, 0.0),
        (2, 8, 0.0),
        (9, 4, 0.0),
        (2, 4, 0.001),
        (2, 4, 0.01),
        (2_usize, 4_usize, 0.05_f64),
    ];
    for (sensors, levels, crossover) in settings {
        let scene = scene(&vec![1.0; sensors], 0.0)?;
        let flips = if crossover > 0.0 {
            -(crossover * crossover.log2() + (1.0 - crossover) * (-crossover).ln_1p() / std::f64::consts::LN_2)
        } else {
            0.0
        };
        let bits = (levels as f64).log2() * (1.0 - flips);
        let words: Vec<u32> = (0..levels as u32).collect();
        let group = SensorGroup::new(
            lloyd(levels, scene.sample_deviation(0))?,
            bsc(&words, crossover)?,
            (0..sensors).collect(),
        )?;
        let best = design::joint(&System::new(scene, vec![group])?, MSE, &Newton::default())?;
        rows.push(Limit {
            sensors,
            levels,
            crossover,
            ceo_bound: bounds::ceo(best.system.scene().prior(), best.system.scene().noise(), &vec![bits; sensors])?
                .distortion,
            van_trees: if crossover == 0.0 {
                Some(bounds::bayesian_cramer_rao(&best.system)?)
            } else {
                None
            },
            achieved: best.value,
            unquantized: 1.0 / (1.0 + sensors as f64),
        });
    }
    Ok(rows)
}

/// Largest difference between two lists of breakpoints.
fn apart(a: &Quantizer, b: &Quantizer) -> f64 {
    a.breakpoints()
        .iter()
        .zip(b.breakpoints())
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max)
}

fn effort() -> Result<Vec<Effort>, Error> {
    let mut rows = Vec::new();
    for levels in [4, 8] {
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
        let (mut current, mut alternating) = (start, 0);
        while apart(current.groups()[0].quantizer(), &limit[0]) > 1e-8 && alternating < 1000 {
            current = current.with_quantizer(0, published::alternating_step(&current, 0, MI)?)?;
            alternating += 1;
        }
        // The last iteration only confirms that the step vanished.
        rows.push(Effort {
            levels,
            newton: fast.iterations - 1,
            alternating,
        });
    }
    Ok(rows)
}

fn grouping() -> Result<Vec<Grouping>, Error> {
    let mut rows = Vec::new();
    let scene = scene(&[1.0; 9], 0.0)?;
    for (levels, sizes) in [(4, vec![3, 3, 3]), (4, vec![5, 4]), (2, vec![3, 3, 3]), (2, vec![1; 9])] {
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
                groups.push(SensorGroup::new(quantizer, Channel::ideal(levels)?, (first..first + size).collect())?);
                first += size;
            }
            let end = design::joint(&System::new(scene.clone(), groups)?, criterion, &Newton::default())?;
            let quantizers = end.quantizers();
            rows.push(Grouping {
                levels,
                groups: listed(&sizes, "+"),
                criterion: name(criterion),
                value: end.value,
                identical: reference.value,
                spread: quantizers.iter().map(|q| apart(q, &quantizers[0])).fold(0.0, f64::max),
            });
        }
    }
    Ok(rows)
}

/// Everything the publication does not have.
pub struct Beyond;

impl Figure for Beyond {
    figure!(Parameters => Rows, "mi-beyond", "Beyond the publication", "",
        "Levels made of several intervals beat every contiguous design found once noise is shared or small: a quarter \
         of the squared error at a noise of 0.3. With them: where identical quantizers lose their optimality, which \
         words suit which channel, bounds that no design can beat, and the iterations each algorithm takes.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        Ok(Rows {
            searches: searches(p, context)?,
            symmetry: thresholds()?,
            words: words(p, context)?,
            channels: channels()?,
            bounds: limits()?,
            effort: effort()?,
            grouping: grouping()?,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let found = || rows.searches.iter();
        let key = |s: &Search| format!("{} {} {}", s.case, s.criterion, s.cells);
        claims.references("value", "the best value known", found(), |s| (key(s), s.value));
        claims.all("curvature", "local optima, not saddles", found(), |s| s.curvature < 1e-8);
        let bounded = found().filter_map(|s| Some((s.mse, s.ceo_bound?)));
        claims.all("ceo", "no search beats the bound for any codes", bounded, |(mse, bound)| mse > bound);
        let what = "where two sign quantizers lose their optimality";
        claims.references("symmetry", what, &rows.symmetry, |t| (format!("{} {}", t.varied, t.criterion), t.threshold));
        let best = |crossover: f64, criterion: &str, sensors: &str| {
            let own = |w: &&Words| (w.crossover, w.criterion, w.sensors, w.rank) == (crossover, criterion, sensors, 1);
            rows.words.iter().find(own)
        };
        let expected = |crossover: f64, criterion: &str| match criterion {
            _ if crossover > 0.06 => "0 1 3 | 0 1 3",
            "mse" if crossover == 0.05 => "0 1 2 3 | 0 1 2 3",
            _ => "0 1 3 2 | 0 1 3 2",
        };
        for criterion in ["mi", "mse"] {
            let what = format!(
                "best words for {criterion}: Gray at small crossovers{}, three words above",
                if criterion == "mse" { ", natural at 0.05" } else { "" }
            );
            here.all(format!("words-{criterion}"), what, &p.crossovers, |c| {
                best(*c, criterion, "same").is_some_and(|w| w.words == expected(*c, criterion))
            });
            let sense = if criterion == "mi" { 1.0 } else { -1.0 };
            let gain = best(0.05, criterion, "mixed").zip(best(0.05, criterion, "same"));
            let what = "different words at the two sensors gain nothing at 0.05";
            let gain = gain.map(|(mixed, same)| sense * (mixed.value - same.value));
            claims.at_most(format!("mixed-{criterion}"), what, gain, 1e-10);
        }
        let three = best(0.1, "mse", "same").map(|w| w.value);
        claims.references("three-words", "three words: squared error", [three], |value| ("0.1".to_owned(), value));
        claims.references("outer", "outer breakpoint", &rows.channels, |c| (c.channel.to_owned(), c.outer));
        claims.references("mse", "squared error", &rows.channels, |c| (c.channel.to_owned(), c.mse));
        let key = |l: &Limit| format!("{} sensors {} levels {}", l.sensors, l.levels, l.crossover);
        claims.references("bound", "bound for any codes", &rows.bounds, |l| (key(l), l.ceo_bound));
        claims.all("bounds", "no design beats a bound", &rows.bounds, |l| {
            l.achieved > l.ceo_bound && l.van_trees.is_none_or(|bound| l.achieved > bound)
        });
        claims.references("newton", "Newton iterations", &rows.effort, |e| (e.levels.to_string(), e.newton as f64));
        let what = "alternating steps";
        claims.references("alternating", what, &rows.effort, |e| (e.levels.to_string(), e.alternating as f64));
        let what = "nine sensors, designed in groups from different starts, all return to one quantizer";
        claims.all("identical", what, &rows.grouping, |g| g.spread <= 1e-6);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let of = |cells: &'static str| select(&rows.searches, move |s| s.criterion == "mse" && s.cells == cells);
        let title = |s: &Search| {
            let words = [
                ("noise", "noise "),
                ("correlated", "correlation 0.85"),
                ("-L", ", levels "),
            ];
            words
                .iter()
                .fold(s.case.to_owned(), |text, (code, word)| text.replace(code, word))
        };
        let y = Axis::ladder(of("any").map(title));
        let place = |value: fn(&Search) -> Option<f64>, cells| {
            of(cells)
                .enumerate()
                .filter_map(|(i, s)| Some((value(s)?, -(i as f64))))
                .collect::<Vec<_>>()
        };
        let errors = Panel::new("Best squared error found", Axis::linear("mean squared error / prior variances"), y)
            .with(Layer::points("contiguous cells", place(|s| Some(s.mse), "contiguous")))
            .with(Layer::points("any cells", place(|s| Some(s.mse), "any")).marked(Marker::Triangle))
            .with(Layer::points("bound for any codes", place(|s| s.ceo_bound, "any")).marked(Marker::Cross));
        let folded = of("any").find(|s| s.case == "noise0.3-L4");
        Plot::grid(2, [errors].into_iter().chain(folded.map(cells_panel)).collect())
    }
}

/// The cells of both sensors, one lane each, by level.
fn cells_panel(search: &Search) -> Panel {
    let reach = 3.0;
    let lanes = Axis::linear("")
        .named([(1.0, "sensor 1".to_owned()), (0.0, "sensor 2".to_owned())])
        .between(-0.6, 1.6);
    let x = Axis::linear("sample / prior deviations").between(-reach, reach);
    let mut panel = Panel::new("Levels of the best pair at a noise of 0.3", x, lanes);
    let numbers = |text: &str| {
        text.split(' ')
            .filter_map(|t| t.parse::<f64>().ok())
            .collect::<Vec<_>>()
    };
    let (mut boxes, mut texts) = (vec![Vec::new(); 4], Vec::new());
    for (lane, gamma, labels) in [
        (1.0, &search.gamma1, &search.labels1),
        (0.0, &search.gamma2, &search.labels2),
    ] {
        let edges = numbers(gamma);
        let edge = |i: usize| edges.get(i).copied().unwrap_or(reach).clamp(-reach, reach);
        for (c, label) in numbers(labels).into_iter().enumerate() {
            let (left, right) = (if c == 0 { -reach } else { edge(c - 1) }, edge(c));
            boxes[label as usize % 4].push((left, right, lane - 0.35, lane + 0.35));
            texts.push((0.5 * (left + right), lane, label.to_string()));
        }
    }
    for (level, boxes) in boxes.into_iter().enumerate() {
        panel = panel.with(Layer::boxes(format!("level {level}"), boxes).coloured([5, 4, 3, 7][level]));
    }
    panel.with(Layer::texts(texts))
}
