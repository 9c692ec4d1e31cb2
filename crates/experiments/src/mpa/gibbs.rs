//! `mpa-gibbs`: how fast Gibbs sweeps over the labels of a product of mixtures forget their start.

use crate::prelude::*;
use fewbits_densities::{Component, Mixture};
use fewbits_pf_mpa::product;
use fewbits_pf_mpa::published::LabelChain;
use nalgebra::{Matrix1, Matrix2, SMatrix, SVector, Vector1, Vector2};

pub struct Gibbs;

parameters! {
    /// Settings.
    pub struct Draws {
        trials: u64 [2..=10_000_000] = 400_000 => quick 5000 => "Draws of the sampler in each case.",
        sweeps: usize [0..=1000] = 5 => "Sweeps of each draw.",
    }
}

rows! {
    struct Mixing by "{case}-t{sweeps}" {
        case: &'static str => "Case.",
        sweeps: usize => "Sweeps.",
        total_variation: f64 => "Total variation between the labels' law and the product's, exactly.",
        bias: f64 => "Mean of a draw minus that of the product, first axis, exactly: what no number of draws removes.",
    }

    struct Sampled by "{case}{axis}" {
        case: &'static str => "Case.",
        axis: usize => "Axis.",
        exact: f64 => "Mean of the product.",
        after_sweeps: f64 => "Mean of a draw after the sweeps, exactly.",
        mean: Measured => "Mean of the draws.",
        second_eigenvalue: f64 => "Second largest modulus of the label chain's eigenvalues.",
        log_normaliser: f64 => "`ln` of the product's mass.",
    }

    #[derive(Default)]
    pub struct GibbsRows {
        mixing: Vec<Mixing> => "How the labels forget their start.",
        sampled: Vec<Sampled> => "What the sampler draws.",
    }
}

fn mixture<const D: usize>(
    means: &[SVector<f64, D>],
    covariance: SMatrix<f64, D, D>,
    weights: &[f64],
) -> Result<Mixture<D>, Error> {
    let components = means
        .iter()
        .zip(weights)
        .map(|(m, w)| Component::new(*w, *m, covariance));
    Ok(Mixture::new(components.collect::<Result<_, _>>()?)?)
}

fn line(means: &[f64], variance: f64, weights: &[f64]) -> Result<Mixture<1>, Error> {
    let means: Vec<_> = means.iter().map(|m| Vector1::new(*m)).collect();
    mixture(&means, Matrix1::new(variance), weights)
}

fn overlapping() -> Result<Vec<Mixture<1>>, Error> {
    Ok(vec![
        line(&[0.0, 1.0, 2.5], 0.25, &[0.2, 0.5, 0.3])?,
        line(&[0.5, 1.5, 3.0], 0.36, &[0.3, 0.3, 0.4])?,
        line(&[0.2, 1.1, 2.0], 0.5, &[0.6, 0.3, 0.1])?,
    ])
}

fn separated() -> Result<Vec<Mixture<1>>, Error> {
    let one = line(&[0.0, 4.0], 0.25, &[0.5, 0.5])?;
    Ok(vec![one.clone(), one])
}

fn plane() -> Result<Vec<Mixture<2>>, Error> {
    let v = Vector2::new;
    Ok(vec![
        mixture(&[v(0.0, 0.0), v(1.0, 0.5), v(2.0, 1.0)], Matrix2::new(0.3, 0.1, 0.1, 0.2), &[0.4, 0.4, 0.2])?,
        mixture(&[v(0.3, 0.2), v(1.2, 0.2), v(1.5, 1.5)], Matrix2::new(0.5, -0.1, -0.1, 0.4), &[0.2, 0.5, 0.3])?,
    ])
}

const SWEEPS: [usize; 9] = [0, 1, 2, 3, 4, 5, 6, 8, 10];

