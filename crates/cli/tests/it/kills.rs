//! Processes that are killed at any moment: centre and sensors with replays before and after, commands that pack and append.
//!
//! `FEWBITS_KILLS` is the number of kills; `.ci/kills` runs them at full number.

use crate::fleet::{Row, free_place, key, measuring, rows, sensor, written};
use crate::{Running, fewbits, folder, good, start, text};
use std::collections::HashMap;
use std::io::{BufRead, BufReader};
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

fn kills(otherwise: u64) -> u64 {
    std::env::var("FEWBITS_KILLS").map_or(otherwise, |text| text.parse().unwrap())
}

/// Moments that differ from kill to kill.
fn moment(kill: u64, longest: u64) -> Duration {
    Duration::from_millis(kill.wrapping_mul(2_654_435_761) % longest)
}

#[derive(Default)]
struct Recorded {
    up: Vec<Vec<u8>>,
    down: Vec<(SocketAddr, Vec<u8>)>,
    /// Bytes under each direction, sensor number and counter: the same counter must not authenticate two frames.
    sealed: HashMap<(bool, [u8; 12]), Vec<u8>>,
}

impl Recorded {
    fn see(&mut self, is_up: bool, bytes: &[u8]) {
        let Some(head) = bytes.first_chunk::<12>() else { return };
        let before = self.sealed.entry((is_up, *head)).or_insert_with(|| bytes.to_vec());
        assert_eq!(before, bytes, "a counter was used for two frames");
    }
}

/// Stands between sensors and centre and records all datagrams.
struct Eavesdropper {
    recorded: Arc<Mutex<Recorded>>,
    front: Arc<UdpSocket>,
    back: Arc<UdpSocket>,
    over: Arc<AtomicBool>,
    threads: Vec<std::thread::JoinHandle<()>>,
}

impl Eavesdropper {
    /// Sensors send to the returned address, the centre listens at `centre`.
    fn new(centre: &str) -> (Self, String) {
        let (recorded, over) = (Arc::new(Mutex::new(Recorded::default())), Arc::new(AtomicBool::new(false)));
        let front = Arc::new(UdpSocket::bind("127.0.0.1:0").unwrap());
        let back = Arc::new(UdpSocket::bind("127.0.0.1:0").unwrap());
        back.connect(centre).unwrap();
        let place = front.local_addr().unwrap().to_string();
        let sensors = Arc::new(Mutex::new(HashMap::<[u8; 4], SocketAddr>::new()));
        let mut threads = Vec::new();
        for is_up in [true, false] {
            let (recorded, over, sensors) = (recorded.clone(), over.clone(), sensors.clone());
            let (front, back) = (front.clone(), back.clone());
            threads.push(std::thread::spawn(move || {
                let socket = if is_up { &front } else { &back };
                socket.set_read_timeout(Some(Duration::from_millis(100))).unwrap();
                let mut buffer = [0; 2048];
                while !over.load(Ordering::Relaxed) {
                    // While the centre is down, its port refuses.
                    let Ok((count, from)) = socket.recv_from(&mut buffer) else {
                        continue;
                    };
                    let (bytes, mut recorded) = (&buffer[..count], recorded.lock().unwrap());
                    let Some(number) = bytes.first_chunk::<4>() else {
                        continue;
                    };
                    recorded.see(is_up, bytes);
                    if is_up {
                        sensors.lock().unwrap().insert(*number, from);
                        recorded.up.push(bytes.to_vec());
                        let _ = back.send(bytes);
                    } else if let Some(to) = sensors.lock().unwrap().get(number) {
                        recorded.down.push((*to, bytes.to_vec()));
                        let _ = front.send_to(bytes, to);
                    }
                }
            }));
        }
        let eavesdropper = Self {
            recorded,
            front,
            back,
            over,
            threads,
        };
        (eavesdropper, place)
    }

