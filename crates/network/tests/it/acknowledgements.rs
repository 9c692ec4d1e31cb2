//! Acknowledgements take time and air: causality, and attempts, energy and latency against hand calculations for the CC2420.

use crate::books::conserves;
use crate::worlds::setup;
use fewbits_core::BitString;
use fewbits_network::{
    Batching, Channel, Context, Detail, Error, Fault, FaultKind, Field, Frame, Instant, Kind, Loss, Protocol, Seconds,
    SensorId, Setup, Simulator, Ticket,
};

/// Sends one frame with a payload of the given bits per timer; the receiver only counts.
struct Caller {
    payload: usize,
}

/// Times of what happened to a node, in nanoseconds.
#[derive(Debug, Clone, Default, PartialEq)]
struct Diary {
    sent: Vec<Ticket>,
    received: Vec<u64>,
    acknowledged: Vec<(u64, Ticket)>,
    given_up: Vec<(u64, Ticket)>,
}

impl Protocol for Caller {
    type Node = Diary;

    fn on_timer(&self, node: &mut Diary, context: &mut Context<'_>, token: u32) -> Result<(), Error> {
        let payload = BitString::from_bytes(vec![0; self.payload.div_ceil(8)], self.payload)?;
        let ticket = context.send(SensorId(token), &Frame::new(Kind::Report, 1.into(), 0, (&payload).into()))?;
        node.sent.push(ticket);
        Ok(())
    }

    fn on_frame(&self, node: &mut Diary, context: &mut Context<'_>, _: SensorId, _: &Frame<'_>) -> Result<(), Error> {
        node.received.push(context.now().0);
        Ok(())
    }

    fn on_ack(&self, node: &mut Diary, context: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        node.acknowledged.push((context.now().0, ticket));
        Ok(())
    }

    fn on_give_up(&self, node: &mut Diary, context: &mut Context<'_>, ticket: Ticket) -> Result<(), Error> {
        node.given_up.push((context.now().0, ticket));
        Ok(())
    }

    fn on_restart(&self, node: &mut Diary, _: &mut Context<'_>) -> Result<(), Error> {
        node.sent.clear();
        Ok(())
    }
}

/// Node 1 sends to node 0 at each of `times` (nanoseconds).
fn run(payload: usize, times: &[u64], setup: Setup) -> Simulator<Caller> {
    let field = Field::star(1, 10.0).unwrap();
    let mut network = Simulator::new(Caller { payload }, vec![Diary::default(); 2], field, setup).unwrap();
    for at in times {
        network.start(SensorId(1), Instant(*at), 0).unwrap();
    }
    network.run_until(Instant(1_000_000_000_000)).unwrap();
    conserves(network.ledger());
    network
}

fn seconds(s: f64) -> Seconds {
    Seconds::new(s).unwrap()
}

// 0 dBm: 57.42 mW sending, 62 mW receiving and awake, 250 kbit/s. In seconds, watts and joules:
const FRAME: f64 = 201.0 / 250e3;
const ANSWER: f64 = 88.0 / 250e3;
const TURN: f64 = 0.192e-3;
const WAKE: f64 = 62e-3 * 0.244e-3;
const SEND: f64 = 57.42e-3;
const RECEIVE: f64 = 62e-3;
// In nanoseconds: 804 us of frame, then 192 us of turnaround and 352 us of acknowledgement.
const ARRIVAL: u64 = 804_000;
const ANSWERED: u64 = ARRIVAL + 192_000 + 352_000;
/// The sender waits a nanosecond longer than the acknowledgement needs.
const ATTEMPT: u64 = ANSWERED + 1;

/// What a case costs: attempts, acknowledgements, and joules of the sender and of the receiver.
fn costs(network: &Simulator<Caller>) -> (u32, u32, f64, f64) {
    let accounts = network.ledger().accounts();
    let joules = |i: usize| accounts[i].sending.value() + accounts[i].receiving.value();
    (accounts[1].frames, accounts[0].acknowledgements, joules(1), joules(0))
}

