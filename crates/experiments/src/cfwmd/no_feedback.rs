//! No feedback, scalar measurements: figure 3 and what the printed likelihood is worth.

use super::case::Simulated;
use super::linear::{Method, Scheme};
use super::pictures::BOTH;
use super::rows::{Part, Step};
use super::setting::{Linear, Setting};
use crate::prelude::*;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_models::{LinearSensor, constant_velocity_1d};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::Vector2;

pub(super) static FIG3: Simulated<Linear, Step> = Simulated {
    about: About::of("cfwmd-fig3", "Scalar measurements, no feedback", "CFwMD paper, figure 3"),
    caption: "The order of the published figure, obtained with the correct filter: a joint Gaussian belief over the \
              state and the sensors' own estimates. With the printed likelihood CFwMD would coincide with CFoMD.",
    pairs: &[("CFwMD", "CFoMD"), ("CFoMD", "random")],
    setting: || Linear::scalar(2, &[1.0]),
    simulate: |setting, context| {
        let schemes = [
            ("all", Scheme::All),
            ("CFwMD", Scheme::NoFeedback(Method::Joint)),
            ("CFoMD", Scheme::NoFeedback(Method::Ignored)),
            ("random", Scheme::Random),
        ];
        setting.at_budgets(context, "", &schemes)
    },
    claims: |rows, claims| {
        rows.in_order(claims, &["all", "CFwMD", "CFoMD", "random"], ("", 1.0), &BOTH);
        rows.beats(claims, ("CFwMD", "CFoMD"), ("", 1.0), &BOTH);
        rows.beats(claims, ("CFoMD", "random"), ("", 1.0), &[Part::Position]);
        let rate = rows.at("CFwMD", 1.0).map(|r| r.rate);
        claims.within("rate-exact", "without feedback the rate is exactly the budget", rate, 1.0, 4.0);
        let gain = rows.ratio("CFwMD", "CFoMD", 1.0).map(|r| 1.0 - r);
        claims.near("gain", "using silence lowers the position RMSE by a tenth", gain, 0.105, 0.025);
    },
    ..Simulated::BASE
};

rows! {
    /// What the printed likelihood says.
    #[derive(Debug, Default)]
    pub struct Literal {
        printed_likelihood: Vec<Printed> => "The printed likelihood of silence over the law that it assumes.",
    }

    #[derive(Debug)]
    struct Printed {
        k: usize => "Time step.",
        offset: f64 ["m"] => "Position less its mean.",
        /// Probability of silence as printed: averaged over an own estimate that scatters about this position.
        probability: f64,
    }
}

/// The printed likelihood by quadrature over the sensor's estimate, at positions of all steps.
fn printed_likelihood(setting: &Linear) -> Result<Vec<Printed>, Error> {
    let noise = setting.noise_variances[0];
    let rate = setting.messages[0] / setting.sensors as f64;
    let threshold = fewbits_cfwmd::threshold::threshold(rate, 1)?;
    let dynamics = constant_velocity_1d(1.0, setting.acceleration_variance)?;
    let sensor = LinearSensor::scalar(Vector2::new(1.0, 0.0), noise)?;
    let start = setting.belief()?;
    let mut own = OwnRecursion::new(&start);
    let mut rows = Vec::new();
    for k in 1..=setting.steps as usize {
        let step = own.advance(&dynamics, &sensor, start.mean())?;
        let half_width = CensoringRule::new(&step.innovation_covariance, threshold)?.half_width();
        let spread = step.innovation_covariance[(0, 0)] - noise;
        for offset in [-10.0, -1.0, 0.0, 1.0, 10.0] {
            let reach = 9.0 * spread.sqrt();
            let mut probability = 0.0;
            for (estimate, weight) in gauss_legendre::<24>().panels(offset - reach, offset + reach, 8) {
                let density = normal::log_pdf_with(estimate, offset, spread).exp();
                let [low, high] = [-half_width, half_width].map(|side| (estimate + side - offset) / noise.sqrt());
                probability += weight * density * normal::log_interval(low, high).exp();
            }
            rows.push(Printed { k, offset, probability });
        }
    }
    Ok(rows)
}

