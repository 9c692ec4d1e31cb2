//! `mpa-leader`: every sensor runs message passing with its own seed; who claims the lead?

use super::world::{Field, Method, Point, STEPS, World, canonical};
use crate::prelude::*;
use fewbits_baselines::pf_mpa::leader::{elect, nearest};
use fewbits_baselines::pf_mpa::{MessagePassing, Reports, Target, Tracker};
use fewbits_core::{NumberFormat, RoundedGaussian};

parameters! {
    pub struct Parameters {
        trials: u64 [2..=100_000] = 100 => quick 3 => "Trajectories of 25 steps.",
    }
}

rows! {
    pub struct Row by "{snr_db}dB-N{particles}" at full_trials {
        snr_db: f64 ["dB"] as x("SNR / dB, particles") => "Ratio of the powers of range and noise.",
        particles: usize as x => "Particles.",
        one: Measured => "Share of steps with one claimant.",
        none: Measured as points("none claims") => "Share of steps with no claimant.",
        several: Measured as points("several claim") => "Share of steps with several claimants.",
        nearest: Measured as points("the nearest leads") => "Share of steps in which the true nearest sensor leads.",
        mse: Measured => "Mean squared position error of the leader's estimate.",
        spread: Measured => "Variance of the sensors' estimates about their mean, both axes.",
    }
}

pub struct Leaders;

const SETTINGS: [(f64, usize); 3] = [(50.0, 40), (50.0, 10), (30.0, 40)];

impl Figure for Leaders {
    figure!(Parameters => Vec<Row>, "mpa-leader", "Elections among copies that drew for themselves", "particle message passing, Section 3.3",
        "Five sensors, each with its own message passing and its own seed; the leader's mean and covariance, rounded to \
         32 bits, are what all go on with. In 98 of 100 steps exactly one claims the lead. One shared seed, or a \
         deterministic tracker, would make it all of them."; linear("share of steps"));

    fn run(&self, p: &Parameters, context: &Context<'_>) -> Result<Vec<Row>, Error> {
        let (target, sensors) = (Target::printed()?, canonical());
        let row = |(snr_db, particles): (f64, usize)| -> Result<Row, Error> {
            let network = Point::published(snr_db, 4)?.network()?;
            let tracker = MessagePassing::improved(particles)?;
            let one = |trial: Trial| {
                let world = World::draw(trial.stream, &target, Field::Confined)?;
                let name = Method::Messages(tracker).name();
                let own = |i: usize| trial.stream.named(&name).indexed(i as u64);
                let mut streams: Vec<_> = (0..sensors.len()).map(|i| own(i).fast_rng()).collect();
                let mut shared: Gaussian<4> = super::world::prior()?;
                // Steps of one trajectory depend on each other: a trajectory is one trial.
                let mut means = [Moments::default(); 6];
                for k in 0..STEPS {
                    let ranges = world.ranges(&network, k);
                    let observed = network.observe(&target, k, &shared, &ranges, Reports::Levels)?;
                    let step = |rng| Some(tracker.step(rng, &target, k, &shared, &observed).ok()?.0);
                    let copies: Vec<_> = streams.iter_mut().map(|rng| step(rng).unwrap_or(shared)).collect();
                    let place = |c: &Gaussian<4>| Vector2::new(c.mean()[0], c.mean()[1]);
                    let places: Vec<_> = copies.iter().map(place).collect();
                    let election = elect(&sensors, &places)?;
                    let truth = Vector2::new(world.track[k][0], world.track[k][1]);
                    let mean = places.iter().sum::<Vector2<f64>>() / places.len() as f64;
                    let squares = places.iter().map(|p| (p - mean).norm_squared()).sum::<f64>();
                    let spread = squares / (places.len() - 1) as f64;
                    shared = RoundedGaussian::new(&copies[election.leader], &NumberFormat::Single)?.belief();
                    let is = |yes: bool| f64::from(u8::from(yes));
                    let count = election.claimants.len();
                    let error = (places[election.leader] - truth).norm_squared();
                    let leads = election.leader == nearest(&sensors, &truth);
                    let all = [is(count == 1), is(count == 0), is(count > 1), is(leads), error, spread];
                    means.iter_mut().zip(all).for_each(|(m, x)| m.add(x));
                }
                Ok(means.map(|m| m.mean()))
            };
            let sums = context.moments(context.stream("mpa-trajectories"), p.trials, one)?;
            Ok(Row {
                snr_db,
                particles,
                one: sums[0].into(),
                none: sums[1].into(),
                several: sums[2].into(),
                nearest: sums[3].into(),
                mse: sums[4].into(),
                spread: sums[5].into(),
            })
        };
        SETTINGS.into_iter().map(row).collect()
    }

    fn claims(&self, _: &Parameters, t: &Vec<Row>, claims: &mut Claims) {
        claims.all("sum", "every step has one, none or several", t, |r| {
            (r.one.value + r.none.value + r.several.value - 1.0).abs() < 1e-9
        });
    }
}
