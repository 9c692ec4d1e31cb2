//! Functions of the caller that see all points at once and may fail, against the same models as types.

use fewbits_core::factor::Value;
use fewbits_core::{Belief, Gaussian, Observed};
use fewbits_filters::calibration::Instant;
use fewbits_filters::centre::{Event, FusionCentre};
use fewbits_filters::fit::{Request, fit, fit_watched};
use fewbits_filters::{
    BootstrapFilter, Error, MomentFilter, Particles, ResamplingRule, RootGaussian, SigmaPointFilter, StateFilter,
};
use fewbits_models::{AutoDynamics, AutoSensing, Differentiable, Number};
use fewbits_monte_carlo::Stream;
use nalgebra::{Matrix1, Matrix2, Vector2};
use rand::RngExt;
use std::cell::Cell;
use std::ops::ControlFlow;

/// A pendulum over a short step, and the distance that is seen of it.
#[derive(Clone, Copy)]
struct Pendulum;

impl Differentiable<2, 2> for Pendulum {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [x[0] + x[1] * 0.1, x[1] - x[0].sin() * 0.1]
    }
}

#[derive(Clone, Copy)]
struct Distance;

impl Differentiable<2, 1> for Distance {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 1] {
        [(x[0] * x[0] + 9.0).sqrt()]
    }
}

/// An error of the caller's, beside those of the library.
#[derive(Debug, PartialEq)]
enum Failed {
    Mine,
    Library(Error),
}

impl From<Error> for Failed {
    fn from(error: Error) -> Self {
        Self::Library(error)
    }
}

fn prior() -> Gaussian<2> {
    Gaussian::new(Vector2::new(0.4, 0.1), Matrix2::new(0.5, 0.1, 0.1, 0.3)).unwrap()
}

#[test]
fn sigma_points_by_functions_are_those_by_models() {
    let noise = Matrix2::new(0.02, 0.001, 0.001, 0.01);
    let dynamics = AutoDynamics::new(Pendulum, noise).unwrap();
    let sensing = AutoSensing::new(Distance, Matrix1::new(0.04)).unwrap();
    let mut rng = Stream::new(1).rng();
    for mut filter in [
        SigmaPointFilter::<2>::cubature().unwrap(),
        SigmaPointFilter::unscented(1.0).unwrap(),
    ] {
        let mut typed = filter.start(&mut rng, &prior()).unwrap();
        let mut free: RootGaussian<2> = typed;
        for z in [3.1, 3.0, 3.3] {
            filter.predict(&mut rng, &dynamics, &mut typed).unwrap();
            let report = Observed::new(sensing, Value::scalar(z, 0.04).unwrap());
            let expected = filter.update(&mut rng, &mut typed, &[&report]).unwrap();
            filter
                .predict_by(&mut free, &noise, |[angle, speed]| {
                    for (angle, speed) in angle.iter_mut().zip(speed) {
                        (*angle, *speed) = (*angle + *speed * 0.1, *speed - angle.sin() * 0.1);
                    }
                    Ok::<(), Error>(())
                })
                .unwrap();
            let found = filter
                .update_by(
                    &mut free,
                    |[angle, _], [seen]| {
                        seen.iter_mut()
                            .zip(*angle)
                            .for_each(|(z, angle)| *z = (angle * angle + 9.0).sqrt());
                        Ok::<(), Error>(())
                    },
                    |_| Ok(Value::scalar(z, 0.04)?),
                )
                .unwrap();
            assert!((found.log_likelihood - expected.log_likelihood).abs() < 1e-12);
            assert!((free.mean() - typed.mean()).amax() < 1e-12);
            assert!((free.lower() - typed.lower()).amax() < 1e-12);
        }
    }
}

#[test]
fn a_failing_function_of_sigma_points_leaves_the_belief() {
    let mut filter = SigmaPointFilter::<2>::cubature().unwrap();
    let before = filter.start(&mut Stream::new(1).rng(), &prior()).unwrap();
    let mut belief = before;
    let noise = Matrix2::identity();
    let failed = filter.predict_by(&mut belief, &noise, |[angle, _]| {
        angle.fill(7.0);
        Err(Failed::Mine)
    });
    assert_eq!((failed, belief), (Err(Failed::Mine), before));
    let failed: Result<(), Failed> = filter.predict_by(&mut belief, &noise, |[angle, _]| {
        angle.fill(f64::NAN);
        Ok(())
    });
    assert!(matches!(failed, Err(Failed::Library(Error::NotANumber { .. }))) && belief == before);
    let seen = |_: &[&[f64]; 2], [seen]: [&mut [f64]; 1]| {
        seen.fill(f64::NAN);
        Ok(())
    };
    let failed = filter.update_by(&mut belief, seen, |_| Ok(Value::scalar(0.0, 1.0).map_err(Error::from)?));
    assert!(matches!(failed, Err(Failed::Library(Error::NotANumber { .. }))) && belief == before);
    let failed = filter.update_by(&mut belief, |_, _| Ok(()), |_| Err::<Value<1>, _>(Failed::Mine));
    assert_eq!((failed.unwrap_err(), belief), (Failed::Mine, before));
}

