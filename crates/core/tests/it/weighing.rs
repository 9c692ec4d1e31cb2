//! Likelihoods that only weigh.

use fewbits_core::{Error, Gaussian, Likelihood};
use nalgebra::{SVector, Vector1};

struct Weighs;

impl Likelihood<1> for Weighs {
    fn log_likelihood(&self, state: &SVector<f64, 1>) -> f64 {
        -state[0].abs()
    }
}

#[test]
fn likelihood_that_only_weighs_is_refused_by_gaussians() {
    let before = Gaussian::scalar(1.0, 2.0).unwrap();
    let mut belief = before;
    let object: &dyn Likelihood<1> = &Weighs;
    assert!(matches!(object.condition(&mut belief), Err(Error::Argument(_))));
    assert!(matches!(object.evidence(&belief), Err(Error::Argument(_))));
    assert_eq!(belief, before);
    assert_eq!((object.as_constant(), object.reads(&Vector1::zeros(), 0)), (None, true));
    let mut logs = [0.0; 3];
    object.add_log_likelihoods([&[1.0, -2.0, 0.5]], &mut logs);
    assert_eq!(logs, [-1.0, -2.0, -0.5]);
}
