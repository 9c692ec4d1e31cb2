//! `binary-fig5-9`: a Gaussian source, three sensors of three bits.

use super::{Scene, check_sweep, crossing, each, mask_text, sweep};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::Mask;
use fewbits_binary_patterns::bounds::{network_rate_distortion, optimal_weight_van_trees, remote_distortion};
use serde::{Deserialize, Serialize};

/// `binary-fig5-9`.
pub struct GaussianSource;

/// Parameters of `binary-fig5-9`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
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
            from_db: -10.0,
            to_db: 30.0,
            step_db: 1.0,
        }
    }
}

const SENSORS: usize = 3;
const GRAY: [Mask; 3] = [3, 4, 6];
const OTHER: [Mask; 3] = [4, 6, 7];

impl Figure for GaussianSource {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-9",
            title: "Gaussian source, three sensors of three bits",
            caption: "The best basis against Gray and natural patterns, the printed distortion-rate function of one observation and the \
                      correct one of three. The printed one is no bound: three identical sign bits fall below it at low ratios.",
            source: "Movaghati, thesis, figure 5.9",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        check_sweep("binary-fig5-9", p.from_db, p.to_db, p.step_db)
    }

    fn quicken(&self, p: &mut Parameters) {
        p.step_db = 5.0;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("snr_db", "dB", "signal-to-noise ratio"),
            column("mse_opt", "", "least error over the 28 bases"),
            column("masks", "", "the best basis"),
            column("mse_gray", "", "error of the Gray basis"),
            column("mse_natural", "", "error of the natural basis"),
            column("dr_print", "", "equation 5.12 as printed, R = 3"),
            column("dr_per_n", "", "the same with the noise of the average"),
            column("vt", "", "optimal-weight van Trees bound of the best basis"),
            column("mse_unconstrained", "", "least error over all triples of masks"),
            column("masks_unconstrained", "", "the best triple"),
            column("mse_signs", "", "error of three sign bits"),
        ]);
        let points = sweep(p.from_db, p.to_db, p.step_db);
        let rows = each(&points, |snr| {
            let scene = Scene::gaussian(snr)?;
            let search = scene.search(SENSORS)?;
            let best = search.best().map_err(Error::failed)?;
            let any = search.any_rank().best().map_err(Error::failed)?;
            let printed = remote_distortion(&scene.source, scene.noise)
                .and_then(|d| d.at(3.0))
                .map_err(Error::failed)?;
            Ok(row![
                snr,
                best.mse,
                mask_text(&best.masks),
                scene.mmse(&GRAY)?,
                scene.mmse(&[4, 2, 1])?,
                printed,
                network_rate_distortion(&scene.source, scene.noise, SENSORS).map_err(Error::failed)?,
                optimal_weight_van_trees(&scene.bank(&best.masks)?).map_err(Error::failed)?,
                any.mse,
                mask_text(&any.masks),
                scene.mmse(&[4, 4, 4])?,
            ])
        })?;
        for row in rows {
            table.push(row)?;
        }
        let mut crossings = Table::new([
            column("pair", "", "two bases"),
            column("snr_db", "dB", "where their errors are equal"),
        ]);
        let gap = |a: &[Mask], b: &[Mask], snr: f64| -> Result<f64, Error> {
            let scene = Scene::gaussian(snr)?;
            Ok(scene.mmse(a)? - scene.mmse(b)?)
        };
        crossings.push(row![
            "{4,5,6} and {4,6,7}",
            crossing(4.0, 5.5, |snr| gap(&[4, 5, 6], &OTHER, snr))?
        ])?;
        crossings.push(row!["{4,6,7} and Gray", crossing(5.5, 7.0, |snr| gap(&OTHER, &GRAY, snr))?])?;
        Ok(Tables::from(table).with("crossings", crossings))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let get = |name: &str| tables.main.numbers(name);
        let (snr, opt, gray, per_n, printed) =
            (get("snr_db")?, get("mse_opt")?, get("mse_gray")?, get("dr_per_n")?, get("dr_print")?);
        let (vt, any, signs) = (get("vt")?, get("mse_unconstrained")?, get("mse_signs")?);
        let masks = tables.main.texts("masks")?;
        let count = |broken: &dyn Fn(usize) -> bool| (0..snr.len()).filter(|&i| broken(i)).count();
        let crossings = tables.named("crossings")?.numbers("snr_db")?;
        let mut claims = vec![
            Claim::never(
                "bound",
                "the corrected distortion-rate function bounds every set",
                count(&|i| per_n[i] > any[i] * (1.0 + 1e-9)),
            ),
            Claim::never(
                "van-trees",
                "the van Trees bound is below the best basis",
                count(&|i| vt[i] > opt[i] * (1.0 + 1e-9)),
            ),
            Claim::at_least(
                "printed-violated",
                "three sign bits fall below the printed function somewhere (erratum binary-6)",
                count(&|i| signs[i] < printed[i]) as f64,
                1.0,
            )
            .at_defaults(),
            Claim::near("from", "{4,6,7} is best from 5.139 dB", crossings[0], 5.139, 1e-3),
            Claim::near("gray-from", "to 6.032 dB, above which Gray is (erratum binary-13)", crossings[1], 6.032, 1e-3),
            Claim::never(
                "gray-above",
                "Gray is the best basis above 6.032 dB and only there",
                count(&|i| (masks[i] == "3 4 6") != (snr[i] > crossings[1])),
            ),
            Claim::never(
                "gray-no-better",
                "and never better than the best",
                count(&|i| gray[i] < opt[i] * (1.0 - 1e-9)),
            ),
        ];
        if let Some(i) = snr.iter().position(|s| (s + 5.0).abs() < 1e-9) {
            claims.push(Claim::near("signs", "three sign bits at -5 dB", signs[i], 0.064_939, 1e-6));
            claims.push(Claim::near("printed", "where the print allows no less than", printed[i], 0.076_350, 1e-6));
            claims.push(Claim::near("corrected", "and the correct bound is", per_n[i], 0.052_077, 1e-6));
        }
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let points = |name| tables.main.points("snr_db", name);
        Ok(Plot::of(
            Panel::new(
                "Three sensors, Gaussian source of variance 0.1",
                Axis::linear("signal-to-noise ratio / dB"),
                Axis::log("mean squared error"),
            )
            .with(Layer::line("best basis", points("mse_opt")?).coloured(0))
            .with(Layer::line("any three masks", points("mse_unconstrained")?).coloured(1))
            .with(Layer::line("Gray", points("mse_gray")?).coloured(2))
            .with(Layer::line("natural", points("mse_natural")?).coloured(3))
            .with(Layer::line("three signs", points("mse_signs")?).coloured(4))
            .with(Layer::dashed("D(R), printed", points("dr_print")?).coloured(6))
            .with(Layer::dashed("D(R), three observations", points("dr_per_n")?).coloured(7))
            .with(Layer::dashed("van Trees, best basis", points("vt")?).coloured(5))
            .legend(Legend::BottomLeft),
        ))
    }
}
