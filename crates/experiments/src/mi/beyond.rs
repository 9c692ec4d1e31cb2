//! Beyond the publication: folded cells, broken symmetry, words, bounds, effort.

mod tables;

use crate::prelude::*;
use tables::{Parameters, Rows, Search, Words, channels, effort, grouping, limits, searches, thresholds, words};

/// Everything the publication does not have.
pub struct Beyond;

impl Figure for Beyond {
    figure!(Parameters => Rows, "mi-beyond", "Beyond the publication", "",
        "Levels made of several intervals beat every contiguous design found once noise is shared or small: a quarter \
         of the squared error at a noise of 0.3. With them: where identical quantizers lose their optimality, which \
         words suit which channel, bounds that no design can beat, and the iterations each algorithm takes.");

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Rows, Error> {
        Ok(Rows {
            searches: searches(p, context)?,
            symmetry: thresholds()?,
            words: words(p, context)?,
            channels: channels()?,
            bounds: limits()?,
            effort: effort()?,
            grouping: grouping()?,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let found = || rows.searches.iter();
        claims.keyed("value", "the best value known, of folded cells where they win (erratum mi-13)", found(), |s| {
            s.value
        });
        claims.all("curvature", "local optima, not saddles", found(), |s| s.curvature < 1e-8);
        let bounded = found().filter_map(|s| Some((s.mse, s.ceo_bound?)));
        claims.all("ceo", "no search beats the bound for any codes", bounded, |(mse, bound)| mse > bound);
        claims.keyed("symmetry", "where two sign quantizers lose their optimality", &rows.symmetry, |t| t.threshold);
        let best = |crossover: f64, criterion: &str, sensors: &str| {
            let own = |w: &&Words| (w.crossover, w.criterion, w.sensors, w.rank) == (crossover, criterion, sensors, 1);
            rows.words.iter().find(own)
        };
        let expected = |crossover: f64, criterion: &str| match criterion {
            _ if crossover > 0.06 => "0 1 3 | 0 1 3",
            "mse" if crossover == 0.05 => "0 1 2 3 | 0 1 2 3",
            _ => "0 1 3 2 | 0 1 3 2",
        };
        for criterion in ["mi", "mse"] {
            let what = format!(
                "best words for {criterion}: Gray at small crossovers{}, three words above",
                if criterion == "mse" { ", natural at 0.05" } else { "" }
            );
            here.all(format!("words-{criterion}"), what, &p.crossovers, |c| {
                best(*c, criterion, "same").is_some_and(|w| w.words == expected(*c, criterion))
            });
            let sense = if criterion == "mi" { 1.0 } else { -1.0 };
            let gain = best(0.05, criterion, "mixed").zip(best(0.05, criterion, "same"));
            let what = "different words at the two sensors gain nothing at 0.05";
            let gain = gain.map(|(mixed, same)| sense * (mixed.value - same.value));
            claims.at_most(format!("mixed-{criterion}"), what, gain, 1e-10);
        }
        let three = best(0.1, "mse", "same").map(|w| w.value);
        claims.references("three-words", "three words: squared error", [three], |value| ("0.1".to_owned(), value));
        claims.keyed("outer", "outer breakpoint", &rows.channels, |c| c.outer);
        claims.keyed("mse", "squared error", &rows.channels, |c| c.mse);
        claims.keyed("bound", "bound for any codes", &rows.bounds, |l| l.ceo_bound);
        claims.all("bounds", "no design beats a bound", &rows.bounds, |l| {
            l.achieved > l.ceo_bound && l.van_trees.is_none_or(|bound| l.achieved > bound)
        });
        claims.keyed("newton", "Newton iterations", &rows.effort, |e| e.newton as f64);
        claims.keyed("alternating", "alternating steps", &rows.effort, |e| e.alternating as f64);
        let what = "nine sensors, designed in groups from different starts, all return to one quantizer";
        claims.all("identical", what, &rows.grouping, |g| g.spread <= 1e-6);
    }

    fn plot(&self, _: &Parameters, rows: &Rows) -> Plot {
        let of = |cells: &'static str| select(&rows.searches, move |s| s.criterion == "mse" && s.cells == cells);
        let title = |s: &Search| {
            let words = [
                ("noise", "noise "),
                ("correlated", "correlation 0.85"),
                ("-L", ", levels "),
            ];
            words
                .iter()
                .fold(s.case.to_owned(), |text, (code, word)| text.replace(code, word))
        };
        let y = Axis::ladder(of("any").map(title));
        let place = |value: fn(&Search) -> Option<f64>, cells| {
            of(cells)
                .enumerate()
                .filter_map(|(i, s)| Some((value(s)?, -(i as f64))))
                .collect::<Vec<_>>()
        };
        let errors = Panel::new("Best squared error found", Axis::linear("mean squared error / prior variances"), y)
            .with(Layer::points("contiguous cells", place(|s| Some(s.mse), "contiguous")))
            .with(Layer::points("any cells", place(|s| Some(s.mse), "any")).marked(Marker::Triangle))
            .with(Layer::points("bound for any codes", place(|s| s.ceo_bound, "any")).marked(Marker::Cross));
        let folded = of("any").find(|s| s.case == "noise0.3-L4");
        Plot::grid(2, [errors].into_iter().chain(folded.map(cells_panel)).collect())
    }
}

/// The cells of both sensors, one lane each, by level.
fn cells_panel(search: &Search) -> Panel {
    let reach = 3.0;
    let lanes = Axis::linear("")
        .named([(1.0, "sensor 1".to_owned()), (0.0, "sensor 2".to_owned())])
        .between(-0.6, 1.6);
    let x = Axis::linear("sample / prior deviations").between(-reach, reach);
    let mut panel = Panel::new("Levels of the best pair at a noise of 0.3", x, lanes);
    let numbers = |text: &str| {
        text.split(' ')
            .filter_map(|t| t.parse::<f64>().ok())
            .collect::<Vec<_>>()
    };
    let (mut boxes, mut texts) = (vec![Vec::new(); 4], Vec::new());
    for (lane, gamma, labels) in [
        (1.0, &search.gamma1, &search.labels1),
        (0.0, &search.gamma2, &search.labels2),
    ] {
        let edges = numbers(gamma);
        let edge = |i: usize| edges.get(i).copied().unwrap_or(reach).clamp(-reach, reach);
        for (c, label) in numbers(labels).into_iter().enumerate() {
            let (left, right) = (if c == 0 { -reach } else { edge(c - 1) }, edge(c));
            boxes[label as usize % 4].push((left, right, lane - 0.35, lane + 0.35));
            texts.push((0.5 * (left + right), lane, label.to_string()));
        }
    }
    for (level, boxes) in boxes.into_iter().enumerate() {
        panel = panel.with(Layer::boxes(format!("level {level}"), boxes).coloured([5, 4, 3, 7][level]));
    }
    panel.with(Layer::texts(texts))
}
