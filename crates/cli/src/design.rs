//! `fewbits design`: quantizers of few bits for one unknown that several sensors measure.

use crate::Ending;
use crate::arguments::TableOptions;
use crate::design_options::{Criterion, DesignOptions, Form};
use crate::error::Error;
use crate::input::Table;
use crate::numbers::mean_and_deviation;
use crate::output;
use crate::plot::{Layer, Picture};
use crate::say::say;
use fewbits_core::Link;

use fewbits_quantizer_design::solve::Rounded;
use fewbits_quantizer_design::{
    Adc, AllowedCells, BitBudget, Noise, ObservationModel, Prior, Progress, Request, Solution,
};
use fewbits_record::TimeBase;
use indicatif::{ProgressBar, ProgressStyle};
use std::fmt::Write;
use std::time::Duration;

const PRIOR: &str =
    "`20±4`, `uniform:0..40`, or `discrete:0,10` (values, each with `@` and its probability, or with equal ones)";
const BITS: &str = "`3`, one number per sensor as `3,1`, or `total:8`";
const ADC: &str = "bits and range, as `12:0..40`";
const PROBABILITY: &str = "one probability for all sensors, or one per sensor";

/// Reads the sample of the unknown.
fn sample(options: &DesignOptions, file: &str) -> Result<Prior, Error> {
    let mut table = Table::open(&TableOptions {
        file: file.to_owned(),
        time: None,
        time_column: None,
        columns: options.column.iter().cloned().collect(),
        delimiter: options.delimiter,
    })?;
    if table.names.len() != 1 {
        let names = table.names.join(", ");
        let problem = format!("columns {names}: name the one of the sample with --column");
        return Err(Error::content(table.file(), problem));
    }
    let mut values = Vec::new();
    while let Some((_, cells)) = table.next(TimeBase::Numbered)? {
        values.extend(cells.into_iter().flatten().filter(|value| value.is_finite()));
    }
    if values.is_empty() {
        return Err(Error::empty(table.file(), "numbers in the column of the sample"));
    }
    let prior = Prior::sample(&values).map_err(Error::refused("the sample cannot be a prior"))?;
    if let Some(fit) = prior.sample_fit() {
        say!(
            "sample of {}: mean {:.6} ({:.2e}), deviation {:.6} ({:.2e}; standard errors)",
            values.len(),
            prior.mean(),
            fit.mean_standard_error,
            prior.deviation(),
            fit.deviation_standard_error
        );
    }
    Ok(prior)
}

/// Parses an interval: two numbers with `..` between them.
fn interval(option: &'static str, whole: &str, text: &str, expected: &'static str) -> Result<(f64, f64), Error> {
    let ends = text
        .split_once("..")
        .and_then(|(low, high)| Some((low.trim().parse().ok()?, high.trim().parse().ok()?)));
    ends.ok_or_else(|| Error::option(option, whole, expected))
}

fn prior(text: &str) -> Result<Prior, Error> {
    let refused = || Error::option("--prior", text, PRIOR);
    let prior = if let Some(ends) = text.strip_prefix("uniform:") {
        let (low, high) = interval("--prior", text, ends, PRIOR)?;
        Prior::uniform(low, high)
    } else if let Some(values) = text.strip_prefix("discrete:") {
        let count = values.split(',').count() as f64;
        let parse = |part: &str| {
            let (value, probability) = part.split_once('@').unwrap_or((part, ""));
            let probability = match probability {
                "" => 1.0 / count,
                text => text.trim().parse().ok()?,
            };
            Some((value.trim().parse::<f64>().ok()?, probability))
        };
        let pairs: Option<Vec<(f64, f64)>> = values.split(',').map(parse).collect();
        let (values, probabilities) = pairs.ok_or_else(refused)?.into_iter().unzip();
        Prior::discrete(values, probabilities)
    } else if text.contains('±') || text.contains("+-") {
        let (mean, deviation) = mean_and_deviation("--prior", text)?;
        Prior::normal(mean, deviation)
    } else {
        return Err(refused());
    };
    prior.map_err(Error::refused("--prior"))
}

