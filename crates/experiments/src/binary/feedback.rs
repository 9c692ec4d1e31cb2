//! `binary-fig5-10`: ten sensors, with and without feedback.

use super::{Scene, check_sweep, each, mask_text, pattern, sweep};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::baselines::{AdaptiveRule, Luo, adaptive, fixed_threshold, multi_threshold_bound};
use fewbits_binary_patterns::bounds::ConditionalMean;
use fewbits_binary_patterns::search::Descent;
use fewbits_binary_patterns::{Mask, gray_basis, rank};
use serde::{Deserialize, Serialize};

/// `binary-fig5-10`.
pub struct Feedback;

/// Parameters of `binary-fig5-10`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Number of sensors.
    sensors: usize,
    /// Most bits of the cell index that are tried.
    most_bits: usize,
    /// First signal-to-noise ratio, dB.
    from_db: f64,
    /// Last signal-to-noise ratio, dB.
    to_db: f64,
    /// Step, dB.
    step_db: f64,
    /// First step of AQ-VS in units of V. The thesis gives no rule.
    vs_step: f64,
    /// Factor of AQ-VS.
    vs_factor: f64,
}

impl Default for Parameters {
    fn default() -> Self {
        Self {
            sensors: 10,
            most_bits: 7,
            from_db: 0.0,
            to_db: 40.0,
            step_db: 1.0,
            vs_step: 0.5,
            vs_factor: 1.5,
        }
    }
}

/// Finer cells than this share of the noise are not tried: they never win.
const FINEST_CELL: f64 = 0.5;

/// The best masks that a descent from the repeated Gray basis and one scattered start finds.
pub(super) fn descend(bits: usize, sensors: usize, snr: f64, extra: usize) -> Result<(Vec<Mask>, f64), Error> {
    let scene = Scene::uniform(bits, snr)?;
    let candidates = (1..1 << bits)
        .map(|mask| pattern(mask, bits)?.on(&scene.grid).map_err(Error::failed))
        .collect::<Result<Vec<_>, _>>()?;
    let descent = Descent::with_deviations(scene.source, vec![scene.noise; sensors], candidates).map_err(Error::failed)?;
    let gray = gray_basis(bits).map_err(Error::failed)?;
    // Both the fine and the coarse end of the basis may need the spare sensors.
    let cycle = |masks: Vec<Mask>| {
        masks
            .into_iter()
            .cycle()
            .take(sensors)
            .map(|m| m as usize - 1)
            .collect::<Vec<_>>()
    };
    let reversed = gray.iter().rev().copied().collect();
    let masks = |choice: &[usize]| choice.iter().map(|&c| c as Mask + 1).collect::<Vec<_>>();
    let found = descent
        .run(&[cycle(gray), cycle(reversed)], extra, |choice| rank(&masks(choice)) == bits)
        .map_err(Error::failed)?;
    let mut best = masks(&found.choice);
    best.sort_unstable();
    Ok((best, found.mse))
}

struct Point {
    coarse: f64,
    coarse_masks: String,
    best: (usize, Vec<Mask>, f64),
    fixed: f64,
    luo: Option<f64>,
    ribeiro: f64,
    vs: f64,
    ml: f64,
    ml_mmse: f64,
    mean: f64,
    clairvoyant: f64,
}

fn point(p: &Parameters, snr: f64) -> Result<Point, Error> {
    let scene = Scene::uniform(3, snr)?;
    let coarse = scene.search(p.sensors)?.best().map_err(Error::failed)?;
    let mut best = (3, coarse.masks.clone(), coarse.mse);
    for bits in 4..=p.most_bits.min(p.sensors) {
        if 2.0 / f64::from(1u32 << bits) < FINEST_CELL * scene.noise {
            break;
        }
        let (masks, mse) = descend(bits, p.sensors, snr, 0)?;
        if mse < best.2 {
            best = (bits, masks, mse);
        }
    }
    let rule = |rule| adaptive(&scene.source, scene.noise, p.sensors, rule).map_err(Error::failed);
    let ml = rule(AdaptiveRule::MaximumLikelihood)?;
    Ok(Point {
        coarse_masks: mask_text(&coarse.masks),
        coarse: coarse.mse,
        best,
        fixed: fixed_threshold(scene.source, scene.noise, p.sensors)
            .and_then(|bank| bank.mmse())
            .map_err(Error::failed)?,
        luo: Luo::new(scene.source, scene.noise, 3, p.sensors)
            .and_then(|luo| luo.errors())
            .ok()
            .map(|errors| errors.soft),
        ribeiro: multi_threshold_bound(&scene.source, scene.noise, p.sensors)
            .map_err(Error::failed)?
            .bound,
        vs: rule(AdaptiveRule::VariableStep {
            step: p.vs_step,
            factor: p.vs_factor,
        })?
        .mle,
        ml: ml.mle,
        ml_mmse: ml.mmse,
        mean: rule(AdaptiveRule::PosteriorMean)?.mmse,
        clairvoyant: ConditionalMean::with_deviation(scene.source, scene.noise / (p.sensors as f64).sqrt())
            .map_err(Error::failed)?
            .estimation_error(),
    })
}

