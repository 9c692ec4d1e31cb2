//! Beyond the paper: lossy links, scheduled thresholds, and what each filter costs.

use super::case::{Case, by_budget};
use super::ensemble::{Ensemble, Part, agrees, beats, first, value};
use super::linear::{Scheme, Setting, run};
use crate::error::Error;
use crate::legacy::claim::Claim;
use crate::legacy::row;
use crate::legacy::{About, Context};
use crate::legacy::{Table, Tables, column};
use crate::plot::{Axis, Layer, Panel, Plot};
use fewbits_cfwmd::information::fisher_information;
use fewbits_cfwmd::rule::Weighing;
use fewbits_filters::cramer_rao;
use fewbits_models::constant_velocity_1d;
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::Matrix2;
use std::hint::black_box;
use std::time::Instant;

/// Links that lose messages.
pub(super) struct Lossy;

const LOSSES: [f64; 4] = [0.05, 0.1, 0.2, 0.3];

fn lossy_names() -> Vec<(String, Scheme)> {
    LOSSES
        .iter()
        .flat_map(|loss| {
            [("ignored", false), ("modelled", true)]
                .map(|(how, modelled)| (format!("{how}, loss {loss}"), Scheme::Lossy { loss: *loss, modelled }))
        })
        .collect()
}

impl Case for Lossy {
    type Setting = Setting;

    fn about() -> About {
        About {
            id: "cfwmd-lossy",
            title: "Censored or lost?",
            caption: "Nothing arrived: the sensor was silent, or spoke and was not heard. A fusion centre that takes loss for silence believes too much; one that weighs both loses far less.",
            source: "",
        }
    }

    fn setting() -> Setting {
        Setting::scalar(2, vec![1.0])
    }

    fn quicken(setting: &mut Setting) {
        setting.quicken();
    }

    fn simulate(setting: &Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error> {
        let names = lossy_names();
        let mut schemes: Vec<(&str, Scheme)> = vec![("no loss", Scheme::Gaussian(Weighing::OwnFilter))];
        schemes.extend(names.iter().map(|(name, scheme)| (name.as_str(), *scheme)));
        let messages = setting.messages.iter();
        messages
            .map(|l| run::<1>(context, setting, *l, &schemes))
            .collect::<Result<Vec<_>, _>>()
            .map(|e| e.concat())
    }

    fn pairs() -> Vec<(&'static str, &'static str)> {
        vec![
            ("modelled, loss 0.1", "ignored, loss 0.1"),
            ("modelled, loss 0.3", "ignored, loss 0.3"),
        ]
    }

    fn claims(_: &Setting, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (summary, paired) = (tables.named("summary")?, tables.named("paired")?);
        let mut claims = Vec::new();
        for loss in ["0.1", "0.3"] {
            for how in ["ignored", "modelled"] {
                claims.extend(agrees(
                    summary,
                    &format!("{how}, loss {loss}"),
                    1.0,
                    &format!("loss/p{loss}_{how}"),
                    0.0,
                    0.01,
                )?);
            }
            claims.push(beats(
                paired,
                &format!("modelled, loss {loss}"),
                &format!("ignored, loss {loss}"),
                1.0,
                Part::Position,
            )?);
        }
        for (loss, expected, tolerance) in [("0.1", 0.064, 0.025), ("0.3", 0.555, 0.12)] {
            let rows = paired.only("first", format!("modelled, loss {loss}"))?;
            let gain = -first(rows.numbers("pos_mse_difference_m2")?)?;
            claims.push(
                Claim::near(
                    format!("gain-{loss}"),
                    format!("gain in squared position error at loss {loss} (m^2)"),
                    gain,
                    expected,
                    tolerance,
                )
                .at_defaults(),
            );
        }
        let honest = value(summary, "modelled, loss 0.3", 1.0, "nees")?;
        let naive = value(summary, "ignored, loss 0.3", 1.0, "nees")?;
        claims.push(
            Claim::below(
                "honest",
                "modelling the loss keeps the belief honest: squared error over variance",
                honest,
                1.4,
            )
            .at_defaults(),
        );
        claims.push(Claim::above("naive", "ignoring it does not", naive, 2.0).at_defaults());
        Ok(claims)
    }

    fn plot(tables: &Tables) -> Result<Plot, Error> {
        let summary = tables.named("summary")?;
        let clean =
            value(summary, "no loss", 1.0, "pos_armse_m").or_else(|_| summary.numbers("pos_armse_m").map(|v| v[0]))?;
        let mut panel = Panel::new(
            "Position error over a lossy link",
            Axis::linear("loss probability"),
            Axis::linear("time-averaged RMSE (m)"),
        )
        .legend(crate::plot::Legend::TopLeft);
        let names = summary.texts("scheme")?;
        let (values, errors) = (summary.numbers("pos_armse_m")?, summary.numbers("pos_se")?);
        for (colour, how) in ["ignored", "modelled"].into_iter().enumerate() {
            let at: Vec<usize> = LOSSES
                .iter()
                .filter_map(|loss| names.iter().position(|n| *n == format!("{how}, loss {loss}")))
                .collect();
            let mut points: Vec<(f64, f64)> = vec![(0.0, clean)];
            points.extend(at.iter().zip(LOSSES).map(|(i, loss)| (loss, values[*i])));
            let marks = points[1..].to_vec();
            panel = panel.with(Layer::line("", points).coloured(colour)).with(
                Layer::points(format!("loss {how}"), marks)
                    .with_errors(at.iter().map(|i| errors[*i]).collect())
                    .coloured(colour),
            );
        }
        Ok(Plot::of(panel))
    }
}

/// Thresholds computed before deployment.
pub(super) struct Scheduled;

const BUDGETS: [f64; 5] = [1.0, 1.2, 1.5, 2.0, 3.0];

impl Case for Scheduled {
    type Setting = Setting;

