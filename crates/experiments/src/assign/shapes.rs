//! `assign-fig6-1` and `assign-figC-1`: where a wrong bit lands, and how likely it is.

use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_sensor_assignment::{CodedSensors, bit_error, flipped_estimate};
use serde::{Deserialize, Serialize};

const BITS: usize = 4;

/// `-1, -1 + step, ..., 1`.
fn axis_points(step: f64) -> Vec<f64> {
    let count = (2.0 / step).round().max(1.0) as usize;
    (0..=count).map(|i| -1.0 + 2.0 * i as f64 / count as f64).collect()
}

fn check_step(figure: &'static str, step: f64) -> Result<(), Error> {
    if (1e-5..=1.0).contains(&step) {
        return Ok(());
    }
    Err(Error::BadParameter {
        figure,
        name: "step".into(),
        value: step.to_string(),
        expected: "a number from 1e-5 to 1".into(),
    })
}

/// `assign-fig6-1`.
pub struct Landings;

/// Parameters of `assign-fig6-1`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LandingParameters {
    /// Step of the horizontal axis in units of V.
    step: f64,
}

impl Default for LandingParameters {
    fn default() -> Self {
        Self { step: 0.002 }
    }
}

const LANDINGS: [&str; BITS] = ["f1", "f2", "f3", "f4"];

impl Figure for Landings {
    type Parameters = LandingParameters;

    fn about(&self) -> About {
        About {
            id: "assign-fig6-1",
            title: "Where a wrong bit lands",
            caption: "The estimate f_b(x) of the centre decoder when bit b of a four-bit Gray code is wrong and the others are right. A wrong \
                      coarse bit mirrors the estimate across the whole range, a wrong fine bit only within a small block.",
            source: "Movaghati, thesis, figure 6.1",
        }
    }

    fn check(&self, p: &LandingParameters) -> Result<(), Error> {
        check_step("assign-fig6-1", p.step)
    }

    fn run(&self, p: &LandingParameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut columns = vec![column("x", "V", "source")];
        columns.extend(
            LANDINGS
                .iter()
                .map(|name| column(name, "V", "estimate with this bit wrong")),
        );
        let mut table = Table::new(columns);
        for x in axis_points(p.step) {
            let mut row = row![x];
            for bit in 0..BITS {
                row.push(flipped_estimate(x, bit, BITS, 1.0).map_err(Error::failed)?.into());
            }
            table.push(row)?;
        }
        Ok(table.into())
    }

    fn claims(&self, _: &LandingParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let centres: Vec<f64> = (0..16).map(|c| (2.0 * f64::from(c) + 1.0) / 16.0 - 1.0).collect();
        let mut broken = 0;
        for bit in 0..BITS {
            for &centre in &centres {
                let there = flipped_estimate(centre, bit, BITS, 1.0).map_err(Error::failed)?;
                let back = flipped_estimate(there, bit, BITS, 1.0).map_err(Error::failed)?;
                broken +=
                    usize::from((back - centre).abs() > 1e-14 || !centres.iter().any(|c| (c - there).abs() < 1e-14));
            }
        }
        let mut levels = 0;
        for name in LANDINGS {
            let mut values = tables.main.numbers(name)?;
            values.sort_by(f64::total_cmp);
            values.dedup();
            levels += values.len().abs_diff(16);
        }
        Ok(vec![
            Claim::never("involution", "flipping a bit twice returns to the centre", broken),
            Claim::never("staircase", "every curve takes exactly the sixteen centres as values", levels).at_defaults(),
        ])
    }

    fn plot(&self, _: &LandingParameters, tables: &Tables) -> Result<Plot, Error> {
        let panels = LANDINGS
            .iter()
            .enumerate()
            .map(|(bit, name)| {
                Ok(Panel::new(
                    format!("Bit {} wrong", bit + 1),
                    Axis::linear("x / V"),
                    Axis::linear("estimate / V").between(-1.1, 1.1),
                )
                .with(Layer::line("", tables.main.points("x", name)?).coloured(bit))
                .with(Layer::dashed("", vec![(-1.0, -1.0), (1.0, 1.0)]).coloured(7))
                .legend(Legend::Hidden))
            })
            .collect::<Result<_, Error>>()?;
        Ok(Plot::grid(2, panels))
    }
}

