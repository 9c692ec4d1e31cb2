//! No feedback, scalar measurements: figure 3 and what the printed likelihood is worth.

use super::case::Case;
use super::ensemble::{Ensemble, Part, agrees, beats, first, ordered_at_every_step, value};
use super::linear::{Method, Scheme, Setting, run};
use crate::error::Error;
use crate::legacy::Tables;
use crate::legacy::claim::Claim;
use crate::legacy::{About, Context};
use crate::plot::{Axis, Layer, Legend, Panel, Plot};

/// Figure 3.
pub(super) struct Fig3;

impl Case for Fig3 {
    type Setting = Setting;

    fn about() -> About {
        About {
            id: "cfwmd-fig3",
            title: "Scalar measurements, no feedback",
            caption: "The order of the published figure, obtained with the correct filter: a joint Gaussian belief over the state and the sensors' own estimates. With the printed likelihood CFwMD would coincide with CFoMD.",
            source: "CFwMD paper, figure 3",
        }
    }

    fn setting() -> Setting {
        Setting::scalar(2, vec![1.0])
    }

    fn quicken(setting: &mut Setting) {
        setting.quicken();
    }

    fn simulate(setting: &Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error> {
        let schemes = [
            ("all", Scheme::All),
            ("CFwMD", Scheme::NoFeedback(Method::Joint)),
            ("CFoMD", Scheme::NoFeedback(Method::Ignored)),
            ("random", Scheme::Random),
        ];
        let messages = setting.messages.iter();
        messages
            .map(|l| run::<1>(context, setting, *l, &schemes))
            .collect::<Result<Vec<_>, _>>()
            .map(|e| e.concat())
    }

    fn pairs() -> Vec<(&'static str, &'static str)> {
        vec![("CFwMD", "CFoMD"), ("CFoMD", "random")]
    }

    fn claims(_: &Setting, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (summary, paired) = (tables.named("summary")?, tables.named("paired")?);
        let mut claims = agrees(summary, "CFoMD", 1.0, "fig3/CFoMD", 0.0, 0.01)?;
        claims.extend(agrees(summary, "CFwMD", 1.0, "fig3/ADFaug_1500", 0.0, 0.01)?);
        for (column, error) in [("pos_rmse_m", "pos_se"), ("vel_rmse_mps", "vel_se")] {
            claims.push(ordered_at_every_step(&tables.main, &["all", "CFwMD", "CFoMD", "random"], 1.0, column, error)?);
        }
        for part in [Part::Position, Part::Velocity] {
            claims.push(beats(paired, "CFwMD", "CFoMD", 1.0, part)?);
        }
        claims.push(beats(paired, "CFoMD", "random", 1.0, Part::Position)?);
        let rate = value(summary, "CFwMD", 1.0, "lbar")?;
        claims.push(
            Claim::near("rate-exact", "without feedback the rate is exactly the budget", rate, 1.0, 0.012)
                .at_defaults(),
        );
        let gain = 1.0 - value(summary, "CFwMD", 1.0, "pos_armse_m")? / value(summary, "CFoMD", 1.0, "pos_armse_m")?;
        claims.push(
            Claim::near("gain", "hearing silence lowers the position RMSE by a tenth", gain, 0.105, 0.025)
                .at_defaults(),
        );
        Ok(claims)
    }
}

/// Six ways to hear silence without feedback.
pub(super) struct NoFeedbackFigure;

impl Case for NoFeedbackFigure {
    type Setting = Setting;

    fn about() -> About {
        About {
            id: "cfwmd-nofeedback",
            title: "What silence is worth without feedback, and what the printed likelihood is",
            caption: "Exact filter (measurements imputed), joint Gaussian belief, a heuristic that scatters the sensors' estimates about the fusion centre's, the filter that ignores silence, the printed likelihood (identical with it to the last bit), and the paper's law of the sensors' estimates with its mean corrected, which does harm because it forgets the data.",
            source: "",
        }
    }

