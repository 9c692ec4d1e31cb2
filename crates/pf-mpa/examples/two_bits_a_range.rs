//! Five sensors send two bits each per step; a grid of 15 x 15 follows the target.

use fewbits_core::{Dynamics, Gaussian, Link, SchemeNode, SensorNode};
use fewbits_filters::centre::{FusionCentre, Reporting, Slot};
use fewbits_models::{ContinuousLinear, PLANE_POSITION};
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise, RangeReference, RangeSensor, optimal_loading};
use nalgebra::{Matrix4, Vector1, Vector4};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (noise, loading) = (RangeNoise::from_snr_db(50.0)?, optimal_loading(4)?);
    let scheme = QuantizedRange::new(4, noise)?;
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]];
    let world = ContinuousLinear::nearly_constant_velocity_2d(0.02)?;
    let mut truth = Vector4::new(13.0, 0.0, 17.0, -0.6); // [x, x velocity, y, y velocity]
    let prior = Gaussian::new(truth, Matrix4::from_diagonal(&Vector4::new(0.04, 0.01, 0.04, 0.01)))?;
    let mut rng = Stream::new(1).rng();
    let filter = GridFilter::new(PLANE_POSITION)?;
    let mut centre = FusionCentre::new(&mut rng, world, filter, &prior)?;
    for (number, place) in (0..).zip(places) {
        let sensor = RangeSensor::new(place.into(), noise)?.on_axes::<4>(PLANE_POSITION)?;
        // Cells about the expected range, as wide as its uncertainty.
        let ask = move |_: &Gaussian<4>, range: &Gaussian<1>| RangeReference::about(range, loading);
        centre.join(number, Reporting::new(sensor, scheme.clone(), Link::PERFECT, ask))?;
    }
    let (steps, mut squares) = (25_u32, 0.0);
    for step in 1..=steps {
        truth = world.over(1.0)?.propagate(&mut rng, &truth);
        centre.advance(&mut rng, f64::from(step))?;
        let mut slots = Vec::new();
        for (number, place) in (0..).zip(places) {
            let feedback = centre.feedback(number)?;
            let sensor = RangeSensor::new(place.into(), noise)?;
            let range = Vector1::new(sensor.measure(&mut rng, sensor.distance(truth[0], truth[2])));
            let report = SchemeNode::new(scheme.clone()).report(&mut rng, &range, &feedback)?;
            slots.push(Slot::new(number, feedback, report.into()));
        }
        centre.receive(&mut rng, &slots)?;
        let error = centre.estimate().mean() - truth;
        squares += (error[0] * error[0] + error[2] * error[2]) / f64::from(steps);
    }
    println!("{} bits a step, RMS position error {:.3}", 5 * scheme.bits(), squares.sqrt());
    assert!(squares < 0.03);
    Ok(())
}