fn agree(found: (u32, u32, f64, f64), expected: (u32, u32, f64, f64)) {
    assert_eq!((found.0, found.1), (expected.0, expected.1));
    assert!((found.2 / expected.2 - 1.0).abs() < 1e-12, "sender {} for {}", found.2, expected.2);
    assert!((found.3 / expected.3 - 1.0).abs() < 1e-12, "receiver {} for {}", found.3, expected.3);
}

/// Loss from the sensor to the centre, and back.
fn lossy(there: f64, back: f64, retries: u32) -> Setup {
    let (sensor, centre) = (SensorId(1), SensorId(0));
    Setup {
        retries: Some(retries),
        link_loss: [
            ((sensor, centre), Loss::Fixed(there)),
            ((centre, sensor), Loss::Fixed(back)),
        ]
        .into(),
        ..setup(1)
    }
}

#[test]
fn case_1_clear_air_takes_one_attempt() {
    let network = run(1, &[0], lossy(0.0, 0.0, 3));
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    assert_eq!(centre.received, [ARRIVAL]);
    assert_eq!(sensor.acknowledged, [(ANSWERED, sensor.sent[0])]);
    let sender = WAKE + SEND * FRAME + RECEIVE * (TURN + ANSWER);
    let receiver = WAKE + RECEIVE * (FRAME + TURN) + SEND * ANSWER;
    agree(costs(&network), (1, 1, sender, receiver));
    assert_eq!(network.ledger().messages().air.0, 201 + 88);
}

#[test]
fn case_2_lost_frames_are_repeated_and_given_up() {
    let network = run(1, &[0], lossy(1.0, 0.0, 2));
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    assert_eq!((centre.received.len(), sensor.acknowledged.len()), (0, 0));
    assert_eq!(sensor.given_up, [(3 * ATTEMPT, sensor.sent[0])]);
    // Both stay awake between attempts: one wake-up.
    let sender = WAKE + 3.0 * (SEND * FRAME + RECEIVE * (TURN + ANSWER));
    let receiver = WAKE + 3.0 * RECEIVE * FRAME;
    agree(costs(&network), (3, 0, sender, receiver));
    assert_eq!((network.ledger().messages().messages, network.ledger().messages().payload.0), (1, 1));
    assert_eq!(network.ledger().faults().given_up, 1);
}

#[test]
fn case_3_lost_answers_are_sent_each_time() {
    let network = run(1, &[0], lossy(0.0, 1.0, 1));
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    // Both attempts arrive, and the sender knows of neither.
    assert_eq!(centre.received, [ARRIVAL, ATTEMPT + ARRIVAL]);
    assert_eq!(sensor.given_up, [(2 * ATTEMPT, sensor.sent[0])]);
    let sender = WAKE + 2.0 * (SEND * FRAME + RECEIVE * (TURN + ANSWER));
    let receiver = WAKE + 2.0 * (RECEIVE * (FRAME + TURN) + SEND * ANSWER);
    agree(costs(&network), (2, 2, sender, receiver));
}

#[test]
fn case_4_a_receiver_that_is_back_gets_the_repetition() {
    // The radio of the centre is out for the first attempt and back before the second.
    let outage = Fault {
        at: Seconds::ZERO,
        node: SensorId(0),
        kind: FaultKind::Outage(seconds(1e-3)),
    };
    let network = run(
        1,
        &[0],
        Setup {
            faults: vec![outage],
            ..lossy(0.0, 0.0, 3)
        },
    );
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    assert_eq!(centre.received, [ATTEMPT + ARRIVAL]);
    assert_eq!(sensor.acknowledged, [(ATTEMPT + ANSWERED, sensor.sent[0])]);
    let sender = WAKE + 2.0 * (SEND * FRAME + RECEIVE * (TURN + ANSWER));
    // The receiver wakes up for the second attempt alone.
    let receiver = WAKE + RECEIVE * (FRAME + TURN) + SEND * ANSWER;
    agree(costs(&network), (2, 1, sender, receiver));
}

