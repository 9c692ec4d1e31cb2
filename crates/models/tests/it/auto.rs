//! Models by automatic differentiation against closed forms and the laws.

use fewbits_core::{GaussianDynamics, Sensing, laws};
use fewbits_models::{AutoDynamics, AutoSensing, Differentiable, Flow, LinearSensor, Number, constant_velocity_2d};
use nalgebra::{Matrix1, Matrix2, Matrix4, SMatrix, SVector, Vector2, Vector4};
use rand::SeedableRng;
use rand_pcg::Pcg64;

/// Position and velocity of a turn at a known rate, over one step.
#[derive(Clone, Copy)]
struct Turn(f64);

impl Differentiable<4, 4> for Turn {
    fn at<N: Number>(&self, x: &[N; 4]) -> [N; 4] {
        let (sin, cos) = self.0.sin_cos();
        let (along, across) = (sin / self.0, (1.0 - cos) / self.0);
        [
            x[0] + x[2] * along - x[3] * across,
            x[1] + x[2] * across + x[3] * along,
            x[2] * cos - x[3] * sin,
            x[2] * sin + x[3] * cos,
        ]
    }
}

/// Range and bearing from the origin.
struct Radar;

impl Differentiable<2, 2> for Radar {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [(x[0] * x[0] + x[1] * x[1]).sqrt(), x[1].atan2(x[0])]
    }
}

/// Harmonic motion `x'' = -w^2 x`.
struct Spring(f64);

impl Differentiable<2, 2> for Spring {
    fn at<N: Number>(&self, x: &[N; 2]) -> [N; 2] {
        [x[1], -x[0] * (self.0 * self.0)]
    }
}

struct Lorenz;

impl Differentiable<3, 3> for Lorenz {
    fn at<N: Number>(&self, x: &[N; 3]) -> [N; 3] {
        [
            (x[1] - x[0]) * 10.0,
            x[0] * (-x[2] + 28.0) - x[1],
            x[0] * x[1] - x[2] * (8.0 / 3.0),
        ]
    }
}

#[test]
fn range_and_bearing_have_the_textbook_jacobian() {
    let radar = AutoSensing::new(Radar, Matrix2::new(4.0, 0.1, 0.1, 0.01)).unwrap();
    for x in [
        Vector2::new(3.0, 4.0),
        Vector2::new(-2.0, 0.5),
        Vector2::new(1e-3, -2e-3),
    ] {
        let r = x.norm();
        let expected = Matrix2::new(x[0] / r, x[1] / r, -x[1] / (r * r), x[0] / (r * r));
        assert!((radar.jacobian(&x) - expected).amax() < 1e-14 * expected.amax());
        assert_eq!(radar.mean(&x), Vector2::new(x.norm(), x[1].atan2(x[0])));
    }
    laws::sensing::is_consistent(&radar, &[Vector2::new(3.0, 4.0), Vector2::new(-2.0, 0.5)]).unwrap();
    let mut rng = Pcg64::seed_from_u64(7);
    laws::sensing::draws_have_the_law(&radar, &mut rng, &Vector2::new(3.0, 4.0), 20_000).unwrap();
}

#[test]
fn own_dynamics_obey_the_laws_with_singular_noise_too() {
    let gain = Vector4::new(0.5, 0.0, 1.0, 0.0);
    for noise in [Matrix4::identity() * 0.3, gain * gain.transpose()] {
        let turn = AutoDynamics::new(Turn(0.3), noise).unwrap();
        let state = Vector4::new(1.0, -2.0, 0.5, 3.0);
        laws::dynamics::jacobian_is_the_derivative(&turn, &state).unwrap();
        laws::dynamics::draws_have_the_law(&turn, &mut Pcg64::seed_from_u64(3), &state, 20_000).unwrap();
    }
    let lorenz = AutoDynamics::new(Flow::new(Lorenz, 0.02, 2).unwrap(), SMatrix::identity()).unwrap();
    laws::dynamics::jacobian_is_the_derivative(&lorenz, &SVector::from([1.0, 2.0, 20.0])).unwrap();
}

/// A turn of nearly no rate is motion at constant velocity, whose matrix another type of this crate writes down (with the coordinates in
/// another order).
#[test]
fn a_slow_turn_is_constant_velocity() {
    let straight = constant_velocity_2d(1.0, 0.1).unwrap();
    let turn = AutoDynamics::new(Turn(1e-6), Matrix4::zeros()).unwrap();
    let jacobian = turn.jacobian(&Vector4::new(1.0, 2.0, 3.0, 4.0));
    let order = [0, 2, 1, 3];
    let found = Matrix4::from_fn(|i, j| jacobian[(order[i], order[j])]);
    assert!((found - straight.jacobian(&Vector4::zeros())).amax() < 2e-6);
}

/// The flow of a spring and its Jacobian are known; the error of the rule falls with the fourth power of the step.
#[test]
fn a_flow_is_of_order_four_and_so_is_its_jacobian() {
    let (w, t) = (2.0_f64, 0.7);
    let (sin, cos) = (w * t).sin_cos();
    let exact = Matrix2::new(cos, sin / w, -w * sin, cos);
    let error = |steps| {
        let flow = Flow::new(Spring(w), t, steps).unwrap();
        let at = Vector2::new(0.4, -1.0);
        let (value, slope) = (flow.value(&at) - exact * at, flow.derivative(&at) - exact);
        value.amax().max(slope.amax())
    };
    let ratio = error(8) / error(16);
    assert!((15.0..17.5).contains(&ratio), "{ratio}");
    assert!(Flow::new(Spring(1.0), 0.0, 1).is_err() && Flow::new(Spring(1.0), 1.0, 0).is_err());
}

/// A linear function gives what the linear sensor gives, to the last bit of its sums.
#[test]
fn a_linear_function_is_a_linear_sensor() {
    struct Row([f64; 3]);
    impl Differentiable<3, 1> for Row {
        fn at<N: Number>(&self, x: &[N; 3]) -> [N; 1] {
            [x[0] * self.0[0] + x[1] * self.0[1] + x[2] * self.0[2]]
        }
    }
    let row = [0.3, -1.5, 2.0];
    let own = AutoSensing::new(Row(row), Matrix1::new(0.2)).unwrap();
    let linear = LinearSensor::scalar(row.into(), 0.2).unwrap();
    let at = SVector::from([1.0, 2.0, 3.0]);
    assert_eq!(own.jacobian(&at), Sensing::jacobian(&linear, &at));
    assert!((own.mean(&at) - Sensing::mean(&linear, &at)).amax() < 1e-15);
    let refused = AutoDynamics::new(Spring(1.0), Matrix2::new(1.0, 2.0, 2.0, 1.0));
    assert!(refused.is_err() && AutoSensing::new(Radar, Matrix2::zeros()).is_err());
}
