//! The likelihood that weighs the particles of the published filter, in the order of its sums.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::censored::{Censored, MissingReports};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::CensoringRule;
use fewbits_cfwmd::scheme::Censoring;
use fewbits_core::{NumberFormat, Observation, Observed, Sensing};
use fewbits_numerics::error::entries;
use nalgebra::SVector;

/// The observations as a likelihood for particle and grid filters: as [`Network::likelihoods`], but the values of identical scalar sensors are
/// one factor, too, and the factors stand in the order of their first sensors.
///
/// # Errors
/// If the numbers of rules or observations are wrong, a number is not finite, or a value violates its rule.
pub fn likelihood_of_particles<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    network: &Network<S, D, M>,
    rules: &[CensoringRule<M>],
    broadcast: &SVector<f64, D>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<Vec<Observed<S, Censored<M>, M>>, Error> {
    let (sensors, link) = (network.sensors(), network.link());
    entries("rules", rules.len(), sensors.len())?;
    entries("observations", observations.len(), sensors.len())?;
    let scheme = |i: usize| Censoring::<S, D, M>::new(sensors[i].clone(), rules[i].clone(), network.format());
    let is_plain = !matches!(network.format(), NumberFormat::Fixed(_));
    let mut all = Vec::new();
    for (i, sensor) in sensors.iter().enumerate() {
        let mut push = |factor| all.push(Observed::new(sensor.clone(), factor));
        let like = |j: &usize| sensors[*j] == *sensor;
        if let Observation::Received(value) = &observations[i] {
            let single = scheme(i)?.received(broadcast, value, link)?;
            if !(M == 1 && is_plain) {
                push(single);
            }
        }
        if M == 1 && is_plain && !(0..i).any(|j| like(&j)) {
            let received = |j: usize| observations[j].received().filter(|_| like(&j)).copied();
            let values: Vec<_> = (i..sensors.len()).filter_map(received).collect();
            if !values.is_empty() {
                push(Censored::values(&values, &sensor.noise_covariance_at(broadcast), link.of_received()?)?);
            }
        }
        // Missing reports of identical scalar sensors under the same rule are one factor, which the first of them carries.
        let is_missing = |j: usize| observations[j].received().is_none();
        let alike = |j: &usize| is_missing(*j) && like(j) && rules[*j] == rules[i];
        if is_missing(i) && !(M == 1 && (0..i).any(|j| alike(&j))) {
            let last = if M == 1 { sensors.len() } else { i + 1 };
            let of = |kind| (i..last).filter(|j| alike(j) && observations[*j] == kind).count();
            let reports = MissingReports {
                nothing: of(Observation::Nothing),
                lost: of(Observation::Lost),
            };
            push(scheme(i)?.missing(broadcast, link, reports)?);
        }
    }
    Ok(all)
}
