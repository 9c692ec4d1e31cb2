//! What a Monte-Carlo run of one scheme leaves: squared errors and message counts of every trial and step.

use crate::error::Error;
use crate::legacy::claim::Claim;
use crate::legacy::row;
use crate::legacy::{Table, column};
use fewbits_monte_carlo::statistics::paired_difference;
use fewbits_monte_carlo::{Estimate, Moments};

/// One trial of one scheme, one entry a step.
#[derive(Debug, Clone, Default)]
pub(super) struct Record {
    /// Squared position error (m^2).
    pub(super) position: Vec<f64>,
    /// Squared velocity error (m^2/s^2).
    pub(super) velocity: Vec<f64>,
    /// Messages sent.
    pub(super) sent: Vec<f64>,
    /// Squared position error over its variance under the belief; empty where the belief has none to offer.
    pub(super) consistency: Vec<f64>,
}

/// All trials of one scheme at one message budget.
#[derive(Debug, Clone)]
pub(super) struct Ensemble {
    pub(super) scheme: String,
    /// Budget `l`.
    pub(super) messages: f64,
    pub(super) records: Vec<Record>,
}

/// A component of the error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Position,
    Velocity,
}

/// The first of some numbers; a row that is not there is an error, not a panic.
pub(super) fn first(values: Vec<f64>) -> Result<f64, Error> {
    let value = values.first().copied();
    value.ok_or_else(|| Error::Table("no row with this key".to_owned()))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

impl Ensemble {
    fn series(&self, part: Part) -> impl Iterator<Item = &Vec<f64>> {
        self.records.iter().map(move |r| match part {
            Part::Position => &r.position,
            Part::Velocity => &r.velocity,
        })
    }

    /// Squared error of each trial, averaged over its steps.
    pub(super) fn squared_errors(&self, part: Part) -> Vec<f64> {
        self.series(part).map(|s| mean(s)).collect()
    }

    /// Time-averaged RMSE: the root of the mean over trials and steps.
    fn averaged(&self, part: Part) -> Estimate {
        self.squared_errors(part).into_iter().collect::<Moments>().root_mean()
    }

    fn rate(&self) -> Estimate {
        self.records
            .iter()
            .map(|r| mean(&r.sent))
            .collect::<Moments>()
            .estimate()
    }

    fn consistency(&self) -> Option<Estimate> {
        let of = |r: &Record| (!r.consistency.is_empty()).then(|| mean(&r.consistency));
        let values: Option<Vec<f64>> = self.records.iter().map(of).collect();
        values.map(|v| v.into_iter().collect::<Moments>().estimate())
    }
}

/// One row a step and scheme.
pub(super) fn step_table(ensembles: &[Ensemble]) -> Result<Table, Error> {
    let mut table = Table::new([
        column("k", "", "time step"),
        column("scheme", "", "what is sent and how silence is heard"),
        column("l", "messages/step", "message budget"),
        column("pos_rmse_m", "m", "root mean squared position error"),
        column("pos_se", "m", "its standard error"),
        column("vel_rmse_mps", "m/s", "root mean squared velocity error"),
        column("vel_se", "m/s", "its standard error"),
        column("lbar_k", "messages", "mean number of messages in this step"),
        column("lbar_se", "messages", "its standard error"),
        column("trials", "", "number of trials"),
    ]);
    for ensemble in ensembles {
        let steps = ensemble.records.first().map_or(0, |r| r.position.len());
        for k in 0..steps {
            let at = |part: Part| ensemble.series(part).map(|s| s[k]).collect::<Moments>().root_mean();
            let (position, velocity) = (at(Part::Position), at(Part::Velocity));
            let sent = ensemble
                .records
                .iter()
                .map(|r| r.sent[k])
                .collect::<Moments>()
                .estimate();
            table.push(row![
                (k + 1) as u64,
                ensemble.scheme.clone(),
                ensemble.messages,
                position.value,
                position.standard_error,
                velocity.value,
                velocity.standard_error,
                sent.value,
                sent.standard_error,
                ensemble.records.len() as u64
            ])?;
        }
    }
    Ok(table)
}

/// One row a scheme: averages over trials and steps.
pub(super) fn summary_table(ensembles: &[Ensemble]) -> Result<Table, Error> {
    let mut table = Table::new([
        column("scheme", "", "what is sent and how silence is heard"),
        column("l", "messages/step", "message budget"),
        column("pos_armse_m", "m", "root mean squared position error over trials and steps"),
        column("pos_se", "m", "its standard error"),
        column("vel_armse_mps", "m/s", "root mean squared velocity error over trials and steps"),
        column("vel_se", "m/s", "its standard error"),
        column("lbar", "messages/step", "mean number of messages a step"),
        column("lbar_se", "messages/step", "its standard error"),
        column("nees", "", "squared position error over its variance under the belief, 1 if consistent"),
        column("trials", "", "number of trials"),
    ]);
    for ensemble in ensembles {
        let (position, velocity) = (ensemble.averaged(Part::Position), ensemble.averaged(Part::Velocity));
        let rate = ensemble.rate();
        table.push(row![
            ensemble.scheme.clone(),
            ensemble.messages,
            position.value,
            position.standard_error,
            velocity.value,
            velocity.standard_error,
            rate.value,
            rate.standard_error,
            ensemble.consistency().map(|c| c.value),
            ensemble.records.len() as u64
        ])?;
    }
    Ok(table)
}

/// One row a pair of schemes on the same trials: the mean difference of their squared errors.
pub(super) fn paired_table(pairs: &[(&Ensemble, &Ensemble)]) -> Result<Table, Error> {
    let mut table = Table::new([
        column("first", "", "scheme"),
        column("second", "", "scheme it is compared with, on the same truth, noise and draws"),
        column("l", "messages/step", "message budget"),
        column("pos_mse_difference_m2", "m^2", "mean squared position error of the first minus that of the second"),
        column("pos_se", "m^2", "its paired standard error"),
        column("vel_mse_difference", "m^2/s^2", "the same for the velocity"),
        column("vel_se", "m^2/s^2", "its paired standard error"),
        column("trials", "", "number of trials"),
    ]);
    for (first, second) in pairs {
        let difference = |part| paired_difference(&first.squared_errors(part), &second.squared_errors(part));
        let (position, velocity) = (difference(Part::Position)?, difference(Part::Velocity)?);
        table.push(row![
            first.scheme.clone(),
            second.scheme.clone(),
            first.messages,
            position.mean(),
            position.standard_error(),
            velocity.mean(),
            velocity.standard_error(),
            position.count()
        ])?;
    }
    Ok(table)
}

/// The ensemble of a scheme and budget.
pub(super) fn find<'a>(ensembles: &'a [Ensemble], scheme: &str, messages: f64) -> Result<&'a Ensemble, Error> {
    ensembles
        .iter()
        .find(|e| e.scheme == scheme && e.messages == messages)
        .ok_or_else(|| Error::Table(format!("no run of `{scheme}` at {messages} messages")))
}

