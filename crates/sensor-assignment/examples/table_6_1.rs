//! Eight sensors of unequal noise share the eight bits of a Gray code: which bit to ask of which sensor.

use fewbits_baselines::sensor_assignment::by_precision;
use fewbits_sensor_assignment::{CodedSensors, Estimator, exchange, pair_costs, quantization_error};

fn main() -> Result<(), fewbits_sensor_assignment::Error> {
    let variances = [0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001];
    let sensors = CodedSensors::with_variances(1.0, &variances)?;
    let costs = pair_costs(&sensors);
    let best = costs.solve();
    let proof = costs.certificate(&best)?;
    println!("bit to sensor: {best:?}, optimal: {}, gap {:e}", proof.is_optimal(), proof.gap);
    println!("approximate error {:.7}", quantization_error(1.0, 8) + costs.cost(&best)?);
    for (name, assignment) in [
        ("in order", (0..8).collect()),
        ("most precise sensor for the coarsest bit", by_precision(&variances)),
        ("linear assignment", best.clone()),
    ] {
        let centre = sensors.mse(&assignment, Estimator::CellCentre)?;
        let mean = sensors.mse(&assignment, Estimator::PosteriorMean)?;
        println!("{name}: cell centre {centre:.7}, posterior mean {mean:.7}");
    }
    let swapped = exchange(&sensors, &best, Estimator::PosteriorMean)?;
    println!("after exchanges: {:?}, {:.7}", swapped.assignment, swapped.error);
    Ok(())
}
