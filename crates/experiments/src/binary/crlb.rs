//! `binary-fig5-6`: equation 5.13 for three sets of patterns, and why it misleads.

use super::{Scene, check_sweep, crossing, each, sweep};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::bounds::printed_crlb;
use fewbits_binary_patterns::{Mask, gray_basis, natural_basis};
use serde::{Deserialize, Serialize};

/// `binary-fig5-6`.
pub struct PrintedBounds;

/// Parameters of `binary-fig5-6`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Bits, and sensors.
    bits: Vec<usize>,
    /// First signal-to-noise ratio, dB.
    from_db: f64,
    /// Last signal-to-noise ratio, dB.
    to_db: f64,
    /// Step, dB.
    step_db: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            bits: vec![3, 4],
            from_db: 0.0,
            to_db: 30.0,
            step_db: 1.0,
        }
    }
}

#[derive(Clone, Copy)]
enum Kind {
    Fixed,
    Natural,
    Gray,
}

fn masks(kind: Kind, bits: usize) -> Result<Vec<Mask>, Error> {
    match kind {
        Kind::Fixed => Ok(vec![1 << (bits - 1); bits]),
        Kind::Natural => natural_basis(bits).map_err(Error::failed),
        Kind::Gray => gray_basis(bits).map_err(Error::failed),
    }
}

/// Equation 5.13 and the exact error.
fn values(kind: Kind, bits: usize, snr: f64) -> Result<(f64, f64), Error> {
    let bank = Scene::uniform(bits, snr)?.bank(&masks(kind, bits)?)?;
    Ok((printed_crlb(&bank).map_err(Error::failed)?, bank.mmse().map_err(Error::failed)?))
}

fn difference(a: Kind, b: Kind, bits: usize, low: f64, high: f64) -> Result<f64, Error> {
    let crlb = |kind, snr| -> Result<f64, Error> {
        printed_crlb(&Scene::uniform(bits, snr)?.bank(&masks(kind, bits)?)?).map_err(Error::failed)
    };
    crossing(low, high, |snr| Ok(crlb(a, snr)? - crlb(b, snr)?))
}

/// Where the thesis's curves cross: bits, fixed with Gray, Gray with natural.
const CROSSINGS: [(usize, f64, f64); 2] = [
    (3, 4.973_374_255_046_639_5, 14.507_565_706_259_713),
    (4, 6.916_634_482_651_003, 19.415_692_206_934_086),
];

impl Figure for PrintedBounds {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-6",
            title: "The printed Cramer-Rao formula for fixed, natural and Gray patterns",
            caption: "Left: equation 5.13 prefers a fixed threshold at low, Gray patterns at medium and natural patterns at high \
                      signal-to-noise ratio. Right: the exact errors of the same sets. At high ratios Gray patterns are better throughout: the \
                      formula averages information and does not see that natural bits fail together.",
            source: "Movaghati, thesis, figure 5.6",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        check_sweep("binary-fig5-6", p.from_db, p.to_db, p.step_db)
    }

    fn quicken(&self, p: &mut Parameters) {
        p.step_db = 2.0;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("bits", "", "bits B and sensors N"),
            column("snr_db", "dB", "signal-to-noise ratio"),
            column("crlb_fixed", "V^2", "equation 5.13, all thresholds at zero"),
            column("crlb_natural", "V^2", "equation 5.13, natural patterns"),
            column("crlb_gray", "V^2", "equation 5.13, Gray patterns"),
            column("mse_fixed", "V^2", "exact error, all thresholds at zero"),
            column("mse_natural", "V^2", "exact error, natural patterns"),
            column("mse_gray", "V^2", "exact error, Gray patterns"),
        ]);
        let mut crossings = Table::new([
            column("bits", "", "bits B and sensors N"),
            column("fixed_gray_db", "dB", "where fixed and Gray cross"),
            column("gray_natural_db", "dB", "where Gray and natural cross"),
        ]);
        for &bits in &p.bits {
            let points = sweep(p.from_db, p.to_db, p.step_db);
            let rows = each(&points, |snr| {
                Ok([
                    values(Kind::Fixed, bits, snr)?,
                    values(Kind::Natural, bits, snr)?,
                    values(Kind::Gray, bits, snr)?,
                ])
            })?;
            for (snr, [f, n, g]) in points.iter().zip(rows) {
                table.push(row![bits, *snr, f.0, n.0, g.0, f.1, n.1, g.1])?;
            }
            if let Some((_, first, second)) = CROSSINGS.iter().find(|c| c.0 == bits) {
                crossings.push(row![
                    bits,
                    difference(Kind::Fixed, Kind::Gray, bits, first - 3.0, first + 3.0)?,
                    difference(Kind::Gray, Kind::Natural, bits, second - 3.0, second + 3.0)?
                ])?;
            }
        }
        Ok(Tables::from(table).with("crossings", crossings))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        let crossings = tables.named("crossings")?;
        for (bits, fixed_gray, gray_natural) in CROSSINGS.iter().filter(|c| p.bits.contains(&c.0)) {
            let own = crossings.only("bits", *bits)?;
            claims.push(Claim::near(
                format!("fixed-below-b{bits}"),
                format!("with {bits} bits, the fixed threshold has the lowest value below {fixed_gray:.3} dB"),
                own.numbers("fixed_gray_db")?[0],
                *fixed_gray,
                1e-3,
            ));
            claims.push(Claim::near(
                format!("natural-above-b{bits}"),
                format!("with {bits} bits, natural patterns have the lowest value above {gray_natural:.3} dB"),
                own.numbers("gray_natural_db")?[0],
                *gray_natural,
                1e-3,
            ));
            let rows = tables.main.only("bits", *bits)?;
            let (snr, natural, gray) =
                (rows.numbers("snr_db")?, rows.numbers("mse_natural")?, rows.numbers("mse_gray")?);
            let broken = (0..snr.len())
                .filter(|&i| snr[i] > *gray_natural && natural[i] <= gray[i])
                .count();
            claims.push(Claim::never(
                format!("contradiction-b{bits}"),
                "where the formula prefers natural patterns, Gray patterns have the smaller error",
                broken,
            ));
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for &bits in &p.bits {
            let rows = tables.main.only("bits", bits)?;
            for (kind, title) in [("crlb", "Equation 5.13"), ("mse", "Exact error")] {
                let mut panel = Panel::new(
                    format!("{title}, N = B = {bits}"),
                    Axis::linear("signal-to-noise ratio / dB"),
                    Axis::log("V^2"),
                );
                for (colour, set) in ["fixed", "natural", "gray"].into_iter().enumerate() {
                    let points = rows.points("snr_db", &format!("{kind}_{set}"))?;
                    panel = panel.with(Layer::line(set, points).coloured(colour));
                }
                panels.push(panel.legend(Legend::TopRight));
            }
        }
        Ok(Plot::grid(2, panels))
    }
}
