//! Regressions: what used to be wrong, each with a case that showed it.

use crate::worlds::{clock, counted, plant, scalar, setup, start};
use fewbits_adaptive::Config;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Decoder, PatternSensor, Source};
use fewbits_core::{
    BitReader, BitString, BitWriter, CodecError, Gaussian, Link, Message, NumberFormat, Observation, Sign,
};
use fewbits_dymbo::{CountFusion, ParallelFilter};
use fewbits_filters::AssumedDensity;
use fewbits_models::{Ar1, LinearSensor};
use fewbits_monte_carlo::Stream;
use fewbits_network::estimators::{Followers, ParallelDymboEstimator, Patterns, Reporting, SendAll};
use fewbits_network::{
    Channel, Check, Clock, Detail, Error, Estimator, Fault, FaultKind, Field, Frame, Instant, Kind, Lead, Loss,
    Measurements, Note, Radio, Replicable, Seconds, SensorId, Setup, Stage, Star, Walk, Walker, digest,
};
use fewbits_topology::Deployment;
use nalgebra::{Vector1, Vector2};
use rand_pcg::Pcg64Dxsm;

fn all_send(link: Link) -> impl Replicable<Measurement = Vector1<f64>, Belief = Gaussian<1>> {
    Reporting {
        dynamics: Ar1::new(0.9, 0.5).unwrap(),
        sensors: vec![LinearSensor::<1, 1>::direct(1.0).unwrap(); 3],
        scheme: SendAll::new(1.0, NumberFormat::Double).unwrap(),
        link,
        filter: AssumedDensity,
        broadcast: (|_: &Gaussian<1>| ()) as fn(&Gaussian<1>),
        start: start(),
    }
}

#[test]
fn a_misconfigured_estimator_ends_the_run() {
    let star = Star::told(all_send(Link::flipping(0.01).unwrap()), scalar(3, 20, 1), clock(), Stream::new(1)).unwrap();
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    let error = network.run_until(clock().end(20)).unwrap_err();
    let Error::MostSlotsFailed {
        failed: 11, slots: 20, ..
    } = &error
    else {
        panic!("{error}");
    };
    let expected = "update failed, slot 11: argument `crossover` is 0.01";
    assert!(error.to_string().contains(expected), "{error}");
    let notes: Vec<String> = network.log().notes().map(|(_, _, note)| note.to_string()).collect();
    assert!(notes[0].starts_with("update failed, slot 1: argument `crossover` is 0.01"), "{notes:?}");
    assert_eq!(network.ledger().faults().failures, 11);
}

#[test]
fn reports_of_half_the_slots_may_fail() {
    // An infinite measurement fits no format: the sensor notes it and the slot passes.
    let measure = |slot: u32, _: usize| Some(Vector1::new(if slot.is_multiple_of(2) { f64::NAN } else { 1.0 }));
    let run = |slots: u32, measure: fn(u32, usize) -> Option<Vector1<f64>>| {
        let link = Link::lossy(0.5).unwrap();
        let measurements = Measurements::from_fn(slots, measure);
        let star = Star::told(all_send(link), measurements, clock(), Stream::new(1)).unwrap();
        let mut network = star.simulate(10.0, setup(1)).unwrap();
        network
            .run_until(clock().end(slots))
            .map(|_| network.ledger().faults().failures)
    };
    assert_eq!(run(20, measure).unwrap(), 30);
    let never = run(20, |_, _| Some(Vector1::new(f64::NAN)));
    assert!(matches!(
        never,
        Err(Error::MostSlotsFailed {
            node: SensorId(1),
            failed: 11,
            ..
        })
    ));
}

#[test]
fn missing_measurements_are_silence() {
    let link = Link::lossy(0.5).unwrap();
    let measure = |slot: u32, sensor: usize| (sensor != 1 || slot > 5).then(|| Vector1::new(1.0));
    let measurements = Measurements::from_fn(8, measure);
    let star = Star::told(all_send(link), measurements, clock(), Stream::new(1)).unwrap();
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(8)).unwrap();
    let frames: Vec<u32> = network.ledger().accounts()[1..]
        .iter()
        .map(|account| account.frames)
        .collect();
    assert_eq!(frames, [8, 3, 8]);
    let missing = network
        .log()
        .notes()
        .filter(|(_, node, note)| *node == SensorId(2) && matches!(note, Note::NotMeasured { .. }));
    assert_eq!(missing.count(), 5);
    // The same from an iterator.
    let table: Measurements<Vector1<f64>> = (1..=8).map(|slot| (0..3).map(|i| measure(slot, i)).collect()).collect();
    let star = Star::told(all_send(link), table, clock(), Stream::new(1)).unwrap();
    let mut again = star.simulate(10.0, setup(1)).unwrap();
    again.run_until(clock().end(8)).unwrap();
    assert_eq!(again.nodes()[0].estimates(), network.nodes()[0].estimates());
}

