//! Every kind of claim holds, fails, and fails about nothing.

use super::*;
use crate::Table;

fn verdict(make: impl FnOnce(&Claims)) -> Verdict {
    let claims = Claims::about("demo-fig1", true, true);
    make(&claims);
    let judged = claims.made();
    assert!(!judged.is_empty());
    if judged.iter().all(|c| c.verdict == Verdict::Pass) {
        Verdict::Pass
    } else {
        Verdict::Fail
    }
}

fn measured(value: f64, error: f64) -> Measured {
    Measured::new(value, error)
}

/// Every kind: an example that holds, one that does not, and one about nothing.
#[test]
fn every_kind_can_hold_and_can_fail() {
    type Make = fn(&Claims, usize);
    const NONE: Option<f64> = None;
    let kinds: [(&str, Make); 11] = [
        ("all", |c, i| c.all("x", "", [vec![1, 2], vec![1, -2], vec![]][i].iter(), |v| *v > 0)),
        ("near", |c, i| c.near("x", "", [Some(1.05), Some(1.2), NONE][i], 1.0, 0.1)),
        ("at_most", |c, i| c.at_most("x", "", [Some(1.0), Some(1.1), NONE][i], 1.0)),
        ("at_least", |c, i| c.at_least("x", "", [Some(1.0), Some(0.9), NONE][i], 1.0)),
        ("below", |c, i| c.below("x", "", [Some(0.9), Some(1.0), NONE][i], 1.0)),
        ("above", |c, i| c.above("x", "", [Some(1.1), Some(1.0), NONE][i], 1.0)),
        ("increasing", |c, i| c.increasing("x", "", [vec![1.0, 2.0], vec![1.0, 1.0], vec![1.0]][i].clone())),
        ("decreasing", |c, i| c.decreasing("x", "", [vec![2.0, 1.0], vec![1.0, 1.0], vec![]][i].clone())),
        ("within", |c, i| {
            c.within("x", "", [Some(measured(1.3, 0.1)), Some(measured(1.5, 0.1)), None][i], 1.0, 4.0)
        }),
        ("less", |c, i| c.less("x", "", [Some(measured(-0.4, 0.1)), Some(measured(-0.2, 0.1)), None][i], 3.0)),
        ("all_within", |c, i| {
            let rows = [vec![1.3], vec![1.0, 1.5], vec![]];
            c.all_within("x", "", &rows[i], |r| (measured(*r, 0.1), 1.0), 4.0)
        }),
    ];
    for (kind, make) in kinds {
        assert_eq!(verdict(|c| make(c, 0)), Verdict::Pass, "{kind}");
        assert_eq!(verdict(|c| make(c, 1)), Verdict::Fail, "{kind} with a counterexample");
        assert_eq!(verdict(|c| make(c, 2)), Verdict::Fail, "{kind} of nothing");
    }
}

#[test]
fn what_is_not_finite_fails_every_kind() {
    let nan = f64::NAN;
    assert_eq!(verdict(|c| c.near("x", "", nan, 0.0, 1.0)), Verdict::Fail);
    assert_eq!(verdict(|c| c.at_most("x", "", f64::NEG_INFINITY, 1.0)), Verdict::Fail);
    assert_eq!(verdict(|c| c.increasing("x", "", [0.0, nan, 1.0])), Verdict::Fail);
    assert_eq!(verdict(|c| c.within("x", "", measured(nan, 1.0), 0.0, 4.0)), Verdict::Fail);
    let rows = [measured(nan, 1.0), measured(0.0, 1.0)];
    assert_eq!(verdict(|c| c.all_within("x", "", rows, |r| (r, 0.0), 4.0)), Verdict::Fail);
    // A single trial has no standard error and shows nothing.
    assert_eq!(verdict(|c| c.within("x", "", Measured::new(1.0, None), 0.9, 4.0)), Verdict::Fail);
}

#[test]
fn undecided_claims_are_skipped() {
    let of = |defaults, full| {
        let claims = Claims::about("demo-fig1", defaults, full);
        claims.at_defaults().near("a", "", 0.0, 1.0, 0.1);
        claims.at_full_trials().near("b", "", 0.0, 1.0, 0.1);
        claims.near("c", "", None, 1.0, 0.1);
        claims.made().iter().map(|c| c.verdict).collect::<Vec<_>>()
    };
    use Verdict::{Fail, Skipped};
    assert_eq!(of(true, true), [Fail, Fail, Fail]);
    assert_eq!(of(false, true), [Skipped, Fail, Skipped]);
    assert_eq!(of(true, false), [Fail, Skipped, Fail]);
}

