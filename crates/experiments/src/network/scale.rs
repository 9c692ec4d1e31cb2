//! Time and memory of the runner against the number of nodes.

use crate::prelude::*;
use fewbits_core::BitString;
use fewbits_network::{
    Context as Air, Field, Frame, Instant, Kind, Protocol, Radio, Seconds, SensorId, Setup, Simulator,
};
use fewbits_topology::Deployment;

parameters! {
    pub struct Parameters {
        /// Nodes, on average ten in range of each.
        nodes: Vec<u64> [2..=10_000_000; 1..] = vec![1_000, 10_000, 100_000, 1_000_000] => quick vec![1_000, 10_000],
        /// Slots; in each every node sends one bit towards node 0.
        slots: u64 [1..=10_000] = 2,
    }
}

rows! {
    pub struct Row {
        /// Nodes.
        nodes: u64,
        /// Nodes that reach node 0.
        connected: u64,
        /// Events handled: timers, arrivals, and frames that had to wait for free air.
        events: u64,
        /// Bits that arrived.
        received: u64 ["bit"],
        /// Bits on air.
        air: u64 ["bit"],
        /// Memory of the network after the run.
        bytes: u64 ["byte"],
        /// The same for each node.
        bytes_per_node: f64 ["byte"],
    }

    /// Times of one size.
    pub struct Time {
        /// Nodes.
        nodes: u64,
        /// Time to lay out the network.
        layout: f64 ["s"],
        /// Time of an event.
        event: f64 ["us"],
    }

    /// What was counted, and what was timed.
    pub struct Rows {
        /// Counts.
        sizes: Vec<Row>,
        /// Times on this machine.
        times: Vec<Time> ["time"],
    }
}

/// The runner's own costs.
pub struct Scale;

/// Every node sends one bit towards node 0 in each slot.
struct Collect {
    parents: Vec<u32>,
    slots: u64,
}

/// A tenth of a second.
const SLOT: u64 = 100_000_000;

impl Protocol for Collect {
    /// Bits received.
    type Node = u32;

    fn on_timer(&self, _: &mut u32, air: &mut Air<'_>, token: u32) -> Result<(), fewbits_network::Error> {
        let parent = self.parents[air.id().index()];
        let bit = BitString::from_bytes(vec![0x80], 1)?;
        air.send(SensorId(parent), &Frame::new(Kind::Report, u64::from(token).into(), 0, (&bit).into()))?;
        if u64::from(token) < self.slots {
            air.at(Instant(air.now().0 + SLOT), token + 1);
        }
        Ok(())
    }

    fn on_frame(
        &self,
        node: &mut u32,
        _: &mut Air<'_>,
        _: SensorId,
        _: &Frame<'_>,
    ) -> Result<(), fewbits_network::Error> {
        *node += 1;
        Ok(())
    }

    fn on_restart(&self, _: &mut u32, _: &mut Air<'_>) -> Result<(), fewbits_network::Error> {
        Ok(())
    }
}

fn measure(context: &Context<'_>, nodes: u64, slots: u64) -> Result<(Row, Time), Error> {
    let started = std::time::Instant::now();
    let stream = context.stream("network-scale").indexed(nodes);
    // Ten nodes in range on average: 10 / (pi 10^2) to the square metre.
    let side = (nodes as f64 * 10.0 * std::f64::consts::PI).sqrt();
    let deployment = Deployment::uniform(&mut stream.named("field").rng(), [0.0; 2], [side; 2], nodes as usize);
    let field = Field::new(&deployment?, 10.0)?;
    let routes = field.graph().hops_from(0)?;
    let parents = (0..nodes as usize)
        .map(|node| routes.parent(node).map_or(u32::MAX, |parent| parent as u32))
        .collect();
    let connected: Vec<u32> = routes.reached().to_vec();
    let layout = started.elapsed().as_secs_f64();
    let protocol = Collect { parents, slots };
    let setup = Setup::new(Radio::cc2420(0.0)?, stream);
    let mut network = Simulator::new(protocol, vec![0; nodes as usize], field, setup)?;
    for node in connected.iter().skip(1) {
        // Spread over the slot.
        let phase = u64::from(*node).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 38;
        network.start(SensorId(*node), Instant(phase), 1)?;
    }
    let started = std::time::Instant::now();
    let end = Instant::default().after(Seconds::new(0.1 * (slots + 2) as f64)?);
    let events = network.run_until(end)?;
    let event = started.elapsed().as_secs_f64() * 1e6 / events.max(1) as f64;
    let bytes = network.memory() as u64;
    let row = Row {
        nodes,
        connected: connected.len() as u64,
        events,
        received: network.nodes().iter().map(|received| u64::from(*received)).sum(),
        air: network.ledger().messages().air.0,
        bytes,
        bytes_per_node: bytes as f64 / nodes as f64,
    };
    Ok((row, Time { nodes, layout, event }))
}

impl Figure for Scale {
    figure!(Parameters => Rows, "network-scale", "A million nodes", "our own measurement",
        "Memory of the simulated network and time of an event against the number of nodes, each of which sends a bit \
         towards a root in every slot. Memory is linear; an event costs a little more where the queue leaves the cache.");

    fn cost(&self, p: &Parameters) -> Cost {
        let nodes: u64 = p.nodes.iter().sum();
        Cost::new(1e-5 * (nodes * p.slots) as f64, 1e3 * p.nodes.iter().max().copied().unwrap_or(0) as f64)
    }

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        let mut rows = Rows {
            sizes: Vec::new(),
            times: Vec::new(),
        };
        for nodes in &p.nodes {
            context.check()?;
            let (size, time) = measure(context, *nodes, p.slots)?;
            rows.sizes.push(size);
            rows.times.push(time);
        }
        Ok(rows)
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let gibibyte = (1_u64 << 30) as f64 / 1e6;
        let what = "a million nodes fit into 1 GiB: 1073 bytes a node, from 10^4 nodes on";
        claims.all("memory", what, &rows.sizes, |r| r.nodes < 10_000 || r.bytes_per_node <= gibibyte);
        let what = "every node that reaches the root sends and is received in every slot";
        claims.all("events", what, &rows.sizes, |r| {
            let sent = p.slots * (r.connected - 1);
            r.received == sent && (2 * sent..=3 * sent).contains(&r.events)
        });
        claims.all("air", "each time 201 bits", &rows.sizes, |r| r.air == 201 * p.slots * (r.connected - 1));
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let nodes = || Axis::log("nodes");
        let memory = points(&rows.sizes, |r| (r.nodes as f64, r.bytes as f64 / 1e6));
        let limit = points(&rows.sizes, |r| (r.nodes as f64, 1_073.741_824));
        let times = points(&rows.times, |r| (r.nodes as f64, r.event));
        Plot::grid(
            2,
            vec![
                Panel::new("memory", nodes(), Axis::log("MB"))
                    .with(Layer::line("network", memory))
                    .with(Layer::dashed("1 GiB", limit)),
                Panel::new("time", nodes(), Axis::linear("µs an event")).with(Layer::line("event", times)),
            ],
        )
    }
}
