//! The law of reports: frequencies rise, fill the total, and are found again.

use fewbits_node::adaptive::{Config, ESCAPE, Encoder, PRECISION, REACH};

/// On a line, on circles of few and many points, and far out.
#[test]
fn every_symbol_is_found_where_it_lies() {
    let line = Config::new(0.01).unwrap();
    let circle = |delta: f64| Config::new(delta).unwrap().circular(360.0).unwrap();
    for config in [line, circle(0.001), circle(0.4), circle(100.0), circle(400.0)] {
        let mut encoder = Encoder::new(config);
        for n in 0..700 {
            let x = f64::from(n);
            let sample = (x * 0.3).sin() * 7.0 + f64::from(n % 7) + 0.1 * x;
            encoder.encode(sample).unwrap();
            if n % 60 != 59 {
                continue;
            }
            let mut replica = encoder.replica().unwrap().clone();
            let slot = replica.predict(1);
            let law = replica.law(&slot);
            let mut end = 0;
            for symbol in 0..=ESCAPE {
                let place = law.place(symbol);
                assert!(place.left == end && place.width >= 1, "{symbol}");
                end = place.left + place.width;
                let near = (i64::from(symbol) - REACH).abs() < 40 || symbol % 97 == 0 || symbol == ESCAPE;
                for quantile in [place.left, end - 1].into_iter().filter(|_| near) {
                    assert_eq!(law.find(quantile), (symbol, place));
                }
            }
            assert_eq!(end, 1 << PRECISION);
        }
    }
}
