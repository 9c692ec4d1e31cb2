//! Quantizer design.

use crate::text;
use fewbits_core::Link;
use fewbits_quantizer_design::{BitBudget, Criterion, Noise, ObservationModel, Prior, Request};
use serde::{Deserialize, Serialize};
use std::time::Duration;
use wasm_bindgen::prelude::wasm_bindgen;

/// Seconds after which a design returns the best that it has.
const LIMIT: Duration = Duration::from_secs(20);

#[derive(Deserialize)]
struct Setting {
    mean: f64,
    deviation: f64,
    noise: Vec<f64>,
    bits: Vec<u32>,
    flips: f64,
    loss: f64,
    criterion: String,
}

#[derive(Serialize)]
struct Cell {
    sensor: usize,
    /// `null` is minus infinity.
    lower: Option<f64>,
    /// `null` is infinity.
    upper: Option<f64>,
    word: u64,
}

#[derive(Serialize)]
struct Found {
    cells: Vec<Cell>,
    value: f64,
    bound: Option<f64>,
    header: String,
}

/// Designs quantizers. Setting and result are JSON.
#[wasm_bindgen]
pub fn design(setting: &str) -> Result<String, String> {
    let setting: Setting = serde_json::from_str(setting).map_err(text)?;
    if setting.noise.len() != setting.bits.len() {
        return Err(format!(
            "{} noises and {} numbers of bits: expected one of each per sensor",
            setting.noise.len(),
            setting.bits.len()
        ));
    }
    let found = designed(&setting).map_err(text)?;
    serde_json::to_string(&found).map_err(text)
}

fn designed(setting: &Setting) -> Result<Found, fewbits_quantizer_design::Error> {
    let prior = Prior::normal(setting.mean, setting.deviation)?;
    let model = ObservationModel::new(prior, Noise::independent_with_deviations(&setting.noise)?)?;
    let link = Link::new(setting.loss, setting.flips)?;
    let mut request = Request {
        clock: crate::clock::browser,
        time_limit: Some(LIMIT),
        ..Request::estimation(model, BitBudget::PerSensor(setting.bits.clone()), link)
    };
    if setting.criterion == "information" {
        request.criterion = Criterion::MutualInformation;
    }
    let solutions = request.run()?;
    let solution = solutions.best();
    let cells = solution.sensors().iter().flat_map(|sensor| {
        let ends = &sensor.breakpoints;
        (0..=ends.len()).map(|k| Cell {
            sensor: sensor.sensor,
            lower: k.checked_sub(1).map(|k| ends[k]),
            upper: ends.get(k).copied(),
            word: sensor.words[k] as u64,
        })
    });
    Ok(Found {
        cells: cells.collect(),
        value: solution.value,
        bound: solution.bound.map(|bound| bound.value),
        header: solution.export("quantizers", 1 << 16)?.to_c_header(),
    })
}
