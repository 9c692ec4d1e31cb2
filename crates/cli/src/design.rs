//! `fewbits design`: quantizers of few bits for one unknown that several sensors measure.

use crate::Ending;
use crate::arguments::{DialectOptions, TableOptions};
use crate::design_options::{Criterion, DesignOptions, Form};
use crate::error::Error;
use crate::input::Table;
use crate::numbers::{column, short};
use crate::output;
use crate::plot::{Layer, Picture};
use crate::say::say;
use crate::track::calibration;
use fewbits_quantizer_design::solve::Rounded;
use fewbits_quantizer_design::{AllowedCells, Prior, Progress, Solution};
use fewbits_recipes::{self as recipe, design};
use fewbits_record::TimeBase;
use fewbits_tracking::CalibratedSensor;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::ops::ControlFlow;
use std::time::Duration;

/// The option of a setting.
fn option(error: recipe::Error) -> Error {
    let names = [
        ("prior", "--prior"),
        ("bits", "--bits"),
        ("adc", "--adc"),
        ("loss", "--loss"),
        ("flips", "--flips"),
        ("erasures", "--erasures"),
    ];
    match error {
        recipe::Error::Setting {
            setting,
            value,
            expected,
        } => {
            let name = names.iter().find(|(known, _)| *known == setting);
            Error::option(name.map_or(setting, |(_, name)| name), &value, expected)
        }
        recipe::Error::Refused { what, source } => Error::Refused { what, source },
        error => Error::refused("the design")(error),
    }
}

/// Ranges in which angles are written: the lower end and the period.
const CIRCLES: [(f64, f64); 4] = [
    (0.0, 360.0),
    (-180.0, 360.0),
    (0.0, std::f64::consts::TAU),
    (-std::f64::consts::PI, std::f64::consts::TAU),
];
/// Share of such a range at either end in which angles lie, and share of the values there, at least.
const END: f64 = 0.05;
const AT_END: f64 = 0.01;
/// Values of which this is told, at least.
const FEWEST: usize = 30;

/// The range and period of values that may be angles, since they reach both of its ends, and what to add so that the widest gap between two is at the ends.
fn angles(values: &[f64]) -> Option<(f64, f64, f64)> {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let (least, most) = (*sorted.first()?, *sorted.last()?);
    let needed = (AT_END * sorted.len() as f64).max(2.0);
    let is_at_ends = |(low, period): &&(f64, f64)| {
        let below = sorted.partition_point(|one| *one < low + END * period);
        let above = sorted.len() - sorted.partition_point(|one| *one <= low + (1.0 - END) * period);
        least >= *low && most <= low + period && (below.min(above) as f64) >= needed
    };
    let (low, period) = *CIRCLES.iter().find(is_at_ends).filter(|_| sorted.len() >= FEWEST)?;
    let widest = sorted
        .windows(2)
        .max_by(|one, other| (one[1] - one[0]).total_cmp(&(other[1] - other[0])))?;
    Some((low, period, low + period - 0.5 * (widest[0] + widest[1])))
}

/// Reads the sample of the unknown.
fn sample(options: &DesignOptions, file: &str) -> Result<Prior, Error> {
    let mut table = Table::open(&TableOptions {
        file: file.to_owned(),
        columns: options.column.iter().cloned().collect(),
        dialect: DialectOptions {
            delimiter: options.delimiter.clone(),
            ..DialectOptions::default()
        },
        ..TableOptions::default()
    })?;
    if table.names.len() != 1 {
        let names = table.names.join(", ");
        let problem = format!("columns {names}: name the one of the sample with --column");
        return Err(Error::content(table.file(), problem));
    }
    table.require_numbers(|_| true)?;
    let mut values = Vec::new();
    while let Some((_, cells)) = table.next(TimeBase::Numbered)? {
        values.extend(cells.into_iter().flatten().filter(|value| value.is_finite()));
    }
    if values.is_empty() {
        return Err(Error::empty(table.file(), "numbers in the column of the sample"));
    }
    if let Some((low, period, turn)) = angles(&values) {
        say!(
            "the sample reaches both ends of {} to {}: if these are angles, values of both ends are far apart to a design. Turn them first, and each \
             measurement: add {} and take the remainder by {}",
            short(low),
            short(low + period),
            short(turn),
            short(period)
        );
    }
    let prior = design::prior_of(&values).map_err(option)?;
    if let Some(fit) = prior.sample_fit() {
        say!(
            "sample of {}: mean {} ({:.2e}), deviation {} ({:.2e}; standard errors)",
            values.len(),
            column(prior.mean()),
            fit.mean_standard_error,
            column(prior.deviation()),
            fit.deviation_standard_error
        );
    }
    if let Some((points, _)) = prior.points() {
        say!("sample of {}: {} different values, taken as points of mass", values.len(), points.len());
    }
    Ok(prior)
}

/// Searches for the design, with a progress bar on a terminal.
fn solve(options: &DesignOptions, prior: Prior) -> Result<Solution, Error> {
    let links = design::links(options.noise.len(), &options.loss, &options.flips, &options.erasures);
    let task = design::Task {
        prior,
        deviations: options.noise.clone(),
        correlation: options.correlation,
        bits: design::bits(&options.bits).map_err(option)?,
        links: links.map_err(option)?,
        criterion: match options.criterion {
            Criterion::Error => design::Criterion::Error,
            Criterion::Information => design::Criterion::Information,
            Criterion::Decision => design::Criterion::Decision,
        },
        cells: match options.folded {
            true => AllowedCells::Any,
            false => AllowedCells::Intervals,
        },
        time_limit: options.time_limit,
    };
    // The bar hides itself if standard error is not a terminal.
    let bar = ProgressBar::new(1);
    let style = ProgressStyle::with_template("{bar:30} {msg} {elapsed}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut show = |progress: Progress| {
        bar.set_length(progress.parts as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("{:?}", progress.stage));
        ControlFlow::Continue(())
    };
    let solutions = task.search(&mut show).map_err(option)?;
    bar.finish_and_clear();
    if solutions.is_cut_short {
        say!("--time-limit ended the search: this is the best design so far");
    }
    Ok(solutions.best().clone())
}