    /// Sends again the last two hundred datagrams of each direction, to the centre also from an address of its own.
    fn replay(&self) {
        let recorded = self.recorded.lock().unwrap();
        let stranger = UdpSocket::bind("127.0.0.1:0").unwrap();
        let centre = self.back.peer_addr().unwrap();
        for bytes in recorded.up.iter().rev().take(200) {
            let _ = stranger.send_to(bytes, centre);
            let _ = self.back.send(bytes);
        }
        for (to, bytes) in recorded.down.iter().rev().take(200) {
            let _ = self.front.send_to(bytes, to);
        }
    }

    fn end(self) -> u64 {
        self.over.store(true, Ordering::Relaxed);
        self.threads.into_iter().for_each(|thread| thread.join().unwrap());
        let recorded = self.recorded.lock().unwrap();
        (recorded.up.len() + recorded.down.len()) as u64
    }
}

/// A centre and the rows that all its lives have written.
struct Centre {
    folder: PathBuf,
    child: Running,
    lives: Arc<Mutex<Vec<Vec<String>>>>,
    readers: Vec<std::thread::JoinHandle<()>>,
}

impl Centre {
    fn new(folder: &Path) -> Self {
        let child = Running::new(start(folder, &["centre", "centre.toml"]));
        let mut centre = Self {
            folder: folder.to_owned(),
            child,
            lives: Arc::default(),
            readers: Vec::new(),
        };
        centre.read();
        centre
    }

    fn read(&mut self) {
        let (output, lives) = (self.child.stdout.take().unwrap(), self.lives.clone());
        let life = {
            let mut lives = lives.lock().unwrap();
            lives.push(Vec::new());
            lives.len() - 1
        };
        self.readers.push(std::thread::spawn(move || {
            for line in BufReader::new(output).lines().map_while(Result::ok) {
                lives.lock().unwrap()[life].push(line);
            }
        }));
    }

    fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    fn again(&mut self) {
        self.child = Running::new(start(&self.folder, &["centre", "centre.toml"]));
        self.read();
    }

    /// The complete rows of all lives, with their lines.
    fn rows(&self) -> Vec<(Row, String)> {
        let lives = self.lives.lock().unwrap();
        let mut all = Vec::new();
        for life in lives.iter().filter(|life| life.len() > 1) {
            // The last line may have been cut off by the kill.
            let whole = |line: &&String| line.split(',').count() == 6;
            let lines: Vec<&String> = life.iter().filter(whole).collect();
            let parsed = rows(lines.iter().map(|line| line.as_str()));
            all.extend(parsed.into_iter().zip(lines.into_iter().skip(1).cloned()));
        }
        all
    }

    /// Waits until both sensors have reported in a row beyond `count` rows.
    fn wait_for_both(&self, count: usize) {
        let began = Instant::now();
        while !self.rows().iter().skip(count).any(|((_, reports, _), _)| *reports == 2) {
            assert!(began.elapsed() < Duration::from_secs(60), "no row has two reports");
            std::thread::sleep(Duration::from_millis(20));
        }
    }
}

