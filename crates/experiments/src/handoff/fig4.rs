//! Figure 4: the field, the target's way, the leaders.

use super::world::{STAND_OFF, World};
use crate::prelude::*;

parameters! {
    pub struct Parameters {
        sensors: usize [5..=10_000] = 25 => "Sensors in the field.",
        steps: usize [2..=1000] = 10 => "Steps.",
    }
}

rows! {
    pub struct Rows {
        track: Vec<Step> => "The target and who leads.",
        sensors: Vec<Sensor> => "The sensors.",
    }

    struct Step {
        t: usize => "Time.",
        x: f64 ["r0"] => "Position of the target.",
        y: f64 ["r0"] => "Position of the target.",
        leader: Option<usize> => "The leader; nobody leads at time 0.",
        leader_x: Option<f64> ["r0"] => "Its position.",
        leader_y: Option<f64> ["r0"] => "Its position.",
        distance: Option<f64> ["r0"] => "Its distance from the target.",
    }

    struct Sensor {
        sensor: usize => "Number.",
        x: f64 ["r0"] => "Position.",
        y: f64 ["r0"] => "Position.",
    }
}

pub struct Fig4;

impl Figure for Fig4 {
    figure!(Parameters => Rows, "handoff-fig4", "The field, the target and its leaders", "compressed particle filter, Section 6, Figure 4",
        "One world: the target steps to the right, turning up to 45 degrees; at every step the nearest sensor that did \
         not just lead, and is not too near, measures and takes over the belief.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let world = World::draw(&mut context.stream("handoff-fig4").rng(), p.sensors, p.steps, 0.05)?;
        let step = |t: usize| {
            let position = world.track[t];
            let leader = t.checked_sub(1).map(|k| world.leaders[k]);
            let at = leader.map(|i| world.sensors[i]);
            Step {
                t,
                x: position[0],
                y: position[1],
                leader,
                leader_x: at.map(|s| s[0]),
                leader_y: at.map(|s| s[1]),
                distance: at.map(|s| (s - position).norm()),
            }
        };
        let sensors = world.sensors.iter().map(|s| (s[0], s[1])).enumerate();
        Ok(Rows {
            track: (0..=p.steps).map(step).collect(),
            sensors: sensors.map(|(sensor, (x, y))| Sensor { sensor, x, y }).collect(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        claims.all("changes", "the leader changes at every step", rows.track[1..].windows(2), |w| {
            w[0].leader != w[1].leader
        });
        let what = "no leader is nearer than 0.7 steps";
        claims.all("stand-off", what, rows.track.iter().filter_map(|s| s.distance), |d| d >= STAND_OFF);
        let what = "every step goes forward by 0.7 to 1.1 lengths";
        claims.all("forward", what, rows.track.windows(2), |w| (0.7..=1.1).contains(&(w[1].x - w[0].x)));
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let track = points(&rows.track, |s| (s.x, s.y));
        let led = || rows.track.iter().filter_map(|s| Some((s, s.leader_x?, s.leader_y?)));
        let leads = led().map(|(_, x, y)| (x, y)).collect();
        let names = led().map(|(s, x, y)| (x, y + 0.35, s.t.to_string())).collect();
        let panel = Panel::linear("One world", "x / r0", "y / r0")
            .with(Layer::points("sensors", points(&rows.sensors, |s| (s.x, s.y))).styled(3, Marker::Cross))
            .with_all(led().map(|(s, x, y)| Layer::dashed("", vec![(s.x, s.y), (x, y)]).coloured(2)))
            .with(Layer::line("target", track.clone()).coloured(0))
            .with(Layer::points("", track).coloured(0))
            .with(Layer::points("leaders, with their times", leads).styled(1, Marker::Square))
            .with(Layer::texts(names));
        Plot::of(panel)
    }
}
