//! `binary-fig5-8`: decoders and bounds for three Gray bits.

use super::{Scene, check_sweep, each, sweep};
use crate::legacy::{About, Claim, Context, Error, Figure, Table, Tables, column, row};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};
use fewbits_binary_patterns::bounds::{
    centralised_bound, network_rate_distortion, optimal_weight_van_trees, printed_crlb, remote_distortion,
};
use fewbits_binary_patterns::{Decoder, gray_basis};
use serde::{Deserialize, Serialize};

/// `binary-fig5-8`.
pub struct Decoders;

/// Parameters of `binary-fig5-8`.
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
            to_db: 40.0,
            step_db: 1.0,
        }
    }
}

const CURVES: [(&str, &str); 10] = [
    ("mmse", "posterior mean"),
    ("cmap", "continuous MAP"),
    ("dmap", "discrete MAP"),
    ("dmap_print", "discrete MAP as printed"),
    ("dmap_exact", "discrete MAP, exact cells"),
    ("crlb", "equation 5.13"),
    ("vt", "van Trees"),
    ("rd_print", "rate-distortion, printed"),
    ("rd_per_n", "rate-distortion, N bits"),
    ("central", "centralised"),
];

fn values(source: &str, snr: f64) -> Result<[f64; 10], Error> {
    let scene = if source == "uniform" {
        Scene::uniform(3, snr)?
    } else {
        Scene::gaussian(snr)?
    };
    let bank = scene.bank(&gray_basis(3).map_err(Error::failed)?)?;
    let mse = |decoder| bank.mse(decoder).map_err(Error::failed);
    let printed = remote_distortion(&scene.source, scene.noise)
        .and_then(|d| d.at(3.0))
        .map_err(Error::failed)?;
    Ok([
        mse(Decoder::Mmse)?,
        mse(Decoder::ContinuousMap)?,
        mse(Decoder::DiscreteMap(&scene.grid))?,
        mse(Decoder::PrintedDiscreteMap(&scene.grid))?,
        mse(Decoder::ExactDivisionMap(&scene.grid))?,
        printed_crlb(&bank).map_err(Error::failed)?,
        optimal_weight_van_trees(&bank).map_err(Error::failed)?,
        printed,
        network_rate_distortion(&scene.source, scene.noise, 3).map_err(Error::failed)?,
        centralised_bound(&scene.source, scene.noise, 3).map_err(Error::failed)?,
    ])
}

impl Figure for Decoders {
    type Parameters = Parameters;

    fn about(&self) -> About {
        About {
            id: "binary-fig5-8",
            title: "Decoders and bounds, three Gray bits",
            caption: "The caption of the thesis says Gaussian, the text uniform: both are here. The posterior mean is best everywhere. The \
                      continuous maximum a posteriori decoder is worse than the discrete one for a uniform source, and better only up to 13 dB for a \
                      Gaussian one. Equation 5.13 is no bound for a uniform source; the optimal-weight van Trees bound is one, and tight.",
            source: "Movaghati, thesis, figure 5.8",
        }
    }

    fn check(&self, p: &Parameters) -> Result<(), Error> {
        check_sweep("binary-fig5-8", p.from_db, p.to_db, p.step_db)
    }

    fn quicken(&self, p: &mut Parameters) {
        p.step_db = 5.0;
    }

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Tables, Error> {
        let mut columns = vec![
            column("source", "", "uniform on [-1, 1], or Gaussian of variance 0.1"),
            column("snr_db", "dB", "signal-to-noise ratio"),
        ];
        columns.extend(CURVES.iter().map(|(name, label)| column(name, "V^2", label)));
        let mut table = Table::new(columns);
        let points = sweep(p.from_db, p.to_db, p.step_db);
        for source in ["uniform", "gaussian"] {
            for (snr, v) in points.iter().zip(each(&points, |snr| values(source, snr))?) {
                let mut row = row![source, *snr];
                row.extend(v.map(Into::into));
                table.push(row)?;
            }
        }
        let mut ratios = Table::new([
            column("snr_db", "dB", "signal-to-noise ratio"),
            column("van_trees", "V^2", "optimal-weight bound, uniform source"),
            column("mmse", "V^2", "exact error"),
            column("crlb", "V^2", "equation 5.13"),
            column("ratio", "", "bound over error"),
        ]);
        for (snr, _) in RATIOS {
            let bank = Scene::uniform(3, snr)?.bank(&[4, 6, 3])?;
            let (bound, mse) =
                (optimal_weight_van_trees(&bank).map_err(Error::failed)?, bank.mmse().map_err(Error::failed)?);
            ratios.push(row![
                snr,
                bound,
                mse,
                printed_crlb(&bank).map_err(Error::failed)?,
                bound / mse
            ])?;
        }
        Ok(Tables::from(table).with("tightness", ratios))
    }

