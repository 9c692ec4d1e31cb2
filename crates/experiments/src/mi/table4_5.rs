//! Table 4.5: words over a binary symmetric channel, and what a wrong assumption about it costs.

use super::common::{MI, MSE, Pair, lloyd_system, odd, over_bsc, scene};
use crate::prelude::*;
use fewbits_baselines::quantizer_design as baselines;
use fewbits_quantizer_design::{Newton, System, design};

/// Name, title and words of the four levels.
const LABELLINGS: [(&str, &str, [u32; 4]); 3] = [
    ("natural", "Natural words", [0, 1, 2, 3]),
    ("gray", "Gray words", [0, 1, 3, 2]),
    ("third", "Third assignment", [0, 3, 1, 2]),
];

/// Crossovers and printed outer breakpoints.
const PRINTED: [(f64, f64); 4] = [(0.0, 1.370), (0.001, 1.358), (0.01, 1.260), (0.05, 0.973)];

parameters! {
    pub struct Parameters {
        /// Crossover probabilities; beyond 0.06 a design of four levels loses a cell.
        crossovers: Vec<f64> [0.0..=0.06; 1..=100] = PRINTED.map(|p| p.0).to_vec(),
        noise_sd: f64 [1e-2..=1e2] = 1.0 => "Noise standard deviation, in prior standard deviations.",
    }
}

impl Parameters {
    fn start(&self, words: &[u32], crossover: f64) -> Result<System, Error> {
        over_bsc(&lloyd_system(&scene(&[self.noise_sd; 2], 0.0)?, 4, |_| 1.2)?, words, crossover)
    }

    fn printed(&self, key: String) -> Option<f64> {
        reference::value(&key).filter(|_| self.noise_sd == 1.0)
    }
}

rows! {
    pub struct Row by "{crossover} {labelling} {design}" {
        crossover: f64 => "Crossover probability of each bit.",
        labelling: &'static str => "Words of the levels.",
        design: &'static str => "Criterion and how it was reached.",
        pair: Pair,
    }
}

pub struct Table45;

