//! What `fit` says of faults that are no parameters.

use crate::numbers::short;
use fewbits_filters::fit::{Fault, FaultKind};

const OFF: &str = "which is no part of the model: its numbers and the change are off by more than stated";

/// A line for people.
pub(super) fn line(fault: &Fault, names: &[String]) -> String {
    let (name, size) = (&names[fault.sensor], short(fault.size.abs()));
    let said = match fault.kind {
        FaultKind::InvertedBits => {
            format!("{} in a hundred of its bits are inverted, {OFF}", short(100.0 * fault.size))
        }
        FaultKind::Hysteresis => {
            format!("its threshold for rises is about {size} above that for falls (hysteresis), {OFF}")
        }
        FaultKind::Lag if fault.size < 0.0 => format!("it leads by about {size} when the level rises and falls, {OFF}"),
        FaultKind::Lag => format!(
            "it lags by about {size} when the level rises and falls, as by hysteresis, friction, or a delay (--find delay), {OFF}"
        ),
        FaultKind::AbsentAbove => {
            format!("its values above {} are missing: empty cells are taken for such values", short(fault.size))
        }
        FaultKind::AbsentBelow => {
            format!("its values below {} are missing: empty cells are taken for such values", short(fault.size))
        }
        _ => "it has another fault".to_owned(),
    };
    format!("{name}: {said}; {} nats of evidence\n", short(fault.evidence))
}
