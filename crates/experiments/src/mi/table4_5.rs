//! Table 4.5: words over a binary symmetric channel, and what a wrong assumption about it costs.

use super::common::{MI, MSE, bsc, cell, design_table, exact, lloyd_system, odd, push_design, push_joint, scene};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, Value, claim, column, row};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use fewbits_quantizer_design::design::Design;
use fewbits_quantizer_design::{Newton, System, design};
use serde::{Deserialize, Serialize};

const LABELLINGS: [(&str, [u32; 4]); 3] = [
    ("natural", [0, 1, 2, 3]),
    ("gray", [0, 1, 3, 2]),
    ("third", [0, 3, 1, 2]),
];

/// Printed crossover, outer breakpoint and error.
const PRINTED: [(f64, f64, f64); 4] = [
    (0.0, 1.370, 0.388),
    (0.001, 1.358, 0.391),
    (0.01, 1.260, 0.411),
    (0.05, 0.973, 0.485),
];

/// Settings of Table 4.5 and its mismatch matrix.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Crossover probabilities, 0 to 0.06: beyond, a design of four levels loses a cell (see mi-beyond).
    pub crossovers: Vec<f64>,
    /// Noise standard deviation, in prior standard deviations.
    pub noise_sd: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            crossovers: PRINTED.iter().map(|p| p.0).collect(),
            noise_sd: 1.0,
        }
    }
}

fn start(p: &Parameters, words: &[u32], crossover: f64) -> Result<System, Error> {
    let scene = scene(&[p.noise_sd; 2], 0.0)?;
    let channel = bsc(words, crossover)?;
    Ok(lloyd_system(&scene, 4, |_| 1.2)?.with_channels(vec![channel; 2])?)
}

fn joint(
    p: &Parameters,
    words: &[u32],
    crossover: f64,
    criterion: fewbits_quantizer_design::Criterion,
) -> Result<Design, Error> {
    Ok(design::joint(&start(p, words, crossover)?, criterion, &Newton::default())?)
}

/// Table 4.5.
pub struct Table45;

/// Independent values: crossover, labelling, design, outer breakpoint of sensor 2, squared error.
const KNOWN: [(f64, &str, &str, f64, f64); 12] = [
    (0.0, "natural", "mi-joint", 1.363_584_5, 0.388_482_96),
    (0.001, "natural", "mi-joint", 1.347_146_6, 0.390_834_79),
    (0.01, "natural", "mi-joint", 1.246_305_9, 0.410_649_97),
    (0.05, "natural", "mi-joint", 0.966_486_3, 0.484_995_68),
    (0.05, "natural", "mi-greedy", 0.967_999_3, 0.484_941_52),
    (0.001, "gray", "mi-joint", 1.361_956_9, 0.390_674_77),
    (0.01, "gray", "mi-joint", 1.360_213_1, 0.410_186_07),
    (0.05, "gray", "mi-joint", 1.358_032_7, 0.493_914_95),
    (0.05, "third", "mi-joint", 1.109_057_2, 0.540_295_88),
    (0.05, "natural", "mse-joint", 0.928_968_1, 0.484_886_00),
    (0.05, "gray", "mse-joint", 1.316_882_4, 0.493_826_09),
    (0.05, "third", "mse-joint", 0.918_508_8, 0.537_765_11),
];