    fn setting() -> Setting {
        Setting {
            trials: 4000,
            particles: 500,
            ..Setting::scalar(2, vec![1.0])
        }
    }

    fn quicken(setting: &mut Setting) {
        setting.quicken();
    }

    fn simulate(setting: &Setting, context: &Context<'_>) -> Result<Vec<Ensemble>, Error> {
        let schemes = [
            ("exact", Scheme::NoFeedback(Method::Imputed(setting.particles as usize))),
            ("joint Gaussian", Scheme::NoFeedback(Method::Joint)),
            ("heuristic", Scheme::Centred),
            ("ignored", Scheme::NoFeedback(Method::Ignored)),
            ("as printed", Scheme::NoFeedback(Method::Printed)),
            ("no history", Scheme::Unconditional),
        ];
        let messages = setting.messages.iter();
        messages
            .map(|l| run::<1>(context, setting, *l, &schemes))
            .collect::<Result<Vec<_>, _>>()
            .map(|e| e.concat())
    }

    fn exact() -> &'static [&'static str] {
        &["printed-is-deaf"]
    }

    fn pairs() -> Vec<(&'static str, &'static str)> {
        vec![
            ("exact", "joint Gaussian"),
            ("joint Gaussian", "ignored"),
            ("exact", "ignored"),
            ("heuristic", "ignored"),
            ("ignored", "no history"),
            ("as printed", "ignored"),
            ("joint Gaussian", "heuristic"),
        ]
    }

    fn claims(_: &Setting, tables: &Tables) -> Result<Vec<Claim>, Error> {
        let (summary, paired) = (tables.named("summary")?, tables.named("paired")?);
        let mut claims = Vec::new();
        for (scheme, reference) in [
            ("ignored", "fig3/CFoMD"),
            ("ignored", "fig3/CFoMD_1500"),
            ("exact", "fig3/RBPF500_1500"),
            ("joint Gaussian", "fig3/ADFaug_1500"),
            ("heuristic", "fig3/heur_centred"),
            ("no history", "fig3/uncond"),
        ] {
            claims.extend(agrees(summary, scheme, 1.0, reference, 0.0, 0.01)?);
        }
        for (first, second) in [
            ("exact", "ignored"),
            ("joint Gaussian", "ignored"),
            ("heuristic", "ignored"),
            ("ignored", "no history"),
            ("joint Gaussian", "heuristic"),
        ] {
            claims.push(beats(paired, first, second, 1.0, Part::Position)?);
        }
        let literal = paired.only("first", "as printed")?;
        let same = first(literal.numbers("pos_mse_difference_m2")?)?.abs() + first(literal.numbers("pos_se")?)?;
        claims.push(Claim::near(
            "printed-is-deaf",
            "the printed likelihood gives the filter that ignores silence, exactly",
            same,
            0.0,
            0.0,
        ));
        let gaussian = paired.only("first", "exact")?.only("second", "joint Gaussian")?;
        let difference = first(gaussian.numbers("pos_mse_difference_m2")?)?;
        claims.push(
            Claim::near(
                "joint-is-exact",
                "the joint Gaussian belief is as good as the exact filter (difference in squared error, m^2)",
                difference,
                0.0,
                0.01,
            )
            .at_defaults(),
        );
        Ok(claims)
    }

    fn plot(tables: &Tables) -> Result<Plot, Error> {
        let summary = tables.named("summary")?;
        let names = summary.texts("scheme")?;
        let bars = summary.numbers("pos_armse_m")?;
        let errors = summary.numbers("pos_se")?;
        let points: Vec<(f64, f64)> = bars.iter().enumerate().map(|(i, v)| (i as f64, *v)).collect();
        let axis = Axis::linear("").named(names.into_iter().enumerate().map(|(i, n)| (i as f64, n)));
        Ok(Plot::of(
            Panel::new(
                "Position error without feedback",
                axis,
                Axis::linear("time-averaged RMSE (m)").between(0.8, 1.3),
            )
            .with(Layer::points("", points).with_errors(errors))
            .legend(Legend::Hidden),
        ))
    }
}
