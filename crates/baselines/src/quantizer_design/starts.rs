//! Joint designs from random starts.

use fewbits_monte_carlo::Stream;
use fewbits_numerics::normal;
use fewbits_quantizer_design::design::{Design, joint};
use fewbits_quantizer_design::{Certificate, Criterion, Error, Newton, System};
use rand::RngExt;

/// The best of the results of [`joint`] from the system's own quantizers and from `starts` random ones, with the same labels and channels.
///
/// Start `i` draws the breakpoints of each group as ordered standard normal samples, scaled by 1.3 standard deviations of the
/// group's sample, from a random stream fixed by (`seed`, `i`). Starts that do not converge are left out.
///
/// # Errors
/// If no start converged; the error is that of the first.
pub fn multi_start(
    system: &System,
    criterion: Criterion,
    starts: usize,
    seed: u64,
    newton: &Newton,
) -> Result<Design, Error> {
    let mut best = joint(system, criterion, newton);
    for start in random_starts(system, starts, seed) {
        let Ok(candidate) = joint(&start, criterion, newton) else {
            continue;
        };
        // A maximum is preferred to a saddle, even if the saddle has the better value.
        let is_better = |design: &Design| match [design, &candidate].map(|d| d.certificate == Certificate::Saddle) {
            [true, false] => true,
            [false, true] => false,
            _ => criterion.sense() * (candidate.value - design.value) > 0.0,
        };
        if best.as_ref().ok().is_none_or(is_better) {
            best = Ok(candidate);
        }
    }
    best
}

/// The starts of [`multi_start`]; one whose breakpoints coincide is left out.
pub fn random_starts(system: &System, starts: usize, seed: u64) -> Vec<System> {
    (0..starts)
        .filter_map(|i| random_system(system, Stream::new(seed).named("quantizer-starts").indexed(i as u64)).ok())
        .collect()
}

/// The system with random ordered breakpoints.
fn random_system(system: &System, stream: Stream) -> Result<System, Error> {
    let mut rng = stream.rng();
    let mean = system.model().prior().mean();
    let quantizers = system
        .groups()
        .iter()
        .map(|group| {
            let spread = 1.3 * system.model().sample_deviation(group.sensors[0]);
            let mut b: Vec<f64> = group
                .quantizer
                .breakpoints()
                .iter()
                .map(|_| mean + spread * normal::quantile(rng.random_range(0.02..0.98)))
                .collect();
            b.sort_by(f64::total_cmp);
            group.quantizer.with_breakpoints(b)
        })
        .collect::<Result<Vec<_>, _>>()?;
    system.with_quantizers(quantizers)
}
