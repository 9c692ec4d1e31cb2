//! `binary-fig5-9`: a Gaussian source, three sensors of three bits.

use super::{Scene, crossing, each, sweep, swept};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{network_rate_distortion, remote_distortion};
use fewbits_binary_patterns::Mask;
use fewbits_binary_patterns::bounds::optimal_weight_van_trees;

pub struct GaussianSource;

swept! { -10.0 to 30.0, step 1.0 => quick 5.0, {} }

const SENSORS: usize = 3;
const GRAY: [Mask; 3] = [3, 4, 6];
const OTHER: [Mask; 3] = [4, 6, 7];

rows! {
    pub struct Rows {
        errors: Vec<Row> => "Errors and bounds; the variance of the source is 0.1.",
        crossings: Vec<Crossing> => "Where two bases have the same error.",
    }

    struct Row by "{snr_db} dB" {
        snr_db: f64 ["dB"] as x("signal-to-noise ratio / dB") => "Signal-to-noise ratio.",
        mse_opt: f64 as line("best basis") => "Least error over the 28 bases.",
        masks: List<Mask> => "The best basis.",
        mse_gray: f64 as line("Gray") => "Error of the Gray basis.",
        mse_natural: f64 as line("natural") => "Error of the natural basis.",
        dr_print: f64 as dashed("D(R), printed") => "Equation 5.12 as printed, R = 3.",
        dr_per_n: f64 as dashed("D(R), three observations") => "The same with the noise of the average.",
        vt: f64 as dashed("van Trees bound, best basis") => "Optimal-weight van Trees bound of the best basis.",
        mse_unconstrained: f64 as line("any three masks") => "Least error over all triples of masks.",
        masks_unconstrained: List<Mask> => "The best triple.",
        mse_signs: f64 as line("three signs") => "Error of three sign bits.",
    }

    struct Crossing by "{pair}" {
        pair: &'static str => "Two bases.",
        snr_db: f64 ["dB"] => "Where their errors are equal: between them {4,6,7} is best (erratum binary-13).",
    }
}

impl Figure for GaussianSource {
    figure!(Parameters => Rows, "binary-fig5-9", "Gaussian source, three sensors of three bits", "Movaghati, thesis, figure 5.9",
        "The best basis against Gray and natural patterns, the printed distortion-rate function of one observation and the \
         correct one of three. The printed one is no bound: three identical sign bits fall below it at low ratios."; semilog("mean squared error"));

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let ratios = sweep(p.from_db, p.to_db, p.step_db);
        let errors = each(&ratios, |snr_db| {
            let scene = Scene::gaussian(snr_db)?;
            let search = scene.search(SENSORS)?;
            let best = search.best()?;
            let any = search.any_rank().best()?;
            let printed = remote_distortion(&scene.source, scene.noise).and_then(|d| d.at(3.0));
            Ok(Row {
                snr_db,
                mse_opt: best.mse,
                masks: List(best.masks.clone()),
                mse_gray: scene.mmse(&GRAY)?,
                mse_natural: scene.mmse(&[4, 2, 1])?,
                dr_print: printed?,
                dr_per_n: network_rate_distortion(&scene.source, scene.noise, SENSORS)?,
                vt: optimal_weight_van_trees(&scene.bank(&best.masks)?)?,
                mse_unconstrained: any.mse,
                masks_unconstrained: List(any.masks),
                mse_signs: scene.mmse(&[4, 4, 4])?,
            })
        })?;
        let meet = |pair, a: &[Mask], b: &[Mask], low, high| -> Result<Crossing, Error> {
            let gap = |snr| {
                let scene = Scene::gaussian(snr)?;
                Ok(scene.mmse(a)? - scene.mmse(b)?)
            };
            let snr_db = crossing(low, high, gap)?;
            Ok(Crossing { pair, snr_db })
        };
        let crossings = vec![
            meet("{4,5,6} and {4,6,7}", &[4, 5, 6], &OTHER, 4.0, 5.5)?,
            meet("{4,6,7} and Gray", &OTHER, &GRAY, 5.5, 7.0)?,
        ];
        Ok(Rows { errors, crossings })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let errors = &rows.errors;
        let what = "the corrected distortion-rate function bounds every set";
        claims.all("bound", what, errors, |r| r.dr_per_n <= r.mse_unconstrained * (1.0 + 1e-9));
        let what = "the van Trees bound is below the best basis";
        claims.all("van-trees", what, errors, |r| r.vt <= r.mse_opt * (1.0 + 1e-9));
        let violated = errors.iter().filter(|r| r.mse_signs < r.dr_print).count();
        let what = "three sign bits fall below the printed function somewhere (erratum binary-6)";
        here.at_least("printed-violated", what, violated as f64, 1.0);
        let from = rows.crossings.last().map_or(f64::NAN, |c| c.snr_db);
        let what = "Gray is the best basis above 6.032 dB and only there";
        claims.all("gray-above", what, errors, |r| (r.masks.0 == GRAY) == (r.snr_db > from));
        let what = "and never better than the best";
        claims.all("gray-no-better", what, errors, |r| r.mse_gray >= r.mse_opt * (1.0 - 1e-9));
    }
}
