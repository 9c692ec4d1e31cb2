//! What no honest node would send, and arguments that make no sense.

use crate::worlds::{Counted, clock, counted, scalar, setup};
use fewbits_core::{BitString, Link};
use fewbits_monte_carlo::Stream;
use fewbits_network::{
    BitStar, Channel, Check, Clock, Context, Error, Fault, FaultKind, Field, Frame, Instant, Kind, Loss, Note,
    Protocol, Radio, Seconds, SensorId, Setup, Simulator, Walk, on_air,
};
use fewbits_protocol::{BoxError, Feedback, Lead, Leader, Payload};
use fewbits_topology::Deployment;
use nalgebra::Vector2;
use proptest::prelude::*;
use rand::Rng;

const SLOTS: u32 = 8;

fn star(feedback: Feedback) -> Counted {
    counted(Link::PERFECT, feedback, scalar(3, SLOTS as usize, 1))
}

fn forged(kind: usize, slot: u64, digest: u32, payload: &[u8], less: usize) -> BitString {
    let kinds = [
        Kind::Feedback,
        Kind::Report,
        Kind::Echo,
        Kind::Snapshot,
        Kind::Request,
        Kind::Handover,
        Kind::Heartbeat,
        Kind::Acknowledgement,
    ];
    let bits = (payload.len() * 8).saturating_sub(less);
    let payload = BitString::from_bytes(payload.to_vec(), bits).unwrap();
    on_air(&Frame::new(kinds[kind], slot.into(), digest, (&payload).into()), Check::Whole)
}

proptest! {
    /// A stranger sends noise, and frames with good checks and arbitrary content, to everybody.
    #[test]
    fn noise_and_forged_frames_are_counted_and_dropped(
        noise in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..40), 0_u32..4, 0_u32..4, 0.5..9.5_f64), 1..20),
        frames in prop::collection::vec(
            (0_usize..8, 0_u64..12, any::<u32>(), prop::collection::vec(any::<u8>(), 0..40), 0_usize..8, 0_u32..4, 0_u32..4, 0.5..9.5_f64),
            0..20,
        ),
        echoed in any::<bool>(),
    ) {
        let star = star(if echoed { Feedback::Echoed } else { Feedback::Told });
        let mut network = star.simulate(10.0, setup(1)).unwrap();
        let at = |t: f64| Instant::default().after(Seconds::new(t).unwrap());
        let mut bad = 0;
        for (bytes, from, to, t) in noise {
            let bits = BitString::from_bytes(bytes.clone(), bytes.len() * 8).unwrap();
            bad += u64::from(Frame::decode(&bytes, Check::Whole).is_err());
            network.inject(at(t), SensorId(from), SensorId(to), bits).unwrap();
        }
        for (kind, slot, digest, payload, less, from, to, t) in frames {
            let bits = forged(kind, slot, digest, &payload, less);
            network.inject(at(t), SensorId(from), SensorId(to), bits).unwrap();
        }
        network.run_until(clock().end(SLOTS + 2)).unwrap();
        prop_assert!(network.ledger().faults().damaged >= bad);
        let estimates = network.nodes()[0].means();
        prop_assert_eq!(estimates.len(), SLOTS as usize);
        prop_assert!(estimates.iter().flatten().all(|x| x.is_finite()));
    }
}

#[test]
fn truncated_messages_are_counted_and_the_estimate_is_that_without_them() {
    let mut network = star(Feedback::Told).simulate(10.0, setup(1)).unwrap();
    let mut honest = star(Feedback::Told).simulate(10.0, setup(1)).unwrap();
    for bits in 0..80 {
        let cut = BitString::from_bytes(vec![0x20; 10], bits).unwrap();
        network
            .inject(Instant(1_950_000_000), SensorId(1), SensorId(2), cut)
            .unwrap();
    }
    network.run_until(clock().end(SLOTS)).unwrap();
    honest.run_until(clock().end(SLOTS)).unwrap();
    assert_eq!(network.ledger().faults().damaged, 80);
    assert_eq!(network.nodes()[0].estimates(), honest.nodes()[0].estimates());
    assert!(
        network
            .log()
            .notes()
            .all(|(_, node, note)| node == SensorId(2) && is_damage(note))
    );
}

fn is_damage(note: &Note) -> bool {
    use fewbits_protocol::Note::{Damaged, FutureVersion};
    matches!(
        note,
        Note::Frame {
            note: Damaged(_) | FutureVersion { .. },
            ..
        }
    )
}

/// Sends to whomever the timer's token names.
struct Sender;

impl Protocol for Sender {
    type Node = ();

    fn on_timer(&self, (): &mut (), context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        context
            .send(SensorId(token), &Frame::new(Kind::Heartbeat, 1.into(), 0, Payload::EMPTY))
            .map(|_| ())
    }

    fn on_frame(&self, (): &mut (), _: &mut Context<'_>, _: SensorId, _: &Frame<'_>) -> Result<(), Error> {
        Ok(())
    }

    fn on_restart(&self, (): &mut (), _: &mut Context<'_>) -> Result<(), Error> {
        Ok(())
    }
}

