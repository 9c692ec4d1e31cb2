//! The nonlinear example, sensors of received power: figures 7 to 10, table III.

use super::case::Simulated;
use super::nonlinear::{Plane, Scheme};
use super::pictures::BOTH;
use super::rates::{Rates, as_printed, misses};
use super::rows::{Part, Step, Summary};
use super::setting::{Field, Setting};
use super::world::World;
use crate::prelude::*;

const FOUR: [(&str, Scheme); 4] = [
    ("all", Scheme::All),
    ("random", Scheme::Random),
    ("CFoMD", Scheme::Ignored),
    ("CFwMD", Scheme::State),
];
const FUSED: [(&str, Scheme); 2] = [("CFwMD", Scheme::State), ("CFwMD2", Scheme::StateAndCovariance)];

pub(crate) struct Fig7;

parameters! {
    pub(crate) struct Shown {
        trial: u64 [..=1_000_000] = 1 => "Index of the trial whose truth is drawn.",
    }
}

rows! {
    pub(crate) struct Map {
        path: Vec<Place> => "The target.",
        sensors: Vec<Place> => "The sensors.",
    }

    struct Place {
        k: usize => "Time step, or index of the sensor.",
        x: f64 ["m"] => "Position.",
        y: f64 ["m"] => "Position.",
    }
}

impl Figure for Fig7 {
    figure!(Shown => Map, "cfwmd-fig7", "Sensors and target", "CFwMD paper, figure 7",
        "Nine sensors of received power on a grid, and one trajectory. The target starts beside a corner sensor and leaves the \
         grid after about ten steps.");

    fn run(&self, shown: &Shown, context: &Context<'_>) -> Result<Map, Error> {
        let world = Plane::new(&Field::default(), 2.0)?;
        let draws = world.draw(context.stream("cfwmd-nonlinear").indexed(shown.trial));
        let states = std::iter::once(world.start.mean()).chain(&draws.truth).enumerate();
        let sensors = world.sensors.iter().map(|s| s.position()).enumerate();
        Ok(Map {
            path: states.map(|(k, s)| Place { k, x: s[0], y: s[2] }).collect(),
            sensors: sensors.map(|(k, s)| Place { k, x: s[0], y: s[1] }).collect(),
        })
    }

    fn claims(&self, _: &Shown, map: &Map, claims: &mut Claims) {
        let here = claims.at_defaults();
        let reach = |place: Option<&Place>| place.map(|p| p.x.abs().max(p.y.abs()));
        let grid = map.sensors.iter().filter_map(|s| reach(Some(s))).fold(0.0, f64::max);
        let what = "the target starts among the sensors (farthest coordinate, m)";
        here.below("starts-inside", what, reach(map.path.first()), grid);
        here.above("ends-outside", "and ends outside the grid (farthest coordinate, m)", reach(map.path.last()), grid);
    }

    fn plot(&self, _: &Shown, map: &Map) -> Plot {
        let places = |places: &[Place]| points(places, |p| (p.x, p.y));
        Plot::of(
            Panel::linear("Sensors and target", "x / m", "y / m")
                .with(Layer::line("target", places(&map.path)).coloured(0))
                .with(Layer::points("each step", places(&map.path[1..])).coloured(0))
                .with(Layer::points("start", places(&map.path[..1])).styled(2, Marker::Square))
                .with(Layer::points("sensors", places(&map.sensors)).styled(1, Marker::Triangle)),
        )
    }
}

pub(crate) static FIG8: Simulated<Field, Step> = Simulated {
    about: About::of("cfwmd-fig8", "Received power, two messages a step", "CFwMD paper, figure 8"),
    caption: "Time-averaged, the order is that of the linear case. Not at every step: at first the truth sits exactly \
              on the prior mean, so that a filter that receives little is right by construction. Errors rise when the \
              target leaves the grid. 5000 particles, where the publication has 10000.",
    pairs: &[("all", "CFwMD"), ("CFwMD", "CFoMD"), ("CFoMD", "random")],
    setting: || Field {
        particles: 5000,
        ..Field::default()
    },
    simulate: |setting, context| setting.at_budgets(context, "", &FOUR),
    claims: |rows, claims| {
        rows.beat(claims, &[("all", "CFwMD"), ("CFwMD", "CFoMD")], ("", 2.0), &[Part::Position]);
        let what = "CFoMD has the smaller time-averaged position error than random (ratio)";
        claims.below("CFoMD-beats-random", what, rows.ratio("CFoMD", "random", 2.0), 1.0);
        let error = |scheme, k| Some(rows.step(scheme, 2.0, k)?.position_rmse.value);
        let first = over(error("all", 1), error("random", 1));
        let what = "in the first step sending everything is worse than random: the truth starts on the prior mean (ratio) (erratum cfwmd-10)";
        claims.above("start-on-the-mean", what, first, 1.0);
        for scheme in ["CFwMD", "all"] {
            let growth = over(error(scheme, 20), error(scheme, 10));
            let what = format!("the error of {scheme} grows after step 10: the target leaves the grid (ratio)");
            claims.above(format!("leaves-{scheme}"), what, growth, 1.0);
        }
        let saved = rows.at("CFwMD", 2.0).map(|r| 1.0 - r.rate.value / 9.0);
        let what = "CFwMD saves 83% of the messages, more than the nominal 78% (erratum cfwmd-14)";
        claims.near("saving", what, saved, 0.831, 0.012);
    },
    ..Simulated::BASE
};

