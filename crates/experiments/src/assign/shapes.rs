//! `assign-fig6-1` and `assign-figC-1`: where a wrong bit lands, and how likely it is.

use crate::prelude::*;
use fewbits_baselines::sensor_assignment::{bit_error, flipped_estimate};
use fewbits_sensor_assignment::CodedSensors;

const BITS: usize = 4;

/// `-1, -1 + step, ..., 1`.
fn axis_points(step: f64) -> impl Iterator<Item = f64> {
    let count = (2.0 / step).round().max(1.0) as usize;
    (0..=count).map(move |i| -1.0 + 2.0 * i as f64 / count as f64)
}

pub struct Landings;

parameters! {
    pub struct LandingParameters {
        step: f64 [1e-5..=1.0] = 0.002 => "Step of the horizontal axis in units of V.",
    }
}

rows! {
    pub struct Landing {
        x: f64 ["V"] => "Source.",
        f: [f64; BITS] ["V"] => "Estimate with the bit of this number wrong, the coarsest being 1.",
    }
}

impl Landing {
    fn at(x: f64) -> Result<Self, Error> {
        let mut f = [0.0; BITS];
        for (bit, estimate) in f.iter_mut().enumerate() {
            *estimate = flipped_estimate(x, bit, BITS, 1.0)?;
        }
        Ok(Self { x, f })
    }
}

rows! {
    pub struct Landed {
        curve: Vec<Landing> => "Estimates along the axis.",
        centres: Vec<Landing> => "Estimates at the centres of the cells.",
    }
}

impl Figure for Landings {
    figure!(LandingParameters => Landed, "assign-fig6-1", "Where a wrong bit lands", "Movaghati, thesis, figure 6.1",
        "The estimate f_b(x) of the centre decoder when bit b of a four-bit Gray code is wrong and the others are right. A wrong \
         coarse bit mirrors the estimate across the whole range, a wrong fine bit only within a small block.");

    fn run(&self, p: &LandingParameters, _: &Context<'_>) -> Result<Landed, Error> {
        let centres = (0..16).map(|c| (2.0 * f64::from(c) + 1.0) / 16.0 - 1.0);
        Ok(Landed {
            curve: axis_points(p.step).map(Landing::at).collect::<Result<_, _>>()?,
            centres: centres.map(Landing::at).collect::<Result<_, _>>()?,
        })
    }

    fn claims(&self, _: &LandingParameters, tables: &Landed, claims: &mut Claims) {
        let here = claims.at_defaults();
        let centre = |x: f64| tables.centres.iter().find(|l| (l.x - x).abs() < 1e-14);
        claims.all("involution", "flipping a bit twice returns to the centre", &tables.centres, |l| {
            let back = |bit: usize| centre(l.f[bit]).is_some_and(|there| (there.f[bit] - l.x).abs() < 1e-14);
            (0..BITS).all(back)
        });
        let what = "every curve takes exactly the sixteen centres as values";
        here.all("staircase", what, 0..BITS, |bit| {
            let mut values: Vec<f64> = tables.curve.iter().map(|l| l.f[bit]).collect();
            values.sort_by(f64::total_cmp);
            values.dedup();
            values.len() == 16 && values.iter().all(|v| centre(*v).is_some())
        });
    }

    fn plot(&self, _: &LandingParameters, tables: &Landed) -> Plot {
        let panel = |bit: usize| {
            let (x, y) = (Axis::linear("source x / V"), Axis::linear("estimate / V").between(-1.1, 1.1));
            Panel::new(format!("Bit {} wrong", bit + 1), x, y)
                .with(Layer::line("", points(&tables.curve, |l| (l.x, l.f[bit]))).coloured(0))
                .with(Layer::dashed("", vec![(-1.0, -1.0), (1.0, 1.0)]).coloured(7))
                .without_legend()
        };
        Plot::grid(2, (0..BITS).map(panel).collect())
    }
}

pub struct BitErrors;

parameters! {
    pub struct ErrorParameters {
        variance: f64 [1e-9..=1e3] = 0.03 => "Noise variance in units of V^2.",
        step: f64 [1e-5..=1.0] = 0.002 => "Step of the horizontal axis in units of V.",
    }
}

rows! {
    pub struct Wrong {
        x: f64 ["V"] as x("source x / V") => "Source.",
        pa: [f64; BITS] as line("bit {}") => "Probability that the bit of this number is wrong, the coarsest being 1.",
    }
}

impl Figure for BitErrors {
    figure!(ErrorParameters => Vec<Wrong>, "assign-figC-1", "Probability that a bit is wrong", "Movaghati, thesis, figure C.1",
        "For each bit of a four-bit Gray code, the probability that noise turns it: one half at the bit's own edges, \
         except where noise reaches across further ones, and for the finest bit hardly less between them. The thesis \
         calls the variance sigma."; linear("probability that the bit is wrong"));

    fn run(&self, p: &ErrorParameters, _: &Context<'_>) -> Result<Vec<Wrong>, Error> {
        let sensors = CodedSensors::with_variances(1.0, &[p.variance; BITS])?;
        let at = |x: f64| {
            let mut pa = [0.0; BITS];
            for (probability, quantizer) in pa.iter_mut().zip(sensors.quantizers()) {
                *probability = bit_error(quantizer, x, p.variance.sqrt())?;
            }
            Ok(Wrong { x, pa })
        };
        axis_points(p.step).map(at).collect()
    }

    fn claims(&self, _: &ErrorParameters, rows: &Vec<Wrong>, claims: &mut Claims) {
        let here = claims.at_defaults();
        let near = |x: f64| rows.iter().find(|r| (r.x - x).abs() < 1e-9).map(|r| r.pa[0]);
        here.near("half", "the sign bit is a coin at zero", near(0.0), 0.5, 1e-12);
        claims
            .references("pa1", "the sign bit is wrong with this probability, x =", [0.2], |x| (x.to_string(), near(x)));
        let what = "all values are probabilities";
        claims.all("probabilities", what, rows, |r| r.pa.iter().all(|p| (0.0..=1.0).contains(p)));
        let mean = |bit: usize| rows.iter().map(|r| r.pa[bit]).sum::<f64>() / rows.len() as f64;
        here.increasing("order", "finer bits are wrong more often on average", (0..BITS).map(mean));
    }
}
