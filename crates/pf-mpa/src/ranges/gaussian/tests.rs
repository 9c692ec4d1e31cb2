//! That a filter's covariance stays one.

use super::*;

/// A range of which it is doubtful whether it depends on the distance raises the variance. Covariances with an error of scale that is held
/// must not outgrow its variance then.
#[test]
fn a_held_scale_keeps_the_covariance_positive() {
    let n = 6;
    let mut normal = Normal {
        mean: vec![3.0, 4.0, 0.0, 0.0, 0.0, 0.0],
        covariance: vec![0.0; n * n],
        axes: 2,
        only: None,
    };
    for (i, variance) in [1.0, 1.0, 0.1, 0.1, 0.5, 0.01].into_iter().enumerate() {
        normal.covariance[i * n + i] = variance;
    }
    let mut cross = [0.0; 6];
    for k in 0..60_i32 {
        let place = [10.0 * f64::from(k % 3), 7.0 * f64::from(k % 2), 0.0];
        let predicted = normal.range(Measured::Distance, &place, 0.0, 0, &mut cross);
        let factor = if k % 4 == 3 { 3.0 } else { 0.3 };
        normal.condition((predicted, &cross), (predicted.mean, factor * predicted.variance), true);
        let scale = 5;
        for i in (0..n).filter(|i| *i != scale) {
            let cross = normal.covariance[i * n + scale];
            let both = normal.variance(i) * normal.variance(scale);
            assert!(cross * cross <= both * (1.0 + 1e-9), "range {k}, coordinate {i}: {cross} of {both}");
        }
        let positions = normal.covariance[1].powi(2);
        assert!(positions <= normal.variance(0) * normal.variance(1) * (1.0 + 1e-9), "range {k}");
    }
}
