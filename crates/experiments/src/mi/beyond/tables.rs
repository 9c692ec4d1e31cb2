//! The tables of `mi-beyond`, each with what computes it.

use crate::mi::common::{MI, MSE, breakpoints, bsc, lloyd, lloyd_system, name, scene};
use crate::prelude::*;
use fewbits_core::Link;
use fewbits_quantizer_design::design::Design;
use fewbits_quantizer_design::{
    AllowedCells, Bits, Channel, Criterion, Newton, ObservationModel, Quantizer, Request, SensorGroup, System, bounds,
    design, published,
};

parameters! {
    pub struct Parameters {
        pub(super) contiguous_starts: usize [1..=10_000] = 20 => quick 8 => "Random starts among contiguous quantizers.",
        pub(super) folded_starts: usize [1..=10_000] = 60 => quick 24 => "Starts among folded quantizers, besides those with one sensor's cells running round or to and fro.",
        /// Crossovers at which words are compared.
        pub(super) crossovers: Vec<f64> [0.0..=0.45; 1..=20] = vec![0.001, 0.01, 0.05, 0.1, 0.2],
    }
}

rows! {
    pub struct Rows {
        pub(super) searches: Vec<Search> => "Best designs found.",
        pub(super) symmetry: Vec<Threshold> => "Where identical quantizers lose their optimality.",
        pub(super) words: Vec<Words> => "Words for a binary symmetric channel.",
        pub(super) channels: Vec<Other> => "Other channels.",
        pub(super) bounds: Vec<Limit> => "Bounds.",
        pub(super) effort: Vec<Effort> => "Iterations of each algorithm.",
        pub(super) grouping: Vec<Grouping> => "Groups of sensors that may differ.",
    }

    pub(super) struct Search by "{case} {criterion} {cells}" {
        pub(super) case: &'static str => "Noise, correlation and levels.",
        pub(super) criterion: &'static str => "Criterion of the design.",
        pub(super) cells: &'static str => "Contiguous cells, or any.",
        pub(super) value: f64 => "The criterion: nats, or prior variances.",
        pub(super) mi_nats: f64 ["nat"] => "Mutual information.",
        pub(super) mse: f64 => "Squared error.",
        pub(super) curvature: f64 => "Largest eigenvalue of the Hessian.",
        pub(super) ceo_bound: Option<f64> => "Least squared error of any codes at this rate, independent noise.",
        pub(super) gamma1: String => "Breakpoints of sensor 1.",
        pub(super) labels1: String => "Levels of its cells.",
        pub(super) gamma2: String => "Breakpoints of sensor 2.",
        pub(super) labels2: String => "Levels of its cells.",
    }

    pub(super) struct Threshold by "{varied} {criterion}" {
        pub(super) varied: &'static str => "Noise standard deviation (no correlation) or correlation (unit noise).",
        pub(super) criterion: &'static str => "Criterion.",
        pub(super) threshold: f64 => "Where two sign quantizers stop being a local optimum.",
    }

    pub(super) struct Words {
        pub(super) crossover: f64 => "Crossover probability.",
        pub(super) criterion: &'static str => "Criterion of the design.",
        pub(super) sensors: &'static str => "Same words at both sensors, or mixed.",
        pub(super) rank: usize => "1 is best.",
        pub(super) words: String => "Words of the cells, left to right, sensors separated by a bar.",
        pub(super) value: f64 => "The criterion: nats, or prior variances.",
        pub(super) mse: f64 => "Squared error.",
    }

    pub(super) struct Other by "{channel}" {
        pub(super) channel: &'static str => "Channel of both sensors.",
        pub(super) outer: f64 => "Outer breakpoint of the joint information design.",
        pub(super) mi_nats: f64 ["nat"] => "Mutual information.",
        pub(super) mse: f64 => "Squared error.",
    }

    pub(super) struct Limit by "{sensors} sensors {levels} levels {crossover}" {
        pub(super) sensors: usize => "Equal sensors in unit noise.",
        pub(super) levels: usize => "Levels of each.",
        pub(super) crossover: f64 => "Crossover probability of the bits.",
        pub(super) ceo_bound: f64 => "Least squared error of any codes within the channels' capacity.",
        pub(super) van_trees: Option<f64> => "Van Trees bound of the design, clean channels only.",
        pub(super) achieved: f64 => "Squared error of the joint design, natural words.",
        pub(super) unquantized: f64 => "Squared error from samples.",
    }

    pub(super) struct Effort by "{levels}" {
        pub(super) levels: usize => "Levels of one sensor in unit noise, from Lloyd-Max of the unknown.",
        pub(super) newton: usize => "Iterations of Newton's method to 1e-12.",
        pub(super) alternating: usize => "Steps of alternating maximisation until within 1e-8 of the same breakpoints.",
    }

    pub(super) struct Grouping {
        pub(super) levels: usize => "Levels of each of nine sensors in unit noise.",
        pub(super) groups: String => "Sizes of the groups that may differ.",
        pub(super) criterion: &'static str => "Criterion.",
        pub(super) value: f64 => "Its value at the end.",
        pub(super) identical: f64 => "Its value with identical quantizers.",
        pub(super) spread: f64 => "Largest difference of the same breakpoint between groups.",
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
    let scene = ObservationModel::new(fewbits_quantizer_design::Prior::gaussian_with_deviation(1.0)?, noise)?;
    System::ideal(scene, vec![Quantizer::new(vec![0.0])?; 2])
}

/// The best quantizers found when levels need not be intervals.
fn folded(scene: &ObservationModel, levels: usize, criterion: Criterion, starts: usize) -> Result<Design, Error> {
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

pub(super) fn searches(p: &Parameters, context: &Context<'_>) -> Result<Vec<Search>, Error> {
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
                    labels1: joined(q[0].labels(), " "),
                    gamma2: breakpoints(&q[1]),
                    labels2: joined(q[1].labels(), " "),
                });
            }
        }
    }
    Ok(rows)
}

pub(super) fn thresholds() -> Result<Vec<Threshold>, Error> {
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

pub(super) fn words(p: &Parameters, context: &Context<'_>) -> Result<Vec<Words>, Error> {
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
                        words: joined(assignment.words.iter().map(|w| joined(w, " ")), " | "),
                        value: assignment.design.value,
                        mse: assignment.design.system.value(MSE)?,
                    });
                }
            }
        }
    }
    Ok(rows)
}

pub(super) fn channels() -> Result<Vec<Other>, Error> {
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

pub(super) fn limits() -> Result<Vec<Limit>, Error> {
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
            ceo_bound: bounds::ceo(best.system.model().prior(), best.system.model().noise(), &vec![bits; sensors])?
                .distortion,
            van_trees: (crossover == 0.0)
                .then(|| bounds::bayesian_cramer_rao(&best.system))
                .transpose()?,
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

pub(super) fn effort() -> Result<Vec<Effort>, Error> {
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

pub(super) fn grouping() -> Result<Vec<Grouping>, Error> {
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
                groups: joined(&sizes, "+"),
                criterion: name(criterion),
                value: end.value,
                identical: reference.value,
                spread: quantizers.iter().map(|q| apart(q, &quantizers[0])).fold(0.0, f64::max),
            });
        }
    }
    Ok(rows)
}
