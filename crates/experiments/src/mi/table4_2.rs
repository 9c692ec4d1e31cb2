//! Table 4.2: two sensors of unequal noise.

use super::common::{MI, MSE, cell, design_table, exact, lloyd_system, odd, push_design, push_joint, scene};
use super::plots::error_bars;
use crate::plot::Plot;
use crate::{About, Claim, Context, Error, Figure, Tables, Value, column, row};
use fewbits_quantizer_design::{Newton, System, bounds, design};
use serde::{Deserialize, Serialize};

/// Settings of Table 4.2.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Noise variances, in prior variances.
    pub noise_variances: Vec<f64>,
    /// Random starts of each joint design.
    pub starts: usize,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            noise_variances: vec![1.0, 0.5],
            starts: 30,
        }
    }
}

/// A printed pair: levels, positive breakpoints of both sensors, its error, and that of the printed Lloyd-Max baseline.
type Printed = (usize, &'static [f64], &'static [f64], f64, f64);

const PRINTED: [Printed; 2] = [
    (4, &[1.38], &[1.135], 0.310, 0.332),
    (8, &[0.69, 1.45, 2.43], &[0.58, 1.22, 2.05], 0.264, 0.281),
];

/// Independent values: levels, method, outer breakpoints, squared error.
const KNOWN: [(usize, &str, f64, f64, f64); 16] = [
    (4, "mi-printed", 1.38, 1.135, 0.312_205_18),
    (4, "mi-greedy", 1.357_495_9, 1.150_693_7, 0.312_153_50),
    (4, "mi-greedy-better-first", 1.385_624_0, 1.150_393_8, 0.312_082_97),
    (4, "mi-joint", 1.385_648_4, 1.150_059_9, 0.312_085_02),
    (4, "mse-joint", 1.445_817_1, 1.207_492_8, 0.311_841_77),
    (4, "lloyd-noise", 0.981_598_8, 0.694_095_2, 0.332_015_63),
    (4, "lloyd-x", 0.981_598_8, 0.981_598_8, 0.318_755_63),
    (4, "lloyd-y", 1.388_190_4, 1.202_208_1, 0.311_895_34),
    (8, "mi-printed", 2.43, 2.05, 0.267_603_72),
    (8, "mi-greedy", 2.441_283_6, 2.083_432_5, 0.267_537_96),
    (8, "mi-greedy-better-first", 2.461_850_4, 2.087_045_9, 0.267_527_31),
    (8, "mi-joint", 2.462_057_2, 2.083_126_6, 0.267_531_16),
    (8, "mse-joint", 2.515_778_0, 2.138_029_9, 0.267_495_41),
    (8, "lloyd-noise", 1.747_927_5, 1.235_971_4, 0.282_463_74),
    (8, "lloyd-x", 1.747_927_5, 1.747_927_5, 0.271_511_88),
    (8, "lloyd-y", 2.471_942_8, 2.140_765_2, 0.267_499_97),
];

/// Table 4.2.
pub struct Table42;

