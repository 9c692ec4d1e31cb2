//! Three kinds of sensor at one centre: bits of x, words of y, and full values of x from a sensor that joins late.
use fewbits_core::{Belief, Dynamics, Evolution, FullValue, Gaussian, Link, OnAxes, SchemeNode, Sensing, SensorNode};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor, PLANE_POSITION};
use fewbits_monte_carlo::Stream;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut rng, mut world_rng) = (Stream::new(3).rng(), Stream::new(4).rng());
    let world = ContinuousLinear::nearly_constant_velocity_2d(0.05)?; // state [x, vx, y, vy]
    let prior = Gaussian::new([0.0, 1.0, 0.0, -0.5].into(), nalgebra::Matrix4::identity())?;
    let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior)?;
    let (direct, [x, y]) = (LinearSensor::direct(0.5)?, PLANE_POSITION);
    let on = |axis| OnAxes::<_, 4, 1>::new(direct, [axis]);
    let sensing = [on(x)?, on(y)?, on(x)?];
    let (bit, word, value) = (SignBit::new(0.5)?, InnovationWord::new(0.5, 3)?, FullValue::new(0.5)?);
    let threshold = |_: &Gaussian<4>, m: &Gaussian<1>| m.mean()[0];
    centre.join(0, Reporting::new(sensing[0], bit, Link::lossy(0.1)?, threshold))?;
    let cells = |_: &Gaussian<4>, m: &Gaussian<1>| Prediction::from(m);
    centre.join(1, Reporting::new(sensing[1], word, Link::PERFECT, cells))?;
    let (mut bit, mut word, mut value) = (SchemeNode::new(bit), SchemeNode::new(word), SchemeNode::new(value));
    let nodes: [&mut dyn SensorNode<1>; 3] = [&mut bit, &mut word, &mut value];
    let mut truth = prior.sample(&mut rng);
    for k in 0..200_u32 {
        if k == 100 {
            centre.join(2, Reporting::values(sensing[2], FullValue::new(0.5)?, Link::PERFECT))?;
        }
        let time = centre.time() + 0.2 + 0.25 * f64::from(k % 7);
        truth = Evolution::over(&world, time - centre.time())?.propagate(&mut world_rng, &truth);
        centre.advance(&mut rng, time)?;
        let mut slots = Vec::new();
        for number in centre.sensors() {
            let (i, feedback) = (number as usize, centre.feedback(number)?);
            let report = nodes[i].report(&mut rng, &sensing[i].sample(&mut world_rng, &truth), &feedback)?;
            slots.push(Slot::new(number, feedback, report.filter(|_| number != 0 || k < 150).into()));
        }
        for event in centre.receive(&mut rng, &slots)?.events {
            println!("{time:6.1} s: {event:?}");
        }
    }
    let error = (centre.estimate().mean() - truth).norm();
    println!("error {error:.2} m; the first sensor works with probability {:.1e}", centre.working(0)?);
    Ok(())
}
