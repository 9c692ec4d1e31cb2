//! Table 4.4: detection of a constant in noise by five sensors.

use super::common::{MI, cell, exact};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, Value, column, row};
use crate::plot::{Axis, Layer, Panel, Plot};
use fewbits_numerics::normal;
use fewbits_quantizer_design::decoder::NeymanPearson;
use fewbits_quantizer_design::design::{self, Separation};
use fewbits_quantizer_design::{Channel, Criterion, JointTable, Newton, Noise, Prior, Quantizer, Scene, System};
use serde::{Deserialize, Serialize};

const PE: Criterion = Criterion::BayesError;

/// Settings of Table 4.4.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// The signals to detect, in noise standard deviations.
    pub signals: Vec<f64>,
    /// Number of sensors.
    pub sensors: usize,
    /// False-alarm probability of the randomised test.
    pub false_alarm: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            signals: vec![2.0, 4.0],
            sensors: 5,
            false_alarm: 0.01,
        }
    }
}

/// Independent values: signal, method, offset of the outer breakpoints, error probability.
const KNOWN: [(f64, &str, f64, f64); 12] = [
    (2.0, "mi-joint", 0.968_921_04, 1.662_752_6e-2),
    (2.0, "mi-greedy", 0.860_133_60, 1.671_667_6e-2),
    (2.0, "mi-single", 0.860_133_60, 1.686_914_3e-2),
    (2.0, "matusita", 1.006_635_28, 1.660_826_6e-2),
    (2.0, "j-divergence", 1.222_395_39, 1.703_727_6e-2),
    (2.0, "pe", 1.011_340_53, 1.660_803_0e-2),
    (4.0, "mi-joint", 1.039_569_17, 1.104_645_2e-5),
    (4.0, "mi-greedy", 0.730_539_80, 1.250_776_0e-5),
    (4.0, "mi-single", 0.730_539_80, 1.545_125_3e-5),
    (4.0, "matusita", 1.082_454_20, 1.098_397_0e-5),
    (4.0, "j-divergence", 1.765_978_86, 2.149_428_6e-5),
    (4.0, "pe", 1.088_563_25, 1.098_300_6e-5),
];

fn printed(signal: f64, method: &str) -> Option<f64> {
    match (signal, method) {
        (2.0, "mi-joint" | "matusita" | "j-divergence") => Some(1.7e-2),
        (4.0, "mi-joint") => Some(1.0e-5),
        (4.0, "matusita") => Some(1.1e-5),
        (4.0, "j-divergence") => Some(2.1e-5),
        _ => None,
    }
}

fn scene(signal: f64, sensors: usize) -> Result<Scene, Error> {
    Ok(Scene::new(Prior::binary(signal, 0.5)?, Noise::independent(&vec![1.0; sensors])?)?)
}

fn about(signal: f64, t: f64) -> Result<Quantizer, Error> {
    let middle = 0.5 * signal;
    Ok(Quantizer::new(vec![middle - t, middle, middle + t])?)
}

/// Table 4.4.
pub struct Table44;

