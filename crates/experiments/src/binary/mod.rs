//! Binary distributed quantization: figures and tables.
//!
//! Everything here is exact: no figure of this system draws a random number.

pub(crate) mod crlb;
pub(crate) mod decoders;
pub(crate) mod feedback;
pub(crate) mod gaussian;
pub(crate) mod optimum;
pub(crate) mod patterns;
pub(crate) mod table5_1;
pub(crate) mod table5_2;

use crate::prelude::*;
use fewbits_baselines::binary_patterns::printed_gaussian_cells;
use fewbits_binary_patterns::search::{Descent, LinearSearch};
use fewbits_binary_patterns::{Bank, Mask, Pattern, Source, linear_pattern, rank, uniform_cells};
use fewbits_quantizers::Quantizer;

/// Axis of the curves.
const ERROR: &str = "mean squared error / V²";

/// Variance of the thesis's Gaussian source.
const GAUSSIAN_VARIANCE: f64 = 0.1;

/// A source, its grid and the noise at one signal-to-noise ratio.
#[derive(Clone)]
struct Scene {
    source: Source,
    grid: Quantizer,
    noise: f64,
}

impl Scene {
    /// Uniform on `[-1, 1]` over `2^bits` cells.
    fn uniform(bits: usize, snr_db: f64) -> Result<Self, Error> {
        let source = Source::uniform(1.0)?;
        let grid = uniform_cells(1.0, bits)?;
        Self::new(source, grid, snr_db)
    }

    /// Gaussian of variance 0.1 over the eight cells with the printed Lloyd-Max edges.
    fn gaussian(snr_db: f64) -> Result<Self, Error> {
        let std = GAUSSIAN_VARIANCE.sqrt();
        let source = Source::gaussian_with_deviation(std)?;
        let grid = printed_gaussian_cells(std)?;
        Self::new(source, grid, snr_db)
    }

    fn new(source: Source, grid: Quantizer, snr_db: f64) -> Result<Self, Error> {
        let noise = source.noise_deviation(snr_db)?;
        Ok(Self { source, grid, noise })
    }

    fn search(&self, sensors: usize) -> Result<LinearSearch, Error> {
        Ok(LinearSearch::with_deviation(self.source, self.grid.clone(), self.noise, sensors)?)
    }

    fn bank(&self, masks: &[Mask]) -> Result<Bank, Error> {
        Ok(self.search(masks.len())?.bank(masks)?)
    }

    fn pattern_bank(&self, patterns: &[Pattern]) -> Result<Bank, Error> {
        let quantizers = patterns.iter().map(|p| p.on(&self.grid)).collect::<Result<_, _>>()?;
        Ok(Bank::homogeneous_with_deviation(self.source, quantizers, self.noise)?)
    }

    /// Exact error of the posterior mean.
    fn mmse(&self, masks: &[Mask]) -> Result<f64, Error> {
        Ok(self.bank(masks)?.mmse()?)
    }
}

/// Parameters of a sweep over signal-to-noise ratios behind the figure's own, and what else is refused.
macro_rules! swept {
    ($from:literal to $to:literal $(=> quick $last:literal)?, step $step:literal => quick $quick:literal,
        { $($own:tt)* } $(check $check:expr)?) => {
        parameters! {
            pub struct Parameters {
                $($own)*
                from_db: f64 [-60.0..=60.0] = $from => "First signal-to-noise ratio, dB.",
                to_db: f64 [-60.0..=60.0] = $to $(=> quick $last)? => "Last signal-to-noise ratio, dB.",
                step_db: f64 [0.01..=60.0] = $step => quick $quick => "Step, dB.",
            }
            check |p| {
                accept("to_db", p.to_db >= p.from_db, || format!("lower than from_db, {}", p.from_db))?;
                $(let own: fn(&Parameters) -> Result<(), Refusal> = $check;
                own(p)?;)?
                Ok(())
            };
        }
    };
}
use swept;