/// What a centre sees of reports whose header alone is checked: the share of slots without any arrival is the loss of the link.
#[test]
fn link_loss_is_the_share_of_silent_slots() {
    let slots = 1500;
    for (channel, question) in [
        (Channel::flipping(0.01).unwrap(), None),
        (
            Channel {
                crossover: 0.01,
                ..Channel::lossy(0.2).unwrap()
            },
            Some(144),
        ),
    ] {
        let link = channel.link(10.0, question, Check::Header).unwrap();
        assert_eq!(link.crossover(), 0.01);
        let setup = Setup {
            channel,
            report_check: Check::Header,
            detail: Detail::Everything,
            ..setup(2)
        };
        let mut arrived = 0;
        let mut count = |log: &fewbits_network::Log| {
            let reports = log.transmissions().filter(|t| t.from != SensorId(0));
            arrived += reports.filter(|t| !t.receptions[0].copies.is_empty()).count();
        };
        if question.is_some() {
            let star = Star::told(counted(Link::new(0.6, 0.01).unwrap()), scalar(3, slots, 1), clock(), Stream::new(1));
            let mut network = star.unwrap().simulate(10.0, setup).unwrap();
            network.run_until(clock().end(slots as u32)).unwrap();
            count(network.log());
        } else {
            let source = Source::gaussian_with_deviation(1.0).unwrap();
            let patterns = patterns(source, &vec![vec![0.0]; 3]);
            let star = Star::told(patterns, scalar(3, slots, 1), clock(), Stream::new(1)).unwrap();
            let mut network = star.simulate(10.0, setup).unwrap();
            network.run_until(clock().end(slots as u32)).unwrap();
            count(network.log());
        }
        let n = 3.0 * slots as f64;
        let silent = 1.0 - arrived as f64 / n;
        // The three sensors miss the same question only if each of its copies is lost: independent.
        let spread = (link.loss() * (1.0 - link.loss()) / n).sqrt();
        assert!((silent - link.loss()).abs() <= 4.0 * spread, "{silent} for {}", link.loss());
    }
}

fn patterns(source: Source, edges: &[Vec<f64>]) -> Patterns {
    let sensors: Vec<_> = edges
        .iter()
        .map(|edges| PatternSensor::with_deviation(BinaryQuantizer::new(edges.clone()).unwrap(), 1.0).unwrap())
        .collect();
    let table = Bank::new(source, sensors.clone())
        .unwrap()
        .table(Decoder::Mmse)
        .unwrap();
    Patterns::new(sensors, table, source.variance()).unwrap()
}

/// One sign bit of `x ~ N(0, s)` in unit noise: mean `sqrt(2 / pi) s / sqrt(s + 1)`, variance `s - (2 / pi) s^2 / (s + 1)`.
#[test]
fn patterns_have_the_variance_given_the_bits() {
    let variance = 2.0;
    let patterns = patterns(Source::gaussian_with_deviation(f64::sqrt(variance)).unwrap(), &[vec![0.0]]);
    let mut rng = Stream::new(1).rng();
    let predicted = patterns.predict(&mut rng, 1, &patterns.start()).unwrap();
    assert!((predicted.covariance()[0] - variance).abs() < 1e-12);
    let bit = patterns
        .report(&mut rng, 1, 0, &mut (), &Vector1::new(5.0), &())
        .unwrap()
        .unwrap();
    let after = patterns
        .update(&mut rng, 1, &predicted, &[Some(Observation::Received(bit))])
        .unwrap();
    let share = 2.0 / std::f64::consts::PI * variance * variance / (variance + 1.0);
    assert!((after.mean()[0].abs() - share.sqrt()).abs() < 1e-9, "{after:?}");
    assert!((after.covariance()[0] - (variance - share)).abs() < 1e-9, "{after:?}");
    let nothing = patterns
        .update(&mut rng, 1, &predicted, &[Some(Observation::Nothing)])
        .unwrap();
    assert!((nothing.covariance()[0] - variance).abs() < 1e-9);
}

