//! Table 4.4: detection of a constant in noise by five sensors.

use super::common::MI;
use crate::prelude::*;
use fewbits_baselines::quantizer_design::{self as baselines, NeymanPearson, Separation};
use fewbits_numerics::normal;
use fewbits_quantizer_design::{
    Channel, Criterion, JointTable, Newton, Noise, ObservationModel, Prior, Quantizer, System, design,
};

const PE: Criterion = Criterion::BayesError;

parameters! {
    pub struct Parameters {
        signals: Vec<f64> [0.1..=16.0; 1..=20] = vec![2.0, 4.0] => "The signals to detect, in noise standard deviations.",
        sensors: usize [2..=9] = 5 => "Number of sensors; the greedy chain enumerates `4^sensors` outcomes.",
        false_alarm: f64 [1e-9..=0.999] = 0.01 => "False-alarm probability of the randomised test.",
    }
}

rows! {
    #[derive(Default)]
    pub struct Rows {
        designs: Vec<Design> => "Designs.",
        curve: Vec<Point> => "Identical quantizers against their offset.",
        checks: Vec<Check> => "What the designs are compared with.",
    }

    struct Design by "{signal} {method}" {
        signal: f64 ["noise sd"] as panel("signal of {} noise deviations") => "The value to tell from 0.",
        method: &'static str as key => "What the quantizer maximises (pe: minimises the error itself).",
        t: f64 ["noise sd"] as x("offset t / noise deviations") => "Offset of the outer breakpoints (of the first sensor).",
        offsets: String ["noise sd"] => "Offsets of all sensors, where they differ.",
        pe: f64 as points in error => "Bayes error at equal priors.",
        printed_pe: Option<f64> => "The publication's value.",
        mi_nats: f64 ["nat"] => "Mutual information.",
        equivocation_nats: f64 ["nat"] => "ln 2 minus it, without cancellation.",
        matusita: Option<f64> => "Matusita distance of one sensor's symbol.",
        j_divergence: Option<f64> => "J-divergence of one sensor's symbol.",
        bhattacharyya: Option<f64> => "Bhattacharyya coefficient of one sensor's symbol.",
        detection: f64 => "Detection probability of the randomised Neyman-Pearson test.",
    }

    struct Point {
        signal: f64 ["noise sd"] as panel("signal of {} noise deviations") => "The value to tell from 0.",
        t: f64 ["noise sd"] as x("offset t / noise deviations") => "Common offset.",
        pe: f64 as line("identical quantizers") in error => "Bayes error.",
    }

    struct Check by "{signal}" {
        signal: f64 ["noise sd"] => "The value to tell from 0.",
        unquantized_pe: f64 => "Error from unquantized samples.",
        /// What the best change of one sensor alone would gain on the minimum error, relative.
        single_change_gain: f64,
    }
}

fn scene(signal: f64, sensors: usize) -> Result<ObservationModel, Error> {
    let noise = Noise::independent_with_deviations(&vec![1.0; sensors])?;
    Ok(ObservationModel::new(Prior::binary(signal, 0.5)?, noise)?)
}

fn about(signal: f64, t: f64) -> Result<Quantizer, Error> {
    let middle = 0.5 * signal;
    Ok(Quantizer::new(vec![middle - t, middle, middle + t])?)
}

/// The row of a system; of one sensor's symbol where all sensors are the same.
fn row(p: &Parameters, signal: f64, method: &'static str, system: &System) -> Result<Design, Error> {
    let printed = reference::value(&format!("mi-table4-4/printed/{signal} {method}"));
    let quantizers = system.quantizers();
    let offset = |q: &Quantizer| q.breakpoints()[2] - 0.5 * signal;
    let symbol = if quantizers.len() == 1 {
        let law = JointTable::new(&System::identical(scene(signal, 1)?, quantizers[0].clone())?)?;
        Some((0..4).map(|t| (law.likelihood(t)[0], law.likelihood(t)[1])).unzip())
    } else {
        None
    };
    let separation = |of: Separation| symbol.as_ref().map(|(p0, p1): &(Vec<f64>, Vec<f64>)| of.of(p0, p1));
    let differ = if quantizers.len() > 1 { &quantizers[..] } else { &[] };
    Ok(Design {
        signal,
        method,
        t: offset(&quantizers[0]),
        offsets: joined(differ.iter().map(|q| format!("{:.8}", offset(q))), " "),
        pe: system.value(PE)?,
        printed_pe: printed.filter(|_| p.sensors == 5),
        mi_nats: system.value(MI)?,
        equivocation_nats: JointTable::new(system)?.equivocation()?,
        matusita: separation(Separation::Matusita),
        j_divergence: separation(Separation::JDivergence),
        bhattacharyya: separation(Separation::Bhattacharyya).map(|distance| (-distance).exp()),
        detection: NeymanPearson::new(system, p.false_alarm)?.detection_probability(),
    })
}

