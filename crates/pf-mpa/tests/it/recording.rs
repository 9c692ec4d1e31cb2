//! The example's logic on a small recording made for it: four anchors, 300 seconds with a gap of 42, bias 2 m, noise 0.8 m, an outlier in
//! 41 ranges, two rows in the wrong order, one without a range.

#[allow(dead_code)]
#[path = "../../examples/plaza.rs"]
mod example;

use example::{Recording, Travel, analyse, draw, track};
use std::path::{Path, PathBuf};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

fn recording() -> Recording {
    Recording::read(&data("anchors.csv"), &data("ranges.csv"), &data("truth.csv")).unwrap()
}

#[test]
fn few_bits_track_nearly_as_well_as_the_ranges() {
    let file = |name| data(name).to_str().unwrap().to_owned();
    let report = analyse(&file("anchors.csv"), &file("ranges.csv"), &file("truth.csv"), None).unwrap();
    let full = report.rows[0].1;
    assert!(full < 1.5, "{report}");
    for (travel, error, _, bias, bits) in &report.rows {
        let most = match travel {
            Travel::Full => 1.0,
            // Levels cannot tell an outlier from a surprise.
            Travel::Bits(1) => 1.7,
            Travel::Bits(_) => 1.3,
        };
        assert!(*error <= most * full && (bias - 2.0).abs() < 1.0, "{report}");
        if let Travel::Bits(own) = travel {
            // Acquisition twice, 32 bits for every range of it.
            assert!(*bits > f64::from(*own) && *bits < f64::from(*own) + 3.0);
        }
    }
}

#[test]
fn a_picture_is_drawn() {
    let recording = recording();
    let file = std::env::temp_dir().join(format!("fewbits-plaza-{}.svg", std::process::id()));
    let track = track(&recording, Travel::Bits(2)).unwrap();
    draw(&file, &recording, &[("two bits", &track)]).unwrap();
    assert!(std::fs::read_to_string(&file).unwrap().contains("two bits"));
    std::fs::remove_file(&file).unwrap();
}

#[test]
fn bad_files_are_refused_with_reasons() {
    let error = |a: &str, r: &str, t: &str| Recording::read(&data(a), &data(r), &data(t)).err().unwrap().to_string();
    assert!(error("anchors.csv", "truth.csv", "truth.csv").contains("no column `anchor`"));
    assert!(error("missing.csv", "ranges.csv", "truth.csv").contains("missing.csv"));
    assert!(recording().ranges.windows(2).all(|pair| pair[0].0 <= pair[1].0));
}
