//! Beyond the paper: lossy links and scheduled thresholds.

use super::case::Simulated;
use super::linear::Scheme;
use super::pictures::by_budget;
use super::rows::{Part, Step, Summary};
use super::scalar::{BUDGETS, CENSORED};
use super::setting::{Linear, Setting};
use crate::prelude::*;
use fewbits_baselines::cfwmd::Weighing;
use fewbits_baselines::cfwmd::information::fisher_information;
use fewbits_core::LinearDynamics;
use fewbits_filters::cramer_rao;
use fewbits_models::constant_velocity_1d;
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;

const NO_LOSS: &str = "no loss";
const IGNORED: &str = "loss ignored";
const MODELLED: &str = "loss modelled";

pub(crate) static LOSSY: Simulated<Linear, Step> = Simulated {
    about: About::of("cfwmd-lossy", "Censored or lost?", ""),
    caption: "Nothing arrived: the sensor was silent, or its message was lost. A fusion centre that takes loss for \
              silence believes too much; one that weighs both loses far less.",
    pairs: &[(MODELLED, IGNORED)],
    setting: || Linear {
        losses: Some(vec![0.05, 0.1, 0.2, 0.3]),
        ..Linear::scalar(2, &[1.0])
    },
    simulate: |setting, context| {
        let mut all = setting.at_budgets(context, "", &[(NO_LOSS, CENSORED[0].1)])?;
        for loss in setting.losses.iter().flatten().copied() {
            let schemes = [(IGNORED, false), (MODELLED, true)];
            let schemes = schemes.map(|(name, modelled)| (name, Scheme::Lossy { loss, modelled }));
            all.extend(setting.at_budgets(context, &format!("loss {loss}"), &schemes)?);
        }
        Ok(all)
    },
    claims: |rows, claims| {
        for loss in ["loss 0.1", "loss 0.3"] {
            rows.beat(claims, LOSSY.pairs, (loss, 1.0), &[Part::Position]);
        }
        let what = "gain in squared position error by modelling the loss (m^2)";
        claims.references("gain", what, &rows.paired, |p| (p.world.clone(), p.position.scaled(-1.0)));
        let nees = |name: &str| Some(rows.at(name, 1.0)?.nees?.value);
        let what = "modelling the loss keeps the belief honest: squared error over variance";
        claims.below("honest", what, nees("loss modelled, loss 0.3"), 1.4);
        claims.above("naive", "ignoring it does not", nees("loss ignored, loss 0.3"), 2.0);
    },
    plot: |setting, rows| {
        let l = setting.messages[0];
        let mut panel = Panel::linear("Position error over a lossy link", "loss probability", "time-averaged RMSE / m");
        for (colour, scheme) in [IGNORED, MODELLED].into_iter().enumerate() {
            let at = |loss: &f64| Some((*loss, rows.at(&format!("{scheme}, loss {loss}"), l)?.position_rmse));
            let clean = rows.at(NO_LOSS, l).map(|r| (0.0, r.position_rmse));
            let lossy = setting.losses.iter().flatten().filter_map(at);
            panel = panel.with_all(Layer::curve(scheme, colour, clean.into_iter().chain(lossy).collect()));
        }
        Plot::of(panel)
    },
    ..Simulated::BASE
};

const TWO: &str = "2 sensors";

rows! {
    /// Bounds of any filter that receives these messages.
    pub struct Bound {
        l: f64 ["messages/step"] => "Message budget.",
        sensors: u64 => "Number of sensors.",
        bound_m: f64 ["m"] => "Time-averaged position bound, innovations weighed by the sensor's own filter (CFwMD).",
        bound_centre_m: f64 ["m"] => "The same, weighed with the bound's own covariance (CFwMD2, scheduled).",
    }
}

fn bounds(p: &Linear) -> Result<Vec<Bound>, Error> {
    let row = |(l, sensors)| {
        let (bound_m, bound_centre_m) = (bound(p, l, sensors, true)?, bound(p, l, sensors, false)?);
        Ok(Bound {
            l,
            sensors,
            bound_m,
            bound_centre_m,
        })
    };
    let own = p.messages.iter().map(|l| (*l, p.sensors));
    let cases = own.chain([(1.0, 2), (2.0, 2)]).filter(|_| p.noise_variances.len() == 1);
    cases.map(row).collect()
}

fn world(sensors: u64) -> String {
    format!("{sensors} sensors")
}