/// Ways to use silence without feedback.
pub(super) static NO_FEEDBACK: Simulated<Linear, Step, Literal> = Simulated {
    about: About::of(
        "cfwmd-nofeedback",
        "What silence is worth without feedback, and what the printed likelihood is",
        "",
    ),
    caption: "Exact filter (measurements imputed), joint Gaussian belief, a heuristic that scatters the sensors' \
              estimates about the fusion centre's, the filter that ignores silence, and the paper's law of the \
              sensors' estimates with its mean corrected, which does harm because it forgets the data. The likelihood \
              as printed is one number whatever the state, and so leaves the filter that ignores silence.",
    pairs: &[
        ("exact", "joint Gaussian"),
        ("joint Gaussian", "ignored"),
        ("exact", "ignored"),
        ("heuristic", "ignored"),
        ("ignored", "no history"),
        ("joint Gaussian", "heuristic"),
    ],
    setting: || Linear {
        trials: 4000,
        ..Linear::scalar(2, &[1.0]).with_particles(500)
    },
    simulate: |setting, context| {
        let schemes = [
            ("exact", Scheme::NoFeedback(Method::Imputed(setting.cloud()))),
            ("joint Gaussian", Scheme::NoFeedback(Method::Joint)),
            ("heuristic", Scheme::Centred),
            ("ignored", Scheme::NoFeedback(Method::Ignored)),
            ("no history", Scheme::Unconditional),
        ];
        setting.at_budgets(context, "", &schemes)
    },
    further: |setting, _| {
        Ok(Literal {
            printed_likelihood: printed_likelihood(setting)?,
        })
    },
    claims: |rows, claims| {
        for pair in [
            ("exact", "ignored"),
            ("joint Gaussian", "ignored"),
            ("heuristic", "ignored"),
            ("joint Gaussian", "heuristic"),
        ] {
            rows.beats(claims, pair, ("", 1.0), &[Part::Position]);
        }
        rows.beats(&mut claims.showing("cfwmd-3"), ("ignored", "no history"), ("", 1.0), &[Part::Position]);
        let gap = rows.pair("exact", "joint Gaussian", "", 1.0).map(|p| p.position.value);
        let what = "the joint Gaussian belief is as good as the exact filter (difference in squared error, m^2; erratum cfwmd-4)";
        claims.near("joint-is-exact", what, gap, 0.0, 0.01);
    },
    always: |setting, rows, claims| {
        let silent = 1.0 - setting.messages[0] / setting.sensors as f64;
        let what = "the printed likelihood of silence is 1 - l/N at every position and step: it says nothing (erratum cfwmd-2)";
        let printed = &rows.further.printed_likelihood;
        claims.all("printed-is-constant", what, printed, |r| (r.probability - silent).abs() < 1e-9);
    },
    plot: |_, rows| {
        let schemes = Axis::categories("", rows.summary.iter().map(|r| r.run.scheme));
        let all = rows.summary.iter().enumerate();
        Plot::of(
            Panel::new("Position error without feedback", schemes, Axis::linear("time-averaged RMSE / m"))
                .with(Layer::measured("", all, |(i, r)| (i as f64, r.position_rmse)))
                .without_legend(),
        )
    },
    ..Simulated::BASE
};

#[cfg(test)]
mod tests {
    use super::*;

    /// Who always sends is never silent: probability zero, not a quotient of nothing by nothing.
    #[test]
    fn the_printed_likelihood_of_silence_at_rate_one_is_zero() {
        let setting = Linear::scalar(2, &[2.0]);
        let rows = printed_likelihood(&setting).unwrap();
        assert_eq!(rows.len(), 5 * setting.steps as usize);
        assert!(rows.iter().all(|row| row.probability == 0.0));
    }
}
