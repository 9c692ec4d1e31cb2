//! `binary-fig5-7`: optimal linear patterns against the signal-to-noise ratio, shortcuts, and Luo's scheme.

use super::{Scene, check_sweep, crossing, each, mask_text, pattern, sweep};
use crate::legacy::claim::largest;
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::baselines::Luo;
use fewbits_binary_patterns::search::{Descent, by_information, tile};
use fewbits_binary_patterns::{Mask, gray_basis, rank};
use serde::{Deserialize, Serialize};

/// `binary-fig5-7`.
pub struct Optimum;

/// Parameters of `binary-fig5-7`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Parameters {
    /// Bits of the cell index.
    bits: usize,
    /// Numbers of sensors.
    sensors: Vec<usize>,
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
            bits: 3,
            sensors: vec![3, 5, 8],
            from_db: 0.0,
            to_db: 30.0,
            step_db: 1.0,
        }
    }
}

struct Point {
    opt: f64,
    masks: String,
    any_rank: f64,
    any_masks: String,
    strategy1: f64,
    strategy13: f64,
    strategy3: f64,
    luo: [Option<f64>; 3],
}

fn point(bits: usize, sensors: usize, snr: f64) -> Result<Point, Error> {
    let scene = Scene::uniform(bits, snr)?;
    let gray = gray_basis(bits).map_err(Error::failed)?;
    let search = scene.search(sensors)?;
    let best = search.best().map_err(Error::failed)?;
    let any = search.clone().any_rank().best().map_err(Error::failed)?;
    let forced = search
        .with_forced(&gray)
        .and_then(|s| s.best())
        .map_err(Error::failed)?;
    let informed = |forced: &[Mask]| {
        by_information(&scene.source, &scene.grid, scene.noise, sensors, forced)
            .map_err(Error::failed)
            .and_then(|masks| scene.mmse(&masks))
    };
    // Few sensors leave a bit without any.
    let luo = match Luo::new(scene.source, scene.noise, bits, sensors) {
        Ok(luo) => {
            let errors = luo.errors().map_err(Error::failed)?;
            [Some(errors.soft), Some(errors.mmse), Some(errors.majority)]
        }
        Err(_) => [None; 3],
    };
    Ok(Point {
        opt: best.mse,
        masks: mask_text(&best.masks),
        any_rank: any.mse,
        any_masks: mask_text(&any.masks),
        strategy1: forced.mse,
        strategy13: informed(&gray)?,
        strategy3: informed(&[])?,
        luo,
    })
}

/// Strategy 2 at 18.2 dB: tiles of small optima against a descent for sixteen sensors.
fn tiling() -> Result<Table, Error> {
    let mut table = Table::new([
        column("design", "", "how sixteen masks were found"),
        column("mse", "V^2", "exact error at 18.2 dB"),
        column("masks", "", "the masks"),
    ]);
    let scene = Scene::uniform(3, 18.2)?;
    let tiled = |n: usize| -> Result<Vec<Mask>, Error> {
        let best = scene.search(n)?.best().map_err(Error::failed)?;
        tile(&best.masks, 16).map_err(Error::failed)
    };
    let (eights, fours) = (tiled(8)?, tiled(4)?);
    table.push(row!["best 8, twice", scene.mmse(&eights)?, mask_text(&eights)])?;
    table.push(row!["best 4, four times", scene.mmse(&fours)?, mask_text(&fours)])?;
    let candidates = (1..8)
        .map(|mask| pattern(mask, 3)?.on(&scene.grid).map_err(Error::failed))
        .collect::<Result<Vec<_>, _>>()?;
    let descent = Descent::with_deviations(scene.source, vec![scene.noise; 16], candidates).map_err(Error::failed)?;
    let start: Vec<usize> = eights.iter().map(|&m| m as usize - 1).collect();
    let masks = |choice: &[usize]| choice.iter().map(|&c| c as Mask + 1).collect::<Vec<_>>();
    let found = descent
        .run(&[start], 2, |choice| rank(&masks(choice)) == 3)
        .map_err(Error::failed)?;
    let mut best = masks(&found.choice);
    best.sort_unstable();
    table.push(row!["descent", found.mse, mask_text(&best)])?;
    Ok(table)
}

impl Optimum {
    fn rows(tables: &Tables, sensors: usize) -> Result<Table, Error> {
        tables.main.only("sensors", sensors)
    }
}