/// `assign-figC-1`.
pub struct BitErrors;

/// Parameters of `assign-figC-1`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ErrorParameters {
    /// Noise variance in units of V^2.
    variance: f64,
    /// Step of the horizontal axis in units of V.
    step: f64,
}

impl Default for ErrorParameters {
    fn default() -> Self {
        Self {
            variance: 0.03,
            step: 0.002,
        }
    }
}

const ERRORS: [&str; BITS] = ["pa1", "pa2", "pa3", "pa4"];

impl Figure for BitErrors {
    type Parameters = ErrorParameters;

    fn about(&self) -> About {
        About {
            id: "assign-figC-1",
            title: "Probability that a bit is wrong",
            caption: "For each bit of a four-bit Gray code, the probability that noise turns it: one half at the bit's own edges, \
                      except where noise reaches across further ones, and for the finest bit hardly less between them. The thesis \
                      calls the variance sigma.",
            source: "Movaghati, thesis, figure C.1",
        }
    }

    fn check(&self, p: &ErrorParameters) -> Result<(), Error> {
        fewbits_numerics::error::positive("variance", p.variance)?;
        check_step("assign-figC-1", p.step)
    }

    fn run(&self, p: &ErrorParameters, _: &Context<'_>) -> Result<Tables, Error> {
        let sensors = CodedSensors::new(1.0, &[p.variance; BITS]).map_err(Error::failed)?;
        let mut columns = vec![column("x", "V", "source")];
        columns.extend(
            ERRORS
                .iter()
                .map(|name| column(name, "", "probability that this bit is wrong")),
        );
        let mut table = Table::new(columns);
        for x in axis_points(p.step) {
            let mut row = row![x];
            for quantizer in sensors.quantizers() {
                row.push(
                    bit_error(quantizer, x, p.variance.sqrt())
                        .map_err(Error::failed)?
                        .into(),
                );
            }
            table.push(row)?;
        }
        Ok(table.into())
    }

    fn claims(&self, _: &ErrorParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let first = tables.main.points("x", "pa1")?;
        let at = |x: f64| first.iter().find(|p| (p.0 - x).abs() < 1e-9).map_or(-1.0, |p| p.1);
        let mut beyond = 0;
        let mut means = Vec::new();
        for name in ERRORS {
            let values = tables.main.numbers(name)?;
            beyond += values.iter().filter(|v| !(0.0..=1.0).contains(*v)).count();
            means.push(values.iter().sum::<f64>() / values.len() as f64);
        }
        Ok(vec![
            Claim::near("half", "the sign bit is a coin at zero", at(0.0), 0.5, 1e-12).at_defaults(),
            Claim::near(
                "sign",
                "and wrong with probability 0.12410654 at 0.2",
                at(0.2),
                0.124_106_539_494_961_86,
                1e-9,
            )
            .at_defaults(),
            Claim::never("probabilities", "all values are probabilities", beyond),
            Claim::never(
                "order",
                "finer bits are wrong more often on average",
                crate::legacy::claim::not_increasing(&means),
            )
            .at_defaults(),
        ])
    }

    fn plot(&self, p: &ErrorParameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panel = Panel::new(
            format!("Noise variance {}", p.variance),
            Axis::linear("x / V"),
            Axis::linear("probability that the bit is wrong").between(0.0, 0.9),
        );
        for (bit, name) in ERRORS.iter().enumerate() {
            panel = panel.with(Layer::line(format!("bit {}", bit + 1), tables.main.points("x", name)?).coloured(bit));
        }
        Ok(Plot::of(panel))
    }
}