impl Figure for Table45 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-5",
            title: "Words over a binary symmetric channel",
            caption: "Two sensors of four levels whose two-bit words cross a binary symmetric channel. With natural words the \
                      breakpoints shrink as the channel gets worse, as printed; with Gray words they hardly move. At a crossover \
                      of 0.05 information prefers Gray words and squared error natural ones.",
            source: "thesis, Table 4.5",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = design_table(&[
            column("crossover", "", "crossover probability of each bit"),
            column("labelling", "", "words of the levels"),
            column("design", "", "criterion and how it was reached"),
        ]);
        for &crossover in &p.crossovers {
            for (labelling, words) in &LABELLINGS {
                let start = start(p, words, crossover)?;
                for (criterion, greedy, both) in [(MI, "mi-greedy", "mi-joint"), (MSE, "mse-greedy", "mse-joint")] {
                    let chain = design::greedy(&start, &[0, 1], criterion, &Newton::default())?;
                    push_design(&mut table, row![crossover, *labelling, greedy], &chain[1].system, None, None)?;
                    let best = design::joint(&start, criterion, &Newton::default())?;
                    push_joint(&mut table, row![crossover, *labelling, both], &best)?;
                }
                if let Some(print) = PRINTED.iter().find(|print| print.0 == crossover) {
                    let system = start.with_quantizers(vec![odd(&[print.1])?; 2])?;
                    let mse = (*labelling == "natural").then_some(print.2);
                    push_design(&mut table, row![crossover, *labelling, "printed"], &system, None, mse)?;
                }
            }
        }
        Ok(table.into())
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let at = |crossover: f64, labelling: &str, design: &str, column: &str| {
            let keys = [
                ("crossover", Value::from(crossover)),
                ("labelling", labelling.into()),
                ("design", design.into()),
            ];
            cell(&tables.main, &keys, column)
        };
        let mut claims = Vec::new();
        for (crossover, labelling, design, outer, mse) in KNOWN {
            if !p.crossovers.contains(&crossover) {
                continue;
            }
            let id = format!("{crossover}-{labelling}-{design}");
            let what = format!("{labelling} words at {crossover}, {design}");
            let found = at(crossover, labelling, design, "mse")?;
            claims.push(exact(id.clone(), format!("{what}: squared error"), found, mse, 1e-8));
            let found = at(crossover, labelling, design, "outer2")?;
            claims.push(exact(format!("{id}-outer"), format!("{what}: outer breakpoint"), found, outer, 1e-7));
        }
        for (crossover, outer, mse) in PRINTED {
            if !p.crossovers.contains(&crossover) {
                continue;
            }
            let excess = outer / at(crossover, "natural", "mi-joint", "outer2")? - 1.0;
            let what = "the printed breakpoint exceeds the joint optimum of natural words by 0.5 to 1.1 %";
            claims.push(Claim::near(format!("{crossover}-excess"), what, excess, 0.008, 0.0035).at_defaults());
            let what = "printed error, natural words, three digits";
            let found = at(crossover, "natural", "printed", "mse")?;
            claims.push(Claim::near(format!("{crossover}-printed"), what, found, mse, 6e-4).at_defaults());
        }
        if p.crossovers.contains(&0.05) {
            let gray = (at(0.05, "gray", "mi-joint", "outer2")? / 1.363_584_5 - 1.0).abs();
            let what = "Gray words move the breakpoint by 0.4 % only, so the printed table is not Gray's";
            claims.push(Claim::at_most("gray-still", what, gray, 0.0045).at_defaults());
            let information = at(0.05, "gray", "mi-joint", "mi_nats")? - at(0.05, "natural", "mi-joint", "mi_nats")?;
            claims.push(
                Claim::above("mi-prefers-gray", "at 0.05 information prefers Gray words", information, 0.0)
                    .at_defaults(),
            );
            let error = at(0.05, "natural", "mse-joint", "mse")? - at(0.05, "gray", "mse-joint", "mse")?;
            let what = "at 0.05 squared error prefers natural words: the designs are not application-independent (errata mi-12)";
            claims.push(Claim::below("mse-prefers-natural", what, error, 0.0).at_defaults());
            let third = at(0.05, "third", "mse-joint", "mse")? - at(0.05, "gray", "mse-joint", "mse")?;
            claims.push(Claim::above("third-worst", "the third assignment is much worse", third, 0.04).at_defaults());
        }
        let natural = tables.main.only("labelling", "natural")?.only("design", "mi-joint")?;
        let rows = claim::not_increasing(&natural.numbers("mse")?);
        claims.push(Claim::never("worse", "errors grow with the crossover", rows).at_defaults());
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut outer = Panel::new("outer breakpoint", Axis::linear("crossover"), Axis::linear("outer breakpoint"));
        let mut error = Panel::new("squared error", Axis::linear("crossover"), Axis::linear("mean squared error"));
        for (labelling, _) in &LABELLINGS {
            let rows = tables.main.only("labelling", *labelling)?.only("design", "mi-joint")?;
            outer = outer.with(Layer::line(*labelling, rows.points("crossover", "outer2")?));
            error = error.with(Layer::line(*labelling, rows.points("crossover", "mse")?));
        }
        let printed = tables.main.only("labelling", "natural")?.only("design", "printed")?;
        let crosses = |column: &str| -> Result<Layer, Error> {
            Ok(Layer::points("printed", printed.points("crossover", column)?).marked(Marker::Cross))
        };
        outer = outer.with(crosses("outer2")?).legend(Legend::BottomLeft);
        error = error.with(crosses("printed_mse")?).legend(Legend::TopLeft);
        Ok(Plot::grid(2, vec![outer, error]))
    }
}

/// The mismatch matrix of Table 4.5.
pub struct Mismatch;

