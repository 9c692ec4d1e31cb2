//! A design as JSON, as a C header and as Rust constants.

use super::adc::Rounded;
use super::additive::AdditiveDecoder;
use super::solution::{SensorDesign, Solution};
use crate::error::{Error, refuse};
use fewbits_numerics::error::entries;
use serde_json::{Value, json};
use std::fmt::Write;

/// The JSON schema of [`Export::to_json`].
pub const JSON_SCHEMA: &str = include_str!("design.schema.json");

/// Bytes of a number in a decoder's table.
const NUMBER_BYTES: usize = 8;

/// A design with its decoder, ready to be written.
///
/// The decoder is a table over all joint symbols if that fits the memory limit, otherwise the best additive one.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    name: String,
    solution: Solution,
    decoder: Decoder,
    /// Thresholds in codes of a converter, one list per sensor.
    codes: Option<Vec<Vec<u32>>>,
}

#[derive(Debug, Clone, PartialEq)]
enum Decoder {
    /// Posterior means and standard deviations, the first sensor's symbol slowest.
    Joint {
        means: Vec<f64>,
        deviations: Vec<f64>,
    },
    Additive(AdditiveDecoder),
}

impl Solution {
    /// The design with a decoder whose estimates take at most `max_bytes`. `name` begins the names of all constants and functions.
    ///
    /// # Errors
    /// If `name` is no identifier of C; [`Error::TooLarge`] if not even the additive decoder fits.
    pub fn export(&self, name: &str, max_bytes: usize) -> Result<Export, Error> {
        let letters = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !name.chars().all(letters) || !name.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return refuse("name", name, "letters, digits and underscores, a letter first");
        }
        let shape: Vec<usize> = self.sensors().iter().map(SensorDesign::symbols).collect();
        let outcomes = shape.iter().fold(1usize, |n, s| n.saturating_mul(*s));
        let decoder = if outcomes.saturating_mul(NUMBER_BYTES) <= max_bytes {
            self.joint_decoder(&shape, outcomes)?
        } else {
            let needed = shape.iter().sum::<usize>() * NUMBER_BYTES;
            if needed > max_bytes {
                return Err(Error::TooLarge {
                    table: "decoder",
                    needed: needed as u64,
                    limit: max_bytes as u64,
                });
            }
            Decoder::Additive(self.additive_decoder()?)
        };
        Ok(Export {
            name: name.to_owned(),
            solution: self.clone(),
            decoder,
            codes: None,
        })
    }

    fn joint_decoder(&self, shape: &[usize], outcomes: usize) -> Result<Decoder, Error> {
        let decoder = self.decoder(outcomes)?;
        let model = self.system().model();
        let (mut means, mut deviations) = (Vec::with_capacity(outcomes), Vec::with_capacity(outcomes));
        let mut symbols = vec![0; shape.len()];
        for outcome in 0..outcomes {
            let mut rest = outcome;
            for (symbol, size) in symbols.iter_mut().zip(shape).rev() {
                *symbol = rest % size;
                rest /= size;
            }
            let (mean, variance) = match decoder.decode_symbols(&symbols) {
                Ok(estimate) => (estimate.mean, estimate.variance),
                // What cannot be received leaves the prior.
                Err(Error::ImpossibleOutcome) => (model.mean, model.variance),
                Err(error) => return Err(error),
            };
            means.push(mean);
            deviations.push(variance.sqrt());
        }
        Ok(Decoder::Joint { means, deviations })
    }
}

impl Rounded {
    /// As [`Solution::export`], with thresholds in codes beside the breakpoints.
    ///
    /// # Errors
    /// As [`Solution::export`].
    pub fn export(&self, name: &str, max_bytes: usize) -> Result<Export, Error> {
        Ok(Export {
            codes: Some(self.thresholds.clone()),
            ..self.solution.export(name, max_bytes)?
        })
    }
}

impl Export {
    /// Mean squared error with the decoder of this export.
    ///
    /// # Errors
    /// As [`Solution::mean_squared_error`].
    pub fn mean_squared_error(&self) -> Result<f64, Error> {
        match &self.decoder {
            Decoder::Joint { .. } => self.solution.mean_squared_error(),
            Decoder::Additive(decoder) => Ok(decoder.mean_squared_error),
        }
    }

