//! Claims of figures 3, 4, 7 to 10.

use super::summary::{Curve, Rows};
use crate::Claims;
use crate::claim::{find, minus};

fn nodes(rows: &Rows, key: &str) -> Option<f64> {
    Some(find(&rows.summary, key)?.nodes_median?.value)
}

fn at<'a>(rows: &'a Rows, scheme: &str, range: f64, step: usize) -> Option<&'a Curve> {
    let same = |c: &&Curve| (c.scheme, c.range, c.step) == (scheme, range, step);
    rows.curves.iter().find(same)
}

fn calibrated(rows: &Rows, claims: &mut Claims, key: &str) {
    let full = claims.at_full_trials();
    let nees = find(&rows.summary, key).and_then(|s| s.nees_median);
    let what = "the exact belief is calibrated: the median squared error is 1.39 covariances";
    full.near("calibrated", what, nees, 1.386, 0.4);
    // A small determinant allows a long thin belief: a metre along it is no error of the belief.
    let wrong = find(&rows.summary, key).map(|s| s.converged_wrong.value);
    let what = "at most one in a hundred exact beliefs converges more than a metre off (erratum diffusive-15)";
    full.at_most("exact-is-right", what, wrong, 0.01);
}

/// Error, example A.
pub(super) fn fig3(rows: &Rows, claims: &mut Claims) {
    let full = claims.at_full_trials();
    for key in ["exact 15", "exact 10", "gmm-4 15", "gmm-4 10"] {
        let end = find(&rows.summary, key)
            .and_then(|s| s.final_err_median)
            .map(|m| m.value);
        let what = format!("the search ends at the source: {key}");
        full.below(format!("arrives/{}", key.replace(' ', "-")), what, end, 0.1);
    }
    let error = |range, step| Some(at(rows, "exact", range, step)?.err_med);
    for range in [15.0, 10.0] {
        let errors = [1, 3, 6].map(|step| error(range, step));
        full.decreasing(format!("falls/{range}"), "the error falls as nodes are added", errors);
    }
    let what = "after six nodes 15 m of range are ahead of 10 m";
    full.below("range", what, minus(error(15.0, 6), error(10.0, 6)), 0.0);
    calibrated(rows, claims, "exact 15");
    let wrong = find(&rows.summary, "gaussian known rate 15").map(|s| s.wrong.value);
    let what = "one Gaussian stops more than a metre off in a good part of the searches; the paper shows none (erratum diffusive-12)";
    full.at_least("gaussian-is-often-wrong", what, wrong, 0.1);
}

/// Determinant, example A.
pub(super) fn fig4(rows: &Rows, claims: &mut Claims) {
    let (full, paper) = (claims.at_full_trials(), claims.at_defaults().at_full_trials());
    for scheme in ["exact", "gmm-4", "gaussian known rate", "gaussian-9"] {
        let [wide, narrow] = [15, 10].map(|range| nodes(rows, &format!("{scheme} {range}")));
        let what = format!("15 m of range need fewer nodes than 10 m: {scheme}");
        full.below(format!("range/{}", scheme.replace(' ', "-")), what, minus(wide, narrow), 0.0);
    }
    let what = "the printed 14 nodes are below almost every single-Gaussian search (erratum diffusive-12)";
    let lowest = find(&rows.summary, "gaussian known rate 15").and_then(|s| s.nodes_q10);
    paper.above("printed-14", what, lowest, 14.0);
    calibrated(rows, claims, "exact 15");
}

