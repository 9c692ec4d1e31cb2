//! Messages as bits, and the sensor's half.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::message::{Format, Report, gather};
use fewbits_cfwmd::network::CensoringSensor;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_core::message::laws;
use fewbits_core::{BitString, Encoder, Message, Observation};
use nalgebra::{Matrix2, Vector1, Vector2};
use proptest::prelude::*;

fn formats() -> [Format; 4] {
    [
        Format::Double,
        Format::Single,
        Format::fixed(-50.0, 50.0, 12).unwrap(),
        Format::fixed(-1e3, 7.0, 32).unwrap(),
    ]
}

proptest! {
    #[test]
    fn reports_round_trip_at_the_stated_price(x in -60.0..60.0f64, y in -60.0..60.0f64) {
        for format in formats() {
            let report = Report::Value(Vector2::new(format.rounded(x), format.rounded(y)));
            prop_assert_eq!(laws::round_trip(&report, &format).unwrap(), 2 * format.bits() as usize);
            prop_assert_eq!(laws::round_trip(&Report::<2>::Silence, &format).unwrap(), 0);
        }
    }

    #[test]
    fn decoding_is_total(bytes in prop::collection::vec(any::<u8>(), 0..20), cut in 0..8usize) {
        let bits = (bytes.len() * 8).saturating_sub(cut);
        for format in formats() {
            let bits = BitString::from_bytes(bytes.clone(), bits).unwrap();
            prop_assert!(laws::decoding_is_total::<Report<2>>(&bits, &format));
        }
    }

    #[test]
    fn what_was_sent_survives_the_audit(z in -30.0..30.0f64, prediction in -30.0..30.0f64, s in 0.1..50.0f64) {
        for format in formats() {
            let sensor = CensoringSensor { rule: CensoringRule::scalar(s, 0.45).unwrap(), format };
            match sensor.encode(&Vector1::new(z), &Vector1::new(prediction)) {
                Report::Value(sent) => {
                    prop_assert_eq!(sent[0], format.rounded(z));
                    prop_assert!(sensor.rule.audit(0, &(sent - Vector1::new(prediction))).is_ok());
                }
                Report::Silence => prop_assert!((format.rounded(z) - prediction).abs() < sensor.rule.half_width()),
            }
        }
    }
}

#[test]
fn a_tie_is_sent_and_a_zero_threshold_sends_all() {
    let sensor = |threshold| CensoringSensor {
        rule: CensoringRule::scalar(4.0, threshold).unwrap(),
        format: Format::Double,
    };
    let prediction = Vector1::new(1.0);
    assert_eq!(sensor(1.0).encode(&Vector1::new(3.0), &prediction), Report::Value(Vector1::new(3.0)));
    assert_eq!(sensor(1.0).encode(&Vector1::new(2.999), &prediction), Report::Silence);
    assert_eq!(sensor(0.0).encode(&prediction, &prediction), Report::Value(prediction));
    let vector = CensoringRule::new(&Matrix2::new(4.0, 0.0, 0.0, 1.0), 1.0).unwrap();
    assert!(vector.speaks(&Vector2::new(2.0, 0.0)) && !vector.speaks(&Vector2::new(1.9, 0.1)));
}

#[test]
fn values_that_do_not_fit_are_not_sent() {
    let fixed = Format::fixed(0.0, 1.0, 3).unwrap();
    assert!(Report::Value(Vector1::new(0.2)).to_bits(&fixed).is_err());
    assert!(Report::Value(Vector1::new(f64::NAN)).to_bits(&Format::Double).is_err());
    assert!(Report::Value(Vector1::new(0.1)).to_bits(&Format::Single).is_err());
    for bits in [0, 33] {
        assert!(Format::fixed(0.0, 1.0, bits).is_err());
    }
    assert!(Format::fixed(1.0, 1.0, 8).is_err() && Format::fixed(f64::NAN, 1.0, 8).is_err());
    assert_eq!(fixed.rounded(7.0), 1.0);
}

#[test]
fn a_step_is_gathered_by_sensor() {
    let value = Report::Value(Vector1::new(2.0));
    let heard = gather(3, [(2, value), (0, Report::Silence)]).unwrap();
    assert_eq!(
        heard,
        [
            Observation::Silent,
            Observation::Silent,
            Observation::Received(Vector1::new(2.0))
        ]
    );
    assert_eq!(gather::<1>(2, []).unwrap(), [Observation::Silent; 2]);
    assert_eq!(gather(2, [(2, value)]), Err(Error::UnknownSensor { sensor: 2, sensors: 2 }));
    assert_eq!(gather(2, [(1, value), (1, Report::Silence)]), Err(Error::HeardTwice { sensor: 1 }));
    assert!(gather(1, [(0, Report::Value(Vector1::new(f64::INFINITY)))]).is_err());
}
