//! A centre that is killed at any moment goes on without a wrong estimate.

use crate::world::{Reports, SENSORS, assert_replayed, peers, receiver, settings};
use crate::worlds::sensors;
use fewbits_link::{Output, Station, Step, Store, Udp, run_station};
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

const FOLDER: &str = "FEWBITS_LINK_TEST_FOLDER";
const ADDRESS: &str = "FEWBITS_LINK_TEST_ADDRESS";
/// So many reports come before the first kill.
const REPORTS: usize = 50;

/// The process that is killed: a centre that writes each step to a journal. Does nothing unless the test below starts it.
#[test]
fn centre_process() {
    let (Ok(folder), Ok(address)) = (std::env::var(FOLDER), std::env::var(ADDRESS)) else {
        return;
    };
    let folder = std::path::PathBuf::from(folder);
    let store = Store::new(folder.join("state"));
    let mut station = Station::new(
        settings(Reports::Signs, 10_000_000, 10),
        receiver(Reports::Signs, 0.05),
        peers(SENSORS),
        Some(store),
    )
    .unwrap();
    let mut journal = std::fs::OpenOptions::new()
        .create(true)
        .append(true)
        .open(folder.join("journal"))
        .unwrap();
    // The process before may have been killed within a line.
    journal.write_all(b"\n").unwrap();
    let mut write = move |step: &Step| {
        journal
            .write_all((serde_json::to_string(step).unwrap() + "\n").as_bytes())
            .unwrap()
    };
    if let Some(step) = station.last_step() {
        write(step);
    }
    let mut socket = Udp::bind(address.as_str()).unwrap();
    run_station(&mut socket, &mut station, |_, outputs| {
        for output in outputs {
            if let Output::Step(step) = output {
                write(step);
            }
        }
        ControlFlow::Continue(())
    })
    .unwrap();
}

/// The steps of all processes so far. A line that was cut off is written again by the next process, from the store.
fn journal(folder: &Path) -> Vec<Step> {
    let text = std::fs::read_to_string(folder.join("journal")).unwrap_or_default();
    let mut steps: Vec<Step> = Vec::new();
    for line in text.lines() {
        let Ok(step) = serde_json::from_str::<Step>(line) else {
            continue;
        };
        match steps.last() {
            Some(last) if last.slot == step.slot => assert_eq!(last, &step),
            last => {
                assert!(last.is_none_or(|last| last.slot < step.slot));
                steps.push(step);
            }
        }
    }
    steps
}

fn received(steps: &[Step]) -> usize {
    let observed = steps.iter().flat_map(|step| &step.observed);
    observed
        .filter(|o| matches!(o, fewbits_core::Observation::Received(_)))
        .count()
}

fn kill(times: u64) {
    let mut steps = Vec::new();
    let folder = tempfile::tempdir().unwrap();
    // A port that was free a moment ago.
    let address = Udp::bind("127.0.0.1:0").unwrap().address();
    let stop = Arc::new(AtomicBool::new(false));
    let threads = sensors(Reports::Signs, address, &stop, &Default::default());
    for i in 0..times {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "stops::centre_process", "--nocapture"])
            .env(FOLDER, folder.path())
            .env(ADDRESS, address.to_string())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // The first lives until reports have come, every other until it has written a step: a busy machine may take long over either.
        let (least_steps, least_reports) = match steps.len() {
            0 => (1, REPORTS),
            before => (before + 1, 0),
        };
        let began = Instant::now();
        while steps.len() < least_steps || received(&steps) < least_reports {
            assert!(began.elapsed() < Duration::from_secs(60), "process {i} wrote {} steps", steps.len());
            std::thread::sleep(Duration::from_millis(10));
            steps = journal(folder.path());
        }
        std::thread::sleep(Duration::from_micros(100_000 + 7_919 * (i * i % 31)));
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
    }
    stop.store(true, Ordering::Relaxed);
    for thread in threads {
        thread.join().unwrap();
    }
    steps = journal(folder.path());
    let received = received(&steps);
    println!("killed {times} times: {} steps, {received} reports", steps.len());
    assert!(steps.len() as u64 > times && received >= REPORTS);
    assert_replayed(&mut receiver(Reports::Signs, 0.05), &steps);
}

#[test]
fn killed_centre_goes_on_without_a_wrong_estimate() {
    kill(5);
}

#[test]
#[ignore = "fifty processes"]
fn centre_killed_fifty_times() {
    kill(50);
}