    /// The estimate from one symbol per sensor: the received word, or `2^bits` for a word that is missing.
    ///
    /// # Errors
    /// If there is not one symbol per sensor, or a symbol is out of range.
    pub fn decode(&self, symbols: &[usize]) -> Result<f64, Error> {
        match &self.decoder {
            Decoder::Additive(decoder) => decoder.decode(symbols),
            Decoder::Joint { means, .. } => {
                let sensors = self.solution.sensors();
                entries("symbols", symbols.len(), sensors.len())?;
                let mut index = 0;
                for (sensor, symbol) in sensors.iter().zip(symbols) {
                    if *symbol >= sensor.symbols() {
                        return refuse("symbol", symbol, format!("a number below {}", sensor.symbols()));
                    }
                    index = index * sensor.symbols() + symbol;
                }
                Ok(means[index])
            }
        }
    }

    /// The design as JSON, of the form that [`JSON_SCHEMA`] says.
    ///
    /// # Errors
    /// As [`Solution::mean_squared_error`].
    pub fn to_json(&self) -> Result<String, Error> {
        let solution = &self.solution;
        let sensors: Vec<Value> = solution
            .sensors()
            .iter()
            .enumerate()
            .map(|(n, s)| {
                json!({
                    "sensor": s.sensor,
                    "bits": s.bits,
                    "breakpoints": s.breakpoints,
                    "words": s.words,
                    "symbols": s.symbols(),
                    "link": { "loss": s.link.loss(), "erasure": s.link.erasure(), "crossover": s.link.crossover() },
                    "thresholds": self.codes.as_ref().map(|codes| &codes[n]),
                })
            })
            .collect();
        let decoder = match &self.decoder {
            Decoder::Joint { means, deviations } => json!({
                "kind": "joint",
                "shape": solution.sensors().iter().map(SensorDesign::symbols).collect::<Vec<_>>(),
                "means": means,
                "deviations": deviations,
            }),
            Decoder::Additive(decoder) => {
                json!({ "kind": "additive", "offset": decoder.offset, "weights": decoder.weights })
            }
        };
        let bound = solution
            .bound()
            .map(|b| json!({ "value": b.value, "kind": format!("{:?}", b.kind) }));
        let document = json!({
            "schema": "fewbits-design-1",
            "name": self.name,
            "criterion": serde_json::to_value(solution.criterion()).unwrap_or(Value::Null),
            "value": solution.value(),
            "bound": bound,
            "certificate": serde_json::to_value(solution.certificate()).unwrap_or(Value::Null),
            "scope": serde_json::to_value(solution.scope()).unwrap_or(Value::Null),
            "mean_squared_error": self.mean_squared_error()?,
            "sensors": sensors,
            "decoder": decoder,
        });
        Ok(format!("{document:#}\n"))
    }

