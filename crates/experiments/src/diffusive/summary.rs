//! What is told of many searches.

use super::common::{Scheme, Settings, Track, fraction, median, quantile};
use crate::prelude::*;

rows! {
    pub struct Rows {
        /// Medians and bands over the deployments, node by node; searches that have ended keep their last values.
        pub(super) curves: Vec<Curve>,
        pub(super) summary: Vec<Summary> => "How the searches ended.",
    }

    /// A step of the searches of one scheme.
    pub struct Curve {
        pub(super) scheme: &'static str => "What travels, and how nodes are chosen.",
        pub(super) range: f64 ["m"] => "Radio range.",
        pub(super) step: usize => "Nodes that have sampled.",
        pub(super) err_med: f64 ["m"] => "Median distance of estimate and source.",
        pub(super) err_q10: f64 ["m"] => "Its lower decile.",
        pub(super) err_q90: f64 ["m"] => "Its upper decile.",
        /// Median of the root of the distance: the paper's "bias", read literally.
        pub(super) sqrt_err_med: f64 ["m^0.5"],
        /// Median decimal logarithm of the covariance's determinant (of m^4).
        pub(super) log10det_med: Option<Measured>,
        /// Median squared error in units of the covariance, 1.39 if the belief is calibrated.
        pub(super) nees_med: f64,
    }

    /// How the searches of one scheme ended.
    pub struct Summary by "{scheme} {range}" {
        pub(super) scheme: &'static str as key => "What travels, and how nodes are chosen.",
        pub(super) range: f64 ["m"] => "Radio range.",
        pub(super) scalars: Option<usize> => "Numbers in one message; none for raw records, which grow.",
        pub(super) reach: Measured => "Share of the searches that reach the threshold.",
        pub(super) nodes_median: Option<Measured> => "Median nodes of those that do.",
        pub(super) nodes_q10: Option<f64> => "Lower decile.",
        pub(super) nodes_q90: Option<f64> => "Upper decile.",
        pub(super) final_err_median: Option<Measured> ["m"] as points => "Median distance of estimate and source at the end.",
        pub(super) wrong: Measured => "Share of all searches that end more than a metre off.",
        pub(super) converged_wrong: Measured => "Share of those that report convergence and are more than a metre off.",
        /// Median squared error in units of the covariance at the end, 1.39 if calibrated.
        pub(super) nees_median: Option<f64>,
        pub(super) err_after_3: Option<Measured> ["m"] => "Median distance of estimate and source after three nodes.",
        pub(super) bytes_median: Option<Measured> ["bytes"] as x("bytes of all messages (median)") => "Median size of all messages together, over all hops.",
    }
}

/// Medians and bands of a scheme's searches, node by node; searches that have ended keep their last values.
pub(super) fn curve(scheme: &Scheme, tracks: &[Track]) -> Vec<Curve> {
    let longest = tracks.iter().map(|t| t.nodes()).max().unwrap_or(0);
    let after = |step: usize| {
        let at = |values: &Vec<f64>| values.get(step - 1).or(values.last()).copied();
        let errors = || tracks.iter().filter_map(|t| at(&t.errors));
        Some(Curve {
            scheme: scheme.name,
            range: scheme.range,
            step,
            err_med: quantile(errors(), 0.5)?,
            err_q10: quantile(errors(), 0.1)?,
            err_q90: quantile(errors(), 0.9)?,
            sqrt_err_med: quantile(errors().map(f64::sqrt), 0.5)?,
            log10det_med: median(tracks.iter().filter_map(|t| at(&t.log10_determinants))),
            nees_med: quantile(tracks.iter().filter_map(|t| at(&t.nees)), 0.5)?,
        })
    };
    (1..=longest).filter_map(after).collect()
}

/// How the searches of a scheme ended.
pub(super) fn summary(scheme: &Scheme, settings: &Settings, tracks: &[Track]) -> Result<Summary, Error> {
    let reached: Vec<&Track> = tracks.iter().filter(|t| t.converged()).collect();
    let counts: Vec<f64> = reached.iter().map(|t| t.nodes() as f64).collect();
    let third = tracks
        .iter()
        .filter_map(|t| t.errors.get(2).or(t.errors.last()).copied());
    let wrong = |t: &Track| t.final_error() > 1.0;
    let rate = scheme.search(settings)?.rate;
    Ok(Summary {
        scheme: scheme.name,
        range: scheme.range,
        scalars: scheme.form.scalars(&rate),
        reach: fraction(reached.len(), tracks.len()),
        nodes_median: median(counts.iter().copied()),
        nodes_q10: quantile(counts.iter().copied(), 0.1),
        nodes_q90: quantile(counts.iter().copied(), 0.9),
        final_err_median: median(tracks.iter().map(|t| t.final_error())),
        wrong: fraction(tracks.iter().filter(|t| wrong(t)).count(), tracks.len()),
        converged_wrong: fraction(reached.iter().filter(|t| wrong(t)).count(), reached.len()),
        nees_median: quantile(tracks.iter().filter_map(|t| t.nees.last().copied()), 0.5),
        err_after_3: median(third),
        bytes_median: median(reached.iter().map(|t| t.bits as f64 / 8.0)),
    })
}