impl Figure for Table45 {
    figure!(Parameters => Vec<Row>, "mi-table4-5", "Words over a binary symmetric channel", "thesis, Table 4.5",
        "Two sensors of four levels whose two-bit words cross a binary symmetric channel. With natural words the \
         breakpoints shrink as the channel gets worse, as printed; with Gray words they hardly move. At a crossover \
         of 0.05 information prefers Gray words and squared error natural ones.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        let newton = Newton::default();
        for &crossover in &p.crossovers {
            for (labelling, _, words) in LABELLINGS {
                context.check()?;
                let mut push = |design, pair: Pair| {
                    let key = format!("mi-table4-5/printed/{crossover} {labelling} {design}");
                    let pair = pair.beside(p.printed(key));
                    rows.push(Row {
                        crossover,
                        labelling,
                        design,
                        pair,
                    });
                };
                let start = p.start(&words, crossover)?;
                for (criterion, greedy, both) in [(MI, "mi-greedy", "mi-joint"), (MSE, "mse-greedy", "mse-joint")] {
                    push(greedy, Pair::of(&baselines::greedy(&start, &[0, 1], criterion, &newton)?[1].system)?);
                    push(both, Pair::joint(&design::joint(&start, criterion, &newton)?)?);
                }
                if let Some((_, outer)) = PRINTED.iter().find(|print| print.0 == crossover) {
                    push("printed", Pair::of(&odd(&start, [&[*outer]; 2])?)?);
                }
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.keyed("printed", "printed error, natural words, three digits", rows, |r| r.pair.mse);
        let at = |crossover: f64, labelling: &str, design: &str| {
            first(rows, |r| (r.crossover, r.labelling, r.design) == (crossover, labelling, design)).map(|r| &r.pair)
        };
        let what = "the printed breakpoint exceeds the joint optimum of natural words by 0.5 to 1.1 % (erratum mi-14)";
        here.all("excess", what, PRINTED, |(crossover, outer)| {
            at(crossover, "natural", "mi-joint").is_some_and(|d| (0.0045..=0.0115).contains(&(outer / d.outer2 - 1.0)))
        });
        let what = "Gray words move the breakpoint by 0.4 % only, so the printed table is not Gray's (erratum mi-14)";
        let gray = at(0.05, "gray", "mi-joint").zip(at(0.0, "gray", "mi-joint"));
        here.at_most("gray-still", what, gray.map(|(a, b)| (a.outer2 / b.outer2 - 1.0).abs()), 0.0045);
        let information = ["natural", "gray"].map(|words| at(0.05, words, "mi-joint").map(|d| d.mi_nats));
        here.increasing("mi-prefers-gray", "at 0.05 information prefers Gray words", information);
        let what =
            "at 0.05 squared error prefers natural words: the designs are not application-independent (erratum mi-12)";
        let error = ["natural", "gray"].map(|words| at(0.05, words, "mse-joint").map(|d| d.mse));
        here.increasing("mse-prefers-natural", what, error);
        let third = at(0.05, "third", "mse-joint").zip(at(0.05, "gray", "mse-joint"));
        here.above("third-worst", "the third assignment is much worse", third.map(|(a, b)| a.mse - b.mse), 0.04);
        let natural = select(rows, |r| r.labelling == "natural" && r.design == "mi-joint");
        here.increasing("worse", "errors grow with the crossover", natural.map(|r| r.pair.mse));
    }

    fn plot(&self, _: &Parameters, rows: &Vec<Row>) -> Plot {
        let panel = |title, axis: &str, value: fn(&Pair) -> f64, printed: fn(&Pair) -> Option<f64>| {
            let lines = LABELLINGS.iter().enumerate().flat_map(|(i, (labelling, title, _))| {
                let own = select(rows, |r| r.labelling == *labelling && r.design == "mi-joint");
                Layer::marked_line(*title, i, points(own, |r| (r.crossover, value(&r.pair))))
            });
            let print = select(rows, |r| r.labelling == "natural" && r.design == "printed");
            let print = points(print, |r| (r.crossover, printed(&r.pair)));
            Panel::linear(title, "crossover probability", axis)
                .with_all(lines)
                .with(Layer::points("printed", print).styled(6, Marker::Cross))
        };
        let [breakpoint, error] = [
            "outer breakpoint / prior deviations",
            "mean squared error / prior variances",
        ];
        let breakpoints = panel("Information designs", breakpoint, |d| d.outer2, |d| Some(d.outer2));
        let errors = panel("Their squared error", error, |d| d.mse, |d| d.printed_mse);
        Plot::grid(2, vec![breakpoints, errors])
    }
}

rows! {
    pub struct Mismatches {
        rows: Vec<Met> => "Designs for one channel on another.",
        printed: Vec<AtPrinted> => "The printed design for a clean channel at a crossover of 0.05.",
    }

    struct Met by "{labelling} {designed_for} {true_crossover}" {
        labelling: &'static str => "Words of the levels.",
        designed_for: f64 => "Crossover of the design.",
        true_crossover: f64 => "Crossover met.",
        mse: f64 => "Squared error.",
        mi_nats: f64 ["nat"] => "Mutual information.",
        printed_mse: Option<f64> => "The publication's value, printed breakpoints.",
    }

    struct AtPrinted by "{labelling}" {
        labelling: &'static str => "Words of the levels.",
        mse: f64 => "Squared error of the printed design for a clean channel at a crossover of 0.05.",
    }
}

pub struct Mismatch;

impl Figure for Mismatch {
    figure!(Parameters => Mismatches, "mi-table4-5-mismatch", "Designed for one channel, used on another", "thesis, Table 4.5 and text",
        "Squared error when the joint information design for one crossover meets another (the decoder knows the true \
         one). Designing for a clean channel costs 2.6 % at a crossover of 0.05 with natural words and nothing with \
         Gray words.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Mismatches, Error> {
        let (mut rows, mut printed) = (Vec::new(), Vec::new());
        for (labelling, _, words) in LABELLINGS {
            for &designed_for in &p.crossovers {
                context.check()?;
                let design = design::joint(&p.start(&words, designed_for)?, MI, &Newton::default())?;
                for &true_crossover in &p.crossovers {
                    let met = over_bsc(&design.system, &words, true_crossover)?;
                    let key = format!("mi-table4-5-mismatch/printed/{labelling} {designed_for} {true_crossover}");
                    rows.push(Met {
                        labelling,
                        designed_for,
                        true_crossover,
                        mse: met.value(MSE)?,
                        mi_nats: met.value(MI)?,
                        printed_mse: p.printed(key),
                    });
                }
            }
            let mse = odd(&p.start(&words, 0.05)?, [&[1.37]; 2])?.value(MSE)?;
            printed.push(AtPrinted { labelling, mse });
        }
        Ok(Mismatches { rows, printed })
    }

    fn claims(&self, p: &Parameters, tables: &Mismatches, claims: &mut Claims) {
        let here = claims.at_defaults();
        let natural = select(&tables.printed, |r| r.labelling == "natural");
        let what = "the printed 0.497 is natural words' value at the printed breakpoints to 0.3 %";
        claims.references("printed", what, natural, |r| (format!("{} 0 0.05", r.labelling), r.mse));
        for (labelling, matched) in [("natural", &[0.0, 0.01, 0.05][..]), ("gray", &[0.0, 0.05])] {
            let least_is_matched = |truth: f64| {
                let best = tables.met(labelling, truth).min_by(|a, b| a.mse.total_cmp(&b.mse));
                best.is_some_and(|best| best.designed_for == truth)
            };
            let what = format!(
                "{labelling} words: the matched design has the least squared error at {matched:?} and nowhere else"
            );
            here.all(format!("{labelling}-diagonal"), what, &p.crossovers, |c| {
                least_is_matched(*c) == matched.contains(c)
            });
        }
    }

    fn plot(&self, p: &Parameters, tables: &Mismatches) -> Plot {
        let panel = |(labelling, title, _): (&'static str, &str, [u32; 4])| {
            let lines = p.crossovers.iter().enumerate().flat_map(|(i, designed)| {
                let excess = |(place, truth): (usize, &f64)| {
                    let met = || tables.met(labelling, *truth);
                    let least = met().map(|r| r.mse).fold(f64::INFINITY, f64::min);
                    let own = met().find(|r| r.designed_for == *designed)?;
                    Some((place as f64, 100.0 * (own.mse / least - 1.0)))
                };
                let line = p.crossovers.iter().enumerate().filter_map(excess).collect();
                Layer::marked_line(format!("designed for {designed}"), i, line)
            });
            let places = (0..).map(f64::from).zip(p.crossovers.iter().map(f64::to_string));
            let x = Axis::linear("true crossover probability").named(places);
            Panel::new(title, x, Axis::linear("excess squared error / %")).with_all(lines)
        };
        Plot::grid(2, LABELLINGS.map(panel).to_vec())
    }
}

impl Mismatches {
    /// The designs for these words at a true crossover.
    fn met(&self, labelling: &'static str, truth: f64) -> impl Iterator<Item = &Met> {
        select(&self.rows, move |r| r.labelling == labelling && r.true_crossover == truth)
    }
}
