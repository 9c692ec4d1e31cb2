//! Three kinds of sensor follow one target in the plane at irregular times: a range in two bits over a lossy link, received power and a
//! coordinate as values. Each sensor is told where the state `[x, x velocity, y, y velocity]` has what it reads.

use fewbits_core::{Dynamics, Evolution, FullValue, Gaussian, Link, OnAxes, SchemeNode, Sensing, SensorNode};
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_filters::{GridFilter, GridOnAxes};
use fewbits_models::{ContinuousLinear, LinearSensor, PLANE_POSITION, ReceivedPower};
use fewbits_pf_mpa::{QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use rand::RngExt;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (mut rng, noise) = (fewbits_monte_carlo::Stream::new(3).rng(), RangeNoise::constant(0.3)?);
    let world = ContinuousLinear::nearly_constant_velocity_2d(0.05)?;
    let prior = Gaussian::new([0.0, 1.0, 0.0, -0.5].into(), nalgebra::Matrix4::identity())?;
    let range = RangeSensor::new([20.0, 5.0].into(), noise)?.on_axes::<4>(PLANE_POSITION)?;
    let power = ReceivedPower::<4>::new([-15.0, 10.0].into(), PLANE_POSITION, 100.0, 0.02, 2.0, 0.04)?;
    let height = OnAxes::<_, 4, 1>::new(LinearSensor::direct(0.25)?, [PLANE_POSITION[1]])?;
    let (levels, loading) = (QuantizedRange::new(4, noise)?, optimal_loading(4)?);
    let ask = move |_: &Gaussian<4>, expected: &Gaussian<1>| RangeReference::about(expected, loading);
    let grid = GridOnAxes::<4, 2>::new(GridFilter::default(), PLANE_POSITION)?;
    let mut centre = FusionCentre::new(&mut rng, world, grid, &prior)?;
    centre.join(0, Reporting::new(range, levels.clone(), Link::lossy(0.1)?, ask))?;
    centre.join(1, Reporting::values(power, FullValue::new(0.04)?, Link::PERFECT))?;
    centre.join(2, Reporting::values(height, FullValue::new(0.25)?, Link::PERFECT))?;
    let value = |variance| Ok::<_, fewbits_core::Error>(Box::new(SchemeNode::new(FullValue::new(variance)?)));
    let mut nodes: [Box<dyn SensorNode<1>>; 3] = [Box::new(SchemeNode::new(levels)), value(0.04)?, value(0.25)?];
    let (mut truth, mut squares) = (prior.sample(&mut rng), 0.0);
    for k in 0..200 {
        let seconds = 0.2 + 0.2 * f64::from(k % 7);
        truth = world.over(seconds)?.propagate(&mut rng, &truth);
        let measured = [
            range.sample(&mut rng, &truth),
            power.sample(&mut rng, &truth),
            height.sample(&mut rng, &truth),
        ];
        let (time, mut slots) = (centre.time() + seconds, Vec::new());
        centre.advance(&mut rng, time)?;
        for (i, (node, z)) in (0..).zip(nodes.iter_mut().zip(&measured)) {
            let asked = centre.feedback(i)?;
            let report = node.report(&mut rng, z, &asked)?;
            let arrives = i > 0 || rng.random::<f64>() > 0.1;
            slots.push(Slot::new(i, asked, report.filter(|_| arrives).into()));
        }
        centre.receive(&mut rng, &slots)?;
        let error = centre.estimate().mean() - truth;
        squares += (error[0] * error[0] + error[2] * error[2]) / 200.0;
    }
    println!("RMS position error {:.3}", squares.sqrt());
    assert!(squares.sqrt() < 0.6);
    Ok(())
}