impl Figure for Table42 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-2",
            title: "Two sensors of unequal noise",
            caption: "Squared error when one sensor has half the other's noise variance. The printed Lloyd-Max baseline is scaled \
                      to the noise; scaled to the sample, as it should be, it beats the mutual-information design.",
            source: "thesis, Table 4.2",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        if p.noise_variances.len() == 2 {
            return Ok(());
        }
        Err(Error::BadParameter {
            figure: "mi-table4-2",
            name: "noise_variances".to_owned(),
            value: format!("{:?}", p.noise_variances),
            expected: "two numbers".to_owned(),
        })
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let keys = [
            column("levels", "", "levels of each sensor"),
            column("method", "", "criterion and how it was reached"),
        ];
        let mut table = design_table(&keys);
        let mut further = crate::Table::new([
            column("levels", "", "levels of each sensor"),
            column("starts", "", "random starts of the joint information design"),
            column("arrived", "", "starts that reached the best value found"),
            column("ceo_bound", "", "least squared error of any codes at these rates"),
        ]);
        let sds: Vec<f64> = p.noise_variances.iter().map(|v| v.sqrt()).collect();
        let scene = scene(&sds, 0.0)?;
        let newton = Newton::default();
        for (levels, first, second, printed, printed_lloyd) in PRINTED {
            let sample = lloyd_system(&scene, levels, |n| scene.sample_sd(n))?;
            let key = |method: &str| row![levels, method];
            let system = System::ideal(scene.clone(), vec![odd(first)?, odd(second)?])?;
            push_design(&mut table, key("mi-printed"), &system, None, Some(printed))?;
            for (criterion, greedy, reversed, joint) in [
                (MI, "mi-greedy", "mi-greedy-better-first", "mi-joint"),
                (MSE, "mse-greedy", "mse-greedy-better-first", "mse-joint"),
            ] {
                let chain = design::greedy(&sample, &[0, 1], criterion, &newton)?;
                push_design(&mut table, key(greedy), &chain[1].system, None, None)?;
                let mut quantizers = design::greedy(&sample, &[1, 0], criterion, &newton)?[1].quantizers();
                quantizers.reverse();
                push_design(&mut table, key(reversed), &System::ideal(scene.clone(), quantizers)?, None, None)?;
                let best = design::joint(&sample, criterion, &newton)?;
                push_joint(&mut table, key(joint), &best)?;
                if criterion == MI {
                    let reached =
                        |s: &System| design::joint(s, MI, &newton).is_ok_and(|d| (d.value - best.value).abs() < 1e-10);
                    let arrived = design::random_starts(&sample, p.starts, 1)
                        .iter()
                        .filter(|s| reached(s))
                        .count();
                    let bits = (levels as f64).log2();
                    let bound = bounds::ceo(1.0, &p.noise_variances, &[bits, bits])?;
                    further.push(row![levels, p.starts, arrived, bound])?;
                }
            }
            let noise = lloyd_system(&scene, levels, |n| sds[n])?;
            push_design(&mut table, key("lloyd-noise"), &noise, None, Some(printed_lloyd))?;
            push_design(&mut table, key("lloyd-x"), &lloyd_system(&scene, levels, |_| 1.0)?, None, None)?;
            push_design(&mut table, key("lloyd-y"), &sample, None, None)?;
        }
        Ok(Tables::from(table).with("searches", further))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let at = |levels: usize, method: &str, column: &str| {
            cell(&tables.main, &[("levels", Value::from(levels)), ("method", method.into())], column)
        };
        let mut claims = Vec::new();
        for (levels, method, outer1, outer2, mse) in KNOWN {
            let id = |what: &str| format!("L{levels}-{method}-{what}");
            let what = format!("L = {levels}, {method}");
            claims.push(exact(id("mse"), format!("{what}: squared error"), at(levels, method, "mse")?, mse, 1e-8));
            let outer = [(1, outer1, "outer1"), (2, outer2, "outer2")];
            for (sensor, known, column) in outer {
                let found = at(levels, method, column)?;
                claims.push(exact(id(column), format!("{what}: outer breakpoint {sensor}"), found, known, 1e-7));
            }
        }
        for (levels, _, _, printed, printed_lloyd) in PRINTED {
            let mse = |method: &str| at(levels, method, "mse");
            let (joint, sample) = (mse("mi-joint")?, mse("lloyd-y")?);
            claims.push(Claim::below(
                format!("L{levels}-lloyd-wins"),
                "Lloyd-Max of the sample beats the information design, against the printed claim (errata mi-7)",
                sample - joint,
                0.0,
            ));
            claims.push(Claim::below(
                format!("L{levels}-order"),
                "the squared-error design is best of all",
                mse("mse-joint")? - sample,
                0.0,
            ));
            let what = "the printed baseline, scaled to the noise, is worse than either correct scaling";
            let least = mse("lloyd-x")?.max(sample);
            claims.push(Claim::above(format!("L{levels}-baseline"), what, mse("lloyd-noise")? - least, 0.0));
            let what = "printed error of the information design against the exact one, relative (errata mi-8)";
            claims.push(
                Claim::at_most(format!("L{levels}-printed"), what, (printed / mse("mi-printed")? - 1.0).abs(), 0.015)
                    .at_defaults(),
            );
            let what = "printed error of the baseline, relative";
            claims.push(
                Claim::at_most(
                    format!("L{levels}-printed-lloyd"),
                    what,
                    (printed_lloyd / mse("lloyd-noise")? - 1.0).abs(),
                    0.006,
                )
                .at_defaults(),
            );
        }
        let searches = tables.named("searches")?;
        let missed = searches
            .points("starts", "arrived")?
            .iter()
            .filter(|(s, a)| s != a)
            .count();
        claims.push(
            Claim::never("one-optimum", "every random start reaches the same joint optimum", missed).at_defaults(),
        );
        for (levels, known) in [(4usize, 0.274_680_4), (8, 0.255_936_0)] {
            let bound = cell(searches, &[("levels", levels.into())], "ceo_bound")?;
            claims.push(exact(format!("L{levels}-ceo"), "bound with all subset constraints", bound, known, 1e-7));
            let gap = at(levels, "mse-joint", "mse")? - bound;
            claims.push(Claim::above(format!("L{levels}-ceo-gap"), "no design beats the bound", gap, 0.0));
        }
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let panels = [4usize, 8].into_iter().map(|levels| {
            let rows = tables.main.only("levels", levels)?;
            error_bars(&format!("L = {levels}"), &rows, &rows.texts("method")?)
        });
        Ok(Plot::grid(2, panels.collect::<Result<_, Error>>()?))
    }
}