#[test]
fn slots_without_time_for_all_are_refused() {
    let filter = ParallelFilter::new(plant(), 1000, CountFusion::Linear).unwrap();
    let estimator = || ParallelDymboEstimator::new(filter, start()).unwrap();
    let measurements = || Measurements::from_fn(3, |_, _| Some(Vector1::new(0.0)));
    let star = |period: f64| {
        let clock = Clock::new(Seconds::new(period).unwrap()).unwrap();
        Star::echoed(estimator(), measurements(), clock, Stream::new(1)).unwrap()
    };
    let refused = star(0.01).simulate(10.0, setup(1)).err();
    let Some(Error::SlotTooShort {
        frames: 1001,
        needed,
        available,
    }) = refused
    else {
        panic!("{refused:?}");
    };
    // 1000 reports of 200 bits, and an echo of 80 + 1000 bits in two link frames, at 250 kbit/s.
    let echo = 1080.0 + 2.0 * (120.0 + 56.0);
    assert!((needed.value() - (1000.0 * 200.0 + echo) / 250e3).abs() < 1e-9, "{needed}");
    assert!((available.value() - 0.009).abs() < 1e-12);
    assert!(star(2.0).simulate(10.0, setup(1)).is_ok());
}

/// Transmissions of neighbours do not overlap.
#[test]
fn frames_wait_until_the_air_is_free() {
    let star = Star::told(counted(Link::PERFECT), scalar(3, 4, 1), clock(), Stream::new(1)).unwrap();
    let mut network = star
        .simulate(
            10.0,
            Setup {
                detail: Detail::Everything,
                ..setup(1)
            },
        )
        .unwrap();
    network.run_until(clock().end(4)).unwrap();
    let mut free = 0;
    for sent in network.log().transmissions() {
        assert!(sent.at.0 >= free, "{} < {free}", sent.at.0);
        free = sent.at.0 + sent.air * 4_000;
    }
    assert_eq!(network.log().transmissions().count(), 16);
}

#[test]
fn every_link_has_its_own_loss() {
    let link_loss = [((SensorId(2), SensorId(0)), Loss::Fixed(1.0))].into();
    let star = Star::told(counted(Link::lossy(0.5).unwrap()), scalar(3, 10, 1), clock(), Stream::new(1)).unwrap();
    let setup = Setup {
        link_loss,
        detail: Detail::Everything,
        ..setup(1)
    };
    let mut network = star.simulate(10.0, setup).unwrap();
    network.run_until(clock().end(10)).unwrap();
    for sent in network.log().transmissions().filter(|t| t.from != SensorId(0)) {
        assert_eq!(sent.receptions[0].copies.is_empty(), sent.from == SensorId(2));
    }
}

#[test]
fn a_sensor_out_of_range_of_the_centre_is_refused() {
    let at = |x: &[f64]| Deployment::given(x.iter().map(|x| Vector2::new(*x, 0.0)).collect()).unwrap();
    let star = || Star::told(counted(Link::PERFECT), scalar(3, 4, 1), clock(), Stream::new(1)).unwrap();
    let field = |x: &[f64]| Field::new(&at(x), 2.0).unwrap();
    let refused = star().simulate_on(field(&[0.0, 1.0, 2.0, 3.0]), setup(1)).err();
    assert!(matches!(refused, Some(Error::OutOfRange { from: 3, to: 0 })));
    let refused = star().simulate_on(field(&[0.0, 1.0]), setup(1)).err();
    assert!(matches!(refused, Some(Error::UnknownNode { node: 2, nodes: 2 })));
    let mut network = star().simulate_on(field(&[0.0, 1.0, 2.0, -1.5]), setup(1)).unwrap();
    network.run_until(clock().end(4)).unwrap();
    assert_eq!(network.nodes()[0].estimates().len(), 4);
}

/// A threshold or nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Threshold(Option<f64>);

impl Message for Threshold {
    /// Whether a threshold is told.
    type Format = bool;

    fn encode(&self, _: &bool, writer: &mut BitWriter) -> Result<(), CodecError> {
        match self.0 {
            Some(threshold) => threshold.encode(&NumberFormat::Double, writer),
            None => Ok(()),
        }
    }

    fn decode(told: &bool, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if *told {
            return f64::decode(&NumberFormat::Double, reader).map(|x| Self(Some(x)));
        }
        Ok(Self(None))
    }
}

/// Two sign sensors; only the first is told a threshold, the second compares with zero.
#[derive(Clone)]
struct OneIsTold;

impl Estimator for OneIsTold {
    type Belief = Vec<f64>;
    type Measurement = Vector1<f64>;
    type Question = Threshold;
    type Report = Sign;
    type Memory = ();