/// Ten thousand particles of a model without a type follow the sigma points.
#[test]
fn a_particle_filter_by_functions_needs_no_model() {
    let mut rng = Stream::new(3).fast_rng();
    let mut filter = BootstrapFilter::new(ResamplingRule::default(), 10_000).unwrap();
    let mut belief: Particles<2> = filter.start(&mut rng, &prior()).unwrap();
    let mut points = SigmaPointFilter::<2>::unscented(1.0).unwrap();
    let mut close = points.start(&mut rng, &prior()).unwrap();
    let dynamics = AutoDynamics::new(Pendulum, Matrix2::identity() * 0.01).unwrap();
    let sensing = AutoSensing::new(Distance, Matrix1::new(0.04)).unwrap();
    for z in [3.1, 3.0, 3.05] {
        points.predict(&mut rng, &dynamics, &mut close).unwrap();
        let report = Observed::new(sensing, Value::scalar(z, 0.04).unwrap());
        points.update(&mut rng, &mut close, &[&report]).unwrap();
        let info = filter.step_by(
            &mut rng,
            &mut belief,
            |rng, [angle, speed]| {
                let mut normal = || rng.sample::<f64, _>(rand_distr::StandardNormal);
                for (angle, speed) in angle.iter_mut().zip(speed) {
                    let before = *angle;
                    *angle += *speed * 0.1 + 0.1 * normal();
                    *speed += 0.1 * normal() - before.sin() * 0.1;
                }
                Ok::<(), Error>(())
            },
            |[angle, _], logs| {
                let log = |x: &f64| -0.5 * ((z - (x * x + 9.0).sqrt()) / 0.2_f64).powi(2);
                logs.iter_mut().zip(angle).for_each(|(sum, x)| *sum += log(x));
                Ok(())
            },
        );
        assert!(info.unwrap().effective_sample_size.unwrap() > 1000.0);
    }
    // The distance hardly tells the sign of the angle, so the approximation by a Gaussian is rough.
    let deviation = close.covariance()[(0, 0)].sqrt();
    assert!((belief.mean()[0] - close.mean()[0]).abs() < 0.5 * deviation);
}

#[test]
fn a_failing_function_of_particles_leaves_the_belief() {
    let mut rng = Stream::new(3).fast_rng();
    let mut filter = BootstrapFilter::new(ResamplingRule::default(), 50).unwrap();
    let before: Particles<2> = filter.start(&mut rng, &prior()).unwrap();
    let mut belief = before.clone();
    let failed = filter.step_by(&mut rng, &mut belief, |_, _| Err(Failed::Mine), |_, _| Ok(()));
    assert!(failed.unwrap_err() == Failed::Mine && belief == before);
    let failed = filter.step_by(
        &mut rng,
        &mut belief,
        |_, [angle, _]| {
            angle.fill(3.0);
            Ok(())
        },
        |_, logs| {
            logs.fill(f64::NAN);
            Err(Failed::Mine)
        },
    );
    assert!(failed.unwrap_err() == Failed::Mine && belief == before);
    let failed = filter.step_by(
        &mut rng,
        &mut belief,
        |_, _| Ok(()),
        |_, logs| {
            logs.fill(f64::NEG_INFINITY);
            Ok::<(), Failed>(())
        },
    );
    assert!(failed.unwrap_err() == Failed::Library(Error::Impossible) && belief == before);
}

#[test]
fn a_centre_may_be_moved_to_another_thread_and_read_from_several() {
    fn both<T: Send + Sync>() {}
    both::<FusionCentre<2, MomentFilter>>();
    both::<FusionCentre<2, BootstrapFilter<2>>>();
}

#[test]
fn events_name_themselves_and_their_sensor() {
    assert_eq!((Event::Dead(7).name(), Event::Dead(7).sensor()), ("dead", Some(7)));
    assert_eq!((Event::NoiseOverstated.name(), Event::NoiseOverstated.sensor()), ("noise overstated", None));
}

/// A fit that is stopped at any evaluation ends soon and says so; one that is not is the plain fit.
#[test]
fn a_fit_can_be_stopped() {
    let mut rng = Stream::new(6).rng();
    let mut level = 20.0;
    let instants: Vec<Instant> = (0..100)
        .map(|row| {
            let mut normal = || rng.sample::<f64, _>(rand_distr::StandardNormal);
            level += 0.3 * normal();
            let values = [0.2, 0.5].map(|noise| level + noise * normal());
            Instant {
                seconds: f64::from(row),
                values: vec![(0, values[0].into()), (1, values[1].into())],
            }
        })
        .collect();
    let request = Request::default();
    let asked = Cell::new(0);
    let count = |limit: u32| {
        asked.set(0);
        fit_watched(&instants, 2, &request, &|| {
            asked.set(asked.get() + 1);
            if asked.get() > limit {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        })
    };
    assert_eq!(count(u32::MAX).unwrap().unwrap(), fit(&instants, 2, &request).unwrap());
    let all = asked.get();
    for limit in [0, 1, all / 2, all - 1] {
        assert_eq!((count(limit).unwrap(), asked.get()), (None, limit + 1));
    }
}
