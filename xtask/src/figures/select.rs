//! Which figures, with which parameters.

use super::Options;
use crate::Error;
use fewbits_experiments::{AnyFigure, Run, all};
use globset::Glob;

/// A figure and its parameters.
pub(super) struct Job {
    pub(super) figure: &'static dyn AnyFigure,
    pub(super) run: Run<'static>,
}

/// The figures that match any of the patterns, in the registry's order; all if there is no pattern.
pub(super) fn figures(patterns: &[String]) -> Result<Vec<&'static dyn AnyFigure>, Error> {
    let figures = all();
    let mut chosen = vec![patterns.is_empty(); figures.len()];
    for pattern in patterns {
        let glob =
            Glob::new(pattern).map_err(|error| Error(format!("`{pattern}` is no valid pattern: {}", error.kind())))?;
        let (matcher, ids) = (glob.compile_matcher(), figures.iter().map(|figure| figure.about().id));
        let matching: Vec<bool> = ids.clone().map(|id| matcher.is_match(id)).collect();
        if !matching.contains(&true) {
            let advice = advice(pattern, &ids.collect::<Vec<_>>());
            return Err(Error(format!("no figure matches `{pattern}`; {advice}")));
        }
        chosen.iter_mut().zip(matching).for_each(|(chosen, own)| *chosen |= own);
    }
    let chosen = figures.into_iter().zip(chosen).filter(|(_, chosen)| *chosen);
    Ok(chosen.map(|(figure, _)| figure).collect())
}

/// The ids that are nearest to what was asked for; all if none is near.
fn advice(pattern: &str, ids: &[&str]) -> String {
    const NEAR: f64 = 0.88;
    const MOST: usize = 4;
    let mut near: Vec<(f64, &str)> = ids.iter().map(|id| (strsim::jaro_winkler(pattern, id), *id)).collect();
    near.retain(|(similarity, _)| *similarity >= NEAR);
    near.sort_by(|a, b| b.0.total_cmp(&a.0));
    near.truncate(MOST);
    if near.is_empty() {
        format!("the figures are: {}", ids.join(", "))
    } else {
        let near: Vec<_> = near.into_iter().map(|(_, id)| id).collect();
        format!("did you mean {}? (`--list` names all figures)", near.join(", "))
    }
}

/// Every `n`-th figure, beginning with the `i`-th, of a shard `i/n`.
pub(super) fn shard(figures: Vec<&'static dyn AnyFigure>, text: &str) -> Result<Vec<&'static dyn AnyFigure>, Error> {
    let number = |text: &str| text.trim().parse::<usize>().ok();
    let (i, n) = text
        .split_once('/')
        .and_then(|(i, n)| Some((number(i)?, number(n)?)))
        .filter(|(i, n)| (1..=*n).contains(i))
        .ok_or_else(|| Error(format!("--shard {text}: expected I/N with I from 1 to N, such as 2/3")))?;
    Ok(figures.into_iter().skip(i - 1).step_by(n).collect())
}

fn has(figure: &dyn AnyFigure, parameter: &str) -> bool {
    figure.parameters().iter().any(|own| own.name == parameter)
}

/// Applies `--set`, `--trials` and `--quick`.
///
/// Each setting goes to all chosen figures that have the parameter and must fit at least one of them.
pub(super) fn configure(figures: &[&'static dyn AnyFigure], options: &Options) -> Result<Vec<Job>, Error> {
    let mut settings = Vec::new();
    for text in &options.set {
        let (name, value) = text
            .split_once('=')
            .filter(|(name, _)| !name.trim().is_empty())
            .ok_or_else(|| Error(format!("--set {text}: expected NAME=VALUE")))?;
        settings.push((name.trim().to_owned(), value.to_owned()));
    }
    if let Some(trials) = options.trials {
        settings.push(("trials".to_owned(), trials.to_string()));
    }
    for setting in &settings {
        let known = figures.iter().any(|figure| has(*figure, &setting.0));
        if let (false, Some(first)) = (known, figures.first()) {
            // The figure's own refusal names the parameters it has.
            first.configure(std::slice::from_ref(setting), options.quick)?;
        }
    }
    figures
        .iter()
        .map(|&figure| {
            let own: Vec<_> = settings.iter().filter(|(name, _)| has(figure, name)).cloned().collect();
            let run = figure.configure(&own, options.quick)?;
            Ok(Job { figure, run })
        })
        .collect()
}
