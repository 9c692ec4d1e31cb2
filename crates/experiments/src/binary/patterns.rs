//! `binary-fig5-2` to `binary-fig5-5` and `binary-figB-1`: the grid, its patterns, and what noise makes of one.

use super::{Scene, pattern, pattern_panel};
use crate::prelude::*;
use fewbits_binary_patterns::{BinaryQuantizer, Mask, Pattern, gray_basis, natural_basis, uniform_cells};
use fewbits_quantizers::Quantizer;

pub struct Clipping;

parameters! {
    pub struct ClippingParameters {
        bits: usize [1..=4] = 3 => "Bits of the cell index.",
        snr_db: f64 [-60.0..=60.0] = 18.2 => "Signal-to-noise ratio at which both readings are compared, dB.",
        masks: Vec<Mask> [1..=15; 1..=10] = vec![4, 6, 3, 3, 3, 3, 2, 2] => "Masks of the sensors that are compared, below 2^bits.",
    }
    check |p| fit("masks", &p.masks, p.bits);
}

/// Refuses masks of more digits than there are bits.
fn fit(name: &str, masks: &[Mask], bits: usize) -> Result<(), Refusal> {
    accept_each(name, masks, |mask| (u64::from(*mask) >> bits != 0).then(|| format!("not below 2^{bits}")))
}

rows! {
    pub struct Clipped {
        cells: Vec<Cell> => "Cells along the axis.",
        errors: Vec<Rule> => "What the rule costs.",
    }

    struct Cell {
        y: f64 ["V"] as x("measurement y / V") => "Measurement.",
        cell: usize as line("nearest outer cell") => "Cell of the measurement, from 1.",
        cell_swapped: usize as dashed("sides as printed") => "The same with the printed sides of the clipping rule.",
    }

    struct Rule by "{rule}" {
        rule: &'static str => "Clipping rule.",
        mse: f64 ["V^2"] => "Exact error of the posterior mean; thirteen times worse with the printed sides (erratum binary-1).",
    }
}

impl Figure for Clipping {
    figure!(ClippingParameters => Clipped, "binary-fig5-2", "Cells of the measurement axis and the clipping rule", "Movaghati, thesis, section 5.2",
        "The axis is cut into 2^B cells; measurements beyond [-V, V] fall into the nearest outer cell. The thesis prints \
         the two sides of this rule swapped (dashed); taken literally that ruins the best eight patterns."; linear("cell"));

    fn run(&self, p: &ClippingParameters, _: &Context<'_>) -> Result<Clipped, Error> {
        let grid = uniform_cells(1.0, p.bits)?;
        let count = grid.cells();
        let place = |i: i32| {
            let y = f64::from(i) / 100.0;
            let cell = grid.encode(y)?;
            let swapped = match y {
                y if y < -1.0 => count - 1,
                y if y > 1.0 => 0,
                _ => cell,
            };
            Ok(Cell {
                y,
                cell: cell + 1,
                cell_swapped: swapped + 1,
            })
        };
        let cells = (-150..=150).map(place).collect::<Result<_, Error>>()?;
        let scene = Scene::uniform(p.bits, p.snr_db)?;
        let all = scene.search(p.masks.len())?.ranking()?;
        let own = scene.mmse(&p.masks)?;
        // The swapped rule is a pattern over a grid with two more cells, which carry the opposite end's bit.
        let grid = Quantizer::new([&[-1.0], grid.breakpoints(), &[1.0]].concat())?;
        let wide = Scene { grid, ..scene };
        let swapped = |masks: &[Mask]| -> Result<f64, Error> {
            let turned = |&mask: &Mask| {
                let inner = pattern(mask, p.bits)?;
                let (first, last) = (inner.bits()[0], inner.bits()[count - 1]);
                Ok::<_, Error>(Pattern::new([&[last], inner.bits(), &[first]].concat())?)
            };
            let patterns = masks.iter().map(turned).collect::<Result<Vec<_>, _>>()?;
            Ok(wide.pattern_bank(&patterns)?.mmse()?)
        };
        let best = parallel::try_map(&all, |set| swapped(&set.masks))?;
        let errors = [
            ("nearest outer cell", own),
            ("sides swapped", swapped(&p.masks)?),
            ("sides swapped, best masks for that", best.into_iter().fold(f64::INFINITY, f64::min)),
        ];
        let errors = errors.map(|(rule, mse)| Rule { rule, mse }).into();
        Ok(Clipped { cells, errors })
    }