pub(crate) static FIG9: Simulated<Field, Summary> = Simulated {
    about: About::of("cfwmd-fig9", "Received power against the budget", "CFwMD paper, figure 9"),
    caption: "Using silence is worth most where little is sent. Censoring with silence ignored beats random selection \
              only up to two messages a step; from four on it does not, in velocity clearly, contrary to the paper. 2500 particles, where the publication has 10000.",
    pairs: &[("CFwMD", "CFoMD"), ("CFwMD", "random"), ("random", "CFoMD")],
    setting: || Field {
        particles: 2500,
        messages: (1..=9).map(f64::from).collect(),
        ..Field::default()
    },
    simulate: |setting, context| {
        let mut all = setting.at_budgets(context, "", &FOUR[1..])?;
        all.extend(setting.run(context, ("", 9.0), &FOUR[..1])?);
        Ok(all)
    },
    claims: |rows, claims| {
        for l in [1.0, 2.0, 3.0, 4.0, 5.0, 6.0] {
            for other in ["CFoMD", "random"] {
                let what = format!("CFwMD has the smaller position error than {other} at l = {l} (ratio)");
                claims.below(format!("lowest-{other}-l{l}"), what, rows.ratio("CFwMD", other, l), 1.0);
            }
        }
        for l in [1.0, 2.0] {
            let what = format!("CFoMD beats random at l = {l} (ratio)");
            claims.below(format!("censoring-l{l}"), what, rows.ratio("CFoMD", "random", l), 1.0);
        }
        for l in [4.0, 5.0, 6.0] {
            rows.beat(&claims.showing("cfwmd-9"), &[("random", "CFoMD")], ("", l), &[Part::Velocity]);
        }
        let error = |scheme, l| Some(rows.at(scheme, l)?.position_rmse.value);
        let gap = minus(error("CFoMD", 1.0), error("CFwMD", 1.0));
        claims.above("gap-at-small-budgets", "the gap between CFwMD and CFoMD at l = 1 (m)", gap, 0.5);
        for scheme in ["random", "CFoMD", "CFwMD"] {
            let what = format!("at l = 9 {scheme} sends everything (ratio of errors; erratum cfwmd-13)");
            claims.near(format!("merge-{scheme}"), what, rows.ratio(scheme, "all", 9.0), 1.0, 0.03);
        }
    },
    ..Simulated::BASE
};

const THREE: [f64; 3] = [2.0, 4.0, 6.0];
/// Where the first budget runs again, to see a small gain.
const MANY: &str = "20 times the trials, a fifth of the particles";

pub(crate) static FIG10: Simulated<Field, Step> = Simulated {
    about: About::of("cfwmd-fig10", "Received power, state against covariance feedback", "CFwMD paper, figure 10"),
    caption: "Feeding the particles' covariance back (CFwMD2) pays at four and six messages per step, more as time \
              goes on. At two it gains a twentieth of the squared position error, which 400 trials do not tell from \
              nothing; 8000 with fewer particles do (table `summary`). The publication has 200 trials of 10000 particles, here \
              are 400 of 2500.",
    pairs: &[("CFwMD2", "CFwMD")],
    setting: || Field {
        trials: 400,
        particles: 2500,
        messages: THREE.into(),
        ..Field::default()
    },
    simulate: |setting, context| {
        let mut all = setting.at_budgets(context, "", &FUSED)?;
        let many = Field {
            trials: 20 * setting.trials,
            particles: (setting.particles / 5).max(2),
            ..setting.clone()
        };
        all.extend(many.run(context, (MANY, setting.messages[0]), &FUSED)?);
        Ok(all)
    },
    shown: |_, run| run.world.is_empty(),
    claims: |rows, claims| {
        for l in [4.0, 6.0] {
            rows.beat(claims, &[("CFwMD2", "CFwMD")], ("", l), &[Part::Position]);
        }
        rows.beat(&claims.showing("cfwmd-12"), &[("CFwMD2", "CFwMD")], (MANY, 2.0), &BOTH);
    },
    ..Simulated::BASE
};

const ON_MEAN: &str = "start on the mean";
const DRAWN: &str = "start drawn from the prior";

pub(crate) static TABLE3: Simulated<Field, Rates> = Simulated {
    about: About::of("cfwmd-table3", "Rates among sensors of received power", "CFwMD paper, table III"),
    caption: "Mean number of messages a step. The grid is not printed; a spacing of 10 m with the truth starting on \
              the prior mean fits best, and leaves the rates at l = 2 about 0.1 below the printed ones, unexplained. \
              2500 particles, where the publication has 10000; drawn starts run 1000.",
    pairs: &[("CFwMD2", "CFwMD")],
    setting: || Field {
        drawn_start: None,
        particles: 2500,
        messages: THREE.into(),
        ..Field::default()
    },
    simulate: |setting, context| {
        let mut all = setting.at_budgets(context, ON_MEAN, &FUSED)?;
        let drawn = Field {
            drawn_start: Some(true),
            particles: setting.particles.min(1000),
            ..setting.clone()
        };
        all.extend(drawn.at_budgets(context, DRAWN, &FUSED)?);
        Ok(all)
    },
    claims: |rows, claims| {
        as_printed(claims, &rows.main, ON_MEAN);
        let [state, covariance] = misses(&rows.main, ON_MEAN, 2.0).map_or([None; 2], |both| both.map(Some));
        for (name, miss) in [("state", state), ("covariance", covariance)] {
            let what = format!(
                "at l = 2 the printed rate with {name} feedback is not reproduced: ours is lower (unexplained)"
            );
            claims.less(format!("unexplained-{name}"), what, miss, 3.0);
        }
        let drawn = rows.at(&format!("CFwMD, {DRAWN}"), 2.0).map(|r| r.rate.value);
        let what = "a start drawn from the prior gives a rate above the printed 1.598 at l = 2 (erratum cfwmd-11)";
        claims.above("drawn-start-rejected", what, drawn, 1.7);
    },
    ..Simulated::BASE
};
