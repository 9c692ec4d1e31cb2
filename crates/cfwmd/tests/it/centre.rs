//! Censoring sensors at a fusion centre: most of them die, and the centre notices.

use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::{Evolution, Gaussian, Link, NumberFormat, Observation, SchemeNode, Sensing, SensorNode};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{Event, FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor};
use fewbits_monte_carlo::{Moments, Stream};
use rand::RngExt;

const SENSORS: u32 = 10;
const DEAD: u32 = 8;
const DEATH: u32 = 100;

/// What one run shows: normalised errors squared after the deaths, slots from death to its notice, sensors named wrongly.
struct Outcome {
    nees: Moments,
    delays: Vec<u32>,
    wrong: usize,
}

/// Ten sensors that send when their innovation exceeds one deviation; eight die after 100 of `slots` slots.
fn run(loss: f64, slots: u32, seed: u64) -> Outcome {
    let (mut rng, mut world) = (Stream::new(seed).named("centre").rng(), Stream::new(seed).named("world").rng());
    let model = ContinuousLinear::ornstein_uhlenbeck(0.0, 20.0, 10.0).unwrap();
    let sensing = LinearSensor::direct(1.0).unwrap();
    let scheme = CovarianceFeedback::new(sensing, 1.0, NumberFormat::Double).unwrap();
    let prior = Gaussian::scalar(0.0, 10.0).unwrap();
    let mut centre = FusionCentre::new(&mut rng, model, MomentFilter, &prior).unwrap();
    let mut nodes = Vec::new();
    for number in 0..SENSORS {
        let ask = |state: &Gaussian<1>, _: &Gaussian<1>| *state;
        let link = Link::lossy(loss).unwrap();
        centre
            .join(number, Reporting::new(sensing, scheme.clone(), link, ask))
            .unwrap();
        nodes.push(SchemeNode::new(scheme.clone()));
    }
    let mut truth = fewbits_core::Belief::sample(&prior, &mut world);
    let mut outcome = Outcome {
        nees: Moments::default(),
        delays: Vec::new(),
        wrong: 0,
    };
    for k in 1..=slots {
        truth = Evolution::over(&model, 1.0).unwrap().propagate(&mut world, &truth);
        centre.advance(&mut rng, f64::from(k)).unwrap();
        let mut heard = Vec::new();
        for number in 0..SENSORS {
            let feedback = centre.feedback(number).unwrap();
            let sample = sensing.sample(&mut world, &truth);
            let report = nodes[number as usize].report(&mut world, &sample, &feedback).unwrap();
            let dead = number < DEAD && k > DEATH;
            let lost = world.random::<f64>() < loss;
            heard.push(Slot::new(number, feedback, report.filter(|_| !dead && !lost).into()));
        }
        let received = centre.receive(&mut rng, &heard).unwrap();
        for event in received.events {
            match event {
                Event::Dead(number) if number < DEAD && k > DEATH => outcome.delays.push(k - DEATH),
                Event::Dead(_) => outcome.wrong += 1,
                _ => {}
            }
        }
        if k > DEATH {
            let error = centre.estimate().normalised_error_squared(&truth).unwrap();
            outcome.nees.add(error);
        }
    }
    assert!(heard_of_all_living(&centre));
    outcome
}

fn heard_of_all_living(centre: &FusionCentre<1, MomentFilter>) -> bool {
    (DEAD..SENSORS)
        .all(|number| !centre.sensor(number).unwrap().declared_dead && centre.sensor(number).unwrap().working > 0.5)
}

#[test]
fn eight_of_ten_dead_sensors_are_named() {
    for loss in [0.0, 0.2] {
        let (mut nees, mut named, mut wrong) = (Moments::default(), 0, 0);
        for seed in 0..10 {
            let outcome = run(loss, 600, seed);
            nees.merge(&outcome.nees);
            named += outcome.delays.iter().filter(|delay| **delay <= 100).count();
            wrong += outcome.wrong;
        }
        println!("loss {loss}: named {named} of 80, wrongly {wrong}, NEES {:.3}", nees.mean());
        assert_eq!(named, 80, "loss {loss}: {named} of 80 named within 100 slots");
        // Ten runs of 10 sensors for 100 slots and 2 for 500: 20,000 sensor slots, at most one in 10^4 wrong.
        assert!(wrong <= 7, "loss {loss}: {wrong} working sensors named dead");
        // Over 500 slots after the deaths, the 20 in which the silence is still believed included.
        assert!(nees.mean() < 1.3, "loss {loss}: NEES {}", nees.mean());
    }
}

/// Defect: each sensor was doubted alone, and at one failure in 10^4 seconds the silence of eight dead ones was believed for 24 slots:
/// NEES 1.55 over the 100 slots after their deaths.
#[test]
fn sensors_that_die_together_are_doubted_together() {
    let mut nees = Moments::default();
    for seed in 0..40 {
        nees.merge(&run(0.2, 200, 2000 + seed).nees);
    }
    println!("NEES over the 100 slots after the deaths: {:.3}", nees.mean());
    assert!(nees.mean() < 1.3, "NEES {}", nees.mean());
}

#[test]
fn working_sensors_are_seldom_named_dead() {
    // 10 sensors, 100 slots before the deaths of `run`; all living is every slot up to then.
    let mut wrong = 0;
    for seed in 0..100 {
        wrong += run(0.2, DEATH, 1000 + seed).wrong;
    }
    // 10^5 sensor slots at 10^-4: ten; Poisson's 4 deviations.
    assert!(wrong <= 23, "{wrong} in 10^5");
}

#[test]
fn a_lost_report_is_no_silence() {
    let mut rng = Stream::new(1).rng();
    let model = ContinuousLinear::random_walk(0.1).unwrap();
    let sensing = LinearSensor::direct(1.0).unwrap();
    let scheme = CovarianceFeedback::new(sensing, 1.0, NumberFormat::Double).unwrap();
    let prior = Gaussian::scalar(0.0, 1.0).unwrap();
    let mut centre = FusionCentre::new(&mut rng, model, MomentFilter, &prior).unwrap();
    let ask = |state: &Gaussian<1>, _: &Gaussian<1>| *state;
    centre
        .join(0, Reporting::new(sensing, scheme, Link::PERFECT, ask))
        .unwrap();
    for k in 1..=200 {
        let feedback = centre.advance(&mut rng, f64::from(k)).unwrap().feedback(0).unwrap();
        centre
            .receive(&mut rng, &[Slot::new(0, feedback, Observation::Lost)])
            .unwrap();
    }
    assert!(!centre.sensor(0).unwrap().declared_dead);
}
