//! Figure 1: which density is which.

use crate::prelude::*;

parameters! {
    pub struct Parameters {
        /// Hand-overs.
        #[garde(range(min = 1, max = 12))]
        steps: u32 = 4,
    }
}

rows! {
    /// A density `p_t^i`, and how it comes from the one before.
    pub struct Row {
        /// Time.
        t: u32,
        /// Hand-overs that were lossy; all after them are exact.
        lossy: u32,
        /// Time of the density it comes from; none at the start.
        from_t: Option<u32>,
        /// Lossy hand-overs of that density: one less where this hand-over was lossy.
        from_lossy: Option<u32>,
        /// Whether a filter that hands on less than it knows has this density.
        available: bool,
    }
}

pub struct Fig1;

impl Figure for Fig1 {
    figure!(Parameters => Vec<Row>, "handoff-fig1", "Exact and lossy hand-overs", "compressed particle filter, Section 4, Figure 1 (redrawn: the print is lost)",
        "Density p(t, i): the first i hand-overs were lossy, all after them exact. Steps to the right are exact \
         (prediction and update), dashed steps lose something. The upper edge is what ought to be known, the \
         diagonal what is known; a bound on their distance adds up the distances of neighbours in a column.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Vec<Row>, Error> {
        let densities = (0..=p.steps).flat_map(|t| (0..=t).map(move |lossy| (t, lossy)));
        Ok(densities
            .map(|(t, lossy)| Row {
                t,
                lossy,
                from_t: t.checked_sub(1),
                from_lossy: t.checked_sub(1).map(|before| lossy.min(before)),
                available: t == lossy,
            })
            .collect())
    }

    fn claims(&self, _: &Parameters, rows: &Vec<Row>, claims: &mut Claims) {
        let what = "a step is exact but for the diagonal's, which lose something";
        claims.all("steps", what, rows.iter().filter(|r| r.t > 0), |r| {
            r.from_lossy.is_some_and(|from| (r.lossy - from == 1) == r.available)
        });
        let what = "all neighbours in a column come from the same densities by exact steps, but for the lowest pair";
        claims.all("columns", what, rows.iter().filter(|r| r.lossy + 1 < r.t), |r| r.from_lossy == Some(r.lossy));
    }

    fn plot(&self, p: &Parameters, rows: &Vec<Row>) -> Plot {
        let at = |t: u32, lossy: u32| (f64::from(t), -f64::from(lossy));
        let step = |r: &Row| Some(vec![at(r.from_t?, r.from_lossy?), at(r.t, r.lossy)]);
        let exact = rows.iter().filter(|r| !r.available).filter_map(step);
        let lossy = rows.iter().filter(|r| r.available).filter_map(step);
        let name = |label: &str, i: usize| if i == 0 { label.to_owned() } else { String::new() };
        let last = f64::from(p.steps);
        let names = (0..=p.steps).map(|i| (-f64::from(i), i.to_string()));
        let of = |available: bool| {
            let own = rows.iter().filter(move |r| r.available == available);
            own.map(|r| at(r.t, r.lossy)).collect::<Vec<_>>()
        };
        let labels = rows.iter().map(|r| {
            let (x, y) = at(r.t, r.lossy);
            (x + 0.06, y + 0.14, format!("p({}, {})", r.t, r.lossy))
        });
        let panel = Panel::new(
            "",
            Axis::linear("time t").between(-0.3, last + 0.6),
            Axis::linear("lossy hand-overs i")
                .named(names)
                .between(-last - 0.4, 0.5),
        )
        .with_all(
            exact
                .enumerate()
                .map(|(i, line)| Layer::line(name("exact step", i), line).coloured(0)),
        )
        .with_all(
            lossy
                .enumerate()
                .map(|(i, line)| Layer::dashed(name("lossy hand-over", i), line).coloured(1)),
        )
        .with(Layer::points("with exact steps from i on", of(false)).styled(0, Marker::Circle))
        .with(Layer::points("available", of(true)).styled(1, Marker::Square))
        .with(Layer::texts(labels.collect()));
        Plot::of(panel)
    }
}
