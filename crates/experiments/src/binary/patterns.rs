//! `binary-fig5-2` to `binary-fig5-5` and `binary-figB-1`: the grid, its patterns, and what noise makes of one.

use super::{Scene, pattern, pattern_panel};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::{
    BinaryQuantizer, Grid, Mask, Pattern, Source, check_separation, generator_matrix, gray_basis, natural_basis,
};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// `binary-fig5-2`.
pub struct Clipping;

/// Parameters of `binary-fig5-2`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClippingParameters {
    /// Bits of the cell index.
    bits: usize,
    /// Signal-to-noise ratio at which both readings are compared, dB.
    snr_db: f64,
    /// Masks of the sensors that are compared.
    masks: Vec<Mask>,
}

impl Default for ClippingParameters {
    fn default() -> Self {
        Self {
            bits: 3,
            snr_db: 18.2,
            masks: vec![4, 6, 3, 3, 3, 3, 2, 2],
        }
    }
}

impl Figure for Clipping {
    type Parameters = ClippingParameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-2",
            title: "Cells of the measurement axis and the clipping rule",
            caption: "The axis is cut into 2^B cells; measurements beyond [-V, V] fall into the nearest outer cell. The thesis prints \
                      the two sides of this rule swapped (dashed); taken literally that ruins the best eight patterns.",
            source: "Movaghati, thesis, section 5.2",
        }
    }

    fn run(&self, p: &ClippingParameters, _: &Context<'_>) -> Result<Tables, Error> {
        let grid = Grid::uniform(1.0, p.bits).map_err(Error::failed)?;
        let cells = grid.cells();
        let mut table = Table::new([
            column("y", "V", "measurement"),
            column("cell", "", "cell of the measurement, from 1"),
            column("cell_swapped", "", "the same with the printed sides of the clipping rule"),
        ]);
        for i in -150..=150 {
            let y = f64::from(i) / 100.0;
            let cell = grid.locate(y).map_err(Error::failed)?;
            let swapped = if y < -1.0 {
                cells - 1
            } else if y > 1.0 {
                0
            } else {
                cell
            };
            table.push(row![y, cell + 1, swapped + 1])?;
        }
        let mut errors = Table::new([
            column("rule", "", "clipping rule"),
            column("mse", "V^2", "exact error of the posterior mean with these masks"),
        ]);
        let scene = Scene::uniform(p.bits, p.snr_db)?;
        errors.push(row!["nearest outer cell", scene.mmse(&p.masks)?])?;
        // The swapped rule is a pattern over a grid with two more cells, which carry the opposite end's bit.
        let mut edges = vec![-1.0];
        edges.extend(grid.breakpoints());
        edges.push(1.0);
        let wide = Scene {
            grid: Grid::from_breakpoints(edges).map_err(Error::failed)?,
            ..scene
        };
        let swapped_mse = |masks: &[Mask]| -> Result<f64, Error> {
            let patterns = masks
                .iter()
                .map(|&mask| {
                    let inner = pattern(mask, p.bits)?;
                    let mut bits = vec![inner.bits()[cells - 1]];
                    bits.extend(inner.bits());
                    bits.push(inner.bits()[0]);
                    Pattern::new(bits).map_err(Error::failed)
                })
                .collect::<Result<Vec<_>, _>>()?;
            wide.pattern_bank(&patterns)?.mmse().map_err(Error::failed)
        };
        errors.push(row!["sides swapped", swapped_mse(&p.masks)?])?;
        let all = Scene::uniform(p.bits, p.snr_db)?
            .search(p.masks.len())?
            .ranking()
            .map_err(Error::failed)?;
        let best = all
            .par_iter()
            .map(|set| swapped_mse(&set.masks))
            .collect::<Result<Vec<_>, _>>()?;
        errors.push(row![
            "sides swapped, best masks for that",
            crate::legacy::claim::smallest(best)
        ])?;
        Ok(Tables::from(table).with("errors", errors))
    }

    fn claims(&self, _: &ClippingParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let cells = tables.main.numbers("cell")?;
        let errors = tables.named("errors")?.numbers("mse")?;
        Ok(vec![
            Claim::never(
                "monotone",
                "the cell never decreases with the measurement",
                cells.windows(2).filter(|w| w[1] < w[0]).count(),
            ),
            Claim::near_relative(
                "optimum",
                "the best eight patterns at 18.2 dB",
                errors[0],
                0.003_119_112_724_490_280_5,
                1e-8,
            )
            .at_defaults(),
            Claim::near(
                "swapped",
                "with the printed sides even the best masks are thirteen times worse (erratum binary-1)",
                errors[2],
                0.0409,
                5e-4,
            )
            .at_defaults(),
        ])
    }

    fn plot(&self, p: &ClippingParameters, tables: &Tables) -> Result<Plot, Error> {
        let top = (1u32 << p.bits) as f64;
        Ok(Plot::of(
            Panel::new(
                "Cell of a measurement",
                Axis::linear("measurement y / V"),
                Axis::linear("cell").between(0.0, top + 2.8),
            )
            .with(Layer::dashed("sides as printed", tables.main.points("y", "cell_swapped")?).coloured(1))
            .with(Layer::line("nearest outer cell", tables.main.points("y", "cell")?).coloured(0))
            .legend(Legend::TopLeft),
        ))
    }
}