    fn about() -> About {
        About {
            id: "cfwmd-scheduled",
            title: "The rate of covariance feedback without the feedback",
            caption: "A schedule of innovation variances, simulated once before deployment, meets the message budget and the error of covariance feedback (CFwMD2) without sending a covariance. Dashed: optimistic bounds for any filter that hears these messages.",
            source: "",
        }
    }

    fn setting() -> Setting {
        Setting::scalar(4, BUDGETS.to_vec())
    }

    fn quicken(setting: &mut Setting) {
        setting.quicken();
    }

    fn simulate(setting: &Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error> {
        let schemes = [
            ("CFwMD", Scheme::Gaussian(Weighing::OwnFilter)),
            ("CFwMD2", Scheme::Gaussian(Weighing::FusionCentre)),
            ("scheduled", Scheme::Gaussian(Weighing::Scheduled)),
        ];
        let messages = setting.messages.iter();
        let mut all = messages
            .map(|l| run::<1>(context, setting, *l, &schemes))
            .collect::<Result<Vec<_>, _>>()
            .map(|e| e.concat())?;
        let two = Setting {
            sensors: 2,
            ..setting.clone()
        };
        let suffixed = [
            ("CFwMD, 2 sensors", schemes[0].1),
            ("CFwMD2, 2 sensors", schemes[1].1),
            ("scheduled, 2 sensors", schemes[2].1),
        ];
        all.extend(run::<1>(context, &two, 1.0, &suffixed)?);
        Ok(all)
    }

    fn pairs() -> Vec<(&'static str, &'static str)> {
        vec![
            ("scheduled", "CFwMD2"),
            ("scheduled", "CFwMD"),
            ("scheduled, 2 sensors", "CFwMD, 2 sensors"),
        ]
    }

    fn exact() -> &'static [&'static str] {
        &["bound-"]
    }