#[test]
fn case_5_two_messages_wait_for_one_another() {
    let network = run(1, &[0, 100_000], lossy(0.0, 0.0, 0));
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    // The second waits until the answer to the first is over.
    assert_eq!(centre.received, [ARRIVAL, ANSWERED + ARRIVAL]);
    let times: Vec<u64> = sensor.acknowledged.iter().map(|(at, _)| *at).collect();
    assert_eq!(times, [ANSWERED, 2 * ANSWERED]);
    let sender = 2.0 * (WAKE + SEND * FRAME + RECEIVE * (TURN + ANSWER));
    let receiver = 2.0 * (WAKE + RECEIVE * (FRAME + TURN) + SEND * ANSWER);
    agree(costs(&network), (2, 2, sender, receiver));
}

#[test]
fn case_6_a_batch_has_one_answer() {
    let batching = Batching {
        max_frames: 2,
        hold: seconds(1.0),
    };
    let network = run(
        1,
        &[0, 0],
        Setup {
            batching,
            ..lossy(0.0, 0.0, 0)
        },
    );
    let [centre, sensor] = network.nodes() else {
        unreachable!()
    };
    // 120 bits of preamble and header, two frames of 81 bits and their lengths: 314 bits, 1.256 ms.
    let (arrival, answered) = (1_256_000, 1_256_000 + 192_000 + 352_000);
    assert_eq!(centre.received, [arrival, arrival]);
    assert_eq!(sensor.acknowledged, [(answered, sensor.sent[0]), (answered, sensor.sent[1])]);
    let frame = 314.0 / 250e3;
    let sender = WAKE + SEND * frame + RECEIVE * (TURN + ANSWER);
    let receiver = WAKE + RECEIVE * (frame + TURN) + SEND * ANSWER;
    agree(costs(&network), (1, 1, sender, receiver));
}

/// The case of the issue: a delay of 100 s, and what is known at 50 s.
#[test]
fn nothing_is_acknowledged_before_it_arrived() {
    let channel = Channel {
        delay: seconds(100.0),
        ..Channel::PERFECT
    };
    let slow = || Setup {
        channel,
        retries: Some(0),
        ..setup(1)
    };
    let field = Field::star(1, 10.0).unwrap();
    let mut network = Simulator::new(Caller { payload: 1 }, vec![Diary::default(); 2], field, slow()).unwrap();
    network.start(SensorId(1), Instant(0), 0).unwrap();
    network.run_until(Instant(50_000_000_000)).unwrap();
    assert!(network.nodes()[0].received.is_empty() && network.nodes()[1].acknowledged.is_empty());
    network.run_until(Instant(150_000_000_000)).unwrap();
    assert!(!network.nodes()[0].received.is_empty() && network.nodes()[1].acknowledged.is_empty());
    network.run_until(Instant(250_000_000_000)).unwrap();
    assert_eq!(network.nodes()[1].acknowledged[0].0, 200_000_000_000 + ANSWERED);
}

/// The case of the issue: 51 attempts took no time, and six arrived at 832 us.
#[test]
fn attempts_follow_one_another_in_time() {
    let network = run(
        1,
        &[0],
        Setup {
            detail: Detail::Everything,
            ..lossy(1.0, 0.0, 50)
        },
    );
    let at: Vec<u64> = network.log().transmissions().map(|t| t.at.0).collect();
    assert_eq!(at, (0..51).map(|k| k * ATTEMPT).collect::<Vec<_>>());
    assert_eq!(network.nodes()[1].given_up[0].0, 51 * ATTEMPT);
}