fn bits_table(rows: &[(String, Mask)], bits: usize) -> Result<Table, Error> {
    let mut table = Table::new([
        column("pattern", "", "name"),
        column("mask", "", "which natural patterns are XORed, the first the most significant digit"),
        column("l", "", "cell, from 1"),
        column("bit", "", "bit sent from the cell"),
    ]);
    for (name, mask) in rows {
        for (l, bit) in pattern(*mask, bits)?.bits().iter().enumerate() {
            table.push(row![name.as_str(), *mask, l + 1, u32::from(*bit)])?;
        }
    }
    Ok(table)
}

fn bits_plot(title: &str, rows: &[(String, Mask)], bits: usize) -> Result<Plot, Error> {
    let named = rows
        .iter()
        .map(|(name, mask)| Ok((name.clone(), pattern(*mask, bits)?)))
        .collect::<Result<Vec<_>, Error>>()?;
    Ok(Plot::of(pattern_panel(title, &named)))
}

/// The bits of the table as strings, pattern after pattern.
fn strings(tables: &Tables, bits: usize) -> Result<Vec<String>, Error> {
    let digits = tables.main.texts("bit")?;
    Ok(digits.chunks(1 << bits).map(|c| c.concat()).collect())
}

fn mismatches(ours: &[String], printed: &[&str]) -> usize {
    ours.len().abs_diff(printed.len()) + ours.iter().zip(printed).filter(|(a, b)| a != b).count()
}

fn check_bits(figure: &'static str, bits: usize) -> Result<(), Error> {
    if (1..=8).contains(&bits) {
        return Ok(());
    }
    Err(Error::BadParameter {
        figure,
        name: "bits".into(),
        value: bits.to_string(),
        expected: "1 to 8".into(),
    })
}

/// Parameters of the pattern pictures.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BitsParameters {
    /// Bits of the cell index.
    bits: usize,
}

impl Default for BitsParameters {
    fn default() -> Self {
        Self { bits: 4 }
    }
}

/// `binary-fig5-3`.
pub struct Natural;

fn natural_rows(bits: usize) -> Result<Vec<(String, Mask)>, Error> {
    let masks = natural_basis(bits).map_err(Error::failed)?;
    Ok(masks
        .into_iter()
        .enumerate()
        .map(|(b, mask)| (format!("N{}", b + 1), mask))
        .collect())
}

impl Figure for Natural {
    type Parameters = BitsParameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-3",
            title: "Natural patterns",
            caption: "The binary digits of the cell's index, most significant first. The finest of them changes at every edge.",
            source: "Movaghati, thesis, figure 5.3",
        }
    }

    fn check(&self, p: &BitsParameters) -> Result<(), Error> {
        check_bits("binary-fig5-3", p.bits)
    }

    fn run(&self, p: &BitsParameters, _: &Context<'_>) -> Result<Tables, Error> {
        Ok(bits_table(&natural_rows(p.bits)?, p.bits)?.into())
    }

    fn claims(&self, p: &BitsParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let ours = strings(tables, p.bits)?;
        let printed = [
            "0000000011111111",
            "0000111100001111",
            "0011001100110011",
            "0101010101010101",
        ];
        Ok(vec![
            Claim::never("bits", "the patterns are those printed", mismatches(&ours, &printed)).at_defaults(),
        ])
    }

    fn plot(&self, p: &BitsParameters, _: &Tables) -> Result<Plot, Error> {
        bits_plot("Natural patterns", &natural_rows(p.bits)?, p.bits)
    }
}

