//! Figures 3, 4, 7 to 10: error and determinant along many searches.

use super::chain_claims;
use super::common::{A, B, CHAINS, Example, Scheme, Settings, tracks};
use super::summary::{Rows, curve, summary};
use crate::prelude::*;

/// One of these figures.
pub struct Chains {
    about: About,
    example: Example,
    /// Names of schemes and radio ranges.
    schemes: &'static [(&'static str, f64)],
    claims: fn(&Rows, &mut Claims),
}

impl Chains {
    fn schemes(&self) -> Vec<Scheme> {
        let of = |(name, range): &(&'static str, f64)| Scheme::new(name, self.example, *range);
        self.schemes.iter().map(of).collect()
    }
}

/// Those of figure 4; the first six are those of figure 3.
const OF_A: [(&str, f64); 9] = [
    ("exact", 15.0),
    ("gmm-4", 15.0),
    ("gaussian known rate", 15.0),
    ("exact", 10.0),
    ("gmm-4", 10.0),
    ("gaussian known rate", 10.0),
    ("gaussian-9", 15.0),
    ("gaussian-9", 10.0),
    ("lpg-2x5 known rate", 15.0),
];
/// Those of figure 8; the first six are those of figure 7.
const OF_B: [(&str, f64); 11] = [
    ("exact", 15.0),
    ("lpg-2x5 known rate", 15.0),
    ("gaussian known rate", 15.0),
    ("gaussian-9", 15.0),
    ("lpg-2x5", 15.0),
    ("exact known rate", 15.0),
    ("gmm-4", 15.0),
    ("gmm-4 known rate", 15.0),
    ("lpg-1x5 known rate", 15.0),
    ("particles-25 known rate", 15.0),
    ("mode and curvature known rate", 15.0),
];
const IN_WIND: [(&str, f64); 3] = [("covariance", 15.0), ("information", 15.0), ("mahalanobis", 15.0)];

pub static FIG3: Chains = Chains {
    about: About::of("diffusive-fig3", "Error along the search, two radio ranges", "Zhao and Nehorai 2007, Fig. 3")
        .showing("Median distance of estimate and source after each node (bands: deciles), example A, ranges of 15 and 10 m, \
                  over 120 random deployments. What the paper calls bias is the root of this distance; both are in the table."),
    example: A,
    schemes: OF_A.split_at(6).0,
    claims: chain_claims::fig3,
};

pub static FIG4: Chains = Chains {
    about: About::of("diffusive-fig4", "Determinant along the search, two radio ranges", "Zhao and Nehorai 2007, Fig. 4")
        .showing("Median log10 determinant of the position's covariance after each node in 120 deployments, example A, ranges of 15 and 10 m. The \
                  threshold is 1e-6. One Gaussian spends about ten nodes near the start, because a ring matched by moments is a \
                  broad blob; mixtures and the exact belief do not."),
    example: A,
    schemes: &OF_A,
    claims: chain_claims::fig4,
};

pub static FIG7: Chains = Chains {
    about: About::of(
        "diffusive-fig7",
        "Error along the search, Gaussian and polynomial Gaussians",
        "Zhao and Nehorai 2007, Fig. 7",
    )
    .showing(
        "Median distance of estimate and source after each node in 120 deployments, example B: polynomial Gaussians of degree 5 with two \
                  components against one Gaussian, and the exact belief as the referee.",
    ),
    example: B,
    schemes: OF_B.split_at(6).0,
    claims: chain_claims::fig7,
};

pub static FIG8: Chains = Chains {
    about: About::of("diffusive-fig8", "Nodes to the threshold, by what travels", "Zhao and Nehorai 2007, Fig. 8")
        .showing(
            "Median log10 determinant after each node in 120 deployments, example B, threshold 1e-5, for every form of the belief. A \
                  determinant alone can mislead: the summary says how many searches end more than a metre off.",
        ),
    example: B,
    schemes: &OF_B,
    claims: chain_claims::fig8,
};

pub static FIG9: Chains = Chains {
    about: About::of("diffusive-fig9", "Choosing nodes in wind, source of example B", "Zhao and Nehorai 2007, Figs. 9 and 10")
        .showing("Error and determinant along searches in 120 deployments in a wind of (-20, -10) m/s, source at (62, 50), by the rule that chooses \
                  nodes. A mixture of four Gaussians over position and rate travels. The paper does not print its source: \
                  diffusive-fig10 has the other one."),
    example: B,
    schemes: &IN_WIND,
    claims: chain_claims::wind,
};

pub static FIG10: Chains = Chains {
    about: About::of(
        "diffusive-fig10",
        "Choosing nodes in wind, source of example A",
        "Zhao and Nehorai 2007, Figs. 9 and 10",
    )
    .showing("The same with the source at (73, 38), ten samples a node and threshold 1e-6."),
    example: A,
    schemes: &IN_WIND,
    claims: chain_claims::wind,
};

impl Figure for Chains {
    figure!(Settings => Rows, about);

