//! Wild arguments: the sensor's halves answer or refuse, and a refused sample changes nothing.

use fewbits_node::adaptive::{Config, Encoder};
use fewbits_node::censor::{self, OwnFilter};
use fewbits_node::golden::Signal;
use fewbits_node::{Packet, Quantizer, cell_of, innovation_cell, pattern_bit, range_level, sign_bit, trigger};
use fewbits_numerics::wild;

/// Random cases: as many as a property of `proptest` draws.
fn cases() -> usize {
    std::env::var("PROPTEST_CASES")
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(256)
}

struct Wild(Signal);

impl Wild {
    fn number(&mut self) -> f64 {
        wild::number(self.0.random())
    }

    fn numbers<const N: usize>(&mut self) -> [f64; N] {
        std::array::from_fn(|_| self.number())
    }
}

#[test]
fn halves_answer_or_refuse() {
    let mut wild = Wild(Signal::new(24));
    for _ in 0..cases() {
        let [sample, a, b, c, d, e] = wild.numbers();
        assert_eq!(sign_bit(sample, a).is_ok(), sample.is_finite() && a.is_finite());
        assert!(cell_of(&[a, b], sample).is_ok_and(|cell| cell <= 2) || sample.is_nan());
        assert_eq!(pattern_bit(&[a, b], sample).is_ok(), !sample.is_nan());
        assert!(
            innovation_cell(&[a, b], sample, c, d).is_ok_and(|cell| cell <= 2)
                || !(sample.is_finite() && c.is_finite() && d.is_finite() && d > 0.0)
        );
        let levels = (wild.0.random() % 9) as u32;
        if let Ok(level) = range_level(sample, a, b, levels) {
            assert!(level < levels, "{sample} {a} {b} {levels}");
        }
        if let Ok(quantizer) = Quantizer::new(&[a, b], &[0, 1, 2], 2) {
            assert!(quantizer.word(sample).is_ok_and(|word| word <= 2) || sample.is_nan());
        }
        assert!(censor::speaks(sample, a, b).is_err() || (sample.is_finite() && a.is_finite() && !b.is_nan()));
        if let Ok(width) = censor::half_width(&[a, b], &[[c, d], [d, e]], sample, e) {
            assert!(width.is_finite() && width >= 0.0);
        }
        let _ = trigger::speaks(sample, a, b, 0.5);
        if let Ok(before) = OwnFilter::new([[a, b], [c, d]], [e, a], [b, c]) {
            let mut filter = before;
            match filter.speaks(sample, &[d, e], wild.number()) {
                Ok(_) => assert!(filter.estimate().iter().all(|x| x.is_finite()), "{before:?} {sample}"),
                Err(_) => assert_eq!(filter, before),
            }
        }
    }
}

#[test]
fn encoders_keep_their_promise_or_refuse() {
    let mut wild = Wild(Signal::new(25));
    for _ in 0..cases().div_ceil(8) {
        let [delta, period, finer] = wild.numbers();
        let Ok(config) = Config::new(delta).or_else(|_| Config::exact(delta)) else {
            continue;
        };
        let config = config.circular(period).unwrap_or(config);
        let config = config.with_delta(finer).unwrap_or(config);
        let mut encoder = Encoder::new(config);
        for _ in 0..8 {
            let (sample, elapsed) = (wild.number(), (wild.0.random() % 3) as u32);
            let before = (encoder.reconstruction(), encoder.slot(), encoder.sequence());
            match encoder.encode_after(elapsed, sample) {
                Ok(_) => {
                    assert!(sample.is_finite() && elapsed > 0 && encoder.reconstruction().is_none_or(f64::is_finite))
                }
                Err(_) => assert_eq!((encoder.reconstruction(), encoder.slot(), encoder.sequence()), before),
            }
        }
    }
}

#[test]
fn packets_hold_what_was_pushed() {
    let mut signal = Signal::new(26);
    for _ in 0..cases() {
        let mut packet = Packet::default();
        for _ in 0..5 {
            let (before, value, width) = (packet, signal.random(), (signal.random() % 70) as u32);
            packet.push(value, width);
            let pushed = packet.bits() - before.bits();
            assert!(pushed == 0 && packet == before || pushed == width && packet.word() >> width == before.word());
        }
        assert_eq!(Packet::from_word(packet.word(), packet.bits()), Some(packet));
        let _ = Packet::from_word(u128::from(signal.random()) << 64, (signal.random() % 200) as u32);
    }
}