    fn sensors(&self) -> usize {
        2
    }

    fn start(&self) -> Vec<f64> {
        vec![0.0; 2]
    }

    fn memory(&self, _: usize) {}

    fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Vec<f64>) -> Result<Vec<f64>, Error> {
        Ok(belief.clone())
    }

    fn question(&self, slot: u32, _: &Vec<f64>, sensor: usize) -> Result<Threshold, Error> {
        Ok(Threshold((sensor == 0).then(|| f64::from(slot))))
    }

    fn question_format(&self, sensor: usize) -> bool {
        sensor == 0
    }

    fn report_format(&self, _: usize) {}

    fn report(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        _: usize,
        (): &mut (),
        measurement: &Vector1<f64>,
        question: &Threshold,
    ) -> Result<Option<Sign>, Error> {
        Ok(Some(Sign::of(measurement[0], question.0.unwrap_or(0.0))?))
    }

    /// Counts the reports of each sensor.
    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        predicted: &Vec<f64>,
        observations: &[Option<Observation<Sign>>],
    ) -> Result<Vec<f64>, Error> {
        let came = |o: &Option<Observation<Sign>>| {
            if let Some(Observation::Received(_)) = o {
                1.0
            } else {
                0.0
            }
        };
        Ok(predicted.iter().zip(observations).map(|(n, o)| n + came(o)).collect())
    }

    fn mean(&self, belief: &Vec<f64>) -> Vec<f64> {
        belief.clone()
    }
}

#[test]
fn a_sensor_without_question_reports_beside_one_with() {
    let star = Star::told(OneIsTold, scalar(2, 6, 1), clock(), Stream::new(1)).unwrap();
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    network.run_until(clock().end(6)).unwrap();
    assert_eq!(network.nodes()[0].estimates()[5], [6.0, 6.0]);
    assert!(network.log().entries.is_empty());
}

#[test]
fn followers_by_echo_come_back_after_losses() {
    let followers = Followers {
        dynamics: Ar1::new(0.9, 0.5).unwrap(),
        sensors: vec![LinearSensor::<1, 1>::direct(1.0).unwrap(); 3],
        noise_variance: 1.0,
        config: Config::new(0.5).and_then(|c| c.resilient(4, Some(4))).unwrap(),
        start: start(),
    };
    let slots = 60;
    let star = Star::echoed(followers, scalar(3, slots, 1), clock(), Stream::new(1)).unwrap();
    // A snapshot has thousands of bytes; as link frames of 127 bytes it would hardly ever arrive whole.
    let radio = Radio {
        mtu: None,
        ..Radio::cc2420(0.0).unwrap()
    };
    let setup = Setup {
        radio,
        channel: Channel::lossy(0.1).unwrap(),
        ..setup(1)
    };
    let mut network = star.simulate(10.0, setup).unwrap();
    network.run_until(clock().end(slots as u32)).unwrap();
    let faults = network.ledger().faults();
    assert!(faults.resynchronisations > 0 && faults.failures == 0, "{faults:?}");
    // 36 of 20 slots before; now about as many as echoes and snapshots are lost.
    assert!(faults.disagreements < slots as u64, "{faults:?}");
}

/// Says that its reports end by themselves, which they do not.
#[derive(Clone)]
struct Mistaken(Followers<Ar1, LinearSensor<1, 1>, 1>);

impl Estimator for Mistaken {
    type Belief = <Followers<Ar1, LinearSensor<1, 1>, 1> as Estimator>::Belief;
    type Measurement = Vector1<f64>;
    type Question = ();
    type Report = fewbits_adaptive::Packet;
    type Memory = fewbits_adaptive::Sensor;

    fn sensors(&self) -> usize {
        self.0.sensors()
    }

    fn start(&self) -> Self::Belief {
        self.0.start()
    }

    fn memory(&self, sensor: usize) -> Self::Memory {
        self.0.memory(sensor)
    }

    fn predict(&self, rng: &mut Pcg64Dxsm, slot: u32, belief: &Self::Belief) -> Result<Self::Belief, Error> {
        self.0.predict(rng, slot, belief)
    }

    fn question(&self, _: u32, _: &Self::Belief, _: usize) -> Result<(), Error> {
        Ok(())
    }

    fn question_format(&self, _: usize) {}

