//! Table 4.3: nine sensors.

use super::common::{MI, MSE, cell, exact, lloyd, scene};
use crate::plot::{Axis, Layer, Legend, Marker, Panel, Plot};
use crate::{About, Claim, Context, Error, Figure, Table, Tables, claim, column, row};
use fewbits_quantizer_design::{Newton, Quantizer, System, bounds, design};
use serde::{Deserialize, Serialize};

/// Settings of Table 4.3.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Number of sensors.
    pub sensors: usize,
    /// Noise standard deviation, in prior standard deviations.
    pub noise_sd: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            sensors: 9,
            noise_sd: 1.0,
        }
    }
}

/// Greedy chain: outer breakpoints.
const CHAIN: [f64; 9] = [
    1.357_495_91,
    1.363_730_22,
    1.367_906_35,
    1.370_904_78,
    1.373_168_84,
    1.374_943_25,
    1.376_374_08,
    1.377_554_04,
    1.378_544_93,
];

/// Independent values: method, common outer breakpoint if any, squared error.
const KNOWN: [(&str, Option<f64>, f64); 7] = [
    ("mse-joint", Some(1.443_682_4), 0.124_480_98),
    ("lloyd-y", Some(1.388_190_4), 0.124_557_96),
    ("mi-joint", Some(1.377_921_5), 0.124_589_41),
    ("mi-greedy", None, 0.124_613_95),
    ("mi-printed", Some(1.275), 0.125_215_57),
    ("lloyd-printed", Some(0.982), 0.130_475_00),
    ("lloyd-x", Some(0.981_598_8), 0.130_486_15),
];

/// Table 4.3.
pub struct Table43;