/// `from, from + step, ..., to`.
fn sweep(from: f64, to: f64, step: f64) -> Vec<f64> {
    let last = ((to - from) / step + 1e-9) as usize;
    (0..=last).map(|i| from + step * i as f64).collect()
}

/// Computes one result a sweep point, in parallel and in order.
fn each<T: Send>(points: &[f64], f: impl Fn(f64) -> Result<T, Error> + Sync) -> Result<Vec<T>, Error> {
    parallel::try_map(points, |&point| f(point))
}

/// Where `f` changes sign between `low` and `high`, to `1e-8`.
fn crossing(mut low: f64, mut high: f64, f: impl Fn(f64) -> Result<f64, Error>) -> Result<f64, Error> {
    let sign = f(low)?.signum();
    if f(high)?.signum() == sign {
        return Err(Error::failed(format_args!("no crossing between {low} and {high}")));
    }
    while high - low > 1e-8 {
        let middle = 0.5 * (low + high);
        if f(middle)?.signum() == sign {
            low = middle;
        } else {
            high = middle;
        }
    }
    Ok(0.5 * (low + high))
}

/// The best masks of full rank that a descent from these and `extra` scattered starts finds, and their error.
fn descent_from(
    scene: &Scene,
    bits: usize,
    sensors: usize,
    starts: &[Vec<Mask>],
    extra: usize,
) -> Result<(Vec<Mask>, f64), Error> {
    let on_grid = |mask| Ok::<_, Error>(pattern(mask, bits)?.on(&scene.grid)?);
    let candidates = (1..1 << bits).map(on_grid).collect::<Result<_, _>>()?;
    let descent = Descent::with_deviations(scene.source, vec![scene.noise; sensors], candidates)?;
    let places = |masks: &Vec<Mask>| masks.iter().map(|&m| m as usize - 1).collect::<Vec<_>>();
    let masks = |choice: &[usize]| choice.iter().map(|&c| c as Mask + 1).collect::<Vec<_>>();
    let starts: Vec<_> = starts.iter().map(places).collect();
    let found = descent.run(&starts, extra, |choice| rank(&masks(choice)) == bits)?;
    let mut best = masks(&found.choice);
    best.sort_unstable();
    Ok((best, found.mse))
}

/// The pattern of a mask.
fn pattern(mask: Mask, bits: usize) -> Result<Pattern, Error> {
    Ok(linear_pattern(mask, bits)?)
}

/// A picture of patterns: a row each, dark where the bit is 1, light where it is 0, over the cells of the unit grid.
fn pattern_panel(title: impl Into<String>, rows: &[(String, Pattern)]) -> Panel {
    let cells = rows.iter().map(|r| r.1.cells()).max().unwrap_or(1);
    let middle = |row: usize| (rows.len() - row) as f64;
    // Left edge and middle of each cell, and its bit.
    let bits = || {
        let places = rows.iter().enumerate();
        places.flat_map(|(row, (_, pattern))| {
            let cells = (0..).map(f64::from).zip(pattern.bits());
            cells.map(move |(cell, &bit)| (cell + 0.5, middle(row), bit))
        })
    };
    let boxes = |value: bool| {
        let cell = |(left, middle, _)| (left + 0.03, left + 0.97, middle - 0.36, middle + 0.36);
        bits().filter(|(.., bit)| *bit == value).map(cell).collect()
    };
    let digits = bits().map(|(left, middle, bit)| (left + 0.5, middle, u8::from(bit).to_string()));
    let names = (0..).zip(rows).map(|(row, (name, _))| (middle(row), name.clone()));
    let x = Axis::linear("cell of the measurement").between(0.4, cells as f64 + 0.6);
    Panel::new(title, x, Axis::linear("").between(0.4, rows.len() as f64 + 0.6).named(names))
        .with(Layer::boxes("", boxes(false)).coloured(5))
        .with(Layer::boxes("", boxes(true)).coloured(4))
        .with(Layer::texts(digits.collect()).coloured(6))
        .without_legend()
}
