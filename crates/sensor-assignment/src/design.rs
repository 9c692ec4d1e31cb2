//! Assignment of bits to sensors, as a start for the design of the cells.
//!
//! The linear assignment assumes a uniform unknown, independent noise and ideal links. The design by `fewbits-quantizer-design` starts from
//! it and makes none of these assumptions: edges of the patterns move, cells merge, and the decoder is that of least squared error.

use crate::{CodedSensors, Error, pair_costs};
use fewbits_core::Link;
use fewbits_quantizer_design::{AllowedCells, BitBudget, ObservationModel, Request, WordedCells};

/// For each sensor, breakpoints and words of the Gray bit that it sends in the best linear assignment, for a
/// uniform unknown with the prior's mean and variance.
fn bit_cells(model: &ObservationModel) -> Result<Vec<WordedCells>, Error> {
    let half_width = 3f64.sqrt() * model.prior().deviation();
    let deviations: Vec<f64> = (0..model.sensors()).map(|n| model.noise().deviation(n)).collect();
    let sensors = CodedSensors::with_deviations(half_width, &deviations)?;
    let assignment = pair_costs(&sensors).solve();
    let mean = model.prior().mean();
    let none = WordedCells {
        breakpoints: Vec::new(),
        words: Vec::new(),
    };
    let mut cells = vec![none; deviations.len()];
    for (sensor, quantizer) in assignment.iter().zip(sensors.quantizers()) {
        let breakpoints: Vec<f64> = quantizer.breakpoints().iter().map(|b| mean + b).collect();
        let words = (0..=breakpoints.len()).map(|cell| cell % 2).collect();
        cells[*sensor] = WordedCells { breakpoints, words };
    }
    Ok(cells)
}

/// A request for the estimate from one bit per sensor. An additional start is the Gray bit that each sensor sends in the best linear
/// assignment for a uniform unknown of the prior's mean and variance. Set further options on the request and run it.
///
/// ```
/// use fewbits_core::Link;
/// use fewbits_quantizer_design::{Noise, Prior, ObservationModel};
/// let noise = Noise::independent_with_deviations(&[0.2, 0.1, 0.05])?;
/// let model = ObservationModel::new(Prior::uniform(0.0, 2.0)?, noise)?;
/// let mut request = fewbits_sensor_assignment::bit_per_sensor(model, Link::flipping(0.01)?)?;
/// request.starts = 4;
/// let solutions = request.run()?;
/// assert!(solutions.best().value < 0.08);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// If there are more than 16 sensors.
pub fn bit_per_sensor(model: ObservationModel, link: Link) -> Result<Request<'static>, Error> {
    Ok(Request {
        cells: AllowedCells::Any,
        start: Some(bit_cells(&model)?),
        ..Request::estimation(model, BitBudget::Each(1), link)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Estimator;
    use fewbits_quantizer_design::{Noise, Prior};

    /// The design starts from the assigned patterns, so it is no worse than their exact error.
    #[test]
    fn designed_cells_are_no_worse_than_patterns() {
        let deviations = [0.2, 0.1, 0.05, 0.12];
        let sensors = CodedSensors::with_deviations(1.0, &deviations).unwrap();
        let assignment = pair_costs(&sensors).solve();
        for (scale, mean) in [(1.0, 0.0), (1e-4, 3.0)] {
            let noise = Noise::independent_with_deviations(&deviations.map(|d| scale * d)).unwrap();
            let prior = Prior::uniform(mean - scale, mean + scale).unwrap();
            let mut request = bit_per_sensor(ObservationModel::new(prior, noise).unwrap(), Link::PERFECT).unwrap();
            request.starts = 2;
            let found = request.run().unwrap().best().value / (scale * scale);
            let patterns = sensors.mse(&assignment, Estimator::PosteriorMean).unwrap();
            assert!(found <= patterns * (1.0 + 1e-6), "{found} {patterns}");
        }
    }
}
