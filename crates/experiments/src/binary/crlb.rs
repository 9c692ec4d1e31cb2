//! `binary-fig5-6`: equation 5.13 for three sets of patterns, and why it misleads.

use super::{Scene, crossing, each, sweep, swept};
use crate::prelude::*;
use crate::reference;
use fewbits_binary_patterns::bounds::printed_crlb;
use fewbits_binary_patterns::{Mask, gray_basis, natural_basis};

pub struct PrintedBounds;

swept! { 0.0 to 30.0, step => quick 2.0,
    bits: Vec<usize> [1..=5; 1..=4] = vec![3, 4] => "Bits, and sensors.",
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
        Kind::Natural => Ok(natural_basis(bits)?),
        Kind::Gray => Ok(gray_basis(bits)?),
    }
}

/// Equation 5.13.
fn printed(kind: Kind, bits: usize, snr: f64) -> Result<f64, Error> {
    Ok(printed_crlb(&Scene::uniform(bits, snr)?.bank(&masks(kind, bits)?)?)?)
}

fn exact(kind: Kind, bits: usize, snr: f64) -> Result<f64, Error> {
    Scene::uniform(bits, snr)?.mmse(&masks(kind, bits)?)
}

/// Where two sets have the same value, near where the thesis's curves cross.
fn meet(a: Kind, b: Kind, bits: usize, name: &str) -> Result<Option<f64>, Error> {
    let Some(about) = reference::value(&format!("binary-fig5-6/crossing/{name} {bits} bits")) else {
        return Ok(None);
    };
    let difference = |snr| Ok(printed(a, bits, snr)? - printed(b, bits, snr)?);
    crossing(about - 3.0, about + 3.0, difference).map(Some)
}

rows! {
    pub struct Rows {
        sets: Vec<Row> => "Values and errors.",
        crossings: Vec<Crossing> => "Crossings of equation 5.13.",
    }

    struct Row {
        bits: usize => "Bits B and sensors N.",
        snr_db: f64 ["dB"] => "Signal-to-noise ratio.",
        crlb_fixed: f64 ["V^2"] => "Equation 5.13, all thresholds at zero.",
        crlb_natural: f64 ["V^2"] => "Equation 5.13, natural patterns.",
        crlb_gray: f64 ["V^2"] => "Equation 5.13, Gray patterns.",
        mse_fixed: f64 ["V^2"] => "Exact error, all thresholds at zero.",
        mse_natural: f64 ["V^2"] => "Exact error, natural patterns.",
        mse_gray: f64 ["V^2"] => "Exact error, Gray patterns.",
    }

    struct Crossing {
        bits: usize => "Bits B and sensors N.",
        fixed_gray_db: Option<f64> ["dB"] => "Where fixed and Gray cross.",
        gray_natural_db: Option<f64> ["dB"] => "Where Gray and natural cross.",
    }
}

impl Figure for PrintedBounds {
    figure!(Parameters => Rows, "binary-fig5-6", "The printed Cramer-Rao formula for fixed, natural and Gray patterns", "Movaghati, thesis, figure 5.6",
        "Left: equation 5.13 prefers a fixed threshold at low, Gray patterns at medium and natural patterns at high \
         signal-to-noise ratio. Right: the exact errors of the same sets. At high ratios Gray patterns are better throughout: the \
         formula averages information and does not see that natural bits fail together.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let (mut sets, mut crossings) = (Vec::new(), Vec::new());
        for &bits in &p.bits {
            let ratios = sweep(p.from_db, p.to_db, p.step_db);
            sets.extend(each(&ratios, |snr_db| {
                Ok(Row {
                    bits,
                    snr_db,
                    crlb_fixed: printed(Kind::Fixed, bits, snr_db)?,
                    crlb_natural: printed(Kind::Natural, bits, snr_db)?,
                    crlb_gray: printed(Kind::Gray, bits, snr_db)?,
                    mse_fixed: exact(Kind::Fixed, bits, snr_db)?,
                    mse_natural: exact(Kind::Natural, bits, snr_db)?,
                    mse_gray: exact(Kind::Gray, bits, snr_db)?,
                })
            })?);
            let fixed_gray_db = meet(Kind::Fixed, Kind::Gray, bits, "fixed-gray")?;
            let gray_natural_db = meet(Kind::Gray, Kind::Natural, bits, "gray-natural")?;
            if fixed_gray_db.is_some() {
                crossings.push(Crossing {
                    bits,
                    fixed_gray_db,
                    gray_natural_db,
                });
            }
        }
        Ok(Rows { sets, crossings })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let what = "the fixed threshold has the lowest value below, natural patterns above the crossing";
        let crossings = rows.crossings.iter().flat_map(|c| {
            [("fixed-gray", c.fixed_gray_db), ("gray-natural", c.gray_natural_db)]
                .map(|(name, at)| (format!("{name} {} bits", c.bits), at))
        });
        claims.references("crossing", what, crossings, |crossing| crossing);
        let natural = |bits: usize| first(&rows.crossings, |c| c.bits == bits).and_then(|c| c.gray_natural_db);
        let beyond = select(&rows.sets, |r| natural(r.bits).is_some_and(|at| r.snr_db > at));
        let what = "where the formula prefers natural patterns, Gray patterns have the smaller error";
        claims.all("contradiction", what, beyond, |r| r.crlb_natural < r.crlb_gray && r.mse_gray < r.mse_natural);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        type Column = fn(&Row) -> f64;
        let kinds: [(&str, &str, [Column; 3]); 2] = [
            ("Equation 5.13", "value / V²", [|r| r.crlb_fixed, |r| r.crlb_natural, |r| r.crlb_gray]),
            ("Exact error", "mean squared error / V²", [|r| r.mse_fixed, |r| r.mse_natural, |r| r.mse_gray]),
        ];
        let panels = p.bits.iter().flat_map(|&bits| {
            kinds.map(|(title, axis, columns)| {
                let curves = ["fixed threshold", "natural patterns", "Gray patterns"]
                    .into_iter()
                    .zip(columns)
                    .enumerate();
                let own = || rows.sets.iter().filter(move |r| r.bits == bits);
                let x = Axis::linear("signal-to-noise ratio / dB");
                Panel::new(format!("{title}, {bits} sensors of {bits} bits"), x, Axis::log(axis)).with_all(
                    curves.map(|(i, (label, value))| {
                        Layer::line(label, points(own(), |r| (r.snr_db, value(r)))).coloured(i)
                    }),
                )
            })
        });
        Plot::grid(2, panels.collect())
    }
}
