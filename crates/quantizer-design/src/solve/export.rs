//! Export of a design as JSON, as a C header and as Rust constants.

use super::adc::Rounded;
use super::additive::AdditiveDecoder;
use super::participant::SensorDesign;
use super::solution::Solution;
use crate::criterion::Criterion;
use crate::error::{Error, refuse};
use fewbits_numerics::error::entries;
use serde_json::json;

/// The JSON schema of [`Export::to_json`].
pub const JSON_SCHEMA: &str = include_str!("design.schema.json");

/// Bytes per number in a decoder's table.
const NUMBER_BYTES: usize = 8;

/// A design with its decoder, for export.
///
/// The decoder is a table over all joint symbols if that fits the memory limit, otherwise the best additive decoder.
#[derive(Debug, Clone, PartialEq)]
pub struct Export {
    name: String,
    solution: Solution,
    decoder: Decoder,
    /// Thresholds as codes of a converter, one list per sensor.
    codes: Option<Vec<Vec<u32>>>,
}

#[derive(Debug, Clone, PartialEq)]
enum Decoder {
    /// Posterior means and standard deviations; the first sensor's symbol varies slowest.
    Joint {
        means: Vec<f64>,
        deviations: Vec<f64>,
    },
    Additive(AdditiveDecoder),
}

impl Solution {
    /// The design with a decoder whose estimates take at most `max_bytes` bytes. The names of all constants and functions begin with
    /// `name`.
    ///
    /// # Errors
    /// If `name` is not an identifier of C; [`Error::TooLarge`] if even the additive decoder needs more memory.
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
            Error::at_most("decoder", needed as u64, max_bytes as u64)?;
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
                // An outcome of probability zero gets the prior mean and deviation.
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
    /// As [`Solution::export`], with thresholds as converter codes in addition to the breakpoints.
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
    /// As [`System::value`](crate::System::value).
    pub fn mean_squared_error(&self) -> Result<f64, Error> {
        match &self.decoder {
            Decoder::Joint { .. } => self.solution.system().value(Criterion::MeanSquaredError),
            Decoder::Additive(decoder) => Ok(decoder.mean_squared_error),
        }
    }

    /// The estimate from one symbol per sensor: the received word, or `2^bits` if the word is missing.
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

    /// The design as JSON, in the form of [`JSON_SCHEMA`].
    ///
    /// # Errors
    /// As [`System::value`](crate::System::value).
    pub fn to_json(&self) -> Result<String, Error> {
        let solution = &self.solution;
        let sensor = |(n, s): (usize, &SensorDesign)| {
            json!({
                "sensor": s.sensor,
                "bits": s.bits,
                "breakpoints": s.breakpoints,
                "words": s.words,
                "symbols": s.symbols(),
                "link": { "loss": s.link.loss(), "erasure": s.link.erasure(), "crossover": s.link.crossover() },
                "thresholds": self.codes.as_ref().map(|codes| &codes[n]),
            })
        };
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
        let document = json!({
            "schema": "fewbits-design-1",
            "name": self.name,
            "criterion": solution.criterion,
            "value": solution.value,
            "bound": solution.bound,
            "certificate": solution.certificate,
            "scope": solution.scope,
            "mean_squared_error": self.mean_squared_error()?,
            "sensors": solution.sensors().iter().enumerate().map(sensor).collect::<Vec<_>>(),
            "decoder": decoder,
        });
        Ok(format!("{document:#}\n"))
    }

    /// The design as a C99 header without includes: tables, an encoder per sensor and a decoder, all `static`.
    pub fn to_c_header(&self) -> String {
        let (name, upper) = (&self.name, self.name.to_uppercase());
        let sensors = self.solution.sensors();
        let mut text = format!(
            "/* Quantizers and decoder, designed by fewbits. Criterion {:?}: {:?}. */\n#ifndef {upper}_H\n#define {upper}_H\n\n\
             #define {upper}_SENSORS {}\n",
            self.solution.criterion,
            self.solution.value,
            sensors.len()
        );
        for (n, sensor) in sensors.iter().enumerate() {
            text += &self.c_encoders(n, sensor);
        }
        let order: Vec<String> = sensors.iter().map(|sensor| sensor.sensor.to_string()).collect();
        text += &format!(
            "\n/* symbols: the words received from sensors {}, in this order. A word that is missing is the number 2^bits, if the design has losses. */\n",
            order.join(", ")
        );
        let symbol = |n: usize| format!("(symbols[{n}] < {0} ? symbols[{n}] : {0})", sensors[n].symbols() - 1);
        let numbers = 0..sensors.len();
        let body = match &self.decoder {
            Decoder::Joint { means, .. } => {
                text += &c_array("double", &format!("{name}_means"), means);
                let next = |index: String, n: usize| format!("({index}) * {} + {}", sensors[n].symbols(), symbol(n));
                format!("    return {name}_means[{}];\n", numbers.fold(String::from("0"), next))
            }
            Decoder::Additive(decoder) => {
                for (n, weights) in decoder.weights.iter().enumerate() {
                    text += &c_array("double", &format!("{name}_weights_{n}"), weights);
                }
                let terms = numbers.map(|n| format!("    sum += {name}_weights_{n}[{}];\n", symbol(n)));
                format!("    double sum = {:?};\n{}    return sum;\n", decoder.offset, terms.collect::<String>())
            }
        };
        text += &c_function(
            "double",
            &format!("{name}_decode"),
            &format!("const unsigned symbols[{upper}_SENSORS]"),
            &body,
        );
        text + "\n#endif\n"
    }

