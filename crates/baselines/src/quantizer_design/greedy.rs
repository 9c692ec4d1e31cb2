//! One sensor after the other.

use super::gains::single_sensor;
use fewbits_numerics::error::refuse;
use fewbits_quantizer_design::design::{Design, of_groups};
use fewbits_quantizer_design::{Criterion, Error, Newton, System};

/// The greedy design (4.4): sensor by sensor in the given order, each for the criterion of the sensors up to it.
///
/// Returns one design per stage; stage `n` is a system of `n + 1` sensors. The first sensor's quantizer does not depend on the
/// later sensors or on their noise.
///
/// # Errors
/// As [`of_groups`]; also if a group of `system` has more than one sensor, or `order` lists a group twice.
pub fn greedy(system: &System, order: &[usize], criterion: Criterion, newton: &Newton) -> Result<Vec<Design>, Error> {
    if order.is_empty() {
        return refuse("order", "empty", "at least one group");
    }
    let mut stages: Vec<Design> = Vec::with_capacity(order.len());
    for n in 0..order.len() {
        let chain = &order[..=n];
        let mut sensors = Vec::with_capacity(chain.len());
        let (mut quantizers, mut channels) = (Vec::new(), Vec::new());
        for (stage, g) in chain.iter().enumerate() {
            let group = single_sensor(system, *g)?;
            sensors.push(group.sensors[0]);
            // Earlier sensors keep their design; only the last one is optimised.
            let designed = stages.last().and_then(|d| d.system.groups().get(stage));
            quantizers.push(designed.unwrap_or(group).quantizer.clone());
            channels.push(group.channel.clone());
        }
        let model = system.model().subset(&sensors)?;
        let partial = System::distinct(model, quantizers, channels)?.with_outcome_limit(system.outcome_limit());
        stages.push(of_groups(&partial, &[n], criterion, newton)?);
    }
    Ok(stages)
}