impl Figure for Optimum {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-7",
            title: "Best linear patterns, three bits",
            caption: "Exact optimum over all sets of linear patterns, without the rank constraint, with the Gray basis forced (strategy 1), \
                      filled up by the printed Cramer-Rao formula (strategies 1 and 3), and Luo's allocation. With more sensors than bits the \
                      error is not monotone: some noise helps, as dither does.",
            source: "Movaghati, thesis, figure 5.7",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        check_sweep("binary-fig5-7", p.from_db, p.to_db, p.step_db)
    }

    fn quicken(&self, p: &mut Parameters) {
        p.step_db = 5.0;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("snr_db", "dB", "signal-to-noise ratio"),
            column("sensors", "", "number of sensors N"),
            column("mse_opt", "V^2", "least error over sets of full rank"),
            column("masks", "", "the best set"),
            column("mse_unconstrained", "V^2", "least error over all sets"),
            column("masks_unconstrained", "", "the best of all sets"),
            column("mse_strategy1", "V^2", "least error with the Gray basis forced"),
            column("mse_strategy13", "V^2", "Gray basis filled up by equation 5.13"),
            column("mse_strategy3", "V^2", "all masks by equation 5.13"),
            column("luo_soft", "V^2", "Luo's bits, linear fusion"),
            column("luo_mmse", "V^2", "Luo's bits, posterior mean"),
            column("luo_majority", "V^2", "Luo's bits, majority"),
        ]);
        let points = sweep(p.from_db, p.to_db, p.step_db);
        for &sensors in &p.sensors {
            for (snr, point) in points.iter().zip(each(&points, |snr| point(p.bits, sensors, snr))?) {
                table.push(row![
                    *snr,
                    sensors,
                    point.opt,
                    point.masks,
                    point.any_rank,
                    point.any_masks,
                    point.strategy1,
                    point.strategy13,
                    point.strategy3,
                    point.luo[0],
                    point.luo[1],
                    point.luo[2],
                ])?;
            }
        }
        let mut special = Table::new([column("quantity", "", "what"), column("value", "", "its value")]);
        let at = |masks: &[Mask], snr: f64| Scene::uniform(3, snr)?.mmse(masks);
        special.push(row![
            "Gray crosses {4,5,6}, dB",
            crossing(6.0, 10.0, |snr| Ok(at(&[4, 5, 6], snr)? - at(&[4, 6, 3], snr)?))?
        ])?;
        special.push(row!["eight sensors at 22 dB, V^2", at(&[2, 2, 3, 3, 3, 3, 4, 6], 22.0)?])?;
        special.push(row!["eight sensors at 60 dB, V^2", at(&[2, 2, 3, 3, 3, 3, 4, 6], 60.0)?])?;
        special.push(row!["three Gray bits at 50 dB, V^2", at(&[4, 6, 3], 50.0)?])?;
        Ok(Tables::from(table).with("special", special).with("tiling", tiling()?))
    }

    fn claims(&self, p: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        let all = &tables.main;
        let (opt, any, first) =
            (all.numbers("mse_opt")?, all.numbers("mse_unconstrained")?, all.numbers("mse_strategy1")?);
        claims.push(Claim::never(
            "order",
            "dropping the rank constraint never hurts, forcing the Gray basis never helps",
            (0..opt.len())
                .filter(|&i| any[i] > opt[i] * (1.0 + 1e-9) || first[i] < opt[i] * (1.0 - 1e-9))
                .count(),
        ));
        if p.sensors.contains(&8) {
            let rows = Self::rows(tables, 8)?;
            let (snr, opt) = (rows.numbers("snr_db")?, rows.numbers("mse_opt")?);
            let mut beaten = 0;
            for name in ["luo_soft", "luo_mmse", "luo_majority"] {
                let luo = rows.numbers(name)?;
                beaten += (0..snr.len()).filter(|&i| snr[i] >= 5.0 && opt[i] >= luo[i]).count();
            }
            claims.push(Claim::never(
                "luo",
                "from 5 dB on eight optimal sensors beat Luo's under every fusion rule",
                beaten,
            ));
            let least = (0..snr.len())
                .min_by(|&a, &b| opt[a].total_cmp(&opt[b]))
                .map_or(0.0, |i| snr[i]);
            claims.push(
                Claim::near(
                    "dither",
                    "the error of eight sensors is least near 22 dB and rises beyond (erratum binary-18)",
                    least,
                    22.0,
                    1.0,
                )
                .at_defaults(),
            );
            let strategy = rows.numbers("mse_strategy13")?;
            for (at, expected) in [
                (5.0, 1.79),
                (10.0, 2.07),
                (15.0, 1.31),
                (20.0, 2.53),
                (25.0, 1.83),
                (30.0, 1.39),
            ] {
                if let Some(i) = snr.iter().position(|s| (s - at).abs() < 1e-9) {
                    claims.push(
                        Claim::near(
                            format!("strategy-3-at-{at}"),
                            "filling the Gray basis by equation 5.13 is poor: ratio to the optimum",
                            strategy[i] / opt[i],
                            expected,
                            6e-3,
                        )
                        .at_defaults(),
                    );
                }
            }
            let repeated = rows.numbers("mse_strategy3")?;
            claims.push(
                Claim::above(
                    "strategy-3-alone",
                    "without the basis, equation 5.13 repeats one pattern; the worst ratio to the optimum",
                    largest((0..snr.len()).map(|i| repeated[i] / opt[i])),
                    20.0,
                )
                .at_defaults(),
            );
        }
        for &(sensors, lossless) in [(5usize, 9.0), (8, 7.5)].iter().filter(|s| p.sensors.contains(&s.0)) {
            let rows = Self::rows(tables, sensors)?;
            let (snr, opt, forced) =
                (rows.numbers("snr_db")?, rows.numbers("mse_opt")?, rows.numbers("mse_strategy1")?);
            let loss = |i: usize| forced[i] / opt[i] - 1.0;
            claims.push(Claim::at_most(
                format!("strategy-1-n{sensors}"),
                format!("forcing the Gray basis costs nothing from {lossless} dB on, {sensors} sensors"),
                largest((0..snr.len()).filter(|&i| snr[i] >= lossless).map(loss)),
                1e-9,
            ));
            claims.push(Claim::at_most(
                format!("strategy-1-loss-n{sensors}"),
                "and at most 3.3 % from 5 dB on (erratum binary-14)",
                largest((0..snr.len()).filter(|&i| snr[i] >= 5.0).map(loss)),
                0.033,
            ));
        }
        if p.sensors.contains(&3) {
            let rows = Self::rows(tables, 3)?;
            let (snr, masks) = (rows.numbers("snr_db")?, rows.texts("masks")?);
            let expected = |snr: f64| match snr {
                s if s <= 1.0 => "1 2 4",
                s if s <= 3.0 => "1 4 6",
                s if s <= 8.0 => "4 5 6",
                _ => "3 4 6",
            };
            claims.push(
                Claim::never(
                    "regimes",
                    "N = B: natural up to 1 dB, {4,6,1} at 2 and 3, {4,5,6} at 4 to 8, Gray above (erratum binary-13)",
                    (0..snr.len()).filter(|&i| masks[i] != expected(snr[i])).count(),
                )
                .at_defaults(),
            );
        }
        let special = tables.named("special")?.numbers("value")?;
        let floor = 0.25 * 0.25 / 12.0;
        claims.extend([
            Claim::near("gray-from", "Gray is optimal only above 8.0212 dB", special[0], 8.021_226_314_507_864, 1e-3),
            Claim::near("least", "least error of eight sensors", special[1], 0.00276, 1e-5),
            Claim::below("limit-below", "their error tends to Delta^2/12 from below", special[2], floor),
            Claim::near_relative("limit", "and reaches it within 3 % at 60 dB", special[2], floor, 0.03),
            Claim::near_relative("limit-three", "three Gray bits tend to Delta^2/12", special[3], floor, 1e-3),
        ]);
        let tiles = tables.named("tiling")?.numbers("mse")?;
        for (i, (id, expected)) in [
            ("tile-8", 0.001_655_2),
            ("tile-4", 0.001_917_6),
            ("descent-16", 0.001_562_5),
        ]
        .into_iter()
        .enumerate()
        {
            claims.push(Claim::near(
                id,
                "strategy 2 for sixteen sensors at 18.2 dB: tiles lose against a descent",
                tiles[i],
                expected,
                2e-7,
            ));
        }
        Ok(claims)
    }

    fn plot(&self, p: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let snr = || Axis::linear("signal-to-noise ratio / dB");
        let mut panels = Vec::new();
        for &sensors in &p.sensors {
            let rows = Self::rows(tables, sensors)?;
            let mut panel =
                Panel::new(format!("{sensors} sensors, {} bits", p.bits), snr(), Axis::log("mean squared error / V^2"));
            for (colour, (name, label)) in [
                ("mse_opt", "best of full rank"),
                ("mse_unconstrained", "best of any rank"),
                ("mse_strategy1", "Gray basis forced"),
                ("mse_strategy13", "Gray, filled by eq. 5.13"),
                ("luo_soft", "Luo, linear"),
                ("luo_mmse", "Luo, posterior mean"),
            ]
            .into_iter()
            .enumerate()
            {
                let points = rows.points("snr_db", name)?;
                if !points.is_empty() {
                    let layer = if name == "mse_strategy1" {
                        Layer::dashed(label, points)
                    } else {
                        Layer::line(label, points)
                    };
                    panel = panel.with(layer.coloured(colour));
                }
            }
            panels.push(panel.legend(Legend::BottomLeft));
        }
        Ok(Plot::grid(p.sensors.len().min(3), panels))
    }
}