pub struct Table44;

impl Figure for Table44 {
    figure!(Parameters => Rows, "mi-table4-4", "Detection by five sensors", "thesis, Table 4.4",
        "Error probability of the optimal decision between 0 and a signal from five sensors of four levels, exact by \
         counting. Mutual information and the Matusita distance give almost the least error; the J-divergence is \
         far off at the strong signal."; { error: semilog("error probability") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        let newton = Newton::default();
        let ideal = Channel::ideal(4)?;
        for &signal in &p.signals {
            context.check()?;
            let start = about(signal, 1.0)?;
            let all = System::identical(scene(signal, p.sensors)?, start.clone())?;
            let one = System::identical(scene(signal, 1)?, start.clone())?;
            let joint =
                |system, criterion| Ok::<_, Error>(design::joint(system, criterion, &newton)?.system.quantizers());
            let separated = |d| Ok::<_, Error>(baselines::separate(d, signal, 1.0, &start, &ideal, &newton)?.0);
            let best = joint(&all, PE)?.remove(0);
            let common = [
                ("mi-joint", joint(&all, MI)?.remove(0)),
                ("mi-single", joint(&one, MI)?.remove(0)),
                ("matusita", separated(Separation::Matusita)?),
                ("j-divergence", separated(Separation::JDivergence)?),
                ("pe", best.clone()),
            ];
            for (method, quantizer) in common {
                rows.designs
                    .push(row(p, signal, method, &all.with_quantizer(0, quantizer)?)?);
            }
            let apart = System::ideal(scene(signal, p.sensors)?, vec![start; p.sensors])?;
            let order: Vec<usize> = (0..p.sensors).collect();
            if let Some(chain) = baselines::greedy(&apart, &order, MI, &newton)?.pop() {
                rows.designs.push(row(p, signal, "mi-greedy", &chain.system)?);
            }
            // Person by person from the identical minimum: no sensor alone can do better.
            let minimum = apart.with_quantizers(vec![best.clone(); p.sensors])?;
            let mut grid: Vec<f64> = (-60..=60).map(|i| 0.5 * signal + 0.05 * f64::from(i)).collect();
            grid.extend(best.breakpoints());
            grid.sort_by(f64::total_cmp);
            grid.dedup_by(|a, b| *a - *b < 1e-9);
            let alone = baselines::best_contiguous(&minimum, 0, PE, &grid)?.1;
            rows.checks.push(Check {
                signal,
                unquantized_pe: normal::cdf(-0.5 * signal * (p.sensors as f64).sqrt()),
                single_change_gain: 1.0 - alone / minimum.value(PE)?,
            });
            for i in 0..=50 {
                let t = 0.5 + 0.03 * f64::from(i);
                let pe = all.with_quantizer(0, about(signal, t)?)?.value(PE)?;
                rows.curve.push(Point { signal, t, pe });
            }
        }
        Ok(rows)
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let designs = &rows.designs;
        claims.keyed("printed", "printed errors are within about 10 % of the exact ones", designs, |d| d.pe);
        let pe = |signal, method| first(designs, |d| d.signal == signal && d.method == method).map(|d| d.pe);
        for &signal in &p.signals {
            let what = "least error < Matusita < mutual information < J-divergence (erratum mi-11)";
            let order = ["pe", "matusita", "mi-joint", "j-divergence"].map(|method| pe(signal, method));
            here.increasing(format!("{signal}-order"), what, order);
            let others = select(designs, |d| d.signal == signal && d.method != "j-divergence");
            let worst = pe(signal, "j-divergence").unwrap_or(0.0);
            here.all(format!("{signal}-j-worst"), "the J-divergence is worst of all", others, |d| d.pe < worst);
        }
        let what = "no change of one sensor improves on the identical minimum (grid of 0.05, dynamic programme)";
        claims.all("person-by-person", what, &rows.checks, |c| c.single_change_gain <= 1e-12);
        let what = "four levels lose against samples";
        claims.all("unquantized", what, &rows.checks, |c| pe(c.signal, "pe").is_some_and(|pe| pe > c.unquantized_pe));
        let what =
            "the printed 1.0e-5 at the strong signal is below the best that any design found reaches (erratum mi-11)";
        here.above("too-low", what, pe(4.0, "pe").map(|pe| pe - 1.0e-5), 0.0);
    }
}
