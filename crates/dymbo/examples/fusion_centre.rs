//! A fusion centre in forty lines: one-bit sensors of a position, a word, a sensor that joins late and one that dies.

use fewbits_core::{Belief, Dynamics, Evolution, FullValue, Gaussian, Link, OnAxes, SchemeNode, Sensing, SensorNode};
use fewbits_dymbo::{InnovationWord, Prediction, SignBit};
use fewbits_filters::MomentFilter;
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, LinearSensor, PLANE_POSITION};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix4, Vector4};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Stream::new(3).rng();
    let world = ContinuousLinear::nearly_constant_velocity_2d(0.05)?;
    let prior = Gaussian::new(Vector4::new(0.0, 1.0, 0.0, -0.5), Matrix4::identity())?;
    let mut centre = FusionCentre::new(&mut rng, world, MomentFilter, &prior)?;

    // Each sensor reads one coordinate of [x, vx, y, vy]; its noise variance is .5 wherever it is named.
    let reading = LinearSensor::direct(0.5)?;
    let axis = |i: usize| OnAxes::<_, 4, 1>::new(reading, [PLANE_POSITION[i]]);
    let (bit, word, value) = (SignBit::new(0.5)?, InnovationWord::new(0.5, 3)?, FullValue::new(0.5)?);
    let threshold = |_: &Gaussian<4>, m: &Gaussian<1>| m.mean()[0];
    let cells = |_: &Gaussian<4>, m: &Gaussian<1>| Prediction {
        mean: m.mean()[0],
        deviation: m.covariance()[0].sqrt(),
    };
    let mut nodes: Vec<(OnAxes<LinearSensor<1, 1>, 4, 1>, Box<dyn SensorNode<1>>)> = Vec::new();
    for number in 0..4_u32 {
        let sensing = axis(number as usize % 2)?;
        match number {
            0 | 1 => centre.join(number, Reporting::new(sensing, bit, Link::lossy(0.1)?, threshold))?,
            _ => centre.join(number, Reporting::new(sensing, word, Link::PERFECT, cells))?,
        }
        nodes.push((
            sensing,
            if number < 2 {
                Box::new(SchemeNode::new(bit))
            } else {
                Box::new(SchemeNode::new(word))
            },
        ));
    }
    let mut truth = prior.sample(&mut rng);
    for k in 0..200_u32 {
        if k == 100 {
            centre.join(4, Reporting::values(axis(0)?, value, Link::PERFECT))?;
            nodes.push((axis(0)?, Box::new(SchemeNode::new(value))));
        }
        let seconds = 0.2 + 0.25 * f64::from(k % 7);
        truth = world.over(seconds)?.propagate(&mut rng, &truth);
        let time = centre.time() + seconds;
        centre.advance(&mut rng, time)?;
        let mut slots = Vec::new();
        for (number, (sensing, node)) in nodes.iter_mut().enumerate() {
            let feedback = centre.feedback(number as u32)?;
            let sample = sensing.sample(&mut rng, &truth);
            let report = node.report(&mut rng, &sample, &feedback)?;
            slots.push(Slot::new(number as u32, feedback, report.filter(|_| number != 1 || k < 150).into()));
        }
        for event in centre.receive(&mut rng, &slots)?.events {
            println!("{time:6.1} s: {event:?}");
        }
    }
    println!(
        "error {:.2} m, sensor 1 works with probability {:.1e}",
        (centre.estimate().mean() - truth).norm(),
        centre.working(1)?
    );
    Ok(())
}
