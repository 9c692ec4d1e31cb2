//! The example's logic on a small recording made for it: `a = 0.95`, `sigma_u = 0.3`, `sigma = 0.5` around 21, 300 rows.

#[allow(dead_code)]
#[path = "../../examples/recording.rs"]
mod example;

use example::{Goal, Task, read_column, report, rms};
use fewbits_adaptive::{Config, Error, best_within, replay};
use std::path::Path;

fn samples() -> Vec<f64> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/recording.csv");
    read_column(&file, "temp_degc").unwrap()
}

#[test]
fn a_rate_is_met_and_the_error_is_bounded() {
    let samples = samples();
    for rate in [0.5, 1.0, 2.0] {
        let (config, run) =
            best_within(Config::new(1.0).unwrap(), &samples, rate, |r| Ok::<_, Error>(r.rate())).unwrap();
        assert!(run.rate() <= rate && run.worst_error() <= config.delta());
        assert!(rms(&run.errors) < 0.7 * config.delta());
        assert_eq!(replay(config, &samples).unwrap(), run);
    }
}

#[test]
fn tasks_are_read_and_reported() {
    let task = |words: &[&str]| Task::parse(&words.iter().map(|w| (*w).to_owned()).collect::<Vec<_>>());
    assert_eq!(task(&["delta=0.5"]).unwrap().goal, Goal::Delta(0.5));
    for bad in [&["delta"][..], &["rate=x"], &["rate=0"], &["speed=1"], &[]] {
        assert!(task(bad).is_err());
    }
    for words in [
        &["delta=0.5"][..],
        &["rate=1"],
        &["words=2"],
        &["delta=5", "period=360"],
    ] {
        let text = report(&samples(), &task(words).unwrap()).unwrap();
        assert!(text.contains("second half"), "{text}");
    }
    let missing = read_column(
        Path::new(env!("CARGO_MANIFEST_DIR"))
            .join("tests/data/recording.csv")
            .as_path(),
        "x",
    );
    assert!(missing.unwrap_err().to_string().contains("temp_degc"));
}