/// Never leads anywhere.
struct Nowhere;

impl Leader for Nowhere {
    fn lead(&self, _: &mut dyn Rng, _: u64, _: u32, _: Option<&BitString>) -> Result<Lead, BoxError> {
        Ok(Lead {
            message: BitString::default(),
            next: Some(7),
            estimate: Vec::new(),
        })
    }
}

#[test]
fn what_makes_no_sense_is_refused_by_name() {
    let line = |x: &[f64]| Deployment::given(x.iter().map(|x| Vector2::new(*x, 0.0)).collect()).unwrap();
    let field = || Field::new(&line(&[0.0, 1.0, 9.0]), 2.0).unwrap();
    let run = |token| {
        let mut network = Simulator::new(Sender, vec![(); 3], field(), setup(1)).unwrap();
        network.start(SensorId(0), Instant(0), token).unwrap();
        network.run_until(Instant(1)).map(|_| ())
    };
    assert!(run(1).is_ok());
    assert!(matches!(run(0), Err(Error::SelfLink { node: 0 })));
    assert!(matches!(run(2), Err(Error::OutOfRange { from: 0, to: 2 })));
    assert!(matches!(run(5), Err(Error::UnknownNode { node: 5, nodes: 3 })));
    let mut network = Simulator::new(Sender, vec![(); 3], field(), setup(1)).unwrap();
    let unknown = |result| matches!(result, Err(Error::UnknownNode { node: 3, nodes: 3 }));
    assert!(unknown(network.start(SensorId(3), Instant(0), 0)));
    assert!(unknown(network.inject(Instant(0), SensorId(0), SensorId(3), BitString::default())));
    assert!(matches!(network.start(SensorId(2), Instant(0), 0), Err(Error::Unheard { node: 2, .. })));
    assert!(network.energy(SensorId(3)).is_err() && !network.is_alive(SensorId(3)));
    assert!(matches!(Field::new(&line(&[0.0]), 0.0), Err(Error::Argument(_))));
    assert!(matches!(Simulator::new(Sender, vec![(); 2], field(), setup(1)), Err(Error::Argument(_))));
    let fault = Fault {
        at: Seconds::ZERO,
        node: SensorId(3),
        kind: FaultKind::Death,
    };
    let faulty = Setup {
        faults: vec![fault],
        ..setup(1)
    };
    let faulty = Simulator::new(Sender, vec![(); 3], field(), faulty);
    assert!(matches!(faulty.err(), Some(Error::UnknownNode { node: 3, nodes: 3 })));
    let mut radio = Radio::first_order();
    radio.bit_rate = 0.0;
    assert!(Simulator::new(Sender, vec![(); 3], field(), Setup { radio, ..setup(1) }).is_err());
    let slower = Radio {
        bit_rate: 1e3,
        ..setup(1).radio
    };
    let radios = [(SensorId(1), slower)].into();
    assert!(Simulator::new(Sender, vec![(); 3], field(), Setup { radios, ..setup(1) }).is_err());
    let link_loss = [((SensorId(0), SensorId(2)), Loss::Fixed(0.1))].into();
    let unlinked = Simulator::new(Sender, vec![(); 3], field(), Setup { link_loss, ..setup(1) });
    assert!(matches!(unlinked.err(), Some(Error::OutOfRange { from: 0, to: 2 })));
    let channel = Channel {
        crossover: 0.7,
        ..Channel::PERFECT
    };
    assert!(Simulator::new(Sender, vec![(); 3], field(), Setup { channel, ..setup(1) }).is_err());
    let walk = || Walk::new(Nowhere, clock(), 3, Stream::new(1)).unwrap();
    let lost = walk().simulate(field(), SensorId(0), setup(1)).err();
    assert!(matches!(
        lost,
        Some(Error::Disconnected {
            root: 0,
            reached: 2,
            nodes: 3
        })
    ));
    assert!(
        walk()
            .simulate(Field::star(2, 1.0).unwrap(), SensorId(9), setup(1))
            .is_err()
    );
    let mut nowhere = walk()
        .simulate(Field::star(2, 1.0).unwrap(), SensorId(0), setup(1))
        .unwrap();
    let nowhere = nowhere.run_until(clock().end(3));
    assert!(matches!(nowhere, Err(Error::UnknownNode { node: 7, nodes: 3 })));
    assert!(Walk::new(Nowhere, clock(), 1 << 23, Stream::new(1)).is_err());
    // Two measurements a slot of three sensors.
    let centre = || Ok(crate::bit_star::Counter::default());
    let node = |_| -> Box<dyn fewbits_core::SensorNode<1>> { Box::new(crate::bit_star::Speaker) };
    let length = fewbits_protocol::ReportLength::Fixed(1);
    let star = BitStar::new(centre, Feedback::Told, length, node, scalar(2, 4, 1), clock(), Stream::new(1));
    assert!(matches!(star, Err(Error::Argument(_))));
    assert!(Clock::new(Seconds::ZERO).is_err() && Clock::new(Seconds::new(1e9).unwrap()).is_err());
}
