//! Table 4.3: nine sensors.

use super::common::{MI, MSE, lloyd, scene};
use crate::prelude::*;
use crate::reference;
use fewbits_quantizer_design::{Newton, Quantizer, System, bounds, design};

parameters! {
    pub struct Parameters {
        sensors: usize [2..=10] = 9 => quick 6 => "Number of sensors; the greedy chain enumerates `4^sensors` outcomes.",
        noise_sd: f64 [1e-3..=1e3] = 1.0 => "Noise standard deviation, in prior standard deviations.",
    }
}

rows! {
    pub struct Rows {
        designs: Vec<Design> => "Designs.",
        chain: Vec<Stage> => "The greedy chains, sensor by sensor.",
        curve: Vec<Point> => "Identical quantizers against their outer breakpoint.",
        bounds: Vec<Bound> => "Least squared errors.",
    }

    struct Design by "{method}" {
        method: String => "Criterion and how it was reached.",
        t: Option<f64> => "Common outer breakpoint; missing where the sensors differ.",
        mi_nats: f64 ["nat"] => "Mutual information.",
        mse: f64 => "Squared error, in prior variances.",
        printed_mse: Option<f64> => "The publication's value.",
    }

    struct Stage by "{stage}" {
        criterion: &'static str => "Criterion of the chain.",
        stage: usize => "Sensors designed so far.",
        t: f64 => "Outer breakpoint of the last one.",
        mi_nats: f64 ["nat"] => "Mutual information of the sensors so far.",
        mse: f64 => "Their squared error.",
    }

    struct Point {
        t: f64 => "Common outer breakpoint.",
        mi_nats: f64 ["nat"] => "Mutual information.",
        mse: f64 => "Squared error.",
    }

    struct Bound by "{bound}" {
        bound: &'static str => "Which bound.",
        mse: f64 => "Least squared error.",
    }
}

impl Rows {
    fn design(&self, method: &str) -> Option<&Design> {
        self.designs.iter().find(|d| d.method == method)
    }

    fn mse(&self, method: &str) -> Option<f64> {
        self.design(method).map(|d| d.mse)
    }

    fn bound(&self, name: &str) -> Option<f64> {
        self.bounds.iter().find(|b| b.bound == name).map(|b| b.mse)
    }
}

/// Table 4.3.
pub struct Table43;

