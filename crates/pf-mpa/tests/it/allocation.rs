//! No tracker allocates in a step once its workspace is filled.

use allocation_counter::measure;
use fewbits_baselines::pf_mpa::MessagePassing;
use fewbits_baselines::pf_mpa::{
    Encoder, GuidedGaussian, Linearised, Network, POSITION, RaoBlackwellGuided, Reports, Target, Tracker,
};
use fewbits_core::Gaussian;
use fewbits_monte_carlo::Stream;
use fewbits_pf_mpa::{GridFilter, QuantizedRange, RangeNoise};
use nalgebra::{Matrix4, Vector2, Vector4};
use std::hint::black_box;

fn allocates_nothing<T: Tracker>(name: &str, tracker: &T) {
    let target = Target::printed().unwrap();
    let covariance = Matrix4::from_diagonal(&Vector4::new(0.04, 0.04, 0.01, 0.01));
    let prior = Gaussian::new(Vector4::new(13.0, 17.0, 0.0, -0.6), covariance).unwrap();
    let places = [[4.0, 4.0], [16.0, 4.0], [10.0, 10.0], [4.0, 16.0], [16.0, 16.0]].map(Vector2::from);
    let scheme = QuantizedRange::new(4, RangeNoise::from_snr_db(50.0).unwrap()).unwrap();
    let network = Network::new(&places, scheme, Encoder::published(3.0).unwrap()).unwrap();
    let mut rng = Stream::new(5).fast_rng();
    let mut belief = tracker.start(&mut rng, &target, &prior).unwrap();
    let mut workspace = T::Workspace::default();
    for (k, state) in target.simulate(&mut rng, prior.mean(), 12).iter().enumerate() {
        let ranges = network.measure(&mut rng, state[0], state[1]);
        let estimate = tracker.estimate(&belief);
        let observed = network
            .observe(&target, k, &estimate, &ranges, Reports::Levels)
            .unwrap();
        let used = measure(|| {
            tracker
                .step_in_place(&mut rng, &target, k, &mut belief, &observed, &mut workspace)
                .unwrap();
        });
        assert!(k == 0 || used.count_total == 0, "{name}, step {k}: {} allocations", used.count_total);
    }
}

#[test]
fn a_step_allocates_nothing() {
    // The counter counts.
    assert_eq!(measure(|| drop(black_box(vec![0_u8; 64]))).count_total, 1);
    allocates_nothing("grid", &GridFilter::new(POSITION).unwrap());
    allocates_nothing("improved", &MessagePassing::improved(40).unwrap());
    allocates_nothing("published", &MessagePassing::published(40).unwrap());
    allocates_nothing("message passing", &Linearised::MESSAGE_PASSING);
    allocates_nothing("guided", &GuidedGaussian::new(40).unwrap());
    allocates_nothing("Rao-Blackwell", &RaoBlackwellGuided::new(40).unwrap());
}
