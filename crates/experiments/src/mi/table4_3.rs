//! Table 4.3: nine sensors.

use super::common::{MI, MSE, outer, scene};
use crate::prelude::*;
use fewbits_baselines::quantizer_design as baselines;
use fewbits_quantizer_design::{Newton, Quantizer, System, bounds, design, lloyd_max};

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
        method: &'static str => "Criterion and how it was reached.",
        t: Option<f64> => "Common outer breakpoint; missing where the sensors differ.",
        values: Values,
        printed_mse: Option<f64> => "The publication's value.",
    }

    #[derive(Clone, Copy)]
    struct Values {
        mi_nats: f64 ["nat"] => "Mutual information.",
        mse: f64 => "Squared error, in prior variances; by counts of identical sensors where they are (erratum mi-4).",
    }

    struct Stage by "{criterion} {stage}" {
        criterion: &'static str => "Criterion of the chain.",
        stage: usize => "Sensors designed so far.",
        t: f64 => "Outer breakpoint of the last one.",
        values: Values,
    }

    struct Point {
        t: f64 => "Common outer breakpoint.",
        values: Values,
    }

    struct Bound by "{bound}" {
        bound: &'static str => "Which bound.",
        mse: f64 => "Least squared error.",
    }
}

impl Values {
    fn of(system: &System) -> Result<Self, Error> {
        Ok(Self {
            mi_nats: system.value(MI)?,
            mse: system.value(MSE)?,
        })
    }
}

pub struct Table43;

impl Figure for Table43 {
    figure!(Parameters => Rows, "mi-table4-3", "Nine sensors", "thesis, Table 4.3",
        "Nine equal sensors of four levels. Identical quantizers need 220 outcomes instead of 262144, so their whole \
         error curve is exact; the greedy chain gives nine different quantizers. The printed design stopped 7.5 % \
         short of the optimum.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let scene = scene(&vec![p.noise_sd; p.sensors], 0.0)?;
        let common = |t: f64| Ok::<_, Error>(System::identical(scene.clone(), Quantizer::symmetric(t)?)?);
        let unit = lloyd_max::gaussian(4)?.breakpoints()[2];
        let sample = unit * scene.sample_deviation(0);
        let newton = Newton::default();
        let best = |criterion| Ok::<_, Error>(outer(&design::joint(&common(sample)?, criterion, &newton)?.system, 0));
        // The prints are for nine sensors of unit noise.
        let as_printed = p.sensors == 9 && p.noise_sd == 1.0;
        let design = |(method, t): (&'static str, f64)| {
            Ok(Design {
                method,
                t: Some(t),
                values: Values::of(&common(t)?)?,
                printed_mse: reference::value(&format!("mi-table4-3/printed/{method}")).filter(|_| as_printed),
            })
        };
        let all = [
            ("mse-joint", best(MSE)?),
            ("lloyd-y", sample),
            ("mi-joint", best(MI)?),
            ("mi-printed", 1.275),
            ("lloyd-printed", 0.982),
            ("lloyd-x", unit),
        ];
        let mut designs = all.into_iter().map(design).collect::<Result<Vec<_>, Error>>()?;
        let mut chain: Vec<Stage> = Vec::new();
        let order: Vec<usize> = (0..p.sensors).collect();
        let start = System::ideal(scene.clone(), vec![Quantizer::symmetric(sample)?; p.sensors])?;
        for (criterion, method, by) in [("mi", "mi-greedy", MI), ("mse", "mse-greedy", MSE)] {
            for (i, stage) in baselines::greedy(&start, &order, by, &newton)?.iter().enumerate() {
                chain.push(Stage {
                    criterion,
                    stage: i + 1,
                    t: outer(&stage.system, i),
                    values: Values::of(&stage.system)?,
                });
            }
            designs.extend(chain.last().map(|whole| Design {
                method,
                t: None,
                values: whole.values,
                printed_mse: None,
            }));
        }
        let point = |i: i32| {
            let t = 0.8 + 0.02 * f64::from(i);
            let values = Values::of(&common(t)?)?;
            Ok(Point { t, values })
        };
        let variance = p.noise_sd * p.noise_sd;
        let codes = bounds::ceo(scene.prior(), scene.noise(), &vec![2.0; p.sensors])?.distortion;
        let bounds = [
            ("ceo", codes),
            ("unquantized", variance / (variance + p.sensors as f64)),
        ];
        Ok(Rows {
            designs,
            chain,
            curve: (0..=60).map(point).collect::<Result<_, Error>>()?,
            bounds: bounds.map(|(bound, mse)| Bound { bound, mse }).into(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let designs = &rows.designs;
        let find = |method: &str| first(designs, |d| d.method == method);
        let mse = |method: &str| find(method).map(|d| d.values.mse);
        let what = "printed errors are exact at the printed breakpoints to 1.6 % (erratum mi-8)";
        claims.keyed("printed", what, designs, |d| d.values.mse);
        let what =
            "squared-error design < Lloyd-Max of the sample < joint < greedy < printed < Lloyd-Max of the unknown";
        let order = ["mse-joint", "lloyd-y", "mi-joint", "mi-greedy", "mi-printed", "lloyd-x"];
        here.increasing("order", what, order.map(mse));
        let chain: Vec<&Stage> = select(&rows.chain, |s| s.criterion == "mi").collect();
        let what = "a greedy chain cannot give equal quantizers (erratum mi-5)";
        claims.all("chain-differs", what, chain.windows(2), |w| (w[0].t - w[1].t).abs() > 1e-6);
        let gap = minus(mse("mse-joint"), find("mi-printed").and_then(|d| d.printed_mse));
        let what = "the printed 0.1233 lies below the best of all identical designs (erratum mi-8)";
        claims.above("too-low", what, gap, 0.0);
        let short = find("mi-joint").and_then(|d| d.t).map(|t| 1.0 - 1.275 / t);
        let what = "the printed breakpoint is 7.5 % short of the optimum (erratum mi-9)";
        here.near("unconverged", what, short, 0.0747, 1e-4);
        let bound = first(&rows.bounds, |b| b.bound == "ceo").map_or(f64::INFINITY, |b| b.mse);
        claims.all("above-ceo", "every design stays above that bound", designs, |d| d.values.mse > bound);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let bound =
            |label, name| Layer::level(label, [0.8, 2.0], first(&rows.bounds, |b| b.bound == name).map(|b| b.mse));
        let marks = |value: fn(&Design) -> Option<f64>| {
            let identical = rows.designs.iter().filter_map(|d| Some((d.t?, value(d))));
            points(identical, |point| point)
        };
        let t = "outer breakpoint t / prior deviations";
        let error = Panel::linear("One quantizer for all sensors", t, "mean squared error / prior variances")
            .with(Layer::line("identical quantizers", points(&rows.curve, |p| (p.t, p.values.mse))))
            .with(Layer::points("designs", marks(|d| Some(d.values.mse))))
            .with(Layer::points("printed", marks(|d| d.printed_mse)).marked(Marker::Cross))
            .with(bound("bound for any codes", "ceo"))
            .with(bound("unquantized", "unquantized"));
        let chain = points(select(&rows.chain, |s| s.criterion == "mi"), |s| (s.stage as f64, s.t));
        let stages = Panel::linear("Greedy chain for information", "sensor, in order of design", t)
            .with_all(Layer::marked_line("", 0, chain))
            .without_legend();
        Plot::grid(2, vec![error, stages])
    }
}