impl Figure for Table43 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-3",
            title: "Nine sensors",
            caption: "Nine equal sensors of four levels. Identical quantizers need 220 outcomes instead of 262144, so their whole \
                      error curve is exact; the greedy chain gives nine different quantizers. The printed design stopped 7.5 % \
                      short of the optimum.",
            source: "thesis, Table 4.3",
        }
    }

    fn quicken(&self, p: &mut Parameters) {
        p.sensors = 6;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("method", "", "criterion and how it was reached"),
            column("t", "", "common outer breakpoint; missing where the sensors differ"),
            column("mi_nats", "nat", "mutual information"),
            column("mse", "", "squared error, in prior variances"),
            column("printed_mse", "", "the publication's value"),
        ]);
        let scene = scene(&vec![p.noise_sd; p.sensors], 0.0)?;
        let common =
            |t: f64| -> Result<System, Error> { Ok(System::identical(scene.clone(), Quantizer::symmetric(t)?)?) };
        let unit = lloyd(4, 1.0)?.breakpoints()[2];
        let sample = unit * scene.sample_sd(0);
        let newton = Newton::default();
        let best = |criterion| -> Result<f64, Error> {
            Ok(design::joint(&common(sample)?, criterion, &newton)?.quantizers()[0].breakpoints()[2])
        };
        for (method, t, printed) in [
            ("mse-joint", best(MSE)?, None),
            ("lloyd-y", sample, None),
            ("mi-joint", best(MI)?, None),
            ("mi-printed", 1.275, Some(0.1233)),
            ("lloyd-printed", 0.982, Some(0.1295)),
            ("lloyd-x", unit, None),
        ] {
            let system = common(t)?;
            table.push(row![method, t, system.value(MI)?, system.value(MSE)?, printed])?;
        }
        let mut chain = Table::new([
            column("criterion", "", "criterion of the chain"),
            column("stage", "", "sensors designed so far"),
            column("t", "", "outer breakpoint of the last one"),
            column("mi_nats", "nat", "mutual information of the sensors so far"),
            column("mse", "", "their squared error"),
        ]);
        let order: Vec<usize> = (0..p.sensors).collect();
        let start = System::ideal(scene.clone(), vec![Quantizer::symmetric(sample)?; p.sensors])?;
        for (name, criterion) in [("mi", MI), ("mse", MSE)] {
            let stages = design::greedy(&start, &order, criterion, &newton)?;
            let mut last = (0.0, 0.0);
            for (i, stage) in stages.iter().enumerate() {
                last = (stage.system.value(MI)?, stage.system.value(MSE)?);
                let t = stage.system.groups()[i].quantizer().breakpoints()[2];
                chain.push(row![name, i + 1, t, last.0, last.1])?;
            }
            table.push(row![format!("{name}-greedy"), None::<f64>, last.0, last.1, None::<f64>])?;
        }
        let mut curve = Table::new([
            column("t", "", "common outer breakpoint"),
            column("mi_nats", "nat", "mutual information"),
            column("mse", "", "squared error"),
        ]);
        for i in 0..=60 {
            let t = 0.8 + 0.02 * f64::from(i);
            let system = common(t)?;
            curve.push(row![t, system.value(MI)?, system.value(MSE)?])?;
        }
        let variance = p.noise_sd * p.noise_sd;
        let mut limits = Table::new([
            column("bound", "", "which bound"),
            column("mse", "", "least squared error"),
        ]);
        let codes = bounds::ceo(1.0, &vec![variance; p.sensors], &vec![2.0; p.sensors])?;
        limits.push(row!["ceo", codes])?;
        limits.push(row!["unquantized", variance / (variance + p.sensors as f64)])?;
        Ok(Tables::from(table)
            .with("chain", chain)
            .with("curve", curve)
            .with("bounds", limits))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let at = |method: &str, column: &str| cell(&tables.main, &[("method", method.into())], column);
        let mut claims = Vec::new();
        for (method, t, mse) in KNOWN {
            let what = format!("{method}: squared error");
            claims.push(exact(format!("{method}-mse"), what, at(method, "mse")?, mse, 1e-8));
            if let Some(t) = t {
                let what = format!("{method}: outer breakpoint");
                claims.push(exact(format!("{method}-t"), what, at(method, "t")?, t, 1e-7));
            }
        }
        claims.push(exact(
            "information",
            "information of the joint design",
            at("mi-joint", "mi_nats")?,
            1.046_491_09,
            1e-8,
        ));
        let order = KNOWN
            .iter()
            .filter(|k| k.0 != "lloyd-printed")
            .map(|k| at(k.0, "mse"))
            .collect::<Result<Vec<_>, _>>()?;
        let what =
            "squared-error design < Lloyd-Max of the sample < joint < greedy < printed < Lloyd-Max of the unknown";
        claims.push(Claim::never("order", what, claim::not_increasing(&order)).at_defaults());
        let chain = tables.named("chain")?.only("criterion", "mi")?.numbers("t")?;
        let off = claim::largest(chain.iter().zip(CHAIN).map(|(a, b)| (a - b).abs()));
        claims.push(exact("chain", "the greedy chain's nine outer breakpoints", off, 0.0, 1e-7));
        let same = chain.windows(2).filter(|w| (w[0] - w[1]).abs() < 1e-6).count();
        claims.push(Claim::never("chain-differs", "a greedy chain cannot give equal quantizers (errata mi-5)", same));
        let best = at("mse-joint", "mse")?;
        let what = "the printed 0.1233 lies below the best of all identical designs (errata mi-8)";
        claims.push(Claim::above("too-low", what, best - 0.1233, 0.0).at_defaults());
        for (method, printed) in [("mi-printed", 0.1233), ("lloyd-printed", 0.1295)] {
            let gap = (printed / at(method, "mse")? - 1.0).abs();
            claims.push(
                Claim::at_most(method, "printed error against the exact one, relative", gap, 0.016).at_defaults(),
            );
        }
        let what = "the printed breakpoint is 7.5 % short of the optimum (errata mi-9)";
        claims.push(exact("unconverged", what, 1.0 - 1.275 / at("mi-joint", "t")?, 0.0747, 1e-4));
        let bound = cell(tables.named("bounds")?, &[("bound", "ceo".into())], "mse")?;
        claims.push(exact("ceo", "least error of any codes of two bits", bound, 0.107_764_26, 1e-8));
        claims.push(Claim::above("above-ceo", "the best design stays above it", best - bound, 0.0));
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let curve = tables.named("curve")?;
        let marks = |column: &str| tables.main.points("t", column);
        let flat = |y: f64| vec![(0.8, y), (2.0, y)];
        let bounds = tables.named("bounds")?.numbers("mse")?;
        let chain = tables.named("chain")?.only("criterion", "mi")?;
        let error = Panel::new(
            "error of one quantizer for all",
            Axis::linear("outer breakpoint t"),
            Axis::linear("mean squared error"),
        )
        .with(Layer::line("identical quantizers", curve.points("t", "mse")?))
        .with(Layer::points("designs", marks("mse")?))
        .with(Layer::points("printed", marks("printed_mse")?).marked(Marker::Cross))
        .with(Layer::dashed("CEO bound", flat(bounds[0])))
        .with(Layer::dashed("unquantized", flat(bounds[1])));
        let stages = Panel::new("greedy chain", Axis::linear("stage"), Axis::linear("outer breakpoint t"))
            .with(Layer::line("information", chain.points("stage", "t")?))
            .with(Layer::points("", chain.points("stage", "t")?).coloured(0))
            .legend(Legend::BottomRight);
        Ok(Plot::grid(2, vec![error, stages]))
    }
}