    /// Tables and encoders of one sensor, for samples and, if there is a converter, for its codes.
    fn c_encoders(&self, n: usize, sensor: &SensorDesign) -> String {
        let (name, own, count) = (&self.name, sensor.sensor, sensor.breakpoints.len());
        let encoder = |function: &str, kind: &str, argument: &str, edges: &str| {
            let body = if count == 0 {
                // C has no empty arrays. A sensor behind a useless link may use only one word.
                format!("    (void){argument};\n    return {};\n", sensor.words[0])
            } else {
                format!(
                    "    unsigned cell = 0;\n    while (cell < {count} && {name}_{edges}_{own}[cell] <= {argument})\n        \
                     ++cell;\n    return {name}_words_{own}[cell];\n"
                )
            };
            c_function("unsigned", &format!("{name}_{function}_{own}"), &format!("{kind} {argument}"), &body)
        };
        let words = if count == 0 {
            "one word.".to_owned()
        } else {
            let rule = "A sample on a breakpoint belongs to the cell above it; NaN is word of cell 0.";
            format!("words of {} bits. {rule}", sensor.bits)
        };
        let mut text = format!("\n/* Sensor {}: {words} */\n", sensor.sensor);
        text += &c_array("double", &format!("{name}_breakpoints_{own}"), &sensor.breakpoints);
        if count > 0 {
            text += &c_array("unsigned short", &format!("{name}_words_{own}"), &sensor.words);
        }
        text += &encoder("encode", "double", "sample", "breakpoints");
        if let Some(codes) = &self.codes {
            text += &c_array("unsigned long", &format!("{name}_thresholds_{own}"), &codes[n]);
            text += &encoder("encode_code", "unsigned long", "code", "thresholds");
        }
        text
    }

    /// The design as constants of a Rust module that does not need the standard library. With `fewbits-node` the word of a sensor is
    /// `WORDS_0[cell_of(&BREAKPOINTS_0, sample)?]`, or the same with `THRESHOLDS_0` and the code of a converter.
    pub fn to_rust(&self) -> String {
        let mut text = String::from("// Quantizers and decoder, designed by fewbits.\n");
        for (n, s) in self.solution.sensors().iter().enumerate() {
            let own = s.sensor;
            let doc = "Breakpoints; a sample on one belongs to the cell above.";
            text += &rust_array(doc, &format!("BREAKPOINTS_{own}"), "f64", &s.breakpoints);
            text += &rust_array("Word of each cell.", &format!("WORDS_{own}"), "u16", &s.words);
            if let Some(codes) = &self.codes {
                text += &rust_array("Thresholds in codes.", &format!("THRESHOLDS_{own}"), "u32", &codes[n]);
            }
        }
        match &self.decoder {
            Decoder::Joint { means, .. } => {
                let doc = "Estimate for every joint symbol, the first sensor's slowest.";
                text += &rust_array(doc, "MEANS", "f64", means);
            }
            Decoder::Additive(decoder) => {
                text += &rust_array("Estimate before any symbol.", "OFFSET", "f64", &[decoder.offset]);
                for (n, weights) in decoder.weights.iter().enumerate() {
                    let doc = "What a symbol adds to the estimate.";
                    text += &rust_array(doc, &format!("WEIGHTS_{n}"), "f64", weights);
                }
            }
        }
        text
    }
}

/// A table in C; an empty string if it has no entries.
fn c_array<T: std::fmt::Debug>(kind: &str, name: &str, values: &[T]) -> String {
    if values.is_empty() {
        return String::new();
    }
    format!("static const {kind} {name}[{}] = {{{}}};\n", values.len(), list(values))
}

fn c_function(kind: &str, name: &str, argument: &str, body: &str) -> String {
    format!("static inline {kind} {name}({argument})\n{{\n{body}}}\n")
}

fn rust_array<T: std::fmt::Debug>(doc: &str, name: &str, kind: &str, values: &[T]) -> String {
    format!("/// {doc}\npub const {name}: [{kind}; {}] = [{}];\n", values.len(), list(values))
}

/// Numbers, printed so that they read back exactly.
fn list<T: std::fmt::Debug>(values: &[T]) -> String {
    values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ")
}
