//! Three kinds of sensor at one centre in a plane: bits of x, words of y, and full values of x from a sensor that joins late.
use fewbits_core::{Belief, Dynamics, FullValue, Gaussian, Link, OnAxes, SchemeNode, Sensing, SensorNode};
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
    let ([x, y], direct) = (PLANE_POSITION, LinearSensor::direct(0.5)?);
    let on = |axis| OnAxes::<_, 4, 1>::new(direct, [axis]);
    let sensing = [on(x)?, on(y)?, on(x)?];
    let (bit, word, value) = (SignBit::new(0.5)?, InnovationWord::new(0.5, 3)?, FullValue::new(0.5)?);
    centre.join(0, Reporting::new(sensing[0], bit, Link::lossy(0.1)?, |_: &_, m: &Gaussian<1>| m.mean()[0]))?;
    centre.join(1, Reporting::new(sensing[1], word, Link::PERFECT, |_: &_, m: &_| Prediction::from(m)))?;
    let (mut bit, mut word, mut full) = (SchemeNode::new(bit), SchemeNode::new(word), SchemeNode::new(value));
    let mut nodes: [&mut dyn SensorNode<1>; 3] = [&mut bit, &mut word, &mut full];
    let (mut truth, mut events) = (prior.sample(&mut rng), Vec::new());
    for k in 0..200_u32 {
        if k == 100 {
            centre.join(2, Reporting::values(sensing[2], value, Link::PERFECT))?;
        }
        let (seconds, mut slots) = (0.2 + 0.25 * f64::from(k % 7), Vec::new());
        truth = world.over(seconds)?.propagate(&mut world_rng, &truth);
        centre.advance(&mut rng, centre.time() + seconds)?;
        for (i, node) in nodes.iter_mut().enumerate().take(centre.sensors().count()) {
            let feedback = centre.feedback(i as u32)?;
            let report = node.report(&mut rng, &sensing[i].sample(&mut world_rng, &truth), &feedback)?;
            slots.push(Slot::new(i as u32, feedback, report.filter(|_| i > 0 || k < 150).into())); // the first one dies
        }
        events.extend(centre.receive(&mut rng, &slots)?.events);
    }
    println!("noticed {events:?}; the first sensor works with probability {:.1e}", centre.sensor(0)?.working);
    println!("error {:.2} m", (centre.estimate().mean() - truth).norm());
    Ok(())
}