#[test]
fn killed_centre_and_sensors_go_on_beside_replays() {
    let folder = tempfile::tempdir().unwrap();
    let (centre_place, kills) = (free_place(), kills(6));
    let (eavesdropper, sensor_place) = Eavesdropper::new(&centre_place);
    written(folder.path(), &centre_place, &key('b'));
    for number in [1, 2] {
        let path = folder.path().join(format!("sensor{number}.toml"));
        let text = std::fs::read_to_string(&path)
            .unwrap()
            .replace(&centre_place, &sensor_place);
        std::fs::write(&path, text).unwrap();
    }
    let mut centre = Centre::new(folder.path());
    let mut sensors = measuring(folder.path());
    centre.wait_for_both(0);
    for kill in 0..kills {
        std::thread::sleep(Duration::from_millis(120) + moment(kill, 90));
        eavesdropper.replay();
        let known = centre.rows().len();
        // Centre, first sensor, centre, second sensor, and so on.
        if kill % 2 == 0 {
            centre.kill();
            eavesdropper.replay();
            std::thread::sleep(moment(kill + 7, 60));
            centre.again();
        } else {
            let which = (kill / 2 % 2) as usize;
            sensors[which].kill().unwrap();
            sensors[which].wait().unwrap();
            eavesdropper.replay();
            std::thread::sleep(moment(kill + 7, 60));
            sensors[which] = sensor(folder.path(), ["sensor1.toml", "sensor2.toml"][which]);
        }
        eavesdropper.replay();
        centre.wait_for_both(known);
    }
    let rows = centre.rows();
    centre.kill();
    for mut sensor in sensors {
        let _ = sensor.kill();
        sensor.wait().unwrap();
    }
    for reader in centre.readers {
        reader.join().unwrap();
    }
    let datagrams = eavesdropper.end();
    let refused: u64 = rows
        .iter()
        .map(|(_, line)| line.split(',').nth(4).unwrap().parse::<u64>().unwrap())
        .sum();
    println!("{kills} kills, {} rows, {datagrams} datagrams, {refused} refused", rows.len());
    let mut last: Option<&(Row, String)> = None;
    // Sensors may start late on a busy machine.
    let first = rows.iter().find(|((_, reports, _), _)| *reports == 2).unwrap().0.0;
    for row in &rows {
        let ((slot, reports, mean), line) = row;
        assert!(*reports <= 2);
        if let Some((before, text)) = last {
            // A centre that starts again writes its last row once more: the same but for what was refused since.
            let same = |line: &str| line.split(',').take(4).map(str::to_owned).collect::<Vec<_>>();
            assert!(*slot > before.0 || *slot == before.0 && same(line) == same(text), "{line} after {text}");
        }
        // 5 and 5.2 in turn.
        if *slot > first + 25 {
            assert!((mean - 5.1).abs() < 0.8, "{line}");
        }
        last = Some(row);
    }
    assert!(refused > 0);
}

/// Rows of a recording, and whether it has its end.
fn count(folder: &Path, file: &str) -> (u64, bool) {
    let output = fewbits(folder, &["info", file, "--json"], b"");
    let info: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let (rows, is_whole) = (info["rows"].as_u64().unwrap(), info["finished"].as_bool().unwrap());
    assert_eq!(output.status.code(), Some(i32::from(!is_whole)), "{info}");
    let cat = fewbits(folder, &["cat", file, "--columns", "price"], b"");
    assert_eq!(text(&cat.stdout).lines().count() as u64, rows + 1);
    (rows, is_whole)
}

/// Packing over an earlier recording, appending, two writers at once, each killed: the recording is that before or the whole new one, and
/// rows come by whole tables.
#[test]
fn recordings_survive_kills_of_packing_appending_and_two_writers() {
    let (_kept, folder) = folder();
    let pack = ["pack", "a.csv", "--time", "exact", "-o", "a.fewb"];
    let append = ["pack", "a.csv", "--append", "-o", "a.fewb"];
    good(&folder, &pack, b"");
    let (kills, mut rows, mut changed) = (kills(9), 1000, 0);
    for kill in 0..kills {
        let mut children = match kill % 3 {
            0 => vec![start(&folder, &pack)],
            1 => vec![start(&folder, &append)],
            _ => vec![start(&folder, &append), start(&folder, &append)],
        };
        std::thread::sleep(moment(kill, 45));
        // Of two writers one is killed, and the other ends as it can.
        let _ = children[0].kill();
        for mut child in children {
            child.wait().unwrap();
        }
        let (found, is_whole) = count(&folder, "a.fewb");
        assert!(is_whole, "kill {kill}: {found} rows without an end");
        let possible = match kill % 3 {
            0 => vec![rows, 1000],
            1 => vec![rows, rows + 1000],
            _ => vec![rows, rows + 1000, rows + 2000],
        };
        assert!(possible.contains(&found), "kill {kill}: {found} rows after {rows}");
        changed += u64::from(found != rows);
        rows = found;
    }
    println!("{kills} kills: {changed} changed the recording, {rows} rows at last");
    good(&folder, &append, b"");
    assert_eq!(count(&folder, "a.fewb"), (rows + 1000, true));
}
