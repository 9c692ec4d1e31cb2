//! Figures 1 and 2: one search, event by event and on the map.

use super::common::{A, ALARM, CHAINS, Network, Scheme, Settings};
use crate::prelude::*;
use fewbits_densities::ellipse;
use fewbits_diffusive::{Outcome, SelectionRule};

parameters! {
    pub struct Parameters {
        deployment: u64 [..=1_000_000] = 0 => "Number of the random deployment.",
        nodes: usize [2..=100_000] = 300 => "Deployed nodes.",
        range: f64 [1.0..=1000.0] = 15.0 => "Radio range, m.",
    }
}

impl Parameters {
    fn stream(&self, context: &Context<'_>) -> Stream {
        context.stream(CHAINS).indexed(self.deployment)
    }

    fn search(&self, scheme: &Scheme, context: &Context<'_>) -> Result<Outcome, Error> {
        let settings = Settings {
            nodes: self.nodes,
            ..Settings::default()
        };
        scheme.run(&settings, self.stream(context))
    }
}

rows! {
    pub struct TraceRow {
        step: usize as x("nodes") => "Nodes that have sampled, this one included.",
        node: usize => "The node.",
        /// The belief is received; the node samples; the belief is updated and its determinant tested; the next node is selected and the
        /// belief sent on, or the search stops.
        event: &'static str,
        bytes: f64 ["bytes"] as points("sent and received") in messages => "Bytes that travel.",
        log10_determinant: Option<f64> as points("after each node") in test => "Decimal logarithm of the determinant, where it is tested.",
    }
}

pub struct Trace;

impl Figure for Trace {
    figure!(Parameters => Vec<TraceRow>, "diffusive-fig1", "One search, event by event", "Zhao and Nehorai 2007, Fig. 1",
        "The paper's flow chart as what happens in one search of example B's kind: receive, sample, update, test, \
         select, send. A mixture of four Gaussians over position and rate travels.";
        { test: linear("lg det of the covariance / m^4", "Test"), messages: semilog("bytes of a message", "Messages") });

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<TraceRow>, Error> {
        let scheme = Scheme {
            rule: SelectionRule::MutualInformation,
            ..Scheme::new("gmm-4", A, p.range)
        };
        let outcome = p.search(&scheme, context)?;
        let mut rows = Vec::new();
        for (i, step) in outcome.steps.iter().enumerate() {
            let mut push = |event, bytes, log10_determinant| {
                rows.push(TraceRow {
                    step: i + 1,
                    node: step.node,
                    event,
                    bytes,
                    log10_determinant,
                });
            };
            if i > 0 {
                push("receive", step.bits as f64 / 8.0, None);
            }
            push("sample", 0.0, None);
            push("update", 0.0, None);
            push("test", 0.0, Some(step.log10_determinant));
            match outcome.steps.get(i + 1) {
                Some(next) => {
                    push("select", 0.0, None);
                    push("send", next.bits as f64 / 8.0, None);
                }
                None => push("stop", 0.0, None),
            }
        }
        Ok(rows)
    }

    fn claims(&self, _: &Parameters, rows: &Vec<TraceRow>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let count = |event| rows.iter().filter(|r| r.event == event).count();
        let balance = count("send") as f64 - count("receive") as f64;
        claims.near("delivered", "what is sent is received", balance, 0.0, 0.0);
        claims.near("one-end", "the search ends once", count("stop") as f64, 1.0, 0.0);
        let last = rows.iter().filter_map(|r| r.log10_determinant).next_back();
        here.below("sharp", "the last determinant is below the threshold", last, A.threshold.log10());
    }
}

rows! {
    pub struct RouteRows {
        route: Vec<RouteRow> => "The nodes visited.",
        field: Vec<Place> => "All deployed nodes.",
    }

    struct RouteRow {
        deployment: u64 => "Number of the random deployment.",
        step: usize => "Nodes that have sampled, this one included.",
        node: usize => "The node.",
        x: f64 ["m"] => "Its position.",
        y: f64 ["m"] => "Its position.",
        hop: usize => "Hops from the node before.",
        estimate_x: f64 ["m"] => "Estimate of the source.",
        estimate_y: f64 ["m"] => "Estimate of the source.",
        variance_x: f64 ["m^2"] => "Variance of x.",
        covariance_xy: f64 ["m^2"] => "Covariance of x and y.",
        variance_y: f64 ["m^2"] => "Variance of y.",
    }

    struct Place {
        x: f64 ["m"] => "Position.",
        y: f64 ["m"] => "Position.",
    }
}