    fn report_format(&self, _: usize) {}

    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        sensor: usize,
        memory: &mut Self::Memory,
        measurement: &Vector1<f64>,
        question: &(),
    ) -> Result<Option<Self::Report>, Error> {
        self.0.report(rng, slot, sensor, memory, measurement, question)
    }

    fn update(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        predicted: &Self::Belief,
        observations: &[Option<Observation<Self::Report>>],
    ) -> Result<Self::Belief, Error> {
        self.0.update(rng, slot, predicted, observations)
    }

    fn mean(&self, belief: &Self::Belief) -> Vec<f64> {
        self.0.mean(belief)
    }
}

impl Replicable for Mistaken {
    fn belief_bits(&self, belief: &Self::Belief) -> Result<BitString, Error> {
        self.0.belief_bits(belief)
    }

    fn belief_of(&self, bits: &BitString) -> Result<Self::Belief, Error> {
        self.0.belief_of(bits)
    }
}

#[test]
fn an_echo_that_cannot_be_read_ends_the_run() {
    let mistaken = Mistaken(Followers {
        dynamics: Ar1::new(0.9, 0.5).unwrap(),
        sensors: vec![LinearSensor::<1, 1>::direct(1.0).unwrap(); 3],
        noise_variance: 1.0,
        config: Config::new(0.5).unwrap(),
        start: start(),
    });
    let star = Star::echoed(mistaken, scalar(3, 5, 1), clock(), Stream::new(1)).unwrap();
    let mut network = star.simulate(10.0, setup(1)).unwrap();
    assert!(matches!(network.run_until(clock().end(5)), Err(Error::UnreadableEcho { slot: 1 })));
}

/// Never leads on.
struct Last;

impl Walker for Last {
    fn lead(&self, _: &mut Pcg64Dxsm, _: u32, _: SensorId, _: Option<&BitString>) -> Result<Lead, Error> {
        Ok(Lead {
            message: BitString::default(),
            next: None,
            estimate: Vec::new(),
        })
    }
}

/// Node 1 is to lead in slot 8. It relays a handover to node 2, which is dead. What cannot be passed on is kept only if it has seen more slots.
#[test]
fn a_relay_that_leads_keeps_its_newer_belief() {
    let leads_after = |relayed: u32| {
        let at = |x: f64| Instant::default().after(Seconds::new(x).unwrap());
        let line = [0.0, 1.0, 2.0].map(|x| Vector2::new(x, 0.0)).to_vec();
        let field = Field::new(&Deployment::given(line).unwrap(), 1.5).unwrap();
        let death = Fault {
            at: Seconds::ZERO,
            node: SensorId(2),
            kind: FaultKind::Death,
        };
        let setup = Setup {
            faults: vec![death],
            retries: Some(1),
            radio: Radio::cc2420(0.0).unwrap(),
            ..setup(1)
        };
        let walk = Walk::new(Last, clock(), 20, Stream::new(1));
        let mut network = walk.simulate(field, SensorId(0), setup).unwrap();
        let mut handover = |time: f64, destination: u32, slot: u32, byte: u8| {
            let payload = BitString::from_bytes(vec![byte], 8).unwrap();
            let frame = Frame {
                destination,
                ..Frame::new(Kind::Handover, slot, digest(u64::from(slot), &payload), payload)
            };
            network
                .inject(at(time), SensorId(0), SensorId(1), frame.to_bits(Check::Whole).unwrap())
                .unwrap();
        };
        handover(2.0, 1, 8, 1);
        handover(2.1, 2, relayed, 2);
        network.run_until(at(3.0)).unwrap();
        let kept = |note: &Note| matches!(note, Note::Retained { .. });
        assert_eq!(network.log().notes().filter(|(_, _, note)| kept(note)).count(), 1);
        network.nodes()[1].leads()
    };
    assert_eq!(leads_after(5), Some(8));
    assert_eq!(leads_after(9), Some(9));
}

#[test]
fn a_leader_that_always_fails_ends_the_run() {
    struct Failing;
    impl Walker for Failing {
        fn lead(&self, _: &mut Pcg64Dxsm, slot: u32, node: SensorId, _: Option<&BitString>) -> Result<Lead, Error> {
            Err(Error::NoReading { node, slot })
        }
    }
    let walk = Walk::new(Failing, clock(), 10, Stream::new(1));
    let mut network = walk
        .simulate(Field::ring(3, 10.0).unwrap(), SensorId(0), setup(1))
        .unwrap();
    let error = network.run_until(clock().end(10)).unwrap_err();
    let Error::MostSlotsFailed {
        failed: 6,
        last: Note::Failed {
            stage: Stage::Lead,
            slot: 6,
            reason,
        },
        ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!(reason, "node 0 has no reading in slot 6");
}