/// The options with what the file of `--settings` says where they say nothing.
fn applied(options: &DesignOptions) -> Result<DesignOptions, Error> {
    let mut options = options.clone();
    let Some(path) = &options.settings else {
        return Ok(options);
    };
    let found = calibration::read(path)?;
    if options.noise.is_empty() {
        options.noise = found.sensors.iter().map(CalibratedSensor::noise).collect();
        for (number, sensor) in found.sensors.iter().enumerate() {
            let model = &sensor.model;
            let reads = match sensor.threshold {
                // Its bits are designed, not those that it sent.
                Some(_) => "the level".to_owned(),
                None => format!("{} + {} times the level", short(model.bias), short(model.gain)),
            };
            say!(
                "sensor {number}: {}, noise {} in the unit of the level; it reads {reads}",
                sensor.name,
                short(sensor.noise())
            );
        }
        for (one, other, value, _) in &found.correlations {
            say!(
                "the noises of {one} and {other} have a correlation of {}: --correlation takes one of all pairs",
                short(*value)
            );
        }
    }
    if options.file.is_none() && options.prior.is_none() {
        options.prior = found.prior().map(|(mean, deviation)| format!("{mean}±{deviation}"));
        if options.prior.is_none() {
            return Err(Error::Needed {
                option: "a FILE or --prior",
                reason: "the level of --settings wanders, so that it has no prior of its own",
            });
        }
    }
    Ok(options)
}

/// Runs the task.
pub(crate) fn run(options: &DesignOptions) -> Result<Ending, Error> {
    let options = &applied(options)?;
    let prior = match (&options.file, &options.prior) {
        (Some(file), _) => sample(options, file)?,
        (None, Some(text)) => design::prior(text).map_err(option)?,
        (None, None) => {
            return Err(Error::Needed {
                option: "a FILE or --prior",
                reason: "a sample of the unknown, or what is known of it",
            });
        }
    };
    if options.noise.contains(&0.0) {
        say!("noise 0: {} is taken, which changes no design", short(design::negligible(&prior)));
    }
    let adc = options.adc.as_deref().map(design::adc).transpose().map_err(option)?;
    let solution = solve(options, prior)?;
    let rounded = adc
        .map(|adc| solution.rounded(&vec![adc; solution.sensors().len()]))
        .transpose()
        .map_err(Error::refused("--adc"))?;
    let text = written(options, &solution, rounded.as_ref())?;
    output::text(options.output.as_deref(), &text)?;
    if let Some(path) = &options.plot {
        let drawn = rounded.as_ref().map_or(&solution, |rounded| &rounded.solution);
        picture(drawn).save(path)?;
    }
    Ok(Ending::Good)
}

/// The design in the requested form.
fn written(options: &DesignOptions, solution: &Solution, rounded: Option<&Rounded>) -> Result<String, Error> {
    let form = if options.json { Form::Json } else { options.form };
    if form == Form::Table {
        let mut text = rounded.map_or(solution, |rounded| &rounded.solution).table();
        if let Some(rounded) = rounded {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "before rounding to the converter: {}", column(solution.value));
            for (sensor, codes) in rounded.solution.sensors().iter().zip(&rounded.thresholds) {
                let codes: Vec<String> = codes.iter().map(u32::to_string).collect();
                let _ = writeln!(text, "sensor {}: thresholds in codes {}", sensor.sensor, codes.join(", "));
            }
        }
        return Ok(text);
    }
    let failed = Error::refused("the design cannot be written");
    let export = match rounded {
        Some(rounded) => rounded.export(&options.name, options.decoder_bytes),
        None => solution.export(&options.name, options.decoder_bytes),
    };
    let export = export.map_err(&failed)?;
    Ok(match form {
        Form::Json => export.to_json().map_err(&failed)? + "\n",
        Form::Rust => export.to_rust(),
        _ => export.to_c_header(),
    })
}

/// A row of boxes per sensor over the range of its samples. Boxes of the same word have the same colour.
fn picture(solution: &Solution) -> Picture {
    let prior = solution.system().model().prior();
    let (mean, reach) = (prior.mean(), 3.5 * prior.deviation());
    let inner = solution.sensors().iter().flat_map(|sensor| sensor.breakpoints.iter());
    let (low, high) = inner.fold((mean - reach, mean + reach), |(low, high), at| (low.min(*at), high.max(*at)));
    let mut layers = Vec::new();
    for (row, sensor) in solution.sensors().iter().enumerate() {
        let height = -(row as f64);
        let mut edges = vec![low];
        edges.extend(&sensor.breakpoints);
        edges.push(high);
        for (edge, word) in edges.windows(2).zip(&sensor.words) {
            layers.push(Layer::Box {
                from: (edge[0], height - 0.4),
                to: (edge[1], height + 0.4),
                colour: *word,
                label: format!("{word:0width$b}", width = sensor.bits as usize),
            });
        }
    }
    Picture {
        title: format!("cells and words of {} sensors", solution.sensors().len()),
        x: "measurement".to_owned(),
        y: "sensor, counted downwards from 0".to_owned(),
        is_log: false,
        is_map: false,
        layers,
    }
}