    fn claims(&self, _: &ClippingParameters, tables: &Clipped, claims: &mut Claims) {
        let what = "the cell never decreases with the measurement";
        claims.all("monotone", what, tables.cells.windows(2), |w| w[1].cell >= w[0].cell);
    }
}

rows! {
    /// A bit of a pattern.
    pub struct Bit {
        pattern: String => "Name.",
        mask: Mask => "Which natural patterns are XORed, the first the most significant digit.",
        l: usize => "Cell, from 1.",
        bit: u32 => "Bit sent from the cell.",
    }
}

/// A mask and its name.
type Named = (String, Mask);

/// Some patterns of a figure, with the printed ones.
pub struct Patterns {
    about: About,
    what: &'static str,
    printed: &'static str,
    /// Masks beyond the Gray basis; without them the figure has no such parameter.
    extra: Option<&'static [Mask]>,
    masks: fn(&PatternParameters) -> Result<Vec<Named>, Error>,
}

parameters! {
    pub struct PatternParameters {
        bits: usize [1..=8] = 4 => "Bits of the cell index.",
        #[serde(default, skip_serializing_if = "Option::is_none")]
        extra: Option<Vec<Mask>> [1..=255; 1..=20] = None => "Masks beyond the Gray basis, below 2^bits.",
    }
    check |p| fit("extra", p.extra(), p.bits);
}

impl PatternParameters {
    fn extra(&self) -> &[Mask] {
        self.extra.as_deref().unwrap_or_default()
    }
}

/// Numbers patterns after their kind.
fn numbered(kind: &str, masks: Vec<Mask>) -> Vec<Named> {
    let numbers = (1..).map(|b| format!("{kind}{b}"));
    numbers.zip(masks).collect()
}

pub static NATURAL: Patterns = Patterns {
    about: About::of("binary-fig5-3", "Natural patterns", "Movaghati, thesis, figure 5.3").showing(
        "The binary digits of the cell's index, most significant first. The finest of them changes at every edge.",
    ),
    what: "the patterns are those printed",
    printed: "0000000011111111 0000111100001111 0011001100110011 0101010101010101",
    extra: None,
    masks: |p| Ok(numbered("N", natural_basis(p.bits)?)),
};

pub static GRAY: Patterns = Patterns {
    about: About::of("binary-fig5-4", "Gray patterns", "Movaghati, thesis, figure 5.4").showing(
        "XORs of neighbouring natural patterns. Every edge belongs to exactly one pattern, so that a measurement near an edge \
         endangers one bit only.",
    ),
    what: "the patterns are those printed",
    printed: "0000000011111111 0000111111110000 0011110000111100 0110011001100110",
    extra: None,
    masks: |p| Ok(numbered("G", gray_basis(p.bits)?)),
};

pub static EXTRA: Patterns = Patterns {
    about: About::of("binary-fig5-5", "Further linear patterns", "Movaghati, thesis, figure 5.5 and equation 5.6").showing(
        "With more sensors than bits, further XORs of the natural patterns join the Gray basis: columns 5 to 7 of the \
         thesis's generator matrix (5.6).",
    ),
    what: "the patterns are columns 5 to 7 of matrix (5.6)",
    printed: "0011110011000011 0101101001011010 0110011010011001",
    extra: Some(&[14, 5, 11]),
    masks: |p| Ok(p.extra().iter().map(|&mask| (format!("mask {mask}"), mask)).collect()),
};

impl Figure for Patterns {
    figure!(PatternParameters => Vec<Bit>, about);

