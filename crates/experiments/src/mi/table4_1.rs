//! Table 4.1: two sensors of equal noise, independent or correlated.

use super::common::{MI, MSE, cell, design_table, exact, lloyd_system, name, odd, push_design, push_joint, scene};
use super::plots::error_bars;
use crate::plot::Plot;
use crate::{About, Claim, Context, Error, Figure, Table, Tables, Value, column, row};
use fewbits_quantizer_design::{Newton, System, bounds, design};
use serde::{Deserialize, Serialize};

/// Settings of Table 4.1.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Noise standard deviation of both sensors, in prior standard deviations.
    pub noise_sd: f64,
    /// Noise correlation of the third case.
    pub correlation: f64,
    /// Random starts of each joint design.
    pub starts: usize,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            noise_sd: 1.0,
            correlation: 0.85,
            starts: 20,
        }
    }
}

/// A printed design: criterion, positive breakpoints of both sensors, printed error.
type Printed = (&'static str, &'static [f64], &'static [f64], f64);

struct Case {
    name: &'static str,
    levels: usize,
    correlated: bool,
    printed: [Printed; 2],
    printed_primal: f64,
}

const CASES: [Case; 3] = [
    Case {
        name: "rho0-L4",
        levels: 4,
        correlated: false,
        printed: [("mi", &[1.37], &[1.37], 0.3879), ("mse", &[1.39], &[1.39], 0.3880)],
        printed_primal: 0.3878,
    },
    Case {
        name: "rho0-L8",
        levels: 8,
        correlated: false,
        printed: [
            ("mi", &[0.73, 1.51, 2.49], &[0.73, 1.51, 2.49], 0.3484),
            ("mse", &[0.71, 1.48, 2.48], &[0.71, 1.48, 2.48], 0.3487),
        ],
        printed_primal: 0.3482,
    },
    Case {
        name: "rho85-L4",
        levels: 4,
        correlated: true,
        printed: [("mi", &[1.15], &[2.1], 0.5170), ("mse", &[1.13], &[2.08], 0.5171)],
        printed_primal: 0.5170,
    },
];

/// Independent values: case, criterion, design, outer breakpoint of sensor 1, squared error.
const KNOWN: [(&str, &str, &str, f64, f64); 18] = [
    ("rho0-L4", "mi", "greedy", 1.357_495_9, 0.388_496_08),
    ("rho0-L4", "mi", "joint", 1.363_584_5, 0.388_482_96),
    ("rho0-L4", "mse", "joint", 1.402_771_7, 0.388_403_07),
    ("rho0-L4", "lloyd-x", "independent", 0.981_598_8, 0.398_485_11),
    ("rho0-L4", "lloyd-y", "independent", 1.388_190_4, 0.388_414_06),
    ("rho0-L8", "mi", "greedy", 2.441_283_6, 0.348_914_78),
    ("rho0-L8", "mi", "joint", 2.443_202_6, 0.348_914_19),
    ("rho0-L8", "mse", "joint", 2.477_908_2, 0.348_903_94),
    ("rho0-L8", "lloyd-x", "independent", 1.747_927_5, 0.355_541_74),
    ("rho0-L8", "lloyd-y", "independent", 2.471_942_8, 0.348_904_25),
    ("rho85-L4", "mi", "greedy", 1.357_495_9, 0.518_913_16),
    ("rho85-L4", "mi", "symmetric", 1.102_388_2, 0.517_372_04),
    ("rho85-L4", "mse", "symmetric", 1.117_894_2, 0.517_344_26),
    ("rho85-L4", "lloyd-x", "independent", 0.981_598_8, 0.533_012_85),
    ("rho85-L4", "lloyd-y", "independent", 1.388_190_4, 0.521_139_72),
    ("rho0-L4", "mi", "printed", 1.37, 0.388_458_86),
    ("rho0-L8", "mi", "printed", 2.49, 0.348_915_68),
    ("rho85-L4", "mi", "printed", 1.15, 0.517_380_36),
];

/// Table 4.1.
pub struct Table41;

impl Figure for Table41 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-1",
            title: "Two sensors of equal noise",
            caption: "Squared error of two-sensor designs for mutual information and for squared error: the greedy chain, the \
                      joint optimum, Lloyd-Max quantizers of the unknown and of the sample, and the printed breakpoints. With \
                      independent noise all differences are in the fourth digit. With correlation 0.85 the printed solution is \
                      a saddle: the best contiguous pair is asymmetric.",
            source: "thesis, Table 4.1",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let keys = [
            column("case", "", "noise correlation and levels"),
            column("method", "", "criterion of the design, or the baseline"),
            column("design", "", "how it was reached"),
        ];
        let mut table = design_table(&keys);
        let mut searches = Table::new([
            column("case", "", "noise correlation and levels"),
            column("criterion", "", "criterion of the design"),
            column("starts", "", "random starts"),
            column("arrived", "", "starts that reached the best value found"),
            column("van_trees", "", "van Trees bound at the joint design, independent noise only"),
            column("printed_primal_mse", "", "printed squared error of problem (4.2)"),
        ]);
        for case in &CASES {
            let rho = if case.correlated { p.correlation } else { 0.0 };
            let scene = scene(&[p.noise_sd; 2], rho)?;
            let sample = lloyd_system(&scene, case.levels, |n| scene.sample_sd(n))?;
            for (criterion, printed) in [MI, MSE].into_iter().zip(&case.printed) {
                let key = |design: &str| row![case.name, name(criterion), design];
                let chain = design::greedy(&sample, &[0, 1], criterion, &Newton::default())?;
                let greedy = &chain[chain.len() - 1];
                push_design(&mut table, key("greedy"), &greedy.system, None, None)?;
                let stay = Newton::to_nearest_stationary_point();
                let nearest = design::joint(&greedy.system, criterion, &stay)?;
                let best = design::multi_start(&sample, criterion, p.starts, 1, &Newton::default())?;
                push_joint(&mut table, key(if case.correlated { "symmetric" } else { "joint" }), &nearest)?;
                if case.correlated {
                    push_joint(&mut table, key("joint"), &best)?;
                }
                let (first, second) = (odd(printed.1)?, odd(printed.2)?);
                let system = System::ideal(scene.clone(), vec![first, second])?;
                push_design(&mut table, key("printed"), &system, None, Some(printed.3))?;
                let starts = design::random_starts(&sample, p.starts, 1);
                let reached = |s: &System| {
                    design::joint(s, criterion, &Newton::default()).is_ok_and(|d| (d.value - best.value).abs() < 1e-10)
                };
                let arrived = starts.iter().filter(|s| reached(s)).count();
                let bound = if case.correlated {
                    None
                } else {
                    Some(bounds::van_trees(&best.system)?)
                };
                searches.push(row![
                    case.name,
                    name(criterion),
                    p.starts,
                    arrived,
                    bound,
                    case.printed_primal
                ])?;
            }
            let unit = lloyd_system(&scene, case.levels, |_| 1.0)?;
            push_design(&mut table, row![case.name, "lloyd-x", "independent"], &unit, None, None)?;
            push_design(&mut table, row![case.name, "lloyd-y", "independent"], &sample, None, None)?;
        }
        Ok(Tables::from(table).with("searches", searches))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let table = &tables.main;
        let at = |case: &str, method: &str, design: &str, column: &str| {
            let keys = [
                ("case", Value::from(case)),
                ("method", method.into()),
                ("design", design.into()),
            ];
            cell(table, &keys, column)
        };
        let mut claims = Vec::new();
        for (case, method, design, outer, mse) in KNOWN {
            let id = format!("{case}-{method}-{design}");
            let what = format!("{case}: {method} {design} squared error");
            claims.push(exact(id.clone(), what, at(case, method, design, "mse")?, mse, 1e-8));
            let what = format!("{case}: {method} {design} outer breakpoint of sensor 1");
            claims.push(exact(format!("{id}-outer"), what, at(case, method, design, "outer1")?, outer, 1e-7));
        }
        for (criterion, mi, mse) in [("mi", 0.331_123_01, 0.516_302_21), ("mse", 0.331_096_15, 0.516_272_61)] {
            let found = at("rho85-L4", criterion, "joint", "mi_nats")?;
            claims.push(exact(
                format!("best-{criterion}-mi"),
                "best contiguous pair at 0.85: information",
                found,
                mi,
                1e-8,
            ));
            let found = at("rho85-L4", criterion, "joint", "mse")?;
            claims.push(exact(
                format!("best-{criterion}-mse"),
                "best contiguous pair at 0.85: squared error",
                found,
                mse,
                1e-8,
            ));
            let saddle = at("rho85-L4", criterion, "symmetric", "curvature")?;
            let what = "the printed (mirror-symmetric) solution at 0.85 is a saddle (errata mi-10)";
            claims.push(Claim::above(format!("saddle-{criterion}"), what, saddle, 1e-3).at_defaults());
            let best = at("rho85-L4", criterion, "joint", "curvature")?;
            claims.push(Claim::below(
                format!("optimum-{criterion}"),
                "the best pair found is a local optimum",
                best,
                0.0,
            ));
        }
        let printed = table.only("design", "printed")?;
        let gaps = printed.numbers("printed_mse")?.into_iter().zip(printed.numbers("mse")?);
        let worst = crate::claim::largest(gaps.map(|(a, b)| (a - b).abs()));
        claims.push(
            Claim::at_most("printed", "printed errors are exact at printed breakpoints to 0.0006", worst, 6e-4)
                .at_defaults(),
        );
        let mut above = 0;
        let primal = tables.named("searches")?;
        for (case, printed) in [("rho0-L4", 0.3878), ("rho0-L8", 0.3482)] {
            let best = at(case, "mse", "joint", "mse")?;
            above += usize::from(printed >= best);
        }
        let what = "printed errors of (4.2) lie below the best any contiguous pair reached, so they are not exact (errata mi-6)";
        claims.push(Claim::never("primal-too-low", what, above).at_defaults());
        let outer = [
            at("rho0-L4", "mi", "greedy", "outer1")?,
            at("rho85-L4", "mi", "greedy", "outer1")?,
        ];
        let what =
            "the greedy chain's first sensor does not depend on correlation, unlike the printed one (errata mi-5)";
        claims.push(exact("greedy-first", what, outer[0] - outer[1], 0.0, 1e-9));
        for (case, loss) in [("rho0-L4", 1.31e-5), ("rho0-L8", 6e-7)] {
            let lost = at(case, "mi", "greedy", "mse")? - at(case, "mi", "joint", "mse")?;
            claims.push(exact(
                format!("{case}-loss"),
                "squared error lost by the greedy chain, no correlation",
                lost,
                loss,
                1e-7,
            ));
        }
        let lost = at("rho85-L4", "mi", "greedy", "mse")? / at("rho85-L4", "mi", "joint", "mse")? - 1.0;
        claims.push(exact(
            "rho85-loss",
            "at 0.85 the greedy chain costs half a percent: not negligible (errata mi-6)",
            lost,
            0.00506,
            1e-4,
        ));
        let (starts, arrived) = (primal.numbers("starts")?, primal.numbers("arrived")?);
        let missed = primal
            .texts("case")?
            .iter()
            .zip(starts.iter().zip(&arrived))
            .filter(|(c, (s, a))| *c != "rho85-L4" && s != a)
            .count();
        claims.push(
            Claim::never("one-optimum", "without correlation every random start reaches the same optimum", missed)
                .at_defaults(),
        );
        let shannon = table.numbers("mi_nats")?.into_iter().zip(table.numbers("mse")?);
        let broken = shannon.filter(|(mi, mse)| *mse < (-2.0 * mi).exp()).count();
        claims.push(Claim::never("shannon", "squared error >= exp(-2 I) in every row", broken));
        let trees = primal.points("arrived", "van_trees")?.len();
        let best = crate::claim::smallest(table.only("case", "rho0-L4")?.numbers("mse")?);
        let bound = crate::claim::smallest(
            primal
                .only("case", "rho0-L4")?
                .points("arrived", "van_trees")?
                .iter()
                .map(|p| p.1),
        );
        claims.push(Claim::above("van-trees", "the best error exceeds the van Trees bound", best - bound, 0.0));
        claims.push(Claim::at_least(
            "van-trees-rows",
            "bounds were computed for the independent cases",
            trees as f64,
            4.0,
        ));
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let panels = CASES.iter().map(|case| {
            let rows = tables.main.only("case", case.name)?;
            let labels: Vec<String> = rows
                .texts("method")?
                .iter()
                .zip(rows.texts("design")?)
                .map(|(m, d)| format!("{m} {d}"))
                .collect();
            let title = case
                .name
                .replace("rho85", "correlation 0.85")
                .replace("rho0", "independent")
                .replace("-L", ", L = ");
            error_bars(&title, &rows, &labels)
        });
        Ok(Plot::grid(2, panels.collect::<Result<_, Error>>()?))
    }
}