fn case<const D: usize>(
    case: &'static str,
    factors: &[Mixture<D>],
    p: &Draws,
    context: &Context<'_>,
    rows: &mut GibbsRows,
) -> Result<(), Error> {
    let factors: Vec<&Mixture<D>> = factors.iter().collect();
    let chain = LabelChain::new(&factors)?;
    for sweeps in SWEEPS {
        rows.mixing.push(Mixing {
            case,
            sweeps,
            total_variation: chain.total_variation(sweeps),
            bias: chain.bias(sweeps)[0],
        });
    }
    let exact = product::exact(&factors)?;
    let batch = 1000;
    let stream = context.stream("mpa-gibbs").named(case);
    let sums = context.tally(
        stream,
        p.trials.div_ceil(batch),
        || [Moments::default(); D],
        |sums: &mut [Moments; D], trial| {
            let drawn = product::gibbs(&mut trial.stream.fast_rng(), &factors, batch as usize, p.sweeps)?;
            for (sum, column) in sums.iter_mut().zip(drawn.columns()) {
                column.iter().for_each(|x| sum.add(*x));
            }
            Ok::<_, Error>(())
        },
    )?;
    let bias = chain.bias(p.sweeps);
    for (axis, sum) in sums.iter().enumerate() {
        rows.sampled.push(Sampled {
            case,
            axis,
            exact: exact.belief.mean()[axis],
            after_sweeps: exact.belief.mean()[axis] + bias[axis],
            mean: sum.into(),
            second_eigenvalue: chain.second_eigenvalue(),
            log_normaliser: exact.log_normaliser,
        });
    }
    Ok(())
}

impl Figure for Gibbs {
    figure!(Draws => GibbsRows, "mpa-gibbs", "How fast Gibbs sweeps forget their start", "particle message passing, Section 2.1.4",
        "Total variation of the labels after some sweeps, exactly, for moderately overlapping mixtures (A, C) and for two \
         separated modes (B), and what the sampler draws after five. In A the chain's own bias after five sweeps is 0.0093.");

    fn run(&self, p: &Draws, context: &Context<'_>) -> Result<GibbsRows, Error> {
        let mut rows = GibbsRows::default();
        case("A", &overlapping()?, p, context, &mut rows)?;
        case("B", &separated()?, p, context, &mut rows)?;
        case("C", &plane()?, p, context, &mut rows)?;
        Ok(rows)
    }

    fn claims(&self, _: &Draws, t: &GibbsRows, claims: &mut Claims) {
        let (here, paper) = (claims.at_defaults(), claims.at_defaults().at_full_trials());
        claims.keyed("tv", "total variation after the sweeps", &t.mixing, |r| r.total_variation);
        claims.keyed("mean", "mean of the product", &t.sampled, |r| r.exact);
        claims.keyed("log-mass", "mass of the product", &t.sampled, |r| r.log_normaliser);
        claims.keyed("eigenvalue", "second eigenvalue", &t.sampled, |r| r.second_eigenvalue);
        let what = "draws have the mean of the chain after these sweeps";
        claims.all_within("law", what, &t.sampled, |r| (r.mean, r.after_sweeps), 4.0);
        let first = t.sampled.iter().find(|r| r.case == "A");
        let what = "five sweeps leave a bias of 0.0093 in case A, beyond the 0.004 that was asked for";
        here.near("bias-a", what, first.map(|r| r.after_sweeps - r.exact), 0.009_346, 1e-5);
        let plane = t.sampled.iter().filter(|r| r.case == "C");
        paper.all("bias-c", "in case C it is within 0.004", plane, |r| (r.mean.value - r.exact).abs() < 0.004);
        let stuck = t.sampled.iter().find(|r| r.case == "B").map(|r| r.second_eigenvalue);
        claims.above("stuck", "between separated modes a chain does not move", stuck, 0.999_999);
    }

    fn plot(&self, _: &Draws, t: &GibbsRows) -> Plot {
        let of = |case: &'static str| select(&t.mixing, move |r| r.case == case && r.total_variation > 1e-12);
        let panel = Panel::semilog("Labels", "sweeps", "total variation")
            .with_all(["A", "C"].map(|c| Layer::line(c, points(of(c), |r| (r.sweeps as f64, r.total_variation)))));
        let bias = |case: &'static str| {
            points(t.mixing.iter().filter(move |r| r.case == case && r.bias != 0.0), |r| {
                (r.sweeps as f64, r.bias.abs())
            })
        };
        let second =
            Panel::semilog("Mean of a draw", "sweeps", "bias").with_all(["A", "C"].map(|c| Layer::line(c, bias(c))));
        Plot::grid(2, vec![panel, second])
    }
}
