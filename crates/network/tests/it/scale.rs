//! Memory of a large network, and what arrives in it.

use fewbits_core::BitString;
use fewbits_monte_carlo::Stream;
use fewbits_network::{Context, Error, Field, Frame, Instant, Kind, Protocol, Radio, SensorId, Setup, Simulator};
use fewbits_topology::Deployment;

const NODES: usize = 100_000;
const SLOTS: u32 = 2;
/// A tenth of a second.
const SLOT: u64 = 100_000_000;

/// Every node sends one bit towards node 0 in each slot, and counts what it receives.
struct Collect {
    parents: Vec<u32>,
}

impl Protocol for Collect {
    type Node = u32;

    fn on_timer(&self, _: &mut u32, air: &mut Context<'_>, token: u32) -> Result<(), Error> {
        let (parent, bit) = (self.parents[air.id().index()], BitString::from_bytes(vec![0x80], 1)?);
        air.send(SensorId(parent), &Frame::new(Kind::Report, u64::from(token).into(), 0, (&bit).into()))?;
        if token < SLOTS {
            air.at(Instant(air.now().0 + SLOT), token + 1);
        }
        Ok(())
    }

    fn on_frame(&self, node: &mut u32, _: &mut Context<'_>, _: SensorId, _: &Frame<'_>) -> Result<(), Error> {
        *node += 1;
        Ok(())
    }

    fn on_restart(&self, _: &mut u32, _: &mut Context<'_>) -> Result<(), Error> {
        Ok(())
    }
}

/// At 1073 bytes a node a million nodes fit into 1 GiB.
#[test]
fn a_hundred_thousand_nodes_take_a_kilobyte_each() {
    // Ten nodes in range on average: 10 / (pi 10^2) to the square metre.
    let side = (NODES as f64 * 10.0 * std::f64::consts::PI).sqrt();
    let deployment = Deployment::uniform(&mut Stream::new(1).rng(), [0.0; 2], [side; 2], NODES).unwrap();
    let field = Field::new(&deployment, 10.0).unwrap();
    let routes = field.graph().hops_from(0).unwrap();
    let parents = (0..NODES).map(|node| routes.parent(node).map_or(u32::MAX, |parent| parent as u32));
    let (protocol, connected) = (
        Collect {
            parents: parents.collect(),
        },
        routes.reached().to_vec(),
    );
    let setup = Setup::new(Radio::cc2420(0.0).unwrap(), Stream::new(2));
    let mut network = Simulator::new(protocol, vec![0; NODES], field, setup).unwrap();
    for node in connected.iter().skip(1) {
        // Spread over the slot.
        let phase = u64::from(*node).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 38;
        network.start(SensorId(*node), Instant(phase), 1).unwrap();
    }
    let events = network.run_until(Instant(SLOT * u64::from(SLOTS + 2))).unwrap();
    let sent = u64::from(SLOTS) * (connected.len() as u64 - 1);
    let received: u64 = network.nodes().iter().map(|received| u64::from(*received)).sum();
    assert_eq!((received, network.ledger().messages().air.0), (sent, 201 * sent));
    // A timer and an arrival, and frames that wait for free air.
    assert!((2 * sent..=3 * sent).contains(&events), "{events} events for {sent} frames");
    assert!(network.memory() <= 1073 * NODES, "{} bytes", network.memory());
}