impl Figure for Feedback {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-10",
            title: "Ten sensors against schemes with thresholds and with feedback",
            caption: "Linear patterns of the best resolution beat the relaxed multi-threshold bound from 5 dB on, and the adaptive variable-step \
                      scheme from 20 dB on. The adaptive maximum-likelihood scheme, which needs feedback, is better than they are at \
                      every ratio from 5 to 40 dB: the thesis's claim is not reproduced.",
            source: "Movaghati, thesis, figure 5.10",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        check_sweep("binary-fig5-10", p.from_db, p.to_db, p.step_db)?;
        if (3..=14).contains(&p.sensors) && (3..=8).contains(&p.most_bits) {
            return Ok(());
        }
        Err(Error::BadParameter {
            figure: "binary-fig5-10",
            name: "sensors, most_bits".into(),
            value: format!("{}, {}", p.sensors, p.most_bits),
            expected: "3 to 14 sensors and 3 to 8 bits".into(),
        })
    }

    fn quicken(&self, p: &mut Parameters) {
        p.step_db = 10.0;
        p.most_bits = 5;
        p.to_db = 30.0;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("snr_db", "dB", "signal-to-noise ratio"),
            column("lbqp_b3", "V^2", "best linear patterns of three bits, exhaustive"),
            column("masks_b3", "", "their masks"),
            column("lbqp_best", "V^2", "best linear patterns of any number of bits, by descent beyond three"),
            column("bits", "", "that number of bits"),
            column("masks", "", "their masks"),
            column("fixed", "V^2", "all thresholds at zero, posterior mean"),
            column("luo_soft", "V^2", "Luo's allocation, linear fusion"),
            column("ribeiro_relaxed", "V^2", "relaxed multi-threshold bound"),
            column("aqvs_mle", "V^2", "adaptive variable step, bounded maximum likelihood"),
            column("aqml_mle", "V^2", "adaptive maximum likelihood, bounded maximum likelihood"),
            column("aqml_mmse", "V^2", "adaptive maximum likelihood, posterior mean"),
            column("aq_posterior_mean", "V^2", "adaptive posterior mean"),
            column("clairvoyant", "V^2", "all measurements without quantization"),
        ]);
        let mut points = sweep(p.from_db, p.to_db, p.step_db);
        // The costly points first, so that no thread is left alone with one at the end.
        points.reverse();
        let mut rows = each(&points, |snr| point(p, snr))?;
        points.reverse();
        rows.reverse();
        for (snr, point) in points.into_iter().zip(rows) {
            table.push(row![
                snr,
                point.coarse,
                point.coarse_masks,
                point.best.2,
                point.best.0,
                mask_text(&point.best.1),
                point.fixed,
                point.luo,
                point.ribeiro,
                point.vs,
                point.ml,
                point.ml_mmse,
                point.mean,
                point.clairvoyant,
            ])?;
        }
        Ok(table.into())
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let get = |name: &str| tables.main.numbers(name);
        let (snr, best, coarse) = (get("snr_db")?, get("lbqp_best")?, get("lbqp_b3")?);
        let (ribeiro, vs, ml, mean, floor) = (
            get("ribeiro_relaxed")?,
            get("aqvs_mle")?,
            get("aqml_mle")?,
            get("aq_posterior_mean")?,
            get("clairvoyant")?,
        );
        let (ml_mmse, bits) = (get("aqml_mmse")?, get("bits")?);
        let within = |low: f64, high: f64| move |s: f64| s >= low - 1e-9 && s <= high + 1e-9;
        let count = |on: &dyn Fn(f64) -> bool, broken: &dyn Fn(usize) -> bool| {
            (0..snr.len()).filter(|&i| on(snr[i]) && broken(i)).count()
        };
        let mut claims = vec![
            Claim::never(
                "ribeiro",
                "patterns of the best resolution are below the relaxed multi-threshold bound from 5 to 40 dB",
                count(&within(5.0, 40.0), &|i| best[i] >= ribeiro[i]),
            ),
            Claim::never(
                "aq-vs",
                "and below AQ-VS (step V/2, factor 1.5) from 20 dB on",
                count(&within(20.0, 40.0), &|i| best[i] >= vs[i]),
            )
            .at_defaults(),
            Claim::never(
                "aq-ml",
                "AQ-ML, which has feedback, beats them from 5 to 40 dB (erratum binary-21)",
                count(&within(5.0, 40.0), &|i| ml[i] >= best[i]),
            ),
            Claim::never(
                "feedback-mmse",
                "posterior-mean thresholds beat AQ-ML's estimate from 5 dB on",
                count(&within(5.0, 40.0), &|i| mean[i] >= ml[i]),
            ),
            Claim::never(
                "decoder",
                "AQ-ML with the posterior mean is no worse than with its own estimate",
                count(&|_| true, &|i| ml_mmse[i] > ml[i]),
            ),
            Claim::never(
                "resolution",
                "more bits never lose against three",
                count(&|_| true, &|i| best[i] > coarse[i]),
            ),
            Claim::never(
                "floor",
                "nothing is below the unquantized estimate",
                count(&|_| true, &|i| floor[i] > best[i].min(mean[i])),
            ),
        ];
        for (at, name, expected, tolerance) in [
            (20.0, "lbqp_b3", 0.002_270_910_756_646_094, 1e-8),
            (30.0, "lbqp_b3", 0.003_446_475_341_307_653, 1e-8),
            (30.0, "lbqp_best", 0.000_191, 3e-3),
            (40.0, "lbqp_best", 2.58e-5, 3e-3),
            (40.0, "aqml_mle", 2.171_789_663e-5, 1e-6),
            (20.0, "aqml_mle", 0.000_98, 6e-3),
            (30.0, "ribeiro_relaxed", 0.002_038, 2e-3),
        ] {
            if let Some(i) = snr.iter().position(|s| (s - at).abs() < 1e-9) {
                let value = get(name)?[i];
                claims.push(
                    Claim::near_relative(
                        format!("{name}-{at}"),
                        format!("`{name}` at {at} dB"),
                        value,
                        expected,
                        tolerance,
                    )
                    .at_defaults(),
                );
            }
        }
        if let Some(i) = snr.iter().position(|s| (s - 40.0).abs() < 1e-9) {
            claims.push(
                Claim::near("bits-40", "the best resolution there is seven bits", bits[i], 7.0, 0.0).at_defaults(),
            );
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let points = |name| tables.main.points("snr_db", name);
        let axis = || Axis::linear("signal-to-noise ratio / dB");
        Ok(Plot::grid(
            2,
            vec![
                Panel::new(format!("{} sensors", p.sensors), axis(), Axis::log("mean squared error / V^2"))
                    .with(Layer::line("patterns, best resolution", points("lbqp_best")?).coloured(0))
                    .with(Layer::line("patterns, three bits", points("lbqp_b3")?).coloured(5))
                    .with(Layer::line("fixed threshold", points("fixed")?).coloured(4))
                    .with(Layer::line("Luo, linear", points("luo_soft")?).coloured(3))
                    .with(Layer::dashed("multi-threshold bound", points("ribeiro_relaxed")?).coloured(6))
                    .with(Layer::line("AQ-VS", points("aqvs_mle")?).coloured(2))
                    .with(Layer::line("AQ-ML", points("aqml_mle")?).coloured(1))
                    .with(Layer::dashed("AQ, posterior mean", points("aq_posterior_mean")?).coloured(1))
                    .with(Layer::dashed("unquantized", points("clairvoyant")?).coloured(7))
                    .legend(Legend::BottomLeft),
                Panel::new(
                    "Best resolution",
                    axis(),
                    Axis::linear("bits of the cell index")
                        .between(2.5, p.most_bits as f64 + 0.5)
                        .named((3..=p.most_bits).map(|b| (b as f64, b.to_string()))),
                )
                .with(Layer::points("", points("bits")?).coloured(0))
                .legend(Legend::Hidden),
            ],
        ))
    }
}