/// Error, example B.
pub(super) fn fig7(rows: &Rows, claims: &mut Claims) {
    let (full, paper) = (claims.at_full_trials(), claims.at_defaults().at_full_trials());
    let error = |scheme, step| Some(at(rows, scheme, 15.0, step)?.err_med);
    for step in [4, 6, 8] {
        let what = format!("polynomial Gaussians are nearer than one Gaussian after {step} nodes");
        let ahead = minus(error("lpg-2x5 known rate", step), error("gaussian known rate", step));
        full.below(format!("lpg-ahead/{step}"), what, ahead, 0.0);
    }
    let determinant = |scheme| at(rows, scheme, 15.0, 5)?.log10det_med;
    let value = |scheme| determinant(scheme).map(|m| m.value);
    let lpg = "lpg-2x5 known rate";
    let what = "after five nodes polynomial Gaussians are sharper than the other program's (log10 det -3.8), by more than four standard errors (erratum diffusive-13)";
    let most = determinant(lpg).map(|m| m.value + 4.0 * m.error());
    paper.below("det5/lpg", what, most, -3.8);
    let what = "and no sharper than the exact belief with the rate known";
    paper.at_least("det5/honest", what, minus(value(lpg), value("exact known rate")), 0.0);
    let what = "which they have a right to: their median squared error is 1.39 covariances";
    let nees = find(&rows.summary, "lpg-2x5 known rate 15").and_then(|s| s.nees_median);
    full.near("det5/calibrated", what, nees, 1.386, 0.4);
    paper.near("det5/gaussian", "log10 det after five nodes, one Gaussian", value("gaussian known rate"), 3.6, 1.0);
    calibrated(rows, claims, "exact 15");
}

/// Determinant, example B.
pub(super) fn fig8(rows: &Rows, claims: &mut Claims) {
    let full = claims.at_full_trials();
    let median = |key: &str| nodes(rows, &format!("{key} 15"));
    let lpg = "lpg-2x5 known rate";
    let what = "the paper's single search with polynomial Gaussians, 7 nodes, is between the deciles of ours";
    full.all("printed-7", what, find(&rows.summary, "lpg-2x5 known rate 15"), |s| {
        s.nodes_q10.is_some_and(|low| low <= 7.0) && s.nodes_q90.is_some_and(|high| high >= 7.0)
    });
    let what = "polynomial Gaussians take no more than one node beyond the exact belief";
    full.at_most("lpg-near-exact", what, minus(median(lpg), median("exact known rate")), 1.0);
    let what = "one Gaussian with the rate carried takes about the printed 20";
    full.near("printed-20", what, median("gaussian-9"), 20.0, 4.0);
    for (id, lpg, gaussian) in [
        ("lpg-first", lpg, "gaussian known rate"),
        ("lpg-first/rate-unknown", "lpg-2x5", "gaussian-9"),
    ] {
        let what = format!("polynomial Gaussians need fewer nodes than one Gaussian: {lpg}");
        full.below(id, what, minus(median(lpg), median(gaussian)), 0.0);
    }
    let what = "a mixture of 23 numbers is as good, within a node, as 52 of polynomial Gaussians (erratum diffusive-9)";
    full.at_most("mixtures-do", what, minus(median("gmm-4 known rate"), median(lpg)), 1.0);
    let wrong = find(&rows.summary, "mode and curvature known rate 15").map(|s| s.wrong.value);
    let what = "mode and curvature report convergence in the wrong place in most searches: never trust a determinant from them";
    full.at_least("curvature-misleads", what, wrong, 0.5);
    calibrated(rows, claims, "exact 15");
}

/// Both examples in wind.
pub(super) fn wind(rows: &Rows, claims: &mut Claims) {
    let full = claims.at_full_trials();
    let reach = |key: &str| find(&rows.summary, key).map(|s| s.reach.value);
    for (rule, id) in [
        ("covariance 15", "covariance-first"),
        ("information 15", "information-first"),
    ] {
        let what = format!("in wind the rule reaches the threshold more often than Mahalanobis: {rule}");
        full.above(id, what, minus(reach(rule), reach("mahalanobis 15")), 0.1);
    }
    let error = |key: &str| find(&rows.summary, key).and_then(|s| s.err_after_3).map(|m| m.value);
    for other in ["covariance 15", "mahalanobis 15"] {
        let id = format!("information-after-3/{}", other.replace(' ', "-"));
        let what = format!("after three nodes information has the smaller median error than {other}");
        full.below(id, what, minus(error("information 15"), error(other)), 0.0);
    }
}
