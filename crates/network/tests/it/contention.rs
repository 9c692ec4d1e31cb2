//! Carrier sense: collisions against hand calculations.

use crate::books::{Chatter, conserves};
use crate::worlds::setup;
use fewbits_network::{Access, CarrierSense, Field, Instant, SensorId, Setup, Simulator};

const TRIALS: u64 = 3000;

fn contending(seed: u64, retries: Option<u32>) -> Setup {
    Setup {
        access: Access::CarrierSense(CarrierSense::IEEE_802_15_4),
        retries,
        ..setup(seed)
    }
}

/// Shares of runs in which none, one and both of two frames of 201 bits arrive that nodes 1 and 2 want to send to node 0 at the same time.
fn shares(field: &Field, retries: Option<u32>) -> [f64; 3] {
    let mut shares = [0.0; 3];
    for seed in 0..TRIALS {
        let setup = contending(seed, retries);
        let mut network = Simulator::new(Chatter, vec![0; 3], field.clone(), setup).unwrap();
        for node in [1, 2] {
            network.start(SensorId(node), Instant(0), 0).unwrap();
        }
        network.run_until(Instant(1_000_000_000)).unwrap();
        conserves(network.ledger());
        shares[network.nodes()[0] as usize] += 1.0 / TRIALS as f64;
    }
    shares
}

fn near(share: f64, p: f64) -> bool {
    (share - p).abs() <= 4.0 * (p * (1.0 - p) / TRIALS as f64).sqrt()
}

/// Both draw one of eight waits. Who draws the later hears the other, whose frame lasts 804 us, and waits again: both are lost if they draw the same.
#[test]
fn nodes_that_hear_each_other_collide_once_in_eight() {
    let [none, one, both] = shares(&Field::star(2, 10.0).unwrap(), None);
    assert!(near(none, 1.0 / 8.0) && near(both, 7.0 / 8.0) && one < 0.002, "{none} {one} {both}");
}

/// Neither hears the other: both are lost if their waits differ by 0, 1 or 2 units of 320 us, 34 of 64 draws.
#[test]
fn hidden_nodes_collide_more_often() {
    let hidden = Field::from_csv("0,1,10\n0,2,10").unwrap();
    let [none, one, both] = shares(&hidden, None);
    assert!(near(none, 34.0 / 64.0) && near(both, 30.0 / 64.0) && one == 0.0, "{none} {one} {both}");
    // Repetitions draw again.
    let [_, _, both] = shares(&hidden, Some(5));
    assert!(both > 0.9, "{both}");
}

/// A node that always hears another gives its frame up.
#[test]
fn who_never_finds_the_air_free_gives_up() {
    let sense = CarrierSense {
        least: 0,
        most: 0,
        tries: 3,
        ..CarrierSense::IEEE_802_15_4
    };
    let setup = Setup {
        access: Access::CarrierSense(sense),
        ..setup(1)
    };
    let mut network = Simulator::new(Chatter, vec![0; 3], Field::star(2, 10.0).unwrap(), setup.clone()).unwrap();
    network.start(SensorId(1), Instant(0), 0).unwrap();
    network.start(SensorId(2), Instant(400_000), 0).unwrap();
    network.run_until(Instant(1_000_000_000)).unwrap();
    assert_eq!((network.nodes()[0], network.ledger().faults().lost), (1, 1));
    let sense = CarrierSense { tries: 0, ..sense };
    let access = Access::CarrierSense(sense);
    assert!(Simulator::new(Chatter, vec![0; 3], Field::star(2, 10.0).unwrap(), Setup { access, ..setup }).is_err());
}
