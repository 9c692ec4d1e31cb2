//! Comparison with reference values of independent programs that no figure shows.

use fewbits_experiments::reference;

/// Every reference `<set>/<quantity>/<row>` whose row contains `part` has the value that `ours` gives for it, within its tolerance.
pub fn agree(set: &str, quantity: &str, part: &str, ours: impl Fn(&str) -> f64) {
    let mut known = reference::group(set, quantity).unwrap();
    known.retain(|(row, _)| row.contains(part));
    assert!(!known.is_empty(), "{set}/{quantity}");
    for (row, known) in known {
        let found = ours(row);
        let off = (found - known.value).abs();
        assert!(off <= known.tolerance, "{}: {found} for {}, off by {off:e}", known.key, known.value);
    }
}

/// The numbers of a row's name.
pub fn numbers(row: &str) -> Vec<f64> {
    let words = row.split(|c: char| !(c.is_ascii_digit() || c == '.'));
    words.filter_map(|word| word.parse().ok()).collect()
}
