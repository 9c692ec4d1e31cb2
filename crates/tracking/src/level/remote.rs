//! The centre's half of a sensor of a table, and how its reports are tested.

use crate::error::Failure;
use crate::level::meaning::Seat;
use crate::level::stated::{StatedReading, Stating};
use fewbits_core::{BitString, Gaussian, Link, Message, NumberFormat, OnAxes};
use fewbits_filters::centre::{RemoteSensor, ReportTest, Reporting};
use fewbits_models::LinearSensor;

/// How a reading that states its meaning is tested.
fn tested(bits: &BitString) -> Option<ReportTest> {
    let reading = StatedReading::from_bits(&NumberFormat::Double, bits).ok()?;
    Some(if reading.lower == reading.upper {
        ReportTest::Value(reading.deviation * reading.deviation)
    } else {
        ReportTest::Cell(reading.upper - reading.lower)
    })
}

/// The same of a sensor that sends on change. Its values come because they are far from the last, so that of right ones too many are on one
/// side and few are near the forecast. Only an improbable one is tested: it stands for a narrow cell about it.
fn tested_on_change(bits: &BitString) -> Option<ReportTest> {
    Some(match tested(bits)? {
        ReportTest::Value(variance) => ReportTest::Cell(NARROW * variance.sqrt()),
        cell => cell,
    })
}

/// Width of a narrow cell, in deviations.
const NARROW: f64 = 1e-6;

/// The centre's half of a sensor.
pub(crate) fn remote<const D: usize>(seat: &Seat) -> Result<Box<dyn RemoteSensor<D>>, Failure> {
    let link = Link::lossy(seat.loss)?;
    if !seat.is_stated() {
        return seat.sends.remote::<D>(seat.noise * seat.noise, link);
    }
    let usual = seat.usual() * seat.usual();
    let sensing = OnAxes::<_, D, 1>::new(LinearSensor::direct(usual)?, [0])?;
    let nothing = |_: &Gaussian<D>, _: &Gaussian<1>| ();
    let remote = Reporting::new(sensing, Stating::new(usual)?, link, nothing)
        .sending_values()
        .testing(if seat.meaning.silent_within.is_some() {
            tested_on_change
        } else {
            tested
        });
    Ok(Box::new(remote))
}