    fn further(setting: &Setting, _: &Context<'_>, tables: Tables) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("l", "messages/step", "message budget"),
            column("sensors", "", "number of sensors"),
            column(
                "bound_m",
                "m",
                "time-averaged position bound, innovations weighed by the sensor's own filter (CFwMD)",
            ),
            column("bound_centre_m", "m", "the same, weighed with the bound's own covariance (CFwMD2, scheduled)"),
        ]);
        let mut cases: Vec<(f64, u64)> = setting.messages.iter().map(|l| (*l, setting.sensors)).collect();
        cases.extend([(1.0, 2), (2.0, 2)]);
        for (l, sensors) in cases {
            table.push(row![
                l,
                sensors,
                bound(setting, l, sensors, true)?,
                bound(setting, l, sensors, false)?
            ])?;
        }
        Ok(tables.with("bound", table))
    }

    fn claims(_: &Setting, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (summary, paired) = (tables.named("summary")?, tables.named("paired")?);
        let mut claims = Vec::new();
        for l in BUDGETS {
            claims.extend(agrees(summary, "scheduled", l, &format!("cal/N4_l{l}"), 0.0, 0.01)?);
            let rate = value(summary, "scheduled", l, "lbar")?;
            claims.push(
                Claim::near(
                    format!("budget-l{l}"),
                    format!("the schedule meets the budget l = {l} without covariance feedback"),
                    rate,
                    l,
                    0.02,
                )
                .at_defaults(),
            );
            let ratio = value(summary, "scheduled", l, "pos_armse_m")? / value(summary, "CFwMD2", l, "pos_armse_m")?;
            claims.push(
                Claim::near(
                    format!("error-l{l}"),
                    format!("and the error of covariance feedback or less, l = {l} (ratio)"),
                    ratio,
                    0.99,
                    0.03,
                )
                .at_defaults(),
            );
        }
        claims.extend(agrees(summary, "scheduled, 2 sensors", 1.0, "cal/N2l1_sched", 0.0, 0.01)?);
        claims.push(beats(paired, "scheduled, 2 sensors", "CFwMD, 2 sensors", 1.0, Part::Position)?);
        let bounds = tables.named("bound")?;
        for (l, sensors, expected) in [(1.0, 2_u64, 0.772), (1.0, 4, 0.750), (2.0, 4, 0.571)] {
            let ours = first(bounds.only("l", l)?.only("sensors", sensors)?.numbers("bound_m")?)?;
            claims.push(
                Claim::near(
                    format!("bound-N{sensors}-l{l}"),
                    format!("information bound with {sensors} sensors at l = {l} (m)"),
                    ours,
                    expected,
                    0.002,
                )
                .at_defaults(),
            );
        }
        for l in BUDGETS {
            let row = bounds.only("l", l)?.only("sensors", 4_u64)?;
            for (scheme, column) in [
                ("CFwMD", "bound_m"),
                ("CFwMD2", "bound_centre_m"),
                ("scheduled", "bound_centre_m"),
            ] {
                let ratio = value(summary, scheme, l, "pos_armse_m")? / first(row.numbers(column)?)?;
                claims.push(
                    Claim::at_least(
                        format!("above-bound-{scheme}-l{l}"),
                        format!("{scheme} does not beat its bound at l = {l} (ratio)"),
                        ratio,
                        0.995,
                    )
                    .at_defaults(),
                );
            }
        }
        let all = first(bounds.only("l", 2.0)?.only("sensors", 2_u64)?.numbers("bound_m")?)?;
        claims.push(
            Claim::near(
                "bound-all",
                "with everything sent the bound is the Kalman filter's error (m)",
                all,
                0.6646,
                0.0005,
            )
            .at_defaults(),
        );
        Ok(claims)
    }

    fn plot(tables: &Tables) -> Result<Plot, Error> {
        let four = |table: &Table| -> Result<Table, Error> {
            let mut kept = Table::new(table.columns().to_vec());
            for row in table.rows() {
                if !matches!(&row[0], crate::legacy::Value::Text(name) if name.ends_with("sensors")) {
                    kept.push(row.clone())?;
                }
            }
            Ok(kept)
        };
        let summary = four(tables.named("summary")?)?;
        let bounds = tables.named("bound")?.only("sensors", 4_u64)?;
        let error = by_budget(&summary, "Position error", "pos_armse_m", "pos_se", "time-averaged RMSE (m)")?
            .with(Layer::dashed("bound on CFwMD", bounds.points("l", "bound_m")?).coloured(0))
            .with(Layer::dashed("bound on the others", bounds.points("l", "bound_centre_m")?).coloured(1));
        let rate = by_budget(&summary, "Rate", "lbar", "lbar_se", "messages a step")?
            .with(Layer::dashed("budget", vec![(1.0, 1.0), (3.0, 3.0)]).coloured(7))
            .legend(crate::plot::Legend::TopLeft);
        Ok(Plot::grid(2, vec![error, rate]))
    }
}