#[test]
fn references_are_found_by_key_and_fail_where_the_row_is_absent_or_off() {
    let judge = |rows: Vec<(&str, f64)>| {
        let claims = Claims::about("mi-table4-3", true, true);
        claims.references("mse", "squared error", rows, |(key, value)| (key.to_owned(), value));
        let of = |c: Claim| (c.id == "mse/lloyd-x").then_some(c.verdict);
        claims.made().into_iter().find_map(of).unwrap()
    };
    assert_eq!(judge(vec![("other", 1.0), ("lloyd-x", 0.130_486_15)]), Verdict::Pass);
    assert_eq!(judge(vec![("lloyd-x", 0.130_487)]), Verdict::Fail);
    assert_eq!(judge(vec![("other", 0.130_486_15)]), Verdict::Fail);
    let one_sided = |mse: f64| {
        let claims = Claims::about("mi-table4-3", true, true);
        let method = "lloyd-x";
        claims
            .no_more()
            .keyed("mse", "squared error", &[Design { method, mse }], |row| Some(row.mse));
        let of = |c: Claim| (c.id == "mse/lloyd-x").then_some(c.verdict);
        claims.made().into_iter().find_map(of).unwrap()
    };
    assert_eq!((one_sided(0.1), one_sided(0.130_487)), (Verdict::Pass, Verdict::Fail));
    // A group without references is a mistake, not a success.
    assert_eq!(
        verdict(|c| {
            let of = |v: f64| (String::new(), v);
            c.at_full_trials().references("nothing", "", [1.0], of);
        }),
        Verdict::Fail
    );
}

rows! {
    struct Design by "{method}" {
        method: &'static str => "Method.",
        mse: f64 => "Squared error.",
    }

    struct Unkeyed {
        mse: f64 => "Squared error.",
    }

    struct Tables {
        others: Vec<Other> => "Other rows with the same column.",
        designs: Vec<Design> => "Rows that the references name.",
    }

    struct Other by "{step}" {
        step: u32 => "Step.",
        mse: f64 => "Squared error.",
    }
}

/// What a figure with these tables is found to claim of its references `mse`.
fn compared<T: crate::schema::Field>(tables: &T, own: impl FnOnce(&Claims)) -> Vec<Verdict> {
    let claims = Claims::about("mi-table4-3", true, true);
    own(&claims);
    claims.compare(&Table::of(tables).unwrap());
    let made = claims.made();
    let of = |claim: &Claim| claim.id == "mse/lloyd-x" || claim.id == "mse-references";
    made.iter()
        .filter(|claim| of(claim))
        .map(|claim| claim.verdict)
        .collect()
}

#[test]
fn a_column_with_references_is_compared_without_a_word() {
    let rows = |method, mse| vec![Design { method, mse }];
    assert_eq!(compared(&rows("lloyd-x", 0.130_486_15), |_| ()), [Verdict::Pass]);
    assert_eq!(compared(&rows("lloyd-x", 0.130_487), |_| ()), [Verdict::Fail]);
    assert_eq!(compared(&rows("lloyd-z", 0.130_486_15), |_| ()), [Verdict::Fail]);
    let (others, designs) = (vec![Other { step: 1, mse: 0.5 }], rows("lloyd-x", 0.130_486_15));
    assert_eq!(compared(&Tables { others, designs }, |_| ()), [Verdict::Pass]);
    // Said by the figure itself, it is said once.
    let own = |c: &Claims| c.references("mse", "", [0.2], |v| ("lloyd-x".to_owned(), v));
    assert_eq!(compared(&rows("lloyd-x", 0.130_486_15), own), [Verdict::Fail]);
}

#[test]
fn references_that_nothing_is_compared_with_fail() {
    assert_eq!(compared(&vec![Unkeyed { mse: 0.130_486_15 }], |_| ()), [Verdict::Fail]);
    assert!(compared(&vec![Unkeyed { mse: 0.130_486_15 }], |c| c.shown("mse")).is_empty());
}

rows! {
    struct Rare by name at full_trials {
        method: &'static str => "How.",
        mse: f64 => "Squared error, no plain average.",
    }
}

fn name(row: &Rare) -> String {
    format!("lloyd-{}", row.method)
}

/// Its references are found by the function's names.
#[test]
fn what_is_no_plain_average_is_compared_at_full_counts_only() {
    let rows = vec![Rare { method: "x", mse: 0.5 }];
    for (full, verdict) in [(true, Verdict::Fail), (false, Verdict::Skipped)] {
        let claims = Claims::about("mi-table4-3", true, full);
        claims.compare(&Table::of(&rows).unwrap());
        let made = claims.made();
        let own = made.iter().find(|claim| claim.id == "mse/lloyd-x").unwrap();
        assert_eq!((own.verdict, own.value), (verdict, Some(0.5)));
    }
}
