//! The duty cycle of LoRa radios.

use crate::books::{Chatter, conserves};
use crate::worlds::setup;
use fewbits_network::{Access, CarrierSense, Channel, Detail, Field, Instant, Radio, SensorId, Setup, Simulator};

const SENSORS: u32 = 3;
const FRAMES: u64 = 20;

/// Frames are asked for every half second; a frame of 25 bytes at spreading factor 7 needs a pause of six seconds.
#[test]
fn every_node_keeps_its_share() {
    let free = Radio::lorawan(7).unwrap();
    let listening = CarrierSense {
        tries: 1000,
        ..CarrierSense::IEEE_802_15_4
    };
    for (access, retries, loss) in [
        (Access::Scheduled, None, 0.0),
        (Access::Scheduled, Some(9), 0.2),
        (Access::CarrierSense(listening), Some(9), 0.2),
    ] {
        for share in [None, Some(0.01), Some(0.1)] {
            let radio = share.map_or(free, |share| free.with_duty_cycle(share).unwrap());
            let setup = Setup {
                radio,
                access,
                retries,
                channel: Channel::lossy(loss).unwrap(),
                detail: Detail::Everything,
                ..setup(4)
            };
            let nodes = vec![0; SENSORS as usize + 1];
            let mut network =
                Simulator::new(Chatter, nodes, Field::star(SENSORS as usize, 10.0).unwrap(), setup).unwrap();
            for sensor in 1..=SENSORS {
                for k in 0..FRAMES {
                    network.start(SensorId(sensor), Instant(k * 500_000_000), 0).unwrap();
                }
            }
            network.run_until(Instant(u64::MAX / 2)).unwrap();
            conserves(network.ledger());
            let case = format!("{access:?} {retries:?} {share:?}");
            // A frame whose acknowledgement was lost arrives again.
            let arrived = u64::from(network.nodes()[0]);
            // By carrier sense acknowledgements may destroy frames until they are given up.
            assert!(access != Access::Scheduled || arrived >= u64::from(SENSORS) * FRAMES, "{case}: {arrived}");
            for sensor in 1..=SENSORS {
                let own = network
                    .log()
                    .transmissions()
                    .filter(|sent| sent.from == SensorId(sensor));
                let sent: Vec<(u64, f64)> = own
                    .map(|sent| (sent.at.0, radio.duration(fewbits_network::Bits(sent.air)).value()))
                    .collect();
                assert!(sent.len() as u64 >= FRAMES, "{case}");
                let apart = |pair: &[(u64, f64)]| (pair[1].0 - pair[0].0) as f64 * 1e-9;
                let is_kept = |share: f64| sent.windows(2).all(|pair| apart(pair) >= pair[0].1 / share - 1e-6);
                assert!(share.is_none_or(is_kept), "{case}: {sent:?}");
                // Without a duty cycle the frames come faster than one of 1 % allows.
                assert!(share.is_some() || !is_kept(0.01), "{case}");
            }
        }
    }
    assert!(Radio::cc2420(0.0).unwrap().with_duty_cycle(0.01).is_err());
    for share in [0.0, -1.0, 1.1, f64::NAN] {
        assert!(free.with_duty_cycle(share).is_err(), "{share}");
    }
}