/// Time-averaged position bound: expected Fisher information of each sensor at the bound's own covariance.
fn bound(setting: &Setting, messages: f64, sensors: u64, own_filter: bool) -> Result<f64, Error> {
    let dynamics = constant_velocity_1d(1.0, setting.acceleration_variance).map_err(Error::failed)?;
    let noise = setting.noise_variances.first().copied().unwrap_or(1.0);
    let eta = fewbits_cfwmd::threshold::threshold(messages / sensors as f64, 1).map_err(Error::failed)?;
    let (f, q) = (
        *fewbits_core::LinearDynamics::transition(&dynamics),
        *fewbits_core::LinearDynamics::noise_covariance(&dynamics),
    );
    let mut bound = Matrix2::identity() * setting.initial_variance;
    let mut own = bound;
    let mut total = 0.0;
    for _ in 0..setting.steps {
        let predicted = f * bound * f.transpose() + q;
        let own_predicted = f * own * f.transpose() + q;
        let s = own_predicted[(0, 0)] + noise;
        own = own_predicted - own_predicted.column(0) * own_predicted.row(0) / s;
        let p = predicted[(0, 0)];
        let half_width = (eta * if own_filter { s } else { p + noise }).sqrt();
        let reach = 9.0 * p.sqrt();
        let mut information = 0.0;
        for (mu, weight) in gauss_legendre::<24>().panels(-reach, reach, 8) {
            let density = normal::log_pdf_with(mu, 0.0, p).exp();
            information += weight * density * fisher_information(mu, half_width, noise).map_err(Error::failed)?;
        }
        let heard = Matrix2::new(sensors as f64 * information, 0.0, 0.0, 0.0);
        bound = cramer_rao::covariance_step(&dynamics, &bound, &heard).map_err(Error::failed)?;
        total += bound[(0, 0)];
    }
    Ok((total / setting.steps as f64).sqrt())
}

/// Error against cost.
pub(super) struct Cost;

const CLOUDS: [(&str, usize); 3] = [("PF 100", 100), ("PF 300", 300), ("PF 1000", 1000)];
const MIXTURES: [(&str, usize); 3] = [("RBPF 10", 10), ("RBPF 30", 30), ("RBPF 100", 100)];

impl Cost {
    fn schemes() -> Vec<(&'static str, Scheme)> {
        let mut schemes = vec![("ADF", Scheme::Gaussian(Weighing::OwnFilter))];
        schemes.extend(CLOUDS.map(|(name, n)| (name, Scheme::Particles(n, Weighing::OwnFilter))));
        schemes.extend(MIXTURES.map(|(name, n)| (name, Scheme::RaoBlackwell(n))));
        schemes
    }
}

impl Case for Cost {
    type Setting = Setting;

    fn about() -> About {
        About {
            id: "cfwmd-cost",
            title: "Error against cost",
            caption: "The Gaussian belief with exact moments (ADF) is as accurate as a thousand particles at a small fraction of the time; thirty Rao-Blackwellised particles are on a par. Times are per step of fusion, draws of the experiment excluded.",
            source: "",
        }
    }

    fn setting() -> Setting {
        Setting::scalar(2, vec![1.0])
    }

    fn quicken(setting: &mut Setting) {
        setting.quicken();
    }

    fn measures_time() -> bool {
        true
    }