    /// The design as a C header: tables, an encoder per sensor and a decoder, all `static`, C99, no other header needed.
    pub fn to_c_header(&self) -> String {
        let (name, upper) = (&self.name, self.name.to_uppercase());
        let sensors = self.solution.sensors();
        let mut text = String::new();
        // Writing to a string cannot fail.
        let _ = write!(
            text,
            "/* Quantizers and decoder, designed by fewbits. Criterion {:?}: {:?}. */\n#ifndef {upper}_H\n#define {upper}_H\n\n\
             #define {upper}_SENSORS {}\n",
            self.solution.criterion(),
            self.solution.value(),
            sensors.len()
        );
        for (n, sensor) in sensors.iter().enumerate() {
            let breakpoints = sensor.breakpoints.len();
            if breakpoints == 0 {
                // C has no empty arrays. A sensor behind a useless link may send one word only.
                let _ = write!(
                    text,
                    "\n/* Sensor {}: one word. */\n\
                     static inline unsigned {name}_encode_{n}(double sample)\n{{\n    (void)sample;\n    return {};\n}}\n",
                    sensor.sensor, sensor.words[0],
                );
                if self.codes.is_some() {
                    let _ = write!(
                        text,
                        "static inline unsigned {name}_encode_code_{n}(unsigned long code)\n{{\n    (void)code;\n    \
                         return {};\n}}\n",
                        sensor.words[0],
                    );
                }
                continue;
            }
            let _ = write!(
                text,
                "\n/* Sensor {}: words of {} bits. A sample on a breakpoint belongs to the cell above it; NaN is word of cell 0. */\n\
                 static const double {name}_breakpoints_{n}[{breakpoints}] = {{{}}};\n\
                 static const unsigned short {name}_words_{n}[{}] = {{{}}};\n\
                 static inline unsigned {name}_encode_{n}(double sample)\n{{\n    unsigned cell = 0;\n    \
                 while (cell < {breakpoints} && {name}_breakpoints_{n}[cell] <= sample)\n        ++cell;\n    \
                 return {name}_words_{n}[cell];\n}}\n",
                sensor.sensor,
                sensor.bits,
                list(&sensor.breakpoints),
                sensor.words.len(),
                list(&sensor.words),
            );
            if let Some(codes) = self.codes.as_ref().map(|codes| &codes[n]) {
                let _ = write!(
                    text,
                    "static const unsigned long {name}_thresholds_{n}[{breakpoints}] = {{{}}};\n\
                     static inline unsigned {name}_encode_code_{n}(unsigned long code)\n{{\n    unsigned cell = 0;\n    \
                     while (cell < {breakpoints} && {name}_thresholds_{n}[cell] <= code)\n        ++cell;\n    \
                     return {name}_words_{n}[cell];\n}}\n",
                    list(codes),
                );
            }
        }
        let last = |s: &SensorDesign| s.symbols() - 1;
        let symbol = |n: usize, s: &SensorDesign| format!("(symbols[{n}] < {0} ? symbols[{n}] : {0})", last(s));
        let _ = write!(
            text,
            "\n/* symbols[n]: the word received from sensor n. A word that is missing is the number 2^bits, if the design has losses. */\n"
        );
        match &self.decoder {
            Decoder::Joint { means, .. } => {
                let index = sensors
                    .iter()
                    .enumerate()
                    .fold(String::from("0"), |index, (n, s)| format!("({index}) * {} + {}", s.symbols(), symbol(n, s)));
                let _ = write!(
                    text,
                    "static const double {name}_means[{}] = {{{}}};\n\
                     static inline double {name}_decode(const unsigned symbols[{upper}_SENSORS])\n{{\n    \
                     return {name}_means[{index}];\n}}\n",
                    means.len(),
                    list(means),
                );
            }
            Decoder::Additive(decoder) => {
                for (n, weights) in decoder.weights.iter().enumerate() {
                    let count = weights.len();
                    let _ = writeln!(text, "static const double {name}_weights_{n}[{count}] = {{{}}};", list(weights));
                }
                let _ = write!(
                    text,
                    "static inline double {name}_decode(const unsigned symbols[{upper}_SENSORS])\n{{\n    double sum = {:?};\n",
                    decoder.offset
                );
                for (n, s) in sensors.iter().enumerate() {
                    let _ = writeln!(text, "    sum += {name}_weights_{n}[{}];", symbol(n, s));
                }
                let _ = write!(text, "    return sum;\n}}\n");
            }
        }
        let _ = write!(text, "\n#endif\n");
        text
    }

    /// The design as constants of a Rust module without the standard library. With `fewbits-node` a sensor's word is
    /// `WORDS_0[cell_of(&BREAKPOINTS_0, sample)?]`, or that of `THRESHOLDS_0` for the code of a converter.
    pub fn to_rust(&self) -> String {
        let mut text = String::from("// Quantizers and decoder, designed by fewbits.\n");
        let mut constant = |doc: &str, name: String, kind: &str, count: usize, values: String| {
            // Writing to a string cannot fail.
            let _ = write!(text, "/// {doc}\npub const {name}: [{kind}; {count}] = [{values}];\n");
        };
        for (n, s) in self.solution.sensors().iter().enumerate() {
            let (b, w) = (&s.breakpoints, &s.words);
            constant(
                "Breakpoints; a sample on one belongs to the cell above.",
                format!("BREAKPOINTS_{n}"),
                "f64",
                b.len(),
                list(b),
            );
            constant("Word of each cell.", format!("WORDS_{n}"), "u16", w.len(), list(w));
            if let Some(codes) = self.codes.as_ref().map(|codes| &codes[n]) {
                constant("Thresholds in codes.", format!("THRESHOLDS_{n}"), "u32", codes.len(), list(codes));
            }
        }
        match &self.decoder {
            Decoder::Joint { means, .. } => {
                let doc = "Estimate for every joint symbol, the first sensor's slowest.";
                constant(doc, "MEANS".to_owned(), "f64", means.len(), list(means));
            }
            Decoder::Additive(decoder) => {
                constant("Estimate before any symbol.", "OFFSET".to_owned(), "f64", 1, format!("{:?}", decoder.offset));
                for (n, w) in decoder.weights.iter().enumerate() {
                    constant("What a symbol adds to the estimate.", format!("WEIGHTS_{n}"), "f64", w.len(), list(w));
                }
            }
        }
        text
    }
}

/// Numbers that read back as they were.
fn list<T: std::fmt::Debug>(values: &[T]) -> String {
    values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ")
}
