//! The bounds on chains of lossy hand-overs of discrete beliefs, where everything is exact.

use fewbits_baselines::handoff::{Amplification, bounds};
use fewbits_baselines::mixture_codec::divergence::discrete;
use fewbits_monte_carlo::Stream;
use rand::{Rng, RngExt};

fn law<R: Rng>(rng: &mut R, points: usize, spread: f64) -> Vec<f64> {
    let raw: Vec<f64> = (0..points)
        .map(|_| 10.0_f64.powf(-rng.random_range(0.0..spread)))
        .collect();
    let total: f64 = raw.iter().sum();
    raw.iter().map(|x| x / total).collect()
}

/// `p_i` after one step of the dynamics and a measurement whose likelihood is given.
fn filtered(p: &[f64], rows: &[Vec<f64>], likelihood: &[f64]) -> Vec<f64> {
    let n = p.len();
    let joint: Vec<f64> = (0..n)
        .map(|j| likelihood[j] * (0..n).map(|i| p[i] * rows[i][j]).sum::<f64>())
        .collect();
    let total: f64 = joint.iter().sum();
    joint.iter().map(|x| x / total).collect()
}

/// A slightly wrong version of a law.
fn blurred<R: Rng>(rng: &mut R, p: &[f64]) -> Vec<f64> {
    let raw: Vec<f64> = p
        .iter()
        .map(|x| x * 10.0_f64.powf(rng.random_range(-0.3..0.3)))
        .collect();
    let total: f64 = raw.iter().sum();
    raw.iter().map(|x| x / total).collect()
}

#[test]
fn bounds_for_every_data_sequence_hold_on_three_thousand_chains() {
    let mut rng = Stream::new(51).rng();
    let mut tightest: f64 = 0.0;
    for _ in 0..3000 {
        let n = rng.random_range(2..6);
        let mut exact = law(&mut rng, n, 2.0);
        let mut known = exact.clone();
        let mut steps = Vec::new();
        for _ in 0..rng.random_range(1..5) {
            let rows: Vec<Vec<f64>> = (0..n).map(|_| law(&mut rng, n, 2.0)).collect();
            let likelihood = law(&mut rng, n, 2.0);
            exact = filtered(&exact, &rows, &likelihood);
            let posterior = filtered(&known, &rows, &likelihood);
            known = blurred(&mut rng, &posterior);
            steps.push(discrete(&posterior, &known).unwrap());
            let (truth, bounds) = (discrete(&exact, &known).unwrap(), bounds(&steps, Amplification::Dr));
            let slack = 1.0 + 1e-9;
            assert!(truth.ml <= bounds.ml_from_dr * slack && bounds.ml_from_dr <= bounds.ml_printed * slack);
            assert!(truth.kl <= bounds.kl_from_dr * slack && truth.l1 <= bounds.l1_from_dr * slack);
            tightest = tightest.max(truth.l1 / bounds.l1_from_dr);
        }
    }
    assert!(tightest > 0.5, "{tightest}");
}

/// The expected bounds: two states, a lossy hand-over after each of two measurements, all data sequences enumerated.
#[test]
fn expected_bounds_hold_over_all_data() {
    let mut rng = Stream::new(52).rng();
    let mut printed_fails = 0;
    for _ in 0..2000 {
        let n = rng.random_range(2..5);
        let prior = law(&mut rng, n, 2.0);
        let rows: Vec<Vec<f64>> = (0..n).map(|_| law(&mut rng, n, 2.0)).collect();
        // p(y | x) for two values of y.
        let up: Vec<f64> = (0..n).map(|_| rng.random_range(0.02..0.98)).collect();
        let given = |y: usize| -> Vec<f64> { up.iter().map(|u| if y == 1 { *u } else { 1.0 - u }).collect() };
        let mass = |p: &[f64], y: usize| -> f64 {
            let l = given(y);
            (0..n)
                .map(|j| l[j] * (0..n).map(|i| p[i] * rows[i][j]).sum::<f64>())
                .sum()
        };
        let (mut kl, mut l1) = (0.0, 0.0);
        let (mut kl_corrected, mut l1_tight, mut kl_printed) = (0.0, 0.0, 0.0);
        for first in 0..2 {
            let p = mass(&prior, first);
            let exact = filtered(&prior, &rows, &given(first));
            let known = blurred(&mut rng, &exact);
            let d = discrete(&exact, &known).unwrap();
            for second in 0..2 {
                let q = p * mass(&exact, second);
                let after = filtered(&exact, &rows, &given(second));
                let posterior = filtered(&known, &rows, &given(second));
                let sent = blurred(&mut rng, &posterior);
                let e = discrete(&posterior, &sent).unwrap();
                let b = bounds(&[d, e], Amplification::Dr);
                let truth = discrete(&after, &sent).unwrap();
                kl += q * truth.kl;
                l1 += q * truth.l1;
                kl_corrected += q * b.ln_kl_corrected.exp();
                kl_printed += q * b.ln_kl_printed.exp();
                l1_tight += q * b.ln_l1_tight.exp();
            }
        }
        assert!(kl <= kl_corrected * (1.0 + 1e-9), "{kl} {kl_corrected}");
        assert!(l1 <= l1_tight * (1.0 + 1e-9), "{l1} {l1_tight}");
        printed_fails += usize::from(kl > kl_printed);
    }
    // The printed form, even with corrected subscripts, is no bound.
    assert!(printed_fails > 0);
}
