//! Kernels per element of a slice, in multiples of one standard normal draw.

use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use fewbits_numerics::kernels;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const COUNT: usize = 10_000;

fn main() {
    divan::Divan::from_args().sample_count(400).main();
}

fn normals(scale: f64) -> Vec<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    (0..COUNT)
        .map(|_| scale * rng.sample::<f64, _>(StandardNormal))
        .collect()
}

#[divan::bench]
fn standard_normal_unit(bencher: Bencher) {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut out = vec![0.0; COUNT];
    bencher.counter(ItemsCount::new(COUNT)).bench_local(|| {
        for z in &mut out {
            *z = rng.sample(StandardNormal);
        }
        black_box(&out);
    });
}

#[divan::bench]
fn standard_normals_block(bencher: Bencher) {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut out = vec![0.0; COUNT];
    bencher.counter(ItemsCount::new(COUNT)).bench_local(|| {
        kernels::StandardNormals::new(&mut rng).fill(&mut out);
        black_box(&out);
    });
}

fn in_place(bencher: Bencher, kernel: fn(&mut [f64]), values: Vec<f64>) {
    let mut work = values.clone();
    bencher.counter(ItemsCount::new(COUNT)).bench_local(|| {
        work.copy_from_slice(&values);
        kernel(&mut work);
        black_box(&work);
    });
}

#[divan::bench]
fn exp(bencher: Bencher) {
    in_place(bencher, kernels::exp, normals(20.0));
}

#[divan::bench]
fn ln(bencher: Bencher) {
    in_place(bencher, kernels::ln, normals(20.0).iter().map(|x| x.exp()).collect());
}

#[divan::bench]
fn cdf(bencher: Bencher) {
    in_place(bencher, kernels::cdf, normals(3.0));
}

#[divan::bench]
fn log_cdf(bencher: Bencher) {
    in_place(bencher, kernels::log_cdf, normals(3.0));
}

#[divan::bench]
fn log_cdf_scalar(bencher: Bencher) {
    let one_by_one = |values: &mut [f64]| {
        values
            .iter_mut()
            .for_each(|x| *x = fewbits_numerics::normal::log_cdf(*x))
    };
    in_place(bencher, one_by_one, normals(3.0));
}

#[divan::bench]
fn log_interval(bencher: Bencher) {
    in_place(bencher, |lower| kernels::log_interval(lower, &UPPER.with(Clone::clone)), normals(3.0));
}

thread_local! {
    static UPPER: std::rc::Rc<Vec<f64>> = std::rc::Rc::new(normals(3.0).iter().map(|x| x + 0.8).collect());
}

#[divan::bench]
fn log_interval_scalar(bencher: Bencher) {
    let one_by_one = |values: &mut [f64]| {
        values
            .iter_mut()
            .for_each(|x| *x = fewbits_numerics::normal::log_interval(*x, *x + 0.8));
    };
    in_place(bencher, one_by_one, normals(3.0));
}

#[divan::bench]
fn exp_minus(bencher: Bencher) {
    let logs = normals(20.0);
    let mut out = vec![0.0; COUNT];
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| black_box(kernels::exp_minus(&logs, 3.0, &mut out)));
}

#[divan::bench]
fn log_sum_exp(bencher: Bencher) {
    let logs = normals(20.0);
    bencher
        .counter(ItemsCount::new(COUNT))
        .bench_local(|| black_box(kernels::log_sum_exp(&logs)));
}
