//! `binary-fig5-7`: optimal linear patterns against the signal-to-noise ratio, shortcuts, and Luo's scheme.

use super::{ERROR, Scene, crossing, descent_from, each, sweep, swept};
use crate::prelude::*;
use fewbits_baselines::binary_patterns::{Luo, by_information, tile, with_basis};
use fewbits_binary_patterns::{Mask, gray_basis};

pub struct Optimum;

swept! { 0.0 to 30.0, step 1.0 => quick 5.0, {
    bits: usize [2..=4] = 3 => "Bits of the cell index.",
    sensors: Vec<usize> [2..=10; 1..=6] = vec![3, 5, 8] => "Numbers of sensors, each at least the number of bits.",
} check |p| {
    let bits = p.bits;
    accept_each("sensors", &p.sensors, |n| (*n < bits).then(|| format!("fewer sensors than the {bits} bits")))
} }

rows! {
    pub struct Rows {
        errors: Vec<Row> => "Errors of searches and shortcuts.",
        special: Vec<Special> => "Single quantities.",
        tiling: Vec<Tiling> => "Sixteen sensors at 18.2 dB.",
    }

    struct Row {
        snr_db: f64 ["dB"] as x("signal-to-noise ratio / dB") => "Signal-to-noise ratio.",
        sensors: usize as panel("{} sensors") => "Number of sensors N.",
        mse_opt: f64 ["V^2"] as line("best of full rank") => "Least error over sets of full rank.",
        masks: List<Mask> => "The best set.",
        mse_unconstrained: f64 ["V^2"] as line("best of any rank") => "Least error over all sets.",
        masks_unconstrained: List<Mask> => "The best of all sets.",
        mse_strategy1: f64 ["V^2"] as line("Gray basis forced") => "Least error with the Gray basis forced (strategy 1).",
        mse_strategy13: f64 ["V^2"] as line("Gray, filled by eq. 5.13") => "Gray basis filled up by equation 5.13.",
        mse_strategy3: f64 ["V^2"] => "All masks by equation 5.13.",
        luo_soft: Option<f64> ["V^2"] as line("Luo, linear") => "Luo's bits, linear fusion; few sensors leave a bit without any.",
        luo_mmse: Option<f64> ["V^2"] as line("Luo, posterior mean") => "Luo's bits, posterior mean.",
        luo_majority: Option<f64> ["V^2"] => "Luo's bits, majority.",
    }

    struct Special by "{quantity}" {
        quantity: &'static str => "What.",
        value: f64 => "Its value. With little noise errors tend to the square of a cell's width over 12.",
    }

    struct Tiling by "{design}" {
        design: &'static str => "How sixteen masks were found.",
        mse: f64 ["V^2"] => "Exact error; tiles (strategy 2) lose against a descent.",
        masks: List<Mask> => "The masks.",
    }
}

fn row(bits: usize, sensors: usize, snr_db: f64) -> Result<Row, Error> {
    let scene = Scene::uniform(bits, snr_db)?;
    let gray = gray_basis(bits)?;
    let search = scene.search(sensors)?;
    let best = search.best()?;
    let any = search.clone().any_rank().best()?;
    let informed = |forced: &[Mask]| {
        let masks = by_information(&scene.source, &scene.grid, scene.noise, sensors, forced)?;
        scene.mmse(&masks)
    };
    let luo = Luo::new(scene.source, scene.noise, bits, sensors).ok();
    let luo = luo.map(|luo| luo.errors()).transpose()?;
    Ok(Row {
        snr_db,
        sensors,
        mse_opt: best.mse,
        masks: List(best.masks),
        mse_unconstrained: any.mse,
        masks_unconstrained: List(any.masks),
        mse_strategy1: with_basis(&search, &gray)?.mse,
        mse_strategy13: informed(&gray)?,
        mse_strategy3: informed(&[])?,
        luo_soft: luo.as_ref().map(|e| e.soft),
        luo_mmse: luo.as_ref().map(|e| e.mmse),
        luo_majority: luo.as_ref().map(|e| e.majority),
    })
}

/// Strategy 2 at 18.2 dB: tiles of small optima against a descent for sixteen sensors.
fn tiling() -> Result<Vec<Tiling>, Error> {
    let scene = Scene::uniform(3, 18.2)?;
    let tiled = |n: usize| Ok::<_, Error>(tile(&scene.search(n)?.best()?.masks, 16)?);
    let row = |design, masks: &[Mask], mse| Tiling {
        design,
        mse,
        masks: List(masks.to_vec()),
    };
    let (eights, fours) = (tiled(8)?, tiled(4)?);
    let found = descent_from(&scene, 3, 16, std::slice::from_ref(&eights), 2)?;
    Ok(vec![
        row("best 8, twice", &eights, scene.mmse(&eights)?),
        row("best 4, four times", &fours, scene.mmse(&fours)?),
        row("descent", &found.0, found.1),
    ])
}

