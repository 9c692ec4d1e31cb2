//! Table 4.5: words over a binary symmetric channel, and what a wrong assumption about it costs.

use super::common::{MI, MSE, Pair, bsc, lloyd_system, odd, scene};
use crate::prelude::*;
use crate::reference;
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
        /// Crossover probabilities; beyond 0.06 a design of four levels loses a cell (see mi-beyond).
        crossovers: Vec<f64> [0.0..=0.06; 1..=100] = PRINTED.map(|p| p.0).to_vec(),
        noise_sd: f64 [1e-2..=1e2] = 1.0 => "Noise standard deviation, in prior standard deviations.",
    }
}

impl Parameters {
    fn start(&self, words: &[u32], crossover: f64) -> Result<System, Error> {
        let channel = bsc(words, crossover)?;
        Ok(lloyd_system(&scene(&[self.noise_sd; 2], 0.0)?, 4, |_| 1.2)?.with_channels(vec![channel; 2])?)
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
        printed_mse: Option<f64> => "The publication's squared error.",
    }
}

/// Table 4.5.
pub struct Table45;

impl Figure for Table45 {
    figure!(Parameters => Vec<Row>, "mi-table4-5", "Words over a binary symmetric channel", "thesis, Table 4.5",
        "Two sensors of four levels whose two-bit words cross a binary symmetric channel. With natural words the \
         breakpoints shrink as the channel gets worse, as printed; with Gray words they hardly move. At a crossover \
         of 0.05 information prefers Gray words and squared error natural ones.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let mut rows = Vec::new();
        for &crossover in &p.crossovers {
            for (labelling, _, words) in &LABELLINGS {
                context.check()?;
                let mut push = |design, pair| {
                    let printed_mse = p.printed(format!("mi-table4-5/printed/{crossover} {labelling} {design}"));
                    rows.push(Row {
                        crossover,
                        labelling,
                        design,
                        pair,
                        printed_mse,
                    });
                };
                let start = p.start(words, crossover)?;
                for (criterion, greedy, both) in [(MI, "mi-greedy", "mi-joint"), (MSE, "mse-greedy", "mse-joint")] {
                    let chain = design::greedy(&start, &[0, 1], criterion, &Newton::default())?;
                    push(greedy, Pair::of(&chain[1].system)?);
                    push(both, Pair::joint(&design::joint(&start, criterion, &Newton::default())?)?);
                }
                if let Some((_, outer)) = PRINTED.iter().find(|print| print.0 == crossover) {
                    push("printed", Pair::of(&start.with_quantizers(vec![odd(&[*outer])?; 2])?)?);
                }
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        claims.keyed("mse", "squared error", rows, |r| r.pair.mse);
        claims.keyed("outer2", "outer breakpoint", rows, |r| r.pair.outer2);
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
        let panel = |title: &str, axis: &str, value: fn(&Row) -> f64, printed: fn(&Row) -> Option<f64>| {
            let lines = LABELLINGS.iter().enumerate().flat_map(|(i, (labelling, title, _))| {
                let own = select(rows, |r| r.labelling == *labelling && r.design == "mi-joint");
                let line = points(own, |r| (r.crossover, value(r)));
                [
                    Layer::line(*title, line.clone()).coloured(i),
                    Layer::points("", line).coloured(i),
                ]
            });
            let print = select(rows, |r| r.labelling == "natural" && r.design == "printed");
            Panel::linear(title, "crossover probability", axis)
                .with_all(lines)
                .with(Layer::points("printed", points(print, |r| (r.crossover, printed(r)))).styled(6, Marker::Cross))
        };
        Plot::grid(
            2,
            vec![
                panel(
                    "Information designs",
                    "outer breakpoint / prior deviations",
                    |r| r.pair.outer2,
                    |r| Some(r.pair.outer2),
                ),
                panel("Their squared error", "mean squared error / prior variances", |r| r.pair.mse, |r| r.printed_mse),
            ],
        )
    }
}

rows! {
    /// All tables of the mismatch matrix.
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

/// The mismatch matrix of Table 4.5.
pub struct Mismatch;

impl Figure for Mismatch {
    figure!(Parameters => Mismatches, "mi-table4-5-mismatch", "Designed for one channel, used on another", "thesis, Table 4.5 and text",
        "Squared error when the joint information design for one crossover meets another (the decoder knows the true \
         one). Designing for a clean channel costs 2.6 % at a crossover of 0.05 with natural words and nothing with \
         Gray words.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Mismatches, Error> {
        let (mut rows, mut printed) = (Vec::new(), Vec::new());
        for (labelling, _, words) in &LABELLINGS {
            for &designed_for in &p.crossovers {
                context.check()?;
                let design = design::joint(&p.start(words, designed_for)?, MI, &Newton::default())?;
                for &true_crossover in &p.crossovers {
                    let met = design.system.with_channels(vec![bsc(words, true_crossover)?; 2])?;
                    let key = format!("mi-table4-5-mismatch/printed/{labelling} {designed_for} {true_crossover}");
                    let (mse, mi_nats) = (met.value(MSE)?, met.value(MI)?);
                    rows.push(Met {
                        labelling,
                        designed_for,
                        true_crossover,
                        mse,
                        mi_nats,
                        printed_mse: p.printed(key),
                    });
                }
            }
            let system = p.start(words, 0.05)?.with_quantizers(vec![odd(&[1.37])?; 2])?;
            printed.push(AtPrinted {
                labelling,
                mse: system.value(MSE)?,
            });
        }
        Ok(Mismatches { rows, printed })
    }

    fn claims(&self, p: &Parameters, tables: &Mismatches, claims: &mut Claims) {
        let here = claims.at_defaults();
        let rows = &tables.rows;
        claims.keyed("at-printed", "printed design at 0.05", &tables.printed, |r| r.mse);
        claims.keyed("mse", "words, designed for, met", rows, |r| r.mse);
        let natural = tables.printed.iter().filter(|r| r.labelling == "natural");
        let what = "the printed 0.497 is natural words' value at the printed breakpoints to 0.3 %";
        claims.references("printed", what, natural, |r| (format!("{} 0 0.05", r.labelling), r.mse));
        for (labelling, matched) in [("natural", &[0.0, 0.01, 0.05][..]), ("gray", &[0.0, 0.05])] {
            let least_is_matched = |truth: &f64| {
                let met = || select(rows, |r| r.labelling == labelling && r.true_crossover == *truth);
                met()
                    .min_by(|a, b| a.mse.total_cmp(&b.mse))
                    .is_some_and(|best| best.designed_for == *truth)
            };
            let what = format!(
                "{labelling} words: the matched design has the least squared error at {matched:?} and nowhere else"
            );
            here.all(format!("{labelling}-diagonal"), what, &p.crossovers, |c| {
                least_is_matched(c) == matched.contains(c)
            });
        }
    }

    fn plot(&self, p: &Parameters, tables: &Mismatches) -> Plot {
        let place = |crossover: f64| p.crossovers.iter().position(|c| *c == crossover).unwrap_or(0) as f64;
        let panel = |(labelling, title, _): &(&'static str, &str, [u32; 4])| {
            let own = |r: &&Met| r.labelling == *labelling;
            let met = |truth: f64| {
                tables
                    .rows
                    .iter()
                    .filter(own)
                    .filter(move |r| r.true_crossover == truth)
            };
            let least = |truth: f64| met(truth).map(|r| r.mse).fold(f64::INFINITY, f64::min);
            let lines = p.crossovers.iter().enumerate().flat_map(|(i, designed)| {
                let line = points(tables.rows.iter().filter(own).filter(|r| r.designed_for == *designed), |r| {
                    (place(r.true_crossover), 100.0 * (r.mse / least(r.true_crossover) - 1.0))
                });
                let label = format!("designed for {designed}");
                [
                    Layer::line("", line.clone()).coloured(i),
                    Layer::points(label, line).coloured(i),
                ]
            });
            let x = Axis::linear("true crossover probability")
                .named(p.crossovers.iter().map(|c| (place(*c), c.to_string())));
            Panel::new(*title, x, Axis::linear("excess squared error / %")).with_all(lines)
        };
        Plot::grid(2, LABELLINGS.iter().map(panel).collect())
    }
}
