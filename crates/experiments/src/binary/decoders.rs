//! `binary-fig5-8`: decoders and bounds for three Gray bits.

use super::{ERROR, Scene, each, sweep, swept};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{
    Decoder, centralised_bound, network_rate_distortion, printed_crlb, remote_distortion,
};
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;
use fewbits_binary_patterns::gray_basis;

pub struct Decoders;

swept! { -10.0 to 40.0, step 1.0 => quick 5.0, {} }

rows! {
    pub struct Rows {
        curves: Vec<Row> => "Errors and bounds.",
        tightness: Vec<Tightness> => "How close the van Trees bound is, uniform source.",
    }

    struct Row by "{source} {snr_db} dB" {
        source: &'static str as panel("{} source") => "Uniform on [-1, 1], or Gaussian of variance 0.1.",
        snr_db: f64 ["dB"] as x("signal-to-noise ratio / dB") => "Signal-to-noise ratio.",
        mmse: f64 ["V^2"] as line("posterior mean") in decoders bounds => "Posterior mean.",
        cmap: f64 ["V^2"] as line("continuous MAP") in decoders => "Continuous maximum a posteriori.",
        dmap: f64 ["V^2"] as line("discrete MAP") in decoders => "Discrete maximum a posteriori, corrected.",
        dmap_print: f64 ["V^2"] as line("discrete MAP as printed") in decoders => "Equation 5.10 as printed (erratum binary-4).",
        dmap_exact: f64 ["V^2"] => "Discrete maximum a posteriori, exact cells.",
        crlb: f64 ["V^2"] as dashed("equation 5.13") in bounds => "Equation 5.13.",
        vt: f64 ["V^2"] as dashed("van Trees") in bounds => "Van Trees bound with optimal weight.",
        rd_print: f64 ["V^2"] as dashed("rate-distortion, printed") in bounds => "Rate-distortion bound as printed.",
        rd_per_n: f64 ["V^2"] as dashed("distortion at N bits") in bounds => "Rate-distortion bound of N bits.",
        central: f64 ["V^2"] as dashed("centralised") in bounds => "Exact centralised bound.",
    }

    struct Tightness by "{snr_db} dB" {
        snr_db: f64 ["dB"] => "Signal-to-noise ratio.",
        van_trees: f64 ["V^2"] => "Optimal-weight bound, uniform source.",
        mmse: f64 ["V^2"] => "Exact error.",
        crlb: f64 ["V^2"] => "Equation 5.13 with the denominators of its scores (erratum binary-8), uniform source.",
        ratio: f64 => "Bound over error.",
    }
}

fn row(source: &'static str, snr_db: f64) -> Result<Row, Error> {
    let scene = match source {
        "uniform" => Scene::uniform(3, snr_db)?,
        _ => Scene::gaussian(snr_db)?,
    };
    let bank = scene.bank(&gray_basis(3)?)?;
    Ok(Row {
        source,
        snr_db,
        mmse: Decoder::Mmse.mse(&bank)?,
        cmap: Decoder::ContinuousMap.mse(&bank)?,
        dmap: Decoder::DiscreteMap(&scene.grid).mse(&bank)?,
        dmap_print: Decoder::PrintedDiscreteMap(&scene.grid).mse(&bank)?,
        dmap_exact: Decoder::ExactDivisionMap(&scene.grid).mse(&bank)?,
        crlb: printed_crlb(&bank)?,
        vt: optimal_weight_van_trees(&bank)?,
        rd_print: remote_distortion(&scene.source, scene.noise)?.at(3.0)?,
        rd_per_n: network_rate_distortion(&scene.source, scene.noise, 3)?,
        central: centralised_bound(&scene.source, scene.noise, 3)?,
    })
}

fn tightness(snr_db: f64) -> Result<Tightness, Error> {
    let bank = Scene::uniform(3, snr_db)?.bank(&[4, 6, 3])?;
    let (van_trees, mmse) = (optimal_weight_van_trees(&bank)?, bank.mmse()?);
    Ok(Tightness {
        snr_db,
        van_trees,
        mmse,
        crlb: printed_crlb(&bank)?,
        ratio: van_trees / mmse,
    })
}

impl Figure for Decoders {
    figure!(Parameters => Rows, "binary-fig5-8", "Decoders and bounds, three Gray bits", "Movaghati, thesis, figure 5.8",
        "The caption of the thesis says Gaussian, the text uniform: both are here. The posterior mean is best everywhere. The \
         continuous maximum a posteriori (MAP) decoder is worse than the discrete one for a uniform source, and better only \
         up to 13 dB for a Gaussian one. Equation 5.13 is no bound for a uniform source; the optimal-weight van Trees \
         bound is one, and tight.";
        { decoders: semilog(ERROR, "Decoders"), bounds: semilog(ERROR, "Bounds") });

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let ratios = sweep(p.from_db, p.to_db, p.step_db);
        let of = |kind| each(&ratios, move |snr| row(kind, snr));
        Ok(Rows {
            curves: of("uniform")?.into_iter().chain(of("gaussian")?).collect(),
            tightness: each(&[-20.0, 0.0, 5.0, 8.0, 10.0, 15.0, 20.0, 25.0, 40.0], tightness)?,
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let of = |kind: &'static str| select(&rows.curves, move |r| r.source == kind);
        let at_most = 1.0 + 1e-9;
        let what = "the posterior mean is no worse than any other decoder, for either source (erratum binary-17)";
        claims.all("mmse", what, &rows.curves, |r| {
            let others = [r.cmap, r.dmap, r.dmap_print, r.dmap_exact];
            others.iter().all(|other| r.mmse <= other * at_most)
        });
        type Bound = (&'static str, &'static str, fn(&Row) -> f64);
        let bounds: [Bound; 3] = [
            ("van-trees", "the optimal-weight van Trees value", |r| r.vt),
            ("rate-distortion", "the rate-distortion value of N bits", |r| r.rd_per_n),
            ("central", "the centralised value", |r| r.central),
        ];
        for (id, what, bound) in bounds {
            claims.all(id, format!("{what} is a bound"), &rows.curves, |r| bound(r) <= r.mmse * at_most);
        }
        let what = "the exact centralised bound is above the rate-distortion bound";
        claims.all("central-tighter", what, &rows.curves, |r| r.rd_per_n <= r.central * at_most);
        let what = "for a uniform source the continuous MAP decoder is worse than the discrete one throughout (erratum binary-15)";
        claims.all("uniform-cmap", what, of("uniform"), |r| r.cmap > r.dmap);
        let what = "for a Gaussian source continuous MAP beats discrete MAP up to 13 dB and loses from 14 dB on";
        here.all("gaussian-cmap", what, of("gaussian"), |r| match r.snr_db {
            snr if snr <= 13.0 => r.cmap < r.dmap,
            snr => snr < 14.0 || r.cmap > r.dmap,
        });
        let what = "for a Gaussian source equation 5.13 is a bound";
        claims.all("gaussian-crlb", what, of("gaussian"), |r| r.crlb <= r.mmse * at_most);
        let what =
            "exact cell probabilities change the discrete decoder's error by less than a hundredth (erratum binary-5)";
        claims.all("exact-division", what, &rows.curves, |r| (r.dmap_exact / r.dmap - 1.0).abs() < 0.01);
        let what =
            "it exceeds the true error at -20, 0, 15 and 20 dB: no bound for a uniform source (erratum binary-7)";
        let beyond = select(&rows.tightness, |r| [-20.0, 0.0, 15.0, 20.0].contains(&r.snr_db));
        claims.all("uniform-crlb", what, beyond, |r| r.crlb > r.mmse);
    }
}