/// An acknowledgement of 88 bits at a bit error rate of .001 arrives with 91.6 %, whatever the length of the frame that it answers.
#[test]
fn answers_are_lost_by_their_own_length() {
    let (mut arrived, mut answered) = (0, 0);
    for seed in 0..3000 {
        let setup = Setup {
            channel: Channel::flipping(1e-3).unwrap(),
            retries: Some(0),
            ..setup(seed)
        };
        let field = Field::star(1, 10.0).unwrap();
        let mut network = Simulator::new(Caller { payload: 700 }, vec![Diary::default(); 2], field, setup).unwrap();
        network.start(SensorId(1), Instant(0), 0).unwrap();
        network.run_until(Instant(1_000_000_000)).unwrap();
        arrived += network.nodes()[0].received.len();
        answered += network.nodes()[1].acknowledged.len();
    }
    let near = |count: usize, p: f64, n: f64| (count as f64 - n * p).abs() < 4.0 * (n * p * (1.0 - p)).sqrt();
    assert!(near(arrived, 0.999_f64.powi(780), 3000.0), "{arrived}");
    assert!(near(answered, 0.999_f64.powi(88), arrived as f64), "{answered} of {arrived}");
}

/// Frames at 0, 1 and 2 ms fill a batch; the fourth begins the next one at 2.1 ms, which waits for its own hold time of 2.5 ms.
#[test]
fn a_full_batch_leaves_no_timer_behind() {
    let batching = Batching {
        max_frames: 3,
        hold: seconds(0.0025),
    };
    let ms = |k: u64| k * 100_000;
    let times = [0, 10, 20, 21, 30, 40].map(ms);
    let network = run(
        1,
        &times,
        Setup {
            batching,
            detail: Detail::Everything,
            ..setup(1)
        },
    );
    let frames: Vec<usize> = network.log().transmissions().map(|t| t.frames.len()).collect();
    assert_eq!(frames, [3, 3]);
    let at: Vec<u64> = network.log().transmissions().map(|t| t.at.0).collect();
    assert_eq!(at, [ms(20), ms(40)]);
}

/// 32,000 bits need 37 link frames of at most 127 bytes, each with its own preamble and header.
#[test]
fn long_frames_pay_for_every_link_frame() {
    let network = run(32_000 - 80, &[0], setup(1));
    let air = 32_000 + 37 * (48 + 72 + 56);
    assert_eq!(network.ledger().messages().air.0, air);
    assert_eq!(network.nodes()[0].received, [air * 4_000]);
    // Any of them may be lost.
    let lost = |seed| {
        let channel = Channel::lossy(0.02).unwrap();
        run(32_000 - 80, &[0], Setup { channel, ..setup(seed) }).nodes()[0]
            .received
            .is_empty()
    };
    let (count, p) = ((0..400).filter(|seed| lost(*seed)).count() as f64, 1.0 - 0.98_f64.powi(37));
    assert!((count - 400.0 * p).abs() < 4.0 * (400.0 * p * (1.0 - p)).sqrt(), "{count}");
}

#[test]
fn a_restarted_sender_forgets_its_frames() {
    let restart = Fault {
        at: seconds(1e-3),
        node: SensorId(1),
        kind: FaultKind::Restart,
    };
    let network = run(
        1,
        &[0],
        Setup {
            faults: vec![restart],
            ..lossy(1.0, 0.0, 5)
        },
    );
    assert!(network.nodes()[1].given_up.is_empty());
    assert_eq!(network.ledger().accounts()[1].frames, 1);
}

#[test]
fn acknowledged_runs_repeat_under_their_seed() {
    let noisy = |seed| Setup {
        channel: Channel {
            loss: Loss::Fixed(0.3),
            jitter: seconds(5e-4),
            duplication: 0.2,
            ..Channel::PERFECT
        },
        retries: Some(3),
        detail: Detail::Everything,
        ..setup(seed)
    };
    let times: Vec<u64> = (0..50).map(|k| k * 3_000_000).collect();
    let first = run(1, &times, noisy(1));
    let again = run(1, &times, noisy(1));
    assert_eq!((again.nodes(), again.ledger()), (first.nodes(), first.ledger()));
    let outcome = &first.nodes()[1];
    assert_eq!(outcome.acknowledged.len() + outcome.given_up.len(), 50);
}
