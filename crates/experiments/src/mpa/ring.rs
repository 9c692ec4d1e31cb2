//! `mpa-ring`: the errata in closed form.

use crate::prelude::*;
use fewbits_pf_mpa::published::{RingBias, kernel_error, ratio_second_moments};

pub struct Rings;

parameters! {
    pub struct None {}
}

rows! {
    struct Ring by "{lower}-{upper}" {
        lower: f64 => "Lower end of the cell.",
        upper: f64 => "Upper end.",
        deviation: f64 => "Deviation of the noise.",
        printed: f64 => "Mean radius of uniform bearings, as printed.",
        exact: f64 => "Mean radius of the message.",
        total_variation: f64 => "Total variation between both.",
    }

    struct Kernel by "N{n}-d{dimension}" {
        n: u32 => "Points.",
        dimension: u32 => "Dimensions.",
        printed: f64 => "Printed factor of the variance.",
        silverman: f64 => "Silverman's.",
        printed_error: f64 => "Integrated squared error with the printed factor, exactly, for a normal density.",
        silverman_error: f64 => "With Silverman's.",
    }

    struct Weight by "{components}x{spacing}" {
        components: usize => "Components.",
        spacing: f64 => "Distance between neighbours, in their deviations.",
        each: f64 => "Second moment of the printed weights, one draw from each component; equal weights have 1.",
        first: f64 => "With all draws from the first.",
    }

    pub struct RingRows {
        rings: Vec<Ring> => "Rings.",
        kernels: Vec<Kernel> => "Kernels.",
        weights: Vec<Weight> => "Weights.",
    }
}

impl Figure for Rings {
    figure!(None => RingRows, "mpa-ring", "Errata in closed form: radii, kernels, weights", "particle message passing, equations 3.8, 3.9, 3.20 to 3.22",
        "Mean radius of the printed ring and of the message, over the cell's distance; errors of the printed and of \
         Silverman's kernel; and the second moment of the printed ratio weights, which equal weights make 1.");

    fn run(&self, _: &None, _: &Context<'_>) -> Result<RingRows, Error> {
        let ring = |(lower, upper, deviation): (f64, f64, f64)| -> Result<Ring, Error> {
            let ring = RingBias::new(lower, upper, deviation)?;
            Ok(Ring {
                lower,
                upper,
                deviation,
                printed: ring.printed,
                exact: ring.exact,
                total_variation: ring.total_variation,
            })
        };
        let mut cells = vec![(9.0, 10.5, 0.03), (1.0, 2.5, 0.005), (0.2, 1.7, 0.003), (4.0, 5.0, 0.3)];
        cells.extend((0..24).map(|i| (0.25 * f64::from(i) + 0.1, 0.25 * f64::from(i) + 1.6, 0.01)));
        let kernel = |(n, dimension): (u32, u32)| {
            let (count, d) = (f64::from(n), f64::from(dimension));
            let printed = count.powf(-1.0 / 6.0);
            let silverman = (4.0 / ((d + 2.0) * count)).powf(2.0 / (d + 4.0));
            Kernel {
                n,
                dimension,
                printed,
                silverman,
                printed_error: kernel_error(count, dimension, printed),
                silverman_error: kernel_error(count, dimension, silverman),
            }
        };
        let weight = |(components, spacing): (usize, f64)| {
            let means: Vec<f64> = (0..components).map(|i| spacing * i as f64).collect();
            let (each, first) = ratio_second_moments(&means, 1.0);
            Weight {
                components,
                spacing,
                each,
                first,
            }
        };
        Ok(RingRows {
            rings: cells.into_iter().map(ring).collect::<Result<_, _>>()?,
            kernels: [(40, 1), (40, 2), (500, 2), (10, 2), (100, 2), (4000, 2)]
                .map(kernel)
                .into(),
            weights: [(2, 0.5), (2, 1.0), (2, 2.0), (2, 3.0), (5, 0.5), (5, 1.0)]
                .map(weight)
                .into(),
        })
    }

    fn claims(&self, _: &None, t: &RingRows, claims: &mut Claims) {
        claims.keyed("printed", "mean radius as printed", &t.rings, |r| r.printed);
        claims.keyed("exact", "mean radius of the message", &t.rings, |r| r.exact);
        claims.keyed("tv", "total variation", &t.rings, |r| r.total_variation);
        claims.keyed("kernel-printed", "error of the printed kernel", &t.kernels, |r| r.printed_error);
        claims.keyed("kernel-silverman", "error of Silverman's", &t.kernels, |r| r.silverman_error);
        let large = t.kernels.iter().filter(|r| r.n >= 40);
        claims.all("kernels", "from forty points up the printed factor is worse (erratum mpa-5)", large, |r| {
            r.silverman_error < r.printed_error
        });
        claims.keyed("weights", "second moment of ratio weights (erratum mpa-4)", &t.weights, |r| r.each);
        claims.all("shift", "the message is further out (erratum mpa-3)", &t.rings, |r| r.exact > r.printed);
    }

    fn plot(&self, _: &None, t: &RingRows) -> Plot {
        let swept = || t.rings.iter().filter(|r| r.deviation == 0.01);
        let middle = |r: &Ring| 0.5 * (r.lower + r.upper);
        let first = Panel::linear("Cell of width 1.5", "middle of the cell", "mean radius minus middle")
            .with(Layer::line("message", points(swept(), |r| (middle(r), r.exact - middle(r)))))
            .with(Layer::line("printed ring", points(swept(), |r| (middle(r), r.printed - middle(r)))));
        let plane = || {
            let mut all: Vec<&Kernel> = t.kernels.iter().filter(|k| k.dimension == 2).collect();
            all.sort_by_key(|k| k.n);
            all
        };
        let second = Panel::loglog("Kernels, two dimensions", "points", "integrated squared error")
            .with(Layer::line("Silverman", points(plane(), |r| (f64::from(r.n), r.silverman_error))))
            .with(Layer::line("printed", points(plane(), |r| (f64::from(r.n), r.printed_error))));
        Plot::grid(2, vec![first, second])
    }
}