impl Figure for Table43 {
    figure!(Parameters => Rows, "mi-table4-3", "Nine sensors", "thesis, Table 4.3",
        "Nine equal sensors of four levels. Identical quantizers need 220 outcomes instead of 262144, so their whole \
         error curve is exact; the greedy chain gives nine different quantizers. The printed design stopped 7.5 % \
         short of the optimum.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let scene = scene(&vec![p.noise_sd; p.sensors], 0.0)?;
        let common =
            |t: f64| -> Result<System, Error> { Ok(System::identical(scene.clone(), Quantizer::symmetric(t)?)?) };
        let unit = lloyd(4, 1.0)?.breakpoints()[2];
        let sample = unit * scene.sample_deviation(0);
        let newton = Newton::default();
        let best = |criterion| -> Result<f64, Error> {
            Ok(design::joint(&common(sample)?, criterion, &newton)?.quantizers()[0].breakpoints()[2])
        };
        // The prints are for nine sensors of unit noise.
        let as_printed = p.sensors == 9 && p.noise_sd == 1.0;
        let printed = |method: &str| reference::value(&format!("mi-table4-3/printed/{method}")).filter(|_| as_printed);
        let mut designs = Vec::new();
        for (method, t) in [
            ("mse-joint", best(MSE)?),
            ("lloyd-y", sample),
            ("mi-joint", best(MI)?),
            ("mi-printed", 1.275),
            ("lloyd-printed", 0.982),
            ("lloyd-x", unit),
        ] {
            let system = common(t)?;
            let (mi_nats, mse) = (system.value(MI)?, system.value(MSE)?);
            designs.push(Design {
                method: method.to_owned(),
                t: Some(t),
                mi_nats,
                mse,
                printed_mse: printed(method),
            });
        }
        let mut chain = Vec::new();
        let order: Vec<usize> = (0..p.sensors).collect();
        let start = System::ideal(scene.clone(), vec![Quantizer::symmetric(sample)?; p.sensors])?;
        for (criterion, by) in [("mi", MI), ("mse", MSE)] {
            let (mut mi_nats, mut mse) = (0.0, 0.0);
            for (i, stage) in design::greedy(&start, &order, by, &newton)?.iter().enumerate() {
                (mi_nats, mse) = (stage.system.value(MI)?, stage.system.value(MSE)?);
                let t = stage.system.groups()[i].quantizer().breakpoints()[2];
                chain.push(Stage {
                    criterion,
                    stage: i + 1,
                    t,
                    mi_nats,
                    mse,
                });
            }
            designs.push(Design {
                method: format!("{criterion}-greedy"),
                t: None,
                mi_nats,
                mse,
                printed_mse: None,
            });
        }
        let mut curve = Vec::new();
        for i in 0..=60 {
            let t = 0.8 + 0.02 * f64::from(i);
            let system = common(t)?;
            curve.push(Point {
                t,
                mi_nats: system.value(MI)?,
                mse: system.value(MSE)?,
            });
        }
        let variance = p.noise_sd * p.noise_sd;
        let codes = bounds::ceo(scene.prior(), scene.noise(), &vec![2.0; p.sensors])?.distortion;
        let bounds = vec![
            Bound {
                bound: "ceo",
                mse: codes,
            },
            Bound {
                bound: "unquantized",
                mse: variance / (variance + p.sensors as f64),
            },
        ];
        Ok(Rows {
            designs,
            chain,
            curve,
            bounds,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let designs = || rows.designs.iter();
        claims.keyed("mse", "squared error, by counts of identical sensors (erratum mi-4)", designs(), |d| d.mse);
        claims.keyed("t", "outer breakpoint", designs(), |d| d.t);
        claims.keyed("mi_nats", "information", designs(), |d| d.mi_nats);
        let what = "printed errors are exact at the printed breakpoints to 1.6 % (erratum mi-8)";
        claims.keyed("printed", what, designs(), |d| d.mse);
        let what =
            "squared-error design < Lloyd-Max of the sample < joint < greedy < printed < Lloyd-Max of the unknown";
        let order = ["mse-joint", "lloyd-y", "mi-joint", "mi-greedy", "mi-printed", "lloyd-x"];
        here.increasing("order", what, order.map(|method| rows.mse(method)));
        let chain: Vec<&Stage> = rows.chain.iter().filter(|s| s.criterion == "mi").collect();
        claims.keyed("chain", "outer breakpoint of the greedy chain, sensor", chain.iter().copied(), |s| s.t);
        let what = "a greedy chain cannot give equal quantizers (erratum mi-5)";
        claims.all("chain-differs", what, chain.windows(2), |w| (w[0].t - w[1].t).abs() > 1e-6);
        let gap = minus(rows.mse("mse-joint"), rows.design("mi-printed").and_then(|d| d.printed_mse));
        let what = "the printed 0.1233 lies below the best of all identical designs (erratum mi-8)";
        claims.above("too-low", what, gap, 0.0);
        let short = rows.design("mi-joint").and_then(|d| d.t).map(|t| 1.0 - 1.275 / t);
        let what = "the printed breakpoint is 7.5 % short of the optimum (erratum mi-9)";
        here.near("unconverged", what, short, 0.0747, 1e-4);
        claims.keyed("bound", "least error of any codes of two bits", &rows.bounds, |b| b.mse);
        let bound = rows.bound("ceo").unwrap_or(f64::INFINITY);
        claims.all("above-ceo", "every design stays above that bound", designs(), |d| d.mse > bound);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let flat = |name: &str| {
            points(select(&rows.bounds, |b| b.bound == name).flat_map(|b| [(0.8, b.mse), (2.0, b.mse)]), |p| p)
        };
        let marks = |value: fn(&Design) -> Option<f64>| {
            points(&rows.designs, |d| (d.t.unwrap_or(f64::NAN), d.t.and_then(|_| value(d))))
        };
        let error = Panel::linear(
            "One quantizer for all sensors",
            "outer breakpoint t / prior deviations",
            "mean squared error / prior variances",
        )
        .with(Layer::line("identical quantizers", points(&rows.curve, |p| (p.t, p.mse))))
        .with(Layer::points("designs", marks(|d| Some(d.mse))))
        .with(Layer::points("printed", marks(|d| d.printed_mse)).marked(Marker::Cross))
        .with(Layer::dashed("bound for any codes", flat("ceo")))
        .with(Layer::dashed("unquantized", flat("unquantized")));
        let chain = points(rows.chain.iter().filter(|s| s.criterion == "mi"), |s| (s.stage as f64, s.t));
        let stages = Panel::linear(
            "Greedy chain for information",
            "sensor, in order of design",
            "outer breakpoint t / prior deviations",
        )
        .with(Layer::line("", chain.clone()).coloured(0))
        .with(Layer::points("", chain).coloured(0))
        .without_legend();
        Plot::grid(2, vec![error, stages])
    }
}