/// `binary-fig5-4`.
pub struct Gray;

fn gray_rows(bits: usize) -> Result<Vec<(String, Mask)>, Error> {
    let masks = gray_basis(bits).map_err(Error::failed)?;
    Ok(masks
        .into_iter()
        .enumerate()
        .map(|(b, mask)| (format!("G{}", b + 1), mask))
        .collect())
}

impl Figure for Gray {
    type Parameters = BitsParameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-4",
            title: "Gray patterns",
            caption: "XORs of neighbouring natural patterns. Every edge belongs to exactly one pattern, so that a measurement near an edge \
                      endangers one bit only.",
            source: "Movaghati, thesis, figure 5.4",
        }
    }

    fn check(&self, p: &BitsParameters) -> Result<(), Error> {
        check_bits("binary-fig5-4", p.bits)
    }

    fn run(&self, p: &BitsParameters, _: &Context<'_>) -> Result<Tables, Error> {
        Ok(bits_table(&gray_rows(p.bits)?, p.bits)?.into())
    }

    fn claims(&self, p: &BitsParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let ours = strings(tables, p.bits)?;
        let printed = [
            "0000000011111111",
            "0000111111110000",
            "0011110000111100",
            "0110011001100110",
        ];
        let rows = generator_matrix(&gray_basis(p.bits).map_err(Error::failed)?, p.bits).map_err(Error::failed)?;
        let distances = rows
            .windows(2)
            .map(|w| w[0].iter().zip(&w[1]).filter(|(a, b)| a != b).count());
        Ok(vec![
            Claim::never("bits", "the patterns are those printed", mismatches(&ours, &printed)).at_defaults(),
            Claim::never(
                "adjacent",
                "neighbouring cells differ in exactly one bit",
                distances.filter(|d| *d != 1).count(),
            ),
        ])
    }

    fn plot(&self, p: &BitsParameters, _: &Tables) -> Result<Plot, Error> {
        bits_plot("Gray patterns", &gray_rows(p.bits)?, p.bits)
    }
}

/// `binary-fig5-5`.
pub struct Extra;

/// Parameters of `binary-fig5-5`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExtraParameters {
    /// Bits of the cell index.
    bits: usize,
    /// Masks beyond the Gray basis.
    extra: Vec<Mask>,
}

impl Default for ExtraParameters {
    fn default() -> Self {
        Self {
            bits: 4,
            extra: vec![14, 5, 11],
        }
    }
}

impl ExtraParameters {
    fn rows(&self) -> Vec<(String, Mask)> {
        self.extra.iter().map(|&mask| (format!("mask {mask}"), mask)).collect()
    }
}

impl Figure for Extra {
    type Parameters = ExtraParameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-5",
            title: "Further linear patterns",
            caption: "With more sensors than bits, further XORs of the natural patterns join the Gray basis: columns 5 to 7 of the \
                      thesis's generator matrix (5.6).",
            source: "Movaghati, thesis, figure 5.5 and equation 5.6",
        }
    }

    fn check(&self, p: &ExtraParameters) -> Result<(), Error> {
        check_bits("binary-fig5-5", p.bits)
    }

    fn run(&self, p: &ExtraParameters, _: &Context<'_>) -> Result<Tables, Error> {
        Ok(bits_table(&p.rows(), p.bits)?.into())
    }

    fn claims(&self, p: &ExtraParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let ours = strings(tables, p.bits)?;
        let printed = ["0011110011000011", "0101101001011010", "0110011010011001"];
        let mut masks = gray_basis(p.bits).map_err(Error::failed)?;
        masks.extend(&p.extra);
        let all = masks
            .iter()
            .map(|&mask| pattern(mask, p.bits))
            .collect::<Result<Vec<_>, _>>()?;
        // Independent over GF(2), yet two cells carry the same column: footnote 2 of the thesis holds for linear patterns only.
        let counterexample = ["00001111", "00110000", "01000000"]
            .iter()
            .map(|text| text.parse::<Pattern>())
            .collect::<Result<Vec<_>, _>>()
            .map_err(Error::failed)?;
        Ok(vec![
            Claim::never("bits", "the patterns are columns 5 to 7 of matrix (5.6)", mismatches(&ours, &printed))
                .at_defaults(),
            Claim::never(
                "separating",
                "with the Gray basis they separate all cells",
                usize::from(check_separation(&all).is_err()),
            ),
            Claim::at_least(
                "independence",
                "independent patterns that are not linear need not separate the cells (erratum binary-3)",
                f64::from(u8::from(check_separation(&counterexample).is_err())),
                1.0,
            ),
        ])
    }

    fn plot(&self, p: &ExtraParameters, _: &Tables) -> Result<Plot, Error> {
        bits_plot("Further linear patterns", &p.rows(), p.bits)
    }
}