fn bits(text: &str) -> Result<BitBudget, Error> {
    let refused = || Error::option("--bits", text, BITS);
    let number = |text: &str| text.trim().parse::<u32>().map_err(|_| refused());
    Ok(match text.strip_prefix("total:") {
        Some(total) => BitBudget::Total(number(total)?),
        None if text.contains(',') => BitBudget::PerSensor(text.split(',').map(number).collect::<Result<_, _>>()?),
        None => BitBudget::Each(number(text)?),
    })
}

/// The model of each sensor's link.
fn links(options: &DesignOptions) -> Result<Vec<Link>, Error> {
    let sensors = options.noise.len();
    let of = |option: &'static str, all: &[f64], sensor: usize| match all {
        [] => Ok(0.0),
        [one] => Ok(*one),
        all if all.len() == sensors => Ok(all[sensor]),
        all => Err(Error::option(option, &format!("{} numbers", all.len()), PROBABILITY)),
    };
    let link = |sensor: usize| {
        let (loss, flips) = (of("--loss", &options.loss, sensor)?, of("--flips", &options.flips, sensor)?);
        let erasures = of("--erasures", &options.erasures, sensor)?;
        let link = Link::new(loss, flips).and_then(|link| link.with_erasure(erasures));
        link.map_err(Error::refused("--loss, --flips and --erasures make no link"))
    };
    (0..sensors).map(link).collect()
}

fn adc(text: &str) -> Result<Adc, Error> {
    let refused = || Error::option("--adc", text, ADC);
    let (bits, range) = text.split_once(':').ok_or_else(refused)?;
    let (low, high) = interval("--adc", text, range, ADC)?;
    Adc::new(bits.trim().parse().map_err(|_| refused())?, low..=high).map_err(Error::refused("--adc"))
}

/// Searches for the design, with a progress bar on a terminal.
fn solve(options: &DesignOptions, model: ObservationModel) -> Result<Solution, Error> {
    let failed = Error::refused("no design");
    let link = Link::PERFECT;
    let bits = bits(&options.bits)?;
    let mut request = match options.criterion {
        Criterion::Decision => Request::detection(model, bits, link).map_err(&failed)?,
        Criterion::Error => Request::estimation(model, bits, link),
        Criterion::Information => Request::estimation(model, bits, link).by_information(),
    };
    request = request.with_links(links(options)?).map_err(&failed)?;
    if options.folded {
        request = request.with_cells(AllowedCells::Any);
    }
    if let Some(limit) = options.time_limit {
        request = request.with_time_limit(limit);
    }
    // The bar hides itself if standard error is not a terminal.
    let bar = ProgressBar::new(1);
    let style = ProgressStyle::with_template("{bar:30} {msg} {elapsed}");
    bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.enable_steady_tick(Duration::from_millis(200));
    let mut show = |progress: Progress| {
        bar.set_length(progress.parts as u64);
        bar.set_position(progress.done as u64);
        bar.set_message(format!("{:?}", progress.stage));
    };
    let solutions = request.with_progress(&mut show).run().map_err(&failed)?;
    bar.finish_and_clear();
    if solutions.is_cut_short {
        say!("--time-limit ended the search: this is the best design so far");
    }
    Ok(solutions.best().clone())
}

/// Runs the task.
pub(crate) fn run(options: &DesignOptions) -> Result<Ending, Error> {
    let prior = match (&options.file, &options.prior) {
        (Some(file), _) => sample(options, file)?,
        (None, Some(text)) => prior(text)?,
        (None, None) => {
            return Err(Error::Needed {
                option: "a FILE or --prior",
                reason: "a sample of the unknown, or what is known of it",
            });
        }
    };
    let noise = if options.correlation == 0.0 {
        Noise::independent_with_deviations(&options.noise)
    } else {
        Noise::equicorrelated_with_deviations(&options.noise, options.correlation)
    };
    let model = ObservationModel::new(prior, noise.map_err(Error::refused("--noise and --correlation"))?);
    let model = model.map_err(Error::refused("prior and noise do not go together"))?;
    let adc = options.adc.as_deref().map(adc).transpose()?;
    let solution = solve(options, model)?;
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
            let _ = writeln!(text, "before rounding to the converter: {:.9}", solution.value);
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
