//! Figure 3: one bit turns a small error into the largest.

use crate::prelude::*;
use fewbits_baselines::mixture_codec::quadrature::QuadratureGrid;
use fewbits_core::Columns;
use fewbits_densities::{Component, Mixture};

parameters! {
    pub struct Parameters {
        mass: f64 [1e-6..=0.5] = 0.1 => "Mass of the small lobe.",
        lobe: f64 [0.6..=0.9] = 0.65 => "Centre of the small lobe of the first density.",
        moved_lobe: f64 [0.6..=0.9] = 0.85 => "Centre of the small lobe of the second.",
        threshold: f64 [0.3..=0.6] = 0.5 => "The measurement tells whether the state is above this.",
    }
}

rows! {
    pub struct Rows {
        densities: Vec<Density> => "The two densities.",
        l1: Vec<Distance> => "L1 before and after the measurement.",
    }

    struct Density {
        x: f64 => "State.",
        p0: f64 => "First density.",
        p1: f64 => "Second density.",
    }

    struct Distance by "{when}" {
        when: &'static str => "When: prior, y0, y1 (given the measurement), expected.",
        probability: f64 => "Probability of the case under the first density.",
        l1: f64 => "L1 of the two densities.",
    }
}

impl Rows {
    fn l1(&self, when: &str) -> Option<f64> {
        self.l1.iter().find(|d| d.when == when).map(|d| d.l1)
    }
}

pub struct Fig3;

impl Figure for Fig3 {
    figure!(Parameters => Rows, "handoff-fig3", "One bit turns a small error into the largest", "compressed particle filter, Section 4, Figure 3",
        "Two densities that differ in where a lobe of a tenth of the mass lies: L1 0.2. A bit that points at the lobe \
         makes them disjoint, L1 2; it comes with probability 0.1, so the expected error has not grown.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let lobe = |w: f64, m: f64, s: f64| Component::new(w, Vector1::new(m), Matrix1::new(s * s));
        let with = |m| Mixture::new(vec![lobe(1.0 - p.mass, 0.25, 0.05)?, lobe(p.mass, m, 0.025)?]);
        let (p0, p1) = (with(p.lobe)?, with(p.moved_lobe)?);
        let density = |i: i32| {
            let x = 0.0025 * f64::from(i);
            let [p0, p1] = [&p0, &p1].map(|m| m.log_pdf(&Vector1::new(x)).exp());
            Density { x, p0, p1 }
        };
        let densities = (0..=400).map(density).collect();
        // L1 over an interval of the densities divided by their masses there.
        let distance = |from: f64, to: f64, mass: [f64; 2]| -> Result<f64, Error> {
            let over = |m: &Mixture<1>, mass: f64, x: Columns<'_, 1>, out: &mut [f64]| {
                m.log_pdf_columns(x, out);
                out.iter_mut().for_each(|l| *l -= mass.ln());
            };
            let grid = QuadratureGrid::new([from], [to], [2e-5])?;
            Ok(grid
                .integrate(|x, out| over(&p0, mass[0], x, out), |x, out| over(&p1, mass[1], x, out))
                .l1)
        };
        let below = [p0.cdf(p.threshold), p1.cdf(p.threshold)];
        let above = below.map(|b| 1.0 - b);
        let prior = distance(-0.5, 1.5, [1.0; 2])?;
        let (y0, y1) = (distance(-0.5, p.threshold, below)?, distance(p.threshold, 1.5, above)?);
        let row = |(when, probability, l1)| Distance { when, probability, l1 };
        let expected = below[0] * y0 + above[0] * y1;
        let l1 = [
            ("prior", 1.0, prior),
            ("y0", below[0], y0),
            ("y1", above[0], y1),
            ("expected", 1.0, expected),
        ];
        Ok(Rows {
            densities,
            l1: l1.map(row).into(),
        })
    }

    fn claims(&self, _: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let gap = rows.l1("expected").zip(rows.l1("prior")).map(|(e, p)| e - 2.0 * p);
        claims.at_most("twice", "the expected L1 is at most twice the prior's", gap, 0.0);
        here.below("nothing", "the other answer leaves nothing of it", rows.l1("y0"), 1e-8);
        here.above("largest", "one answer leaves the largest L1 there is, nearly 2", rows.l1("y1"), 1.999);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let density = Panel::linear("Two densities", "state x", "density")
            .with(Layer::line("p0", points(&rows.densities, |d| (d.x, d.p0))))
            .with(Layer::line("p1", points(&rows.densities, |d| (d.x, d.p1))))
            .with(Layer::dashed("threshold", vec![(p.threshold, 0.0), (p.threshold, 7.0)]));
        let names = Axis::categories("", rows.l1.iter().map(|d| d.when));
        let each = rows.l1.iter().enumerate().map(|(i, d)| (i as f64, d.l1)).collect();
        let distance = Panel::new("Error before and after the bit", names, Axis::linear("L1").between(-0.1, 2.1))
            .with(Layer::points("", each))
            .without_legend();
        Plot::grid(2, vec![density, distance])
    }
}