    fn claims(&self, _: &Parameters, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let mut claims = Vec::new();
        for source in ["uniform", "gaussian"] {
            let rows = tables.main.only("source", source)?;
            let get = |name: &str| rows.numbers(name);
            let (snr, mmse, cmap, dmap) = (get("snr_db")?, get("mmse")?, get("cmap")?, get("dmap")?);
            let count = |broken: &dyn Fn(usize) -> bool| (0..snr.len()).filter(|&i| broken(i)).count();
            let at_most = 1.0 + 1e-9;
            claims.push(Claim::never(
                format!("{source}-mmse"),
                "the posterior mean is no worse than any other decoder",
                count(&|i| mmse[i] > cmap[i].min(dmap[i]) * at_most),
            ));
            for bound in ["vt", "rd_per_n", "central"] {
                let values = get(bound)?;
                claims.push(Claim::never(
                    format!("{source}-{bound}"),
                    format!("`{bound}` is a bound"),
                    count(&|i| values[i] > mmse[i] * at_most),
                ));
            }
            let (rd, central) = (get("rd_per_n")?, get("central")?);
            claims.push(Claim::never(
                format!("{source}-central-tighter"),
                "the exact centralised bound is above the rate-distortion bound",
                count(&|i| rd[i] > central[i] * at_most),
            ));
            let (crlb, printed) = (get("crlb")?, get("dmap_print")?);
            if source == "uniform" {
                claims.push(Claim::never(
                    "uniform-cmap",
                    "for a uniform source the continuous MAP decoder is worse than the discrete one throughout (erratum binary-15)",
                    count(&|i| cmap[i] <= dmap[i]),
                ));
                claims.push(
                    Claim::at_least(
                        "uniform-crlb",
                        "equation 5.13 exceeds the true error somewhere: no bound for a uniform source (erratum binary-7)",
                        count(&|i| crlb[i] > mmse[i]) as f64,
                        1.0,
                    )
                    .at_defaults(),
                );
            } else {
                claims.push(
                    Claim::never(
                        "gaussian-cmap",
                        "for a Gaussian source continuous MAP beats discrete MAP up to 13 dB and loses from 14 dB on",
                        count(&|i| {
                            if snr[i] <= 13.0 {
                                cmap[i] >= dmap[i]
                            } else {
                                snr[i] >= 14.0 && cmap[i] <= dmap[i]
                            }
                        }),
                    )
                    .at_defaults(),
                );
                claims.push(Claim::never(
                    "gaussian-crlb",
                    "for a Gaussian source equation 5.13 is a bound",
                    count(&|i| crlb[i] > mmse[i] * at_most),
                ));
                for (at, wrong, right) in [(10.0, 0.03280, 0.01626), (15.0, 0.02181, 0.00668)] {
                    if let Some(i) = snr.iter().position(|s| (s - at).abs() < 1e-9) {
                        claims.push(
                            Claim::near(
                                format!("gaussian-print-{at}"),
                                format!("equation 5.10 as printed has error {wrong} at {at} dB (erratum binary-4)"),
                                printed[i],
                                wrong,
                                1e-5,
                            )
                            .at_defaults(),
                        );
                        claims.push(
                            Claim::near(
                                format!("gaussian-dmap-{at}"),
                                format!("corrected, {right}"),
                                dmap[i],
                                right,
                                1e-5,
                            )
                            .at_defaults(),
                        );
                    }
                }
            }
        }
        let tightness = tables.named("tightness")?;
        for ((snr, expected), ratio) in RATIOS.iter().zip(tightness.numbers("ratio")?) {
            let statement = format!("van Trees bound over error at {snr} dB");
            claims.push(Claim::near(format!("tightness-{snr}"), statement, ratio, *expected, 6e-4));
        }
        for (snr, crlb) in [(-20.0, 52.4), (0.0, 0.3819), (15.0, 0.01676), (20.0, 0.00913)] {
            let own = tightness.only("snr_db", snr)?;
            let (formula, mse) = (own.numbers("crlb")?[0], own.numbers("mmse")?[0]);
            claims.push(Claim::near_relative(
                format!("crlb-{snr}"),
                format!("equation 5.13 at {snr} dB"),
                formula,
                crlb,
                2e-3,
            ));
            claims.push(Claim::above(
                format!("crlb-exceeds-{snr}"),
                "and it exceeds the true error there",
                formula,
                mse,
            ));
        }
        Ok(claims)
    }

    fn plot(&self, _: &Parameters, tables: &Tables) -> Result<Plot, Error> {
        let mut panels = Vec::new();
        for (source, name) in [("uniform", "uniform"), ("gaussian", "Gaussian")] {
            let rows = tables.main.only("source", source)?;
            let axis = || Axis::linear("signal-to-noise ratio / dB");
            let mut decoders =
                Panel::new(format!("Decoders, {name} source"), axis(), Axis::log("mean squared error / V^2"));
            let mut bounds = Panel::new(format!("Bounds, {name} source"), axis(), Axis::log("V^2"));
            for (at, (curve, label)) in CURVES.iter().enumerate() {
                let points = rows.points("snr_db", curve)?;
                if at < 4 {
                    decoders = decoders.with(Layer::line(*label, points).coloured(at));
                } else if at > 4 {
                    bounds = bounds.with(Layer::dashed(*label, points).coloured(at - 4));
                }
            }
            bounds = bounds.with(Layer::line("posterior mean", rows.points("snr_db", "mmse")?).coloured(0));
            panels.push(decoders.legend(Legend::TopRight));
            panels.push(bounds.legend(Legend::BottomLeft));
        }
        Ok(Plot::grid(2, panels))
    }
}

/// Bound over error, as found independently.
const RATIOS: [(f64, f64); 9] = [
    (-20.0, 0.999),
    (0.0, 0.859),
    (5.0, 0.776),
    (8.0, 0.730),
    (10.0, 0.737),
    (15.0, 0.887),
    (20.0, 0.961),
    (25.0, 0.928),
    (40.0, 0.969),
];