impl Figure for Optimum {
    figure!(Parameters => Rows, "binary-fig5-7", "Best linear patterns, three bits", "Movaghati, thesis, figure 5.7",
        "Exact optimum over all sets of linear patterns, without the rank constraint, with the Gray basis forced (strategy 1), \
         filled up by the printed Cramer-Rao formula (strategies 1 and 3), and Luo's allocation. With more sensors than bits the \
         error is not monotone: some noise helps, as dither does."; semilog(ERROR));

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let ratios = sweep(p.from_db, p.to_db, p.step_db);
        let mut errors = Vec::new();
        for &sensors in &p.sensors {
            errors.extend(each(&ratios, |snr| row(p.bits, sensors, snr))?);
        }
        let at = |masks: &[Mask], snr: f64| Scene::uniform(3, snr)?.mmse(masks);
        let eight = [2, 2, 3, 3, 3, 3, 4, 6];
        let meet = crossing(6.0, 10.0, |snr| Ok(at(&[4, 5, 6], snr)? - at(&[4, 6, 3], snr)?))?;
        let special = [
            ("Gray crosses {4,5,6}, dB", meet),
            ("eight sensors at 22 dB, V^2", at(&eight, 22.0)?),
            ("eight sensors at 60 dB, V^2", at(&eight, 60.0)?),
            ("three Gray bits at 50 dB, V^2", at(&[4, 6, 3], 50.0)?),
        ];
        Ok(Rows {
            errors,
            special: special.map(|(quantity, value)| Special { quantity, value }).into(),
            tiling: tiling()?,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let all = &rows.errors;
        let of = |sensors: usize| select(all, move |r| r.sensors == sensors);
        let what = "dropping the rank constraint never hurts, forcing the Gray basis never helps";
        claims.all("order", what, all, |r| {
            r.mse_unconstrained <= r.mse_opt * (1.0 + 1e-9) && r.mse_strategy1 >= r.mse_opt * (1.0 - 1e-9)
        });
        let what = "from 5 dB on eight optimal sensors beat Luo's under every fusion rule";
        here.all("luo", what, of(8).filter(|r| r.snr_db >= 5.0), |r| {
            let luo = [r.luo_soft, r.luo_mmse, r.luo_majority];
            luo.iter().all(|luo| luo.is_some_and(|luo| r.mse_opt < luo))
        });
        let least = of(8).min_by(|a, b| a.mse_opt.total_cmp(&b.mse_opt)).map(|r| r.snr_db);
        let what = "the error of eight sensors is least near 22 dB and rises beyond (erratum binary-18)";
        here.near("dither", what, least, 22.0, 1.0);
        let what = "filling the Gray basis by equation 5.13 is poor: ratio to the optimum";
        let ratio = |r: &Row| (format!("{} sensors, {} dB", r.sensors, r.snr_db), r.mse_strategy13 / r.mse_opt);
        claims.references("strategy-3", what, all, ratio);
        let what =
            "without the basis, equation 5.13 repeats one pattern; the worst ratio to the optimum (erratum binary-16)";
        let worst = of(8).map(|r| r.mse_strategy3 / r.mse_opt).reduce(f64::max);
        here.above("strategy-3-alone", what, worst, 20.0);
        if p.bits == 3 {
            for (sensors, lossless) in [(5, 9.0), (8, 7.5)] {
                let loss = |from: f64| {
                    let high = of(sensors).filter(move |r| r.snr_db >= from);
                    high.map(|r| r.mse_strategy1 / r.mse_opt - 1.0).reduce(f64::max)
                };
                let what = format!("forcing the Gray basis costs nothing from {lossless} dB on, {sensors} sensors");
                claims.at_most(format!("strategy-1-n{sensors}"), what, loss(lossless), 1e-9);
                let what = format!("and at most 3.3 % from 5 dB on, {sensors} sensors (erratum binary-14)");
                claims.at_most(format!("strategy-1-loss-n{sensors}"), what, loss(5.0), 0.033);
            }
        }
        let expected = |snr: f64| match snr {
            s if s <= 1.0 => [1, 2, 4],
            s if s <= 3.0 => [1, 4, 6],
            s if s <= 8.0 => [4, 5, 6],
            _ => [3, 4, 6],
        };
        let what = "N = B: natural up to 1 dB, {4,6,1} at 2 and 3, {4,5,6} at 4 to 8, Gray above (erratum binary-13)";
        here.all("regimes", what, of(3), |r| r.masks.0 == expected(r.snr_db));
        let limit = first(&rows.special, |r| r.quantity.contains("at 60 dB")).map(|r| r.value);
        claims.below("limit-below", "eight sensors tend to it from below", limit, 0.25 * 0.25 / 12.0);
    }
}