    fn defaults(&self) -> PatternParameters {
        PatternParameters {
            extra: self.extra.map(<[Mask]>::to_vec),
            ..PatternParameters::default()
        }
    }

    fn run(&self, p: &PatternParameters, _: &Context<'_>) -> Result<Vec<Bit>, Error> {
        let mut table = Vec::new();
        for (name, mask) in (self.masks)(p)? {
            for (l, bit) in pattern(mask, p.bits)?.bits().iter().enumerate() {
                table.push(Bit {
                    pattern: name.clone(),
                    mask,
                    l: l + 1,
                    bit: u32::from(*bit),
                });
            }
        }
        Ok(table)
    }

    fn claims(&self, _: &PatternParameters, table: &Vec<Bit>, claims: &mut Claims) {
        let printed = self.printed.replace(' ', "");
        let same = |(row, digit): (&Bit, char)| char::from_digit(row.bit, 2) == Some(digit);
        let rows = if table.len() == printed.len() { &table[..] } else { &[] };
        claims
            .at_defaults()
            .all("bits", self.what, rows.iter().zip(printed.chars()), same);
    }

    fn plot(&self, _: &PatternParameters, table: &Vec<Bit>) -> Plot {
        let named = |chunk: &[Bit]| {
            let bits = chunk.iter().map(|b| b.bit == 1).collect();
            Some((chunk[0].pattern.clone(), Pattern::new(bits).ok()?))
        };
        let chunks = table.chunk_by(|a, b| a.pattern == b.pattern);
        Plot::of(pattern_panel(self.about.title, &chunks.filter_map(named).collect::<Vec<_>>()))
    }
}

pub struct Response;

parameters! {
    pub struct ResponseParameters {
        thresholds: Vec<f64> [-10.0..=10.0; 1..=100] = vec![-0.6, -0.2, 0.1, 0.7] => "Where the bit changes, in units of V, increasing.",
        noise_std: f64 [1e-6..=1e3] = 0.1 => "Noise standard deviation, in units of V.",
    }
}

rows! {
    pub struct Answer {
        x: f64 ["V"] as x("source x / V") => "Source.",
        bit: u32 as dashed("without noise") in probability => "Bit without noise.",
        p1: f64 as line("with noise") in probability => "Probability of a 1.",
        information: f64 ["1/V^2"] as line("of the bit") in information => "Fisher information about x in the bit.",
    }
}

impl Figure for Response {
    figure!(ResponseParameters => Vec<Answer>, "binary-figB-1", "Probability of a 1 under a pattern with four edges", "Movaghati, thesis, figure B.1",
        "Noise rounds the pattern off; a run of cells narrower than about two standard deviations never reaches certainty. The \
         derivative of this curve over its standard deviation is the information in the bit.";
        { probability: linear("P(1 | x)", "Probability of a 1"), information: linear("Fisher information / V⁻²", "Information in the bit") });

    fn run(&self, p: &ResponseParameters, _: &Context<'_>) -> Result<Vec<Answer>, Error> {
        let quantizer = BinaryQuantizer::new(p.thresholds.clone())?;
        let at = |i: i32| {
            let x = -1.0 + f64::from(i) / 400.0;
            Ok(Answer {
                x,
                bit: u32::from(quantizer.encode(x)?),
                p1: quantizer.probabilities(x, p.noise_std)[1],
                information: quantizer.fisher_information(x, p.noise_std),
            })
        };
        (0..=800).map(at).collect()
    }

    fn claims(&self, p: &ResponseParameters, rows: &Vec<Answer>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let what = "at an edge far from the others both bits are equally likely";
        here.all("half", what, &p.thresholds, |t| {
            let nearest = rows.iter().min_by(|a, b| (a.x - *t).abs().total_cmp(&(b.x - *t).abs()));
            nearest.is_some_and(|r| (r.p1 - 0.5).abs() <= 2e-3)
        });
        claims.all("probabilities", "all values are probabilities", rows, |r| (0.0..=1.0).contains(&r.p1));
    }
}
