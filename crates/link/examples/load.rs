//! Many simulated sensors in one process, to load centres: one thread and four sockets per centre.
//!
//! ```text
//! load KEY_FILE SECONDS CENTRE FIRST LAST [CENTRE FIRST LAST ...]
//! ```
//! `KEY_FILE` holds the fleet key, `CENTRE` is an address, and the sensors FIRST to LAST are its own. Each reports the sign of its innovation
//! (`report = "bit"`) in noise of deviation 0.5 about 5. Every ten seconds, and at the end, a line says what was asked and answered.

use fewbits_core::{SchemeNode, SensorNode};
use fewbits_dymbo::SignBit;
use fewbits_link::{FleetKey, Request, SensorLink, now, sensor_of};
use fewbits_monte_carlo::Stream;
use fewbits_protocol::{Feedback, SensorSettings};
use nalgebra::Vector1;
use rand::Rng;
use rand_distr::StandardNormal;
use std::collections::VecDeque;
use std::error::Error;
use std::net::{SocketAddr, UdpSocket};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

const SOCKETS: usize = 4;
const NOISE: f64 = 0.5;
const LEVEL: f64 = 5.0;
/// All say where they are within this time, and again if they are not asked for so long.
const HELLO_WITHIN: Duration = Duration::from_secs(10);
const HELLO_EVERY: Duration = Duration::from_secs(30);

#[derive(Default)]
struct Totals {
    asked: AtomicU64,
    reported: AtomicU64,
    hellos: AtomicU64,
}

struct Shard {
    centre: SocketAddr,
    first: u32,
    links: Vec<SensorLink>,
    sockets: Vec<UdpSocket>,
    totals: Arc<Totals>,
    /// Sensors in the order of their next hello.
    hellos: VecDeque<(Instant, usize)>,
    asked_at: Vec<Instant>,
}

impl Shard {
    fn new(
        fleet: &FleetKey,
        centre: SocketAddr,
        (first, last): (u32, u32),
        totals: Arc<Totals>,
    ) -> Result<Self, Box<dyn Error>> {
        let settings = SensorSettings::new(Feedback::Told);
        let link = |number| Ok::<_, Box<dyn Error>>(SensorLink::new(settings, number, fleet.key_of(number, 1)?, None)?);
        let links = (first..=last).map(link).collect::<Result<Vec<_>, _>>()?;
        let socket = |_| {
            let socket = UdpSocket::bind("0.0.0.0:0")?;
            socket2::SockRef::from(&socket).set_recv_buffer_size(4 << 20)?;
            socket.set_nonblocking(true)?;
            Ok::<_, std::io::Error>(socket)
        };
        let (start, count) = (Instant::now(), links.len());
        Ok(Self {
            centre,
            first,
            sockets: (0..SOCKETS).map(socket).collect::<Result<_, _>>()?,
            totals,
            hellos: (0..count)
                .map(|i| (start + HELLO_WITHIN.mul_f64(i as f64 / count as f64), i))
                .collect(),
            asked_at: vec![start; count],
            links,
        })
    }

    fn run(&mut self, until: Instant) -> Result<(), Box<dyn Error>> {
        let mut node = SchemeNode::new(SignBit::new(NOISE * NOISE)?);
        let mut rng = Stream::new(u64::from(self.first)).rng();
        let (mut buffer, mut requests) = ([0; 2048], Vec::new());
        while Instant::now() < until {
            let mut is_idle = true;
            for place in 0..SOCKETS {
                for _ in 0..256 {
                    let Ok((count, _)) = self.sockets[place].recv_from(&mut buffer) else {
                        break;
                    };
                    is_idle = false;
                    self.take(place, &buffer[..count], &mut node, &mut rng, &mut requests)?;
                }
            }
            self.say_hello()?;
            if is_idle {
                std::thread::sleep(Duration::from_millis(1));
            }
        }
        Ok(())
    }

    fn take(
        &mut self,
        place: usize,
        bytes: &[u8],
        node: &mut SchemeNode<SignBit, 1>,
        rng: &mut dyn Rng,
        requests: &mut Vec<Request>,
    ) -> Result<(), Box<dyn Error>> {
        let Some(index) = sensor_of(bytes).and_then(|number| number.checked_sub(self.first)) else {
            return Ok(());
        };
        let Some(link) = self.links.get_mut(index as usize) else {
            return Ok(());
        };
        link.on_datagram(now(), bytes, requests)?;
        while let Some(request) = requests.pop() {
            match request {
                Request::Datagram(bytes) => {
                    self.totals.reported.fetch_add(1, Ordering::Relaxed);
                    let _ = self.sockets[place].send_to(&bytes, self.centre);
                }
                Request::Sample { feedback, .. } => {
                    self.totals.asked.fetch_add(1, Ordering::Relaxed);
                    self.asked_at[index as usize] = Instant::now();
                    let noise: f64 = rand::RngExt::sample(rng, StandardNormal);
                    let report = node.report(rng, &Vector1::new(LEVEL + NOISE * noise), &feedback)?;
                    link.on_sample(now(), report.as_ref(), requests)?;
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn say_hello(&mut self) -> Result<(), Box<dyn Error>> {
        let time = Instant::now();
        // A few at a time: the centre's answers come in between.
        for _ in 0..64 {
            if self.hellos.front().is_none_or(|(at, _)| *at > time) {
                break;
            }
            let Some((_, index)) = self.hellos.pop_front() else {
                break;
            };
            let again = match self.asked_at[index].elapsed() < HELLO_EVERY && self.links[index].counts().taken > 0 {
                true => self.asked_at[index] + HELLO_EVERY,
                false => {
                    if let Request::Datagram(bytes) = self.links[index].hello()? {
                        let _ = self.sockets[index % SOCKETS].send_to(&bytes, self.centre);
                        self.totals.hellos.fetch_add(1, Ordering::Relaxed);
                    }
                    time + HELLO_EVERY
                }
            };
            self.hellos.push_back((again, index));
        }
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [key, seconds, shards @ ..] = &words[..] else {
        return Err("expected KEY_FILE SECONDS CENTRE FIRST LAST [CENTRE FIRST LAST ...]".into());
    };
    let fleet = FleetKey::from_hex(std::fs::read_to_string(key)?.trim())?;
    let (totals, start) = (Arc::new(Totals::default()), Instant::now());
    let until = start + Duration::from_secs(seconds.parse()?);
    let mut threads = Vec::new();
    for shard in shards.chunks(3) {
        let [centre, first, last] = shard else {
            return Err("expected CENTRE FIRST LAST for each centre".into());
        };
        let mut shard = Shard::new(&fleet, centre.parse()?, (first.parse()?, last.parse()?), totals.clone())?;
        threads.push(std::thread::spawn(move || shard.run(until).map_err(|error| error.to_string())));
    }
    let say = || {
        let count = |of: &AtomicU64| of.load(Ordering::Relaxed);
        let (asked, reported, hellos) = (count(&totals.asked), count(&totals.reported), count(&totals.hellos));
        println!("{:5.0} s: {asked} questions, {reported} reports, {hellos} hellos", start.elapsed().as_secs_f64());
    };
    while Instant::now() < until {
        std::thread::sleep(Duration::from_secs(10).min(until.saturating_duration_since(Instant::now())));
        say();
    }
    for thread in threads {
        thread.join().map_err(|_| "a thread ended")??;
    }
    say();
    Ok(())
}