    fn cost(&self, p: &Settings) -> Cost {
        let searches = p.trials as f64 * self.schemes.len() as f64;
        Cost::new(0.1 * searches, 2e3 * searches)
    }

    fn world(&self) -> Option<&'static str> {
        Some(CHAINS)
    }

    fn run(&self, p: &Settings, context: &Context<'_>) -> Result<Rows, Error> {
        let (mut curves, mut ends) = (Vec::new(), Vec::new());
        for scheme in self.schemes() {
            let tracks = tracks(context, p, &scheme)?;
            curves.extend(curve(&scheme, &tracks));
            ends.push(summary(&scheme, p, &tracks)?);
        }
        Ok(Rows { curves, summary: ends })
    }

    fn claims(&self, _: &Settings, rows: &Rows, claims: &mut Claims) {
        (self.claims)(rows, claims);
    }

    fn plot(&self, _: &Settings, rows: &Rows) -> Plot {
        let schemes = self.schemes();
        let several = schemes.iter().any(|s| s.range != schemes[0].range);
        let label = |s: &Scheme| match several {
            true => format!("{}, {} m", s.name, s.range),
            false => s.name.to_owned(),
        };
        let of = |s: &Scheme| {
            let (name, range) = (s.name, s.range);
            rows.curves.iter().filter(move |c| c.scheme == name && c.range == range)
        };
        // Of two ranges the first is solid and the second dashed, in one colour per scheme.
        let curve = |s: &Scheme, points| {
            let line = match (several, s.range == schemes[0].range) {
                (false, _) => Layer::line(label(s), points),
                (true, true) => Layer::unbroken(label(s), points),
                (true, false) => Layer::dashed(label(s), points),
            };
            line.coloured(s.place)
        };
        let threshold = schemes[0].example.threshold.log10();
        let last = rows.curves.iter().map(|c| c.step).max().unwrap_or(1) as f64;
        let limit = || Layer::level("threshold", [1.0, last], threshold).coloured(7);
        let determinants = |title: &str, chosen: &dyn Fn(&Scheme) -> bool| {
            let panel = Panel::linear(title, "nodes", "lg det of the covariance / m^4").with(limit());
            let line = |scheme: &Scheme| {
                let line = points(of(scheme), |c| (c.step as f64, c.log10det_med.map_or(f64::NAN, |m| m.value)));
                curve(scheme, line)
            };
            panel.with_all(schemes.iter().filter(|s| chosen(s)).map(line))
        };
        if schemes.len() > 7 {
            // Too many lines for one panel.
            let (unknown, known) = ("Rate unknown", "Rate known");
            let panels = [
                determinants(unknown, &|s| !s.known_rate),
                determinants(known, &|s| s.known_rate),
            ];
            return Plot::grid(2, panels.into());
        }
        let mut errors = Panel::semilog("Error", "nodes", "distance to the source / m").without_legend();
        let band = of(&schemes[0]).map(|c| (c.step as f64, c.err_q10, c.err_q90)).collect();
        errors = errors.with(Layer::band("", band).coloured(schemes[0].place));
        for scheme in &schemes {
            let line = points(of(scheme), |c| (c.step as f64, c.err_med));
            errors = errors.with(curve(scheme, line));
        }
        let determinants = determinants("Determinant", &|_| true);
        Plot::grid(2, vec![errors, determinants])
    }
}