impl Figure for Table44 {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "mi-table4-4",
            title: "Detection by five sensors",
            caption: "Error probability of the optimal decision between 0 and a signal from five sensors of four levels, exact by \
                      counting. Mutual information and the Matusita distance give almost the least error; the J-divergence is \
                      far off at the strong signal.",
            source: "thesis, Table 4.4",
        }
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("signal", "noise sd", "the value to tell from 0"),
            column("method", "", "what the quantizer maximises (pe: minimises the error itself)"),
            column("t", "noise sd", "offset of the outer breakpoints (of the first sensor)"),
            column("offsets", "noise sd", "offsets of all sensors, where they differ"),
            column("pe", "", "Bayes error at equal priors"),
            column("printed_pe", "", "the publication's value"),
            column("mi_nats", "nat", "mutual information"),
            column("equivocation_nats", "nat", "ln 2 minus it, without cancellation"),
            column("matusita", "", "Matusita distance of one sensor's symbol"),
            column("j_divergence", "", "J-divergence of one sensor's symbol"),
            column("bhattacharyya", "", "Bhattacharyya coefficient of one sensor's symbol"),
            column("detection", "", "detection probability of the randomised Neyman-Pearson test"),
        ]);
        let mut curve = Table::new([
            column("signal", "noise sd", "the value to tell from 0"),
            column("t", "noise sd", "common offset"),
            column("pe", "", "Bayes error"),
        ]);
        let mut checks = Table::new([
            column("signal", "noise sd", "the value to tell from 0"),
            column("unquantized_pe", "", "error from unquantized samples"),
            column(
                "single_change_gain",
                "",
                "what the best change of one sensor alone would gain on the minimum error, relative",
            ),
        ]);
        let newton = Newton::default();
        let ideal = Channel::ideal(4)?;
        for &signal in &p.signals {
            let start = about(signal, 1.0)?;
            let all = System::identical(scene(signal, p.sensors)?, start.clone())?;
            let one = System::identical(scene(signal, 1)?, start.clone())?;
            let separated = |d| design::separate(d, signal, 1.0, &start, &ideal, &newton).map(|found| found.0);
            let best = design::joint(&all, PE, &newton)?.quantizers().remove(0);
            let common = [
                ("mi-joint", design::joint(&all, MI, &newton)?.quantizers().remove(0)),
                ("mi-single", design::joint(&one, MI, &newton)?.quantizers().remove(0)),
                ("matusita", separated(Separation::Matusita)?),
                ("j-divergence", separated(Separation::JDivergence)?),
                ("pe", best.clone()),
            ];
            let offset = |q: &Quantizer| q.breakpoints()[2] - 0.5 * signal;
            for (method, quantizer) in common {
                let system = all.with_quantizer(0, quantizer.clone())?;
                let law = JointTable::new(&one.with_quantizer(0, quantizer.clone())?)?;
                let (p0, p1): (Vec<f64>, Vec<f64>) =
                    (0..4).map(|t| (law.likelihood(t)[0], law.likelihood(t)[1])).unzip();
                table.push(row![
                    signal,
                    method,
                    offset(&quantizer),
                    "",
                    system.value(PE)?,
                    printed(signal, method),
                    system.value(MI)?,
                    JointTable::new(&system)?.equivocation()?,
                    Separation::Matusita.of(&p0, &p1),
                    Separation::JDivergence.of(&p0, &p1),
                    (-Separation::Bhattacharyya.of(&p0, &p1)).exp(),
                    NeymanPearson::new(&system, p.false_alarm)?.detection_probability(),
                ])?;
            }
            let apart = System::ideal(scene(signal, p.sensors)?, vec![start; p.sensors])?;
            let order: Vec<usize> = (0..p.sensors).collect();
            if let Some(chain) = design::greedy(&apart, &order, MI, &newton)?.pop() {
                let offsets: Vec<f64> = chain.quantizers().iter().map(offset).collect();
                let text = offsets.iter().map(|t| format!("{t:.8}")).collect::<Vec<_>>().join(" ");
                let missing = || None::<f64>;
                table.push(row![
                    signal,
                    "mi-greedy",
                    offsets[0],
                    text,
                    chain.system.value(PE)?,
                    missing(),
                    chain.system.value(MI)?,
                    JointTable::new(&chain.system)?.equivocation()?,
                    missing(),
                    missing(),
                    missing(),
                    NeymanPearson::new(&chain.system, p.false_alarm)?.detection_probability(),
                ])?;
            }
            // Person by person from the identical minimum: no sensor alone can do better.
            let minimum = apart.with_quantizers(vec![best.clone(); p.sensors])?;
            let pe = minimum.value(PE)?;
            let mut grid: Vec<f64> = (-60..=60).map(|i| 0.5 * signal + 0.05 * f64::from(i)).collect();
            grid.extend(best.breakpoints());
            grid.sort_by(f64::total_cmp);
            grid.dedup_by(|a, b| *a - *b < 1e-9);
            let alone = design::best_contiguous(&minimum, 0, PE, &grid)?.1;
            let unquantized = normal::cdf(-0.5 * signal * (p.sensors as f64).sqrt());
            checks.push(row![signal, unquantized, 1.0 - alone / pe])?;
            for i in 0..=50 {
                let t = 0.5 + 0.03 * f64::from(i);
                curve.push(row![signal, t, all.with_quantizer(0, about(signal, t)?)?.value(PE)?])?;
            }
        }
        Ok(Tables::from(table).with("curve", curve).with("checks", checks))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let at = |signal: f64, method: &str, column: &str| {
            cell(&tables.main, &[("signal", Value::from(signal)), ("method", method.into())], column)
        };
        let mut claims = Vec::new();
        let mut off = 0;
        for (signal, method, t, pe) in KNOWN {
            if !p.signals.contains(&signal) {
                continue;
            }
            let id = format!("{signal}-{method}");
            let found = at(signal, method, "pe")?;
            claims.push(
                Claim::near_relative(format!("{id}-pe"), format!("{method} at {signal}: error"), found, pe, 1e-7)
                    .at_defaults(),
            );
            claims.push(exact(
                format!("{id}-t"),
                format!("{method} at {signal}: offset"),
                at(signal, method, "t")?,
                t,
                1e-7,
            ));
            off += usize::from(printed(signal, method).is_some_and(|print| (print / found - 1.0).abs() > 0.1));
        }
        claims.push(
            Claim::never("printed", "printed errors are within 10 % of the exact ones (two digits are printed)", off)
                .at_defaults(),
        );
        for &signal in &p.signals {
            let pe = |method: &str| at(signal, method, "pe");
            let order = [pe("pe")?, pe("matusita")?, pe("mi-joint")?, pe("j-divergence")?];
            let what = "least error < Matusita < mutual information < J-divergence (errata mi-11)";
            claims.push(
                Claim::never(format!("{signal}-order"), what, crate::legacy::claim::not_increasing(&order))
                    .at_defaults(),
            );
            let worst = pe("mi-joint")?
                .max(pe("mi-greedy")?)
                .max(pe("mi-single")?)
                .max(pe("matusita")?);
            claims.push(
                Claim::above(
                    format!("{signal}-j-worst"),
                    "the J-divergence is worst of all",
                    pe("j-divergence")? - worst,
                    0.0,
                )
                .at_defaults(),
            );
            let checks = tables.named("checks")?;
            let gain = cell(checks, &[("signal", signal.into())], "single_change_gain")?;
            let what = "no change of one sensor improves on the identical minimum (grid of 0.05, dynamic programme)";
            claims.push(Claim::at_most(format!("{signal}-person-by-person"), what, gain, 1e-12));
            let unquantized = cell(checks, &[("signal", signal.into())], "unquantized_pe")?;
            claims.push(Claim::above(
                format!("{signal}-unquantized"),
                "four levels lose against samples",
                pe("pe")? - unquantized,
                0.0,
            ));
        }
        for (signal, known) in [(2.0, 1.267_365_9e-2), (4.0, 3.872_108_2e-6)] {
            if p.signals.contains(&signal) {
                let found = cell(tables.named("checks")?, &[("signal", signal.into())], "unquantized_pe")?;
                claims.push(
                    Claim::near_relative(format!("{signal}-q"), "error from samples", found, known, 1e-7).at_defaults(),
                );
            }
        }
        if p.signals.contains(&4.0) {
            let what = "the printed 1.0e-5 at the strong signal is below the best that any design found reaches (errata mi-11)";
            claims.push(Claim::above("too-low", what, at(4.0, "pe", "pe")? - 1.0e-5, 0.0).at_defaults());
            let found = at(4.0, "mi-joint", "equivocation_nats")?;
            claims.push(exact("equivocation", "ln 2 minus the information at the strong signal", found, 3.9e-5, 1e-6));
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let curve = tables.named("curve")?;
        let panels = p.signals.iter().map(|&signal| {
            let mut panel =
                Panel::new(format!("signal {signal}"), Axis::linear("offset t"), Axis::log("error probability"))
                    .with(Layer::line("identical quantizers", curve.only("signal", signal)?.points("t", "pe")?));
            let rows = tables.main.only("signal", signal)?;
            for method in ["mi-joint", "mi-single", "matusita", "j-divergence", "pe"] {
                panel = panel.with(Layer::points(method, rows.only("method", method)?.points("t", "pe")?));
            }
            Ok(panel)
        });
        Ok(Plot::grid(2, panels.collect::<Result<_, Error>>()?))
    }
}
