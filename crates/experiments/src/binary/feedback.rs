//! `binary-fig5-10`: ten sensors, with and without feedback.

use super::{ERROR, Scene, descent_from, each, sweep, swept};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{
    AdaptiveRule, ConditionalMean, Luo, adaptive, fixed_threshold, multi_threshold_bound,
};
use fewbits_binary_patterns::{Mask, gray_basis};

pub struct Feedback;

swept! { 0.0 to 40.0 => quick 30.0, step 2.5 => quick 10.0, {
    sensors: usize [3..=14] = 10 => "Number of sensors.",
    most_bits: usize [3..=8] = 7 => quick 5 => "Most bits of the cell index that are tried.",
    vs_step: f64 [1e-6..=10.0] = 0.5 => "First step of AQ-VS in units of V. The thesis gives no rule.",
    vs_factor: f64 [1.0..=10.0] = 1.5 => "Factor of AQ-VS.",
} }

/// Finer cells than this share of the noise are not tried: they never win.
const FINEST_CELL: f64 = 0.5;

/// The best masks that a descent from the repeated Gray basis finds.
fn descend(bits: usize, sensors: usize, snr: f64) -> Result<(Vec<Mask>, f64), Error> {
    // Both the fine and the coarse end of the basis may need the spare sensors.
    let gray = gray_basis(bits)?;
    let reversed = gray.iter().rev().copied().collect();
    let cycle = |masks: Vec<Mask>| masks.into_iter().cycle().take(sensors).collect::<Vec<_>>();
    descent_from(&Scene::uniform(bits, snr)?, bits, sensors, &[cycle(gray), cycle(reversed)], 0)
}

rows! {
    pub struct Row by "{snr_db} dB" {
        snr_db: f64 ["dB"] as x("signal-to-noise ratio / dB") => "Signal-to-noise ratio.",
        lbqp_b3: f64 ["V^2"] as line("patterns, three bits") in errors => "Best linear patterns of three bits, exhaustive.",
        masks_b3: List<Mask> => "Their masks.",
        /// Best linear patterns of any number of bits, by descent beyond three.
        lbqp_best: f64 ["V^2"] as line("best patterns") in errors,
        bits: usize as points("best") in bits => "That number of bits.",
        masks: List<Mask> => "Their masks.",
        fixed: f64 ["V^2"] as line("fixed threshold") in errors => "All thresholds at zero, posterior mean.",
        luo_soft: Option<f64> ["V^2"] as line("Luo, linear") in errors => "Luo's allocation, linear fusion.",
        ribeiro_relaxed: f64 ["V^2"] as dashed("multi-threshold bound") in errors => "Relaxed multi-threshold bound.",
        aqvs_mle: f64 ["V^2"] as line("AQ-VS") in errors => "Adaptive variable step, bounded maximum likelihood.",
        aqml_mle: f64 ["V^2"] as line("AQ-ML") in errors => "Adaptive maximum likelihood, bounded maximum likelihood.",
        aqml_mmse: f64 ["V^2"] => "Adaptive maximum likelihood, posterior mean.",
        aq_posterior_mean: f64 ["V^2"] as dashed("AQ, posterior mean") in errors => "Adaptive posterior mean.",
        clairvoyant: f64 ["V^2"] as dashed("unquantized") in errors => "All measurements without quantization.",
    }
}

fn row(p: &Parameters, snr_db: f64) -> Result<Row, Error> {
    let scene = Scene::uniform(3, snr_db)?;
    let coarse = scene.search(p.sensors)?.best()?;
    let mut best = (3, coarse.masks.clone(), coarse.mse);
    for bits in 4..=p.most_bits.min(p.sensors) {
        if 2.0 / f64::from(1u32 << bits) < FINEST_CELL * scene.noise {
            break;
        }
        let (masks, mse) = descend(bits, p.sensors, snr_db)?;
        if mse < best.2 {
            best = (bits, masks, mse);
        }
    }
    let rule = |rule| Ok::<_, Error>(adaptive(&scene.source, scene.noise, p.sensors, rule)?);
    let ml = rule(AdaptiveRule::MaximumLikelihood)?;
    let variable = AdaptiveRule::VariableStep {
        step: p.vs_step,
        factor: p.vs_factor,
    };
    let luo = Luo::new(scene.source, scene.noise, 3, p.sensors).and_then(|luo| luo.errors());
    Ok(Row {
        snr_db,
        lbqp_b3: coarse.mse,
        masks_b3: List(coarse.masks),
        lbqp_best: best.2,
        bits: best.0,
        masks: List(best.1),
        fixed: fixed_threshold(scene.source, scene.noise, p.sensors)?.mmse()?,
        luo_soft: luo.ok().map(|errors| errors.soft),
        ribeiro_relaxed: multi_threshold_bound(&scene.source, scene.noise, p.sensors)?.bound,
        aqvs_mle: rule(variable)?.mle,
        aqml_mle: ml.mle,
        aqml_mmse: ml.mmse,
        aq_posterior_mean: rule(AdaptiveRule::PosteriorMean)?.mmse,
        clairvoyant: ConditionalMean::with_deviation(scene.source, scene.noise / (p.sensors as f64).sqrt())?
            .estimation_error(),
    })
}

impl Figure for Feedback {
    figure!(Parameters => Vec<Row>, "binary-fig5-10", "Ten sensors against schemes with thresholds and with feedback", "Movaghati, thesis, figure 5.10",
        "Linear patterns of the best resolution beat the relaxed multi-threshold bound from 5 dB on, and the adaptive variable-step \
         scheme (AQ-VS) from 20 dB on. The adaptive maximum-likelihood scheme (AQ-ML), which needs feedback, is better \
         than they are at every ratio from 5 to 40 dB: the thesis's claim is not reproduced.";
        { errors: semilog(ERROR, "Errors"), bits: linear("bits of the cell index", "Best resolution") });

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        // The costly points first, so that no thread is left alone with one at the end.
        let mut points = sweep(p.from_db, p.to_db, p.step_db);
        points.reverse();
        let mut rows = each(&points, |snr| row(p, snr))?;
        rows.reverse();
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let from = |low: f64| select(rows, move |r| (low - 1e-9..=40.0 + 1e-9).contains(&r.snr_db));
        let what = "patterns of the best resolution are below the relaxed multi-threshold bound from 5 to 40 dB";
        claims.all("ribeiro", what, from(5.0), |r| r.lbqp_best < r.ribeiro_relaxed);
        let what = "and below AQ-VS (step V/2, factor 1.5) from 20 dB on";
        here.all("aq-vs", what, from(20.0), |r| r.lbqp_best < r.aqvs_mle);
        let what = "AQ-ML, which has feedback, beats them from 5 to 40 dB (erratum binary-21)";
        claims.all("aq-ml", what, from(5.0), |r| r.aqml_mle < r.lbqp_best);
        let what = "posterior-mean thresholds beat AQ-ML's estimate from 5 dB on";
        claims.all("feedback-mmse", what, from(5.0), |r| r.aq_posterior_mean < r.aqml_mle);
        let what = "AQ-ML with the posterior mean is no worse than with its own estimate";
        claims.all("decoder", what, rows, |r| r.aqml_mmse <= r.aqml_mle);
        let what = "nothing is below the unquantized estimate";
        claims.all("floor", what, rows, |r| r.clairvoyant <= r.lbqp_best.min(r.aq_posterior_mean));
    }
}