    fn exact() -> &'static [&'static str] {
        &["cheaper"]
    }

    fn simulate(setting: &Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error> {
        let messages = setting.messages.iter();
        messages
            .map(|l| run::<1>(context, setting, *l, &Cost::schemes()))
            .collect::<Result<Vec<_>, _>>()
            .map(|e| e.concat())
    }

    fn further(setting: &Setting, context: &Context<'_>, tables: Tables) -> Result<Tables, Error> {
        let mut table = Table::new([
            column("scheme", "", "filter"),
            column("time_us", "us", "time of one fusion step, best of the repetitions"),
            column("relative", "", "time over that of the Gaussian belief"),
        ]);
        let l = setting.messages.first().copied().unwrap_or(1.0);
        let bench = super::linear::Stopwatch::new(context, setting, l)?;
        let mut base = 0.0;
        for (name, scheme) in Cost::schemes() {
            let mut best = f64::INFINITY;
            for _ in 0..REPETITIONS {
                let started = Instant::now();
                let steps = black_box(bench.run(scheme)?);
                best = best.min(started.elapsed().as_secs_f64() / steps as f64);
            }
            if name == "ADF" {
                base = best;
            }
            table.push(row![name, best * 1e6, best / base])?;
        }
        Ok(tables.with_volatile("time", table))
    }

    fn pairs() -> Vec<(&'static str, &'static str)> {
        vec![("PF 1000", "ADF"), ("RBPF 30", "ADF"), ("ADF", "PF 100")]
    }

    fn claims(_: &Setting, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (summary, times) = (tables.named("summary")?, tables.named("time")?);
        let mut claims = Vec::new();
        for (scheme, reference) in [
            ("ADF", "ADF"),
            ("PF 100", "PF100"),
            ("PF 300", "PF300"),
            ("PF 1000", "PF1000"),
            ("RBPF 10", "RB10"),
            ("RBPF 30", "RB30"),
            ("RBPF 100", "RB100"),
        ] {
            claims.extend(agrees(summary, scheme, 1.0, &format!("cost/{reference}"), 0.0, 0.01)?);
        }
        let relative =
            |scheme: &str| -> Result<f64, Error> { first(times.only("scheme", scheme)?.numbers("relative")?) };
        claims.push(Claim::at_least(
            "cheaper",
            "the Gaussian belief is at least 15 times cheaper than 1000 particles",
            relative("PF 1000")?,
            15.0,
        ));
        let ratio = |scheme: &str| -> Result<f64, Error> {
            Ok(value(summary, scheme, 1.0, "pos_armse_m")? / value(summary, "ADF", 1.0, "pos_armse_m")?)
        };
        claims.push(
            Claim::at_least(
                "not-worse",
                "and not worse: RMSE of 1000 particles over that of the Gaussian belief",
                ratio("PF 1000")?,
                0.995,
            )
            .at_defaults(),
        );
        claims.push(
            Claim::near(
                "rao-blackwell",
                "30 Rao-Blackwellised particles are within 1.5% of it",
                ratio("RBPF 30")?,
                1.0,
                0.015,
            )
            .at_defaults(),
        );
        claims
            .push(Claim::above("too-few", "100 plain particles are not enough", ratio("PF 100")?, 1.03).at_defaults());
        claims.push(
            Claim::near(
                "consistent",
                "squared position error over its variance averages to one",
                value(summary, "ADF", 1.0, "nees")?,
                1.0,
                0.06,
            )
            .at_defaults(),
        );
        Ok(claims)
    }

    fn plot(tables: &Tables) -> Result<Plot, Error> {
        let (summary, times) = (tables.named("summary")?, tables.named("time")?);
        let mut panel = Panel::new(
            "Position error against time",
            Axis::log("time a step (us)"),
            Axis::linear("time-averaged RMSE (m)"),
        );
        for (colour, scheme) in summary.texts("scheme")?.iter().enumerate() {
            let at = summary.only("scheme", scheme.as_str())?;
            let time = times.only("scheme", scheme.as_str())?.numbers("time_us")?[0];
            let point = vec![(time, first(at.numbers("pos_armse_m")?)?)];
            panel = panel.with(
                Layer::points(scheme.as_str(), point)
                    .with_errors(at.numbers("pos_se")?)
                    .coloured(colour),
            );
        }
        Ok(Plot::of(panel))
    }
}

/// Repetitions of a timed run; the best is kept, as others share the machine.
const REPETITIONS: usize = 5;
