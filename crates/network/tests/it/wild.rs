//! Wild arguments: times, energies, losses and frames are numbers, or refused.

use fewbits_core::laws::wild;
use fewbits_network::{Bits, Channel, Check, Clock, Field, Instant, Joules, Log, Radio, Seconds, Watts};
use fewbits_topology::Deployment;
use nalgebra::Vector2;
use proptest::prelude::*;

fn wild() -> impl Strategy<Value = f64> {
    any::<u64>().prop_map(wild::number)
}

proptest! {
    #[test]
    fn media_answer_numbers(x in prop::array::uniform6(wild()), bits in any::<u32>(), nodes in 0..6_usize, question in prop::option::of(0..5000_usize)) {
        prop_assert_eq!(Seconds::new(x[0]).is_ok_and(|s| s.value().is_nan()), false);
        prop_assert_eq!(Joules::new(x[0]).is_ok_and(|s| s.value().is_nan()), false);
        prop_assert_eq!(Watts::new(x[0]).is_ok_and(|s| s.value().is_nan()), false);
        for channel in [Channel::lossy(x[0]), Channel::flipping(x[1]), Channel::lossy(x[0]).and_then(Channel::checked)].into_iter().flatten() {
            for check in [Check::Whole, Check::Header] {
                if let Ok(link) = channel.link(x[2], question, check) {
                    prop_assert!((0.0..=1.0).contains(&link.arrival()), "{:?} {}: {:?}", channel, x[2], link);
                }
            }
        }
        for radio in [Radio::cc2420(x[3]), Ok(Radio::first_order())].into_iter().flatten() {
            let count = Bits(u64::from(bits));
            let _ = (radio.on_air(count), radio.link_frames(count), radio.answer_time(), radio.wake_up());
            let energies = [radio.transmit(count, 10.0), radio.receive(count), radio.turn(), radio.listen()];
            prop_assert!(radio.duration(count).value() >= 0.0 && energies.iter().all(|e| e.value() >= 0.0), "{:?}", radio);
        }
        if let Ok(clock) = Seconds::new(x[4]).and_then(Clock::new)
            && let Ok(after) = Seconds::new(x[5])
        {
                let slot = clock.slot(Instant::default().after(after));
                let _ = (clock.start(slot), clock.deadline(slot), clock.end(bits));
        }
        for field in [Field::star(nodes, x[0]).ok(), Field::ring(nodes, x[0]).ok(), Deployment::given(vec![Vector2::new(x[0], x[1])]).ok().and_then(|d| Field::new(&d, x[2]).ok())].into_iter().flatten() {
            prop_assert!(!field.range().is_nan() && field.len() <= nodes.max(1) + 1);
        }
    }

    #[test]
    fn any_bytes_are_a_log_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..120)) {
        let _ = Log::read(bytes.as_slice());
    }
}
