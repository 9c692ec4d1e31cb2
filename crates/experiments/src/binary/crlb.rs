//! `binary-fig5-6`: equation 5.13 for three sets of patterns, and why it misleads.

use super::{ERROR, Scene, crossing, each, sweep, swept};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::printed_crlb;
use fewbits_binary_patterns::{Mask, gray_basis, natural_basis};

pub struct PrintedBounds;

swept! { 0.0 to 30.0, step 1.0 => quick 2.0, {
    bits: Vec<usize> [1..=5; 1..=4] = vec![3, 4] => "Bits, and sensors.",
} }

/// Where equation 5.13 has the same value for two sets, near where the thesis's curves cross.
fn meet(bits: usize, name: &str, [a, b]: [&[Mask]; 2]) -> Result<Option<f64>, Error> {
    let Some(about) = reference::value(&format!("binary-fig5-6/crossing/{name} {bits} bits")) else {
        return Ok(None);
    };
    let difference = |snr| {
        let scene = Scene::uniform(bits, snr)?;
        Ok(printed_crlb(&scene.bank(a)?)? - printed_crlb(&scene.bank(b)?)?)
    };
    crossing(about - 3.0, about + 3.0, difference).map(Some)
}

rows! {
    #[derive(Default)]
    pub struct Rows {
        sets: Vec<Row> => "Values and errors.",
        crossings: Vec<Crossing> => "Crossings of equation 5.13.",
    }

    struct Row {
        bits: usize as panel("{} bits") => "Bits B and sensors N.",
        snr_db: f64 ["dB"] as x("signal-to-noise ratio / dB") => "Signal-to-noise ratio.",
        crlb_fixed: f64 ["V^2"] as line("fixed threshold") in values => "Equation 5.13, all thresholds at zero.",
        crlb_natural: f64 ["V^2"] as line("natural patterns") in values => "Equation 5.13, natural patterns.",
        crlb_gray: f64 ["V^2"] as line("Gray patterns") in values => "Equation 5.13, Gray patterns.",
        mse_fixed: f64 ["V^2"] as line("fixed threshold") in errors => "Exact error, all thresholds at zero.",
        mse_natural: f64 ["V^2"] as line("natural patterns") in errors => "Exact error, natural patterns.",
        mse_gray: f64 ["V^2"] as line("Gray patterns") in errors => "Exact error, Gray patterns.",
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
         formula averages information and does not see that natural bits fail together.";
        { values: semilog("value / V²", "Equation 5.13"), errors: semilog(ERROR, "Exact error") });

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows::default();
        for &bits in &p.bits {
            // As many sensors as bits.
            let (fixed, natural, gray) = (vec![1 << (bits - 1); bits], natural_basis(bits)?, gray_basis(bits)?);
            rows.sets.extend(each(&sweep(p.from_db, p.to_db, p.step_db), |snr_db| {
                let scene = Scene::uniform(bits, snr_db)?;
                let crlb = |masks: &[Mask]| Ok::<_, Error>(printed_crlb(&scene.bank(masks)?)?);
                Ok(Row {
                    bits,
                    snr_db,
                    crlb_fixed: crlb(&fixed)?,
                    crlb_natural: crlb(&natural)?,
                    crlb_gray: crlb(&gray)?,
                    mse_fixed: scene.mmse(&fixed)?,
                    mse_natural: scene.mmse(&natural)?,
                    mse_gray: scene.mmse(&gray)?,
                })
            })?);
            let fixed_gray_db = meet(bits, "fixed-gray", [&fixed, &gray])?;
            let gray_natural_db = meet(bits, "gray-natural", [&gray, &natural])?;
            if fixed_gray_db.is_some() {
                rows.crossings.push(Crossing {
                    bits,
                    fixed_gray_db,
                    gray_natural_db,
                });
            }
        }
        Ok(rows)
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
}
