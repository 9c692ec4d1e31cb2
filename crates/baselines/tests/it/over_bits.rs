//! Estimators in types as receivers over bits.

use fewbits_baselines::over_bits::{Estimator, OverBits};
use fewbits_core::{BitString, NumberFormat, Observation};
use fewbits_protocol::{BoxError, Receiver};
use proptest::prelude::*;

/// A level that grows by one in each slot, and is set to what is reported.
#[derive(Debug, Clone, PartialEq)]
struct Level;

impl Estimator for Level {
    type Belief = f64;
    type Feedback = f64;
    type Report = f64;

    fn sensors(&self) -> usize {
        2
    }
    fn start(&self) -> f64 {
        10.0
    }
    fn predict(&self, _: u64, belief: &f64) -> Result<f64, BoxError> {
        Ok(belief + 1.0)
    }
    fn feedback(&self, predicted: &f64, sensor: usize) -> Result<f64, BoxError> {
        Ok(predicted + sensor as f64)
    }
    fn update(&self, _: u64, predicted: &f64, observed: &[(usize, Observation<f64>)]) -> Result<f64, BoxError> {
        observed
            .iter()
            .try_fold(*predicted, |level, (_, observation)| match observation {
                Observation::Received(report) if *report < 0.0 => Err("a negative level is impossible".into()),
                Observation::Received(report) => Ok(1e308 * report),
                Observation::Nothing => Ok(level),
                Observation::Lost => Ok(level + 100.0),
            })
    }
    fn estimate(&self, belief: &f64) -> Vec<(f64, f64)> {
        vec![(*belief, 0.5)]
    }
    fn belief_format(&self) -> NumberFormat {
        NumberFormat::Double
    }
    fn feedback_format(&self, _: usize) -> NumberFormat {
        NumberFormat::Double
    }
    fn report_format(&self, _: usize) -> NumberFormat {
        NumberFormat::Single
    }
}

fn single(x: f32) -> BitString {
    BitString::from_bytes(x.to_bits().to_be_bytes().to_vec(), 32).unwrap()
}

#[test]
fn the_start_holds_before_the_first_slot_and_gaps_are_predicted_through() {
    let mut receiver = OverBits::new(Level);
    receiver.predict(7_000_000_000_000).unwrap();
    assert_eq!(receiver.estimate(), [(11.0, 0.5)]);
    receiver.predict(7_000_000_000_003).unwrap();
    assert_eq!(receiver.estimate(), [(14.0, 0.5)]);
    // The same slot again is none.
    receiver.predict(7_000_000_000_003).unwrap();
    assert_eq!(receiver.estimate(), [(14.0, 0.5)]);
}

#[test]
fn a_step_that_fails_leaves_the_state() {
    let mut receiver = OverBits::new(Level);
    receiver.predict(1).unwrap();
    let before = receiver.state().unwrap();
    let received = |x: f32| [(0, Observation::Received(single(x)))];
    assert!(receiver.update(&received(-1.0)).is_err());
    // 1e308 times 1e3 is no number.
    let error = receiver.update(&received(1e3)).unwrap_err().to_string();
    assert_eq!(error, "the estimate is inf in coordinate 0: expected a finite number");
    assert_eq!(receiver.state().unwrap(), before);
    // Bits that are no report were sent and not understood.
    let broken = BitString::from_bytes(vec![0xff], 8).unwrap();
    receiver.update(&[(1, Observation::Received(broken))]).unwrap();
    assert_eq!(receiver.estimate(), [(111.0, 0.5)]);
}

proptest! {
    #[test]
    fn states_come_back_and_any_bits_are_one_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..20), slot in 1_u64..1000) {
        let mut receiver = OverBits::new(Level);
        receiver.predict(slot).unwrap();
        let state = receiver.state().unwrap();
        let mut other = OverBits::new(Level);
        other.restore(&state).unwrap();
        prop_assert_eq!(&other, &receiver);
        let bits = 8 * bytes.len();
        let noise = BitString::from_bytes(bytes, bits).unwrap();
        if other.restore(&noise).is_err() {
            prop_assert_eq!(&other, &receiver);
        } else {
            prop_assert_eq!(other.state().unwrap(), noise);
        }
    }
}
