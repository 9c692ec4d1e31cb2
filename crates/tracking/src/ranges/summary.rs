//! What is said of a track by ranges.

use super::settings::Anchor;
use crate::text::short;
use fewbits_pf_mpa::{Mistake, RangeSettings, RangeTracker};
use serde::Serialize;

/// A track that is lost, or doubtful, once in so many rows is so often.
pub(crate) const OFTEN: u64 = 20;

/// What was found over all rows of ranges.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RangesSummary {
    /// The target's name, if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<String>,
    /// Number of rows.
    pub rows: u64,
    /// Number of ranges.
    pub ranges: usize,
    /// Number of bits that were sent.
    pub bits: usize,
    /// Mean number of bits of a range.
    pub bits_per_range: f64,
    /// Number of rows without an estimate, during acquisition of the position.
    pub searching: u64,
    /// Number of rows in which several places explain the ranges.
    pub ambiguous: u64,
    /// Number of rows in which bias and scale contradict what is supposed of them.
    pub doubtful: u64,
    /// Number of ranges that were left out because they are negative.
    pub negative: u64,
    /// Number of ranges that were left out because they are zero.
    pub zero: u64,
    /// How often the track was lost.
    pub losses: usize,
    /// The anchors.
    pub anchors: Vec<AnchorSummary>,
    /// What the ranges suggest that no option says, a sentence each, as [`LevelSummary::hints`](crate::LevelSummary::hints).
    pub hints: Vec<String>,
    /// The mistake of the tables that explains the ranges.
    #[serde(skip)]
    pub mistake: Option<Mistake>,
    /// The summary as sentences.
    #[serde(skip)]
    pub lines: Vec<String>,
}

/// An anchor over all rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct AnchorSummary {
    /// Its name.
    pub name: String,
    /// Number of its ranges.
    pub ranges: usize,
    /// Probability at the end that its ranges depend on the distance.
    pub works: f64,
    /// Mean product of its successive residuals in their deviations, if it is far above zero: its place, or the law of its ranges, is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lasting: Option<f64>,
    /// The bias that it has alone.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own_bias: Option<f64>,
}

impl RangesSummary {
    pub(crate) fn new(anchors: &[Anchor]) -> Self {
        let anchor = |(name, _): &Anchor| AnchorSummary {
            name: name.clone(),
            ranges: 0,
            works: 1.0,
            own_bias: None,
            lasting: None,
        };
        Self {
            target: None,
            rows: 0,
            ranges: 0,
            bits: 0,
            bits_per_range: 0.0,
            searching: 0,
            ambiguous: 0,
            doubtful: 0,
            negative: 0,
            zero: 0,
            losses: 0,
            anchors: anchors.iter().map(anchor).collect(),
            hints: Vec::new(),
            mistake: None,
            lines: Vec::new(),
        }
    }
}

/// What is said of a track, a line each. `least`: the probability below which an anchor contradicts the others.
pub(crate) fn lines(
    summary: &RangesSummary,
    tracker: &RangeTracker,
    settings: RangeSettings,
    least: f64,
) -> Vec<String> {
    let silence = settings.silence;
    let mut lines = vec![
        format!("{} rows, {} ranges of {:.2} bits on average", summary.rows, summary.ranges, summary.bits_per_range),
        format!("{} rows without a place, track lost {} times", summary.searching, summary.losses),
    ];
    // Values that are no distances say nothing of anchors.
    let has_ranges = summary.ranges > 0 || summary.negative == 0;
    if summary.zero > 0 {
        lines.push(format!("{} ranges of 0 were left out, as radios write it for no range", summary.zero));
    }
    if summary.searching == summary.rows && has_ranges {
        lines.push(format!("a place needs ranges of {} anchors within {silence} s: a larger --silence, or, if times are no seconds, --time-format with their unit",
            tracker.needed()
        ));
    }
    if summary.ambiguous > 0 {
        lines.push(format!(
            "{} rows with several places that explain the ranges: the band holds them",
            summary.ambiguous
        ));
    }
    if !has_ranges {
        lines.push(format!(
            "all {} values are negative: they are no distances. Signal strengths in dBm need --rssi; differences of ranges need --unknown-clock",
            summary.negative
        ));
    } else if summary.negative > 0 {
        lines.push(format!(
            "{} negative ranges were left out: they are no distances; differences of ranges need --unknown-clock",
            summary.negative
        ));
    }
    if summary.doubtful > summary.rows / OFTEN {
        lines.push(format!(
            "{} rows are doubtful: bias and scale are larger than --bias and --scale allow, as if an anchor's ranges or place were wrong; --bias 0 --scale 0 for calibrated ranges shows which",
            summary.doubtful
        ));
    }
    lines.extend(summary.hints.iter().cloned());
    // A wrong height lengthens the ranges of the nearest anchors, and their errors last.
    let is_height = matches!(summary.mistake, Some(Mistake::Height(_) | Mistake::HeightChanges { .. }));
    for anchor in &summary.anchors {
        if anchor.ranges == 0 && !has_ranges {
            continue;
        }
        if anchor.ranges == 0 {
            lines.push(format!("no range from anchor {}", anchor.name));
        } else if anchor.works < least {
            lines.push(format!("anchor {} contradicts the others and is not used", anchor.name));
        } else if let Some(bias) = anchor.own_bias.filter(|_| !is_height) {
            let off = if bias > 0.0 { "long" } else { "short" };
            let size = if settings.proportional {
                format!("{} %", short(100.0 * bias.abs().exp_m1()))
            } else {
                short(bias.abs())
            };
            lines.push(format!(
                "ranges of anchor {} are {size} too {off}, as if it stood elsewhere or were behind a wall: they are used less that",
                anchor.name
            ));
        }
    }
    let lasting: Vec<(&str, f64)> = summary
        .anchors
        .iter()
        .filter_map(|one| Some((one.name.as_str(), one.lasting?)))
        .collect();
    if !lasting.is_empty() && !is_height {
        let most = lasting.iter().fold(0.0_f64, |most, (_, product)| most.max(*product));
        let names: Vec<&str> = lasting.iter().map(|(name, _)| *name).collect();
        lines.push(format!(
            "errors of anchors {} last from range to range (mean product of neighbours up to {most:.2} of their variance), so bands are too narrow: an anchor stands elsewhere than its table says, or walls lengthen ranges",
            names.join(", ")
        ));
    }
    lines
}