/// Reference values of an independent program, with their standard errors.
const REFERENCE: &str = include_str!("reference.csv");

/// Claims that one row of a summary table agrees with a reference run: `4 sqrt(se^2 + se^2)`, plus `slack` of the RMSE where
/// another estimator was used there, plus 0.01 (`rate_slack`) for the rate.
pub(super) fn agrees(
    summary: &Table,
    scheme: &str,
    messages: f64,
    reference: &str,
    slack: f64,
    rate_slack: f64,
) -> Result<Vec<Claim>, Error> {
    let missing = || Error::Table(format!("no reference `{reference}`"));
    let line = REFERENCE
        .lines()
        .find_map(|line| line.strip_prefix(reference)?.strip_prefix(','))
        .ok_or_else(missing)?;
    let fields: Vec<Option<f64>> = line.split(',').map(|f| f.parse().ok()).collect();
    let own = summary.only("scheme", scheme)?.only("l", messages)?;
    let of = |name: &str| -> Result<f64, Error> { own.numbers(name)?.first().copied().ok_or_else(missing) };
    let mut claims = Vec::new();
    for (index, (what, name, se)) in [
        ("position", "pos_armse_m", "pos_se"),
        ("velocity", "vel_armse_mps", "vel_se"),
        ("rate", "lbar", "lbar_se"),
    ]
    .into_iter()
    .enumerate()
    {
        if let (Some(Some(expected)), Some(Some(error))) = (fields.get(2 * index), fields.get(2 * index + 1)) {
            let relative = if index == 2 { rate_slack } else { slack * expected };
            let tolerance = 4.0 * error.hypot(of(se)?) + relative;
            let statement = format!("{what} of {scheme} at l = {messages} is that of the independent run {reference}");
            claims.push(
                Claim::near(
                    format!("ref-{}-{what}", reference.replace('/', "-")),
                    statement,
                    of(name)?,
                    *expected,
                    tolerance,
                )
                .at_defaults(),
            );
        }
    }
    Ok(claims)
}

/// Claim that, in squared position error, `first` beats `second` by at least three paired standard errors.
pub(super) fn beats(paired: &Table, first: &str, second: &str, messages: f64, part: Part) -> Result<Claim, Error> {
    let rows = paired
        .only("first", first)?
        .only("second", second)?
        .only("l", messages)?;
    let (difference, error, what) = match part {
        Part::Position => ("pos_mse_difference_m2", "pos_se", "position"),
        Part::Velocity => ("vel_mse_difference", "vel_se", "velocity"),
    };
    let at = |name: &str| -> Result<f64, Error> {
        rows.numbers(name)?
            .first()
            .copied()
            .ok_or_else(|| Error::Table(format!("no pair {first}, {second}")))
    };
    Ok(Claim::below(
        format!("{first}-beats-{second}-{what}-l{messages}"),
        format!("{first} has the smaller {what} error than {second} at l = {messages} (paired difference in standard errors)"),
        at(difference)? / at(error)?,
        -3.0,
    )
    .at_defaults())
}

/// Claim that at every step the schemes are in this order, smallest RMSE first, beyond `sigmas` standard errors of a violation.
pub(super) fn ordered_at_every_step(
    steps: &Table,
    schemes: &[&str],
    messages: f64,
    column: &str,
    error: &str,
) -> Result<Claim, Error> {
    let at_budget = steps.only("l", messages)?;
    let mut violations = 0;
    for pair in schemes.windows(2) {
        let (low, high) = (at_budget.only("scheme", pair[0])?, at_budget.only("scheme", pair[1])?);
        let (a, b, ea, eb) = (low.numbers(column)?, high.numbers(column)?, low.numbers(error)?, high.numbers(error)?);
        violations += (0..a.len())
            .filter(|k| a[*k] > b[*k] + 2.0 * ea[*k].hypot(eb[*k]))
            .count();
    }
    Ok(Claim::never(
        format!("order-{column}-l{messages}"),
        format!("at every step {} in {column} (violations beyond two standard errors)", schemes.join(" < ")),
        violations,
    )
    .at_defaults())
}

/// A number of the summary table.
pub(super) fn value(summary: &Table, scheme: &str, messages: f64, name: &str) -> Result<f64, Error> {
    summary
        .only("scheme", scheme)?
        .only("l", messages)?
        .numbers(name)?
        .first()
        .copied()
        .ok_or_else(|| Error::Table(format!("no summary of {scheme} at {messages}")))
}