pub struct Route;

impl Figure for Route {
    figure!(Parameters => RouteRows, "diffusive-fig2", "The route of one search", "Zhao and Nehorai 2007, Fig. 2",
        "Nodes visited in one random deployment, example A, with 90 per cent ellipses of the belief after each \
         node. The belief is exact; the next node is the one nearest to the estimate in Mahalanobis distance.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<RouteRows, Error> {
        let outcome = p.search(&Scheme::new("exact", A, p.range), context)?;
        let network = Network::draw(p.stream(context), p.nodes, p.range)?;
        let positions = network.deployment.positions();
        let route = outcome.steps.iter().enumerate().map(|(i, step)| {
            let c = step.estimate.covariance();
            RouteRow {
                deployment: p.deployment,
                step: i + 1,
                node: step.node,
                x: positions[step.node].x,
                y: positions[step.node].y,
                hop: step.hops,
                estimate_x: step.estimate.mean().x,
                estimate_y: step.estimate.mean().y,
                variance_x: c[(0, 0)],
                covariance_xy: c[(0, 1)],
                variance_y: c[(1, 1)],
            }
        });
        Ok(RouteRows {
            route: route.collect(),
            field: positions.iter().map(|place| Place { x: place.x, y: place.y }).collect(),
        })
    }

    fn claims(&self, p: &Parameters, rows: &RouteRows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let last = rows.route.last();
        let end = last.map(|r| (r.x - A.source[0]).hypot(r.y - A.source[1]));
        here.at_most("ends-near", "the route ends within 15 m of the source", end, 15.0);
        let error = last.map(|r| (r.estimate_x - A.source[0]).hypot(r.estimate_y - A.source[1]));
        here.at_most("estimate", "the estimate is within 0.2 m of the source", error, 0.2);
        let first = rows.route.first().map(|r| (r.x - ALARM[0]).hypot(r.y - ALARM[1]));
        claims.near("starts", "the route starts at the alarm node", first, 0.0, 1e-9);
        claims.all("in-range", "no hop is longer than the range", rows.route.windows(2), |pair| {
            (pair[0].x - pair[1].x).hypot(pair[0].y - pair[1].y) <= p.range * pair[1].hop as f64 + 1e-9
        });
    }

    fn plot(&self, _: &Parameters, rows: &RouteRows) -> Plot {
        let axis = |label: &str| Axis::linear(label).between(0.0, 100.0);
        let mut panel = Panel::new("Route and belief", axis("x / m"), axis("y / m"));
        panel = panel
            .with(Layer::points("deployed", rows.field.iter().map(|p| (p.x, p.y)).collect()).styled(7, Marker::Circle));
        for r in &rows.route {
            let covariance = Matrix2::new(r.variance_x, r.covariance_xy, r.covariance_xy, r.variance_y);
            let belief = Gaussian::new(Vector2::new(r.estimate_x, r.estimate_y), covariance);
            if let Ok(Ok(outline)) = belief.map(|b| ellipse(&b, 0.9, 90)) {
                let mut closed: Vec<(f64, f64)> = outline.iter().map(|p| (p[0], p[1])).collect();
                closed.extend(closed.first().copied());
                let label = if r.step == 1 { "90 % of the belief" } else { "" };
                panel = panel.with(Layer::dashed(label, closed).coloured(1));
            }
        }
        let route: Vec<_> = rows.route.iter().map(|r| (r.x, r.y)).collect();
        panel = panel
            .with(Layer::line("", route.clone()).coloured(0))
            .with(Layer::points("visited", route).styled(0, Marker::Square))
            .with(Layer::points("source", vec![A.source.into()]).styled(3, Marker::Triangle));
        Plot::of(panel)
    }
}