pub(crate) static SCHEDULED: Simulated<Linear, Step, Vec<Bound>> = Simulated {
    further: bounds,
    about: About::of("cfwmd-scheduled", "The rate of covariance feedback without the feedback", ""),
    caption: "A schedule of innovation variances, simulated once before deployment, meets the message budget and the \
              error of covariance feedback (CFwMD2) without sending a covariance. Thin: optimistic bounds for any \
              filter that receives these messages.",
    pairs: &[("scheduled", "CFwMD2"), ("scheduled", "CFwMD")],
    setting: || Linear::scalar(4, &BUDGETS),
    simulate: |setting, context| {
        let schemes = [
            CENSORED[0],
            CENSORED[1],
            ("scheduled", Scheme::Gaussian(Weighing::Scheduled)),
        ];
        let mut all = setting.at_budgets(context, &world(setting.sensors), &schemes)?;
        if setting.sensors != 2 {
            let two = Linear {
                sensors: 2,
                ..setting.clone()
            };
            all.extend(two.run(context, (TWO, 1.0), &schemes)?);
        }
        Ok(all)
    },
    claims: |rows, claims| {
        let name = |scheme: &str| format!("{scheme}, 4 sensors");
        let bounds = &rows.further;
        for l in BUDGETS {
            let rate = rows.at(&name("scheduled"), l).map(|r| r.rate.value);
            let what = format!("the schedule meets the budget l = {l} without covariance feedback");
            claims.near(format!("budget-l{l}"), what, rate, l, 0.02);
            let ratio = rows.ratio(&name("scheduled"), &name("CFwMD2"), l);
            let what = format!("and the error of covariance feedback or less, l = {l} (ratio)");
            claims.near(format!("error-l{l}"), what, ratio, 0.99, 0.03);
            let bound = bounds.iter().find(|b| b.l == l && b.sensors == 4);
            for scheme in ["CFwMD", "CFwMD2", "scheduled"] {
                let error = rows.at(&name(scheme), l).map(|r| r.position_rmse.value);
                let own = bound.map(|b| if scheme == "CFwMD" { b.bound_m } else { b.bound_centre_m });
                let ratio = over(error, own);
                let what = format!("{scheme} does not beat its bound at l = {l} (ratio)");
                claims.at_least(format!("above-bound-{scheme}-l{l}"), what, ratio, 0.995);
            }
        }
        rows.beat(claims, &[("scheduled", "CFwMD")], (TWO, 1.0), &[Part::Position]);
        let key = |b: &Bound| (format!("N = {}, l = {}", b.sensors, b.l), b.bound_m);
        claims.references("bound", "information bound of CFwMD (m)", bounds, key);
    },
    plot: |setting, rows| {
        let own = world(setting.sensors);
        let all: Vec<&Summary> = select(&rows.summary, |r| r.run.world == own).collect();
        let bounds = || {
            let own = select(&rows.further, |b| b.sensors == setting.sensors);
            own.take(setting.messages.len())
        };
        let error = by_budget(&all, "Position error", "time-averaged RMSE / m", |r| r.position_rmse)
            .with(Layer::dashed("bound on CFwMD", points(bounds(), |b| (b.l, b.bound_m))).coloured(0))
            .with(Layer::dashed("bound on the others", points(bounds(), |b| (b.l, b.bound_centre_m))).coloured(1));
        let budget = setting.messages.iter().map(|l| (*l, *l)).collect();
        let rate =
            by_budget(&all, "Rate", "messages a step", |r| r.rate).with(Layer::dashed("budget", budget).coloured(7));
        Plot::grid(2, vec![error, rate])
    },
    ..Simulated::BASE
};

/// Time-averaged position bound: expected Fisher information of each sensor at the bound's own covariance.
fn bound(setting: &Linear, messages: f64, sensors: u64, own_filter: bool) -> Result<f64, Error> {
    let dynamics = constant_velocity_1d(1.0, setting.acceleration_variance)?;
    let noise = setting.noise_variances[0];
    let eta = fewbits_cfwmd::threshold::threshold(messages / sensors as f64, 1)?;
    let (f, q) = (*dynamics.transition(), *dynamics.noise_covariance());
    let mut bound = *setting.belief()?.covariance();
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
            information += weight * density * fisher_information(mu, half_width, noise)?;
        }
        let received = Matrix2::new(sensors as f64 * information, 0.0, 0.0, 0.0);
        bound = cramer_rao::covariance_step(&dynamics, &bound, &received)?;
        total += bound[(0, 0)];
    }
    Ok((total / setting.steps as f64).sqrt())
}