impl Figure for Mismatch {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-5-mismatch",
            title: "Designed for one channel, used on another",
            caption: "Squared error when the joint information design for one crossover meets another (the decoder knows the true \
                      one). Designing for a clean channel costs 2.6 % at a crossover of 0.05 with natural words and nothing with \
                      Gray words.",
            source: "thesis, Table 4.5 and text",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("labelling", "", "words of the levels"),
            column("designed_for", "", "crossover of the design"),
            column("true_crossover", "", "crossover met"),
            column("mse", "", "squared error"),
            column("mi_nats", "nat", "mutual information"),
            column("printed_mse", "", "the publication's value, printed breakpoints"),
        ]);
        let mut at_printed = Table::new([
            column("labelling", "", "words of the levels"),
            column("mse", "", "squared error of the printed design for a clean channel at a crossover of 0.05"),
        ]);
        for (labelling, words) in &LABELLINGS {
            for &designed in &p.crossovers {
                let design = joint(p, words, designed, MI)?;
                for &truth in &p.crossovers {
                    let met = design.system.with_channels(vec![bsc(words, truth)?; 2])?;
                    let printed = (*labelling == "natural" && designed == 0.0 && truth == 0.05).then_some(0.497);
                    table.push(row![*labelling, designed, truth, met.value(MSE)?, met.value(MI)?, printed])?;
                }
            }
            let printed = start(p, words, 0.05)?.with_quantizers(vec![odd(&[1.37])?; 2])?;
            at_printed.push(row![*labelling, printed.value(MSE)?])?;
        }
        Ok(Tables::from(table).with("printed", at_printed))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let table = &tables.main;
        let at = |labelling: &str, designed: f64, truth: f64| {
            let keys = [
                ("labelling", Value::from(labelling)),
                ("designed_for", designed.into()),
                ("true_crossover", truth.into()),
            ];
            cell(table, &keys, "mse")
        };
        let printed = tables.named("printed")?;
        let mut claims = Vec::new();
        for (labelling, matched, print) in [
            ("natural", true, 0.498_246_61),
            ("gray", false, 0.493_973_68),
            ("third", false, 0.550_954_48),
        ] {
            let found = cell(printed, &[("labelling", labelling.into())], "mse")?;
            claims.push(exact(
                format!("{labelling}-printed"),
                format!("{labelling} words: printed design at 0.05"),
                found,
                print,
                1e-8,
            ));
            if matched {
                let what = "the printed 0.497 is natural words' value to 0.3 %";
                claims.push(Claim::at_most("printed", what, (0.497 / found - 1.0).abs(), 0.003).at_defaults());
            }
        }
        let diagonal: [(&str, &[f64]); 2] = [("natural", &[0.0, 0.01, 0.05]), ("gray", &[0.0, 0.05])];
        let crossovers = PRINTED.map(|p| p.0);
        if table.only("designed_for", 0.05)?.is_empty() || table.only("designed_for", 0.001)?.is_empty() {
            return Ok(claims);
        }
        for (labelling, best_matched) in diagonal {
            let mut wrong = 0;
            for truth in crossovers {
                let column = crossovers
                    .iter()
                    .map(|d| at(labelling, *d, truth))
                    .collect::<Result<Vec<_>, _>>()?;
                let least = claim::smallest(column.iter().copied());
                let matched = at(labelling, truth, truth)? <= least;
                wrong += usize::from(matched != best_matched.contains(&truth));
            }
            let what = format!(
                "{labelling} words: the matched design has the least squared error at {best_matched:?} and nowhere else"
            );
            claims.push(Claim::never(format!("{labelling}-diagonal"), what, wrong).at_defaults());
        }
        for (id, labelling, designed, truth, known) in [
            ("clean-at-0.05", "natural", 0.0, 0.05, 0.497_894_26),
            ("matched-at-0.05", "natural", 0.05, 0.05, 0.484_995_68),
            ("gray-clean-at-0.05", "gray", 0.0, 0.05, 0.493_940_37),
        ] {
            claims.push(exact(
                id,
                format!("{labelling} words designed for {designed} at {truth}"),
                at(labelling, designed, truth)?,
                known,
                1e-8,
            ));
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let names = || p.crossovers.iter().enumerate().map(|(i, c)| (i as f64, format!("{c}")));
        let places: Vec<f64> = (0..p.crossovers.len()).map(|i| i as f64).collect();
        let panels = LABELLINGS.iter().map(|(labelling, _)| {
            let rows = tables.main.only("labelling", *labelling)?;
            let mut excess = Vec::new();
            for &designed in &p.crossovers {
                let mut line = Vec::new();
                for &truth in &p.crossovers {
                    let column = rows.only("true_crossover", truth)?;
                    let least = claim::smallest(column.numbers("mse")?);
                    let found = cell(&column, &[("designed_for", designed.into())], "mse")?;
                    line.push(100.0 * (found / least - 1.0));
                }
                excess.push(line);
            }
            let x = Axis::linear("true crossover").named(names());
            let y = Axis::linear("designed for").named(names());
            Ok(Panel::new(format!("{labelling} words"), x, y)
                .with(Layer::heat("excess error, %", places.clone(), places.clone(), excess))
                .legend(Legend::Hidden))
        });
        Ok(Plot::grid(3, panels.collect::<Result<_, Error>>()?))
    }
}