/// `binary-figB-1`.
pub struct Response;

/// Parameters of `binary-figB-1`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponseParameters {
    /// Where the bit changes, in units of V.
    thresholds: Vec<f64>,
    /// Noise standard deviation, in units of V.
    noise_std: f64,
}

impl Default for ResponseParameters {
    fn default() -> Self {
        Self {
            thresholds: vec![-0.6, -0.2, 0.1, 0.7],
            noise_std: 0.1,
        }
    }
}

impl Figure for Response {
    type Parameters = ResponseParameters;

    fn about(&self) -> About {
        About {
            id: "binary-figB-1",
            title: "Probability of a 1 under a pattern with four edges",
            caption: "Noise rounds the pattern off; a run of cells narrower than about two standard deviations never reaches certainty. The \
                      derivative of this curve over its standard deviation is the information in the bit.",
            source: "Movaghati, thesis, figure B.1",
        }
    }

    fn run(&self, p: &ResponseParameters, _: &Context<'_>) -> Result<Tables, Error> {
        let quantizer = BinaryQuantizer::new(p.thresholds.clone()).map_err(Error::failed)?;
        let noise = fewbits_numerics::error::positive("noise_std", p.noise_std)?;
        // Only checks that the source the axis stands for exists.
        Source::uniform(1.0).map_err(Error::failed)?;
        let mut table = Table::new([
            column("x", "V", "source"),
            column("bit", "", "bit without noise"),
            column("p1", "", "probability of a 1"),
            column("information", "1/V^2", "Fisher information about x in the bit"),
        ]);
        for i in 0..=800 {
            let x = -1.0 + f64::from(i) / 400.0;
            let bit = u32::from(quantizer.encode(x).map_err(Error::failed)?);
            let p1 = quantizer.probabilities(x, noise)[1];
            table.push(row![x, bit, p1, quantizer.fisher_information(x, noise)])?;
        }
        Ok(table.into())
    }

    fn claims(&self, p: &ResponseParameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let p1 = tables.main.points("x", "p1")?;
        let at_edges = p.thresholds.iter().map(|t| {
            let nearest = p1.iter().min_by(|a, b| (a.0 - t).abs().total_cmp(&(b.0 - t).abs()));
            nearest.map_or(1.0, |point| (point.1 - 0.5).abs())
        });
        Ok(vec![
            Claim::at_most(
                "half",
                "at an edge far from the others both bits are equally likely",
                crate::legacy::claim::largest(at_edges),
                2e-3,
            )
            .at_defaults(),
            Claim::never(
                "probabilities",
                "all values are probabilities",
                p1.iter().filter(|v| !(0.0..=1.0).contains(&v.1)).count(),
            ),
        ])
    }

    fn plot(&self, _: &ResponseParameters, tables: &Tables) -> Result<Plot, Error> {
        let x = || Axis::linear("x / V");
        Ok(Plot::grid(
            2,
            vec![
                Panel::new("Probability of a 1", x(), Axis::linear("P(1|x)").between(-0.05, 1.25))
                    .with(Layer::dashed("without noise", tables.main.points("x", "bit")?).coloured(7))
                    .with(Layer::line("with noise", tables.main.points("x", "p1")?).coloured(0)),
                Panel::new("Information in the bit", x(), Axis::linear("Fisher information / V^-2"))
                    .with(Layer::line("", tables.main.points("x", "information")?).coloured(1))
                    .legend(Legend::Hidden),
            ],
        ))
    }
}
