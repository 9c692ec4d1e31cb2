//! Nodes between which a belief travels.

use fewbits_core::BitString;
use fewbits_protocol::{Bearer, Check, Errand, Frame, Kind, Lead, Note, Payload, Schedule, Slot};
use std::num::NonZeroU64;

const PERIOD: u64 = 1000;

fn bearer(address: u32) -> Bearer {
    Bearer::new(address, Schedule::new(NonZeroU64::new(PERIOD).unwrap()), 10, true)
}

fn belief(byte: u8) -> BitString {
    BitString::from_bytes(vec![byte], 8).unwrap()
}

/// Leads in a slot and hands the belief to `next`; returns the frame.
fn led(bearer: &mut Bearer, slot: u64, next: u32, byte: u8) -> ((Slot, u32), Vec<u8>) {
    let mut errands = Vec::new();
    bearer.on_timer(slot * PERIOD, &mut errands);
    assert!(
        matches!(&errands[..], [Errand::Lead { slot: at, .. }] if *at == Slot::of_count(slot)),
        "{errands:?}"
    );
    let lead = Lead {
        message: belief(byte),
        next: Some(next),
        estimate: Vec::new(),
    };
    errands.clear();
    bearer.on_led(slot * PERIOD, lead, &mut errands);
    match errands.pop() {
        Some(Errand::Send {
            destination,
            name,
            frame,
        }) if destination == next => (name, frame),
        other => panic!("{other:?}"),
    }
}

fn arrive(bearer: &mut Bearer, slot: u64, from: u32, frame: &[u8]) -> Vec<Errand> {
    let mut errands = Vec::new();
    let frame = Frame::decode(frame, Check::Whole).unwrap();
    bearer.on_decoded(slot * PERIOD, from, &frame, &mut errands);
    errands
}

#[test]
fn a_belief_goes_round_over_a_relay() {
    let (mut first, mut relay, mut last) = (bearer(0).first(), bearer(1), bearer(2));
    let (name, frame) = led(&mut first, 1, 2, 7);
    // The relay passes the same bytes on, and does not lead.
    let passed = arrive(&mut relay, 1, 0, &frame);
    assert!(matches!(&passed[..], [Errand::Send { destination: 2, frame: bytes, .. }] if *bytes == frame));
    assert_eq!(relay.leads(), None);
    assert_eq!(arrive(&mut last, 1, 1, &frame), [Errand::SetTimer { at: 2 * PERIOD }]);
    first.on_ack(name);
    relay.on_ack(name);
    // A copy is noted, by both.
    for (bearer, from) in [(&mut relay, 0), (&mut last, 1)] {
        let again = arrive(bearer, 1, from, &frame);
        assert!(matches!(
            &again[..],
            [Errand::Note {
                note: Note::Duplicate { .. },
                ..
            }]
        ));
    }
    // An early timer starts nothing.
    let mut errands = Vec::new();
    last.on_timer(2 * PERIOD - 1, &mut errands);
    assert!(errands.is_empty());
    let (_, frame) = led(&mut last, 2, 0, 8);
    assert_eq!(arrive(&mut first, 2, 2, &frame), [Errand::SetTimer { at: 3 * PERIOD }]);
    assert_eq!((first.leads(), last.leads()), (Some(Slot::of_count(3)), None));
}

#[test]
fn who_gives_up_leads_and_says_so() {
    let (mut first, mut second) = (bearer(0).first(), bearer(1));
    let (name, frame) = led(&mut first, 1, 1, 7);
    let mut errands = Vec::new();
    first.on_give_up(PERIOD, name, &mut errands);
    let slot = Slot::of_count(2);
    let expected = [
        Errand::Note {
            with: 1,
            note: Note::Retained { slot },
        },
        Errand::SetTimer { at: 2 * PERIOD },
    ];
    assert_eq!((&errands[..], first.leads()), (&expected[..], Some(slot)));
    // It had arrived: two leaders. Where they meet there is a note, and the belief that is here stays.
    arrive(&mut second, 1, 0, &frame);
    let (_, other) = led(&mut second, 2, 0, 9);
    let met = arrive(&mut first, 2, 1, &other);
    assert!(matches!(
        &met[..],
        [
            Errand::Note {
                note: Note::Disagreement { .. },
                ..
            },
            Errand::SetTimer { .. }
        ]
    ));
    assert_eq!(first.leads(), Some(Slot::of_count(3)));
    // Nothing is pending that was acknowledged or given up.
    errands.clear();
    first.on_give_up(PERIOD, name, &mut errands);
    assert!(errands.is_empty());
}

#[test]
fn a_step_that_fails_is_tried_again_with_the_same_belief() {
    let mut node = bearer(1);
    let (_, frame) = led(&mut bearer(0).first(), 1, 1, 7);
    arrive(&mut node, 1, 0, &frame);
    for slot in 2..=10 {
        let mut errands = Vec::new();
        node.on_timer(slot * PERIOD, &mut errands);
        let message = Some(belief(7));
        let slot = Slot::of_count(slot);
        assert_eq!(errands, [Errand::Lead { slot, message }]);
        node.on_failed(u64::from(slot) * PERIOD, &mut Vec::new());
    }
    // The last slot is over.
    assert_eq!(node.leads(), None);
}

#[test]
fn foreign_frames_are_noted() {
    let mut node = bearer(1);
    let slot = Slot::of_count(3);
    let bits = belief(5);
    for (kind, sum) in [(Kind::Report, 1), (Kind::Handover, 1)] {
        let frame = Frame {
            destination: 1,
            ..Frame::new(kind, slot, sum, Payload::from(&bits))
        };
        let mut errands = Vec::new();
        node.on_decoded(PERIOD, 4, &frame, &mut errands);
        assert!(matches!(errands[..], [Errand::Note { with: 4, .. }]), "{errands:?}");
    }
    assert_eq!(node.leads(), None);
}
