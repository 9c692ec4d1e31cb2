//! A centre that is killed at any moment goes on without a wrong estimate.

use crate::world::{Reports, SENSORS, assert_replayed, peers, receiver, settings};
use crate::worlds::sensors;
use fewbits_link::{Output, Station, Step, Store, Udp, run_station};
use std::io::Write;
use std::ops::ControlFlow;
use std::process::{Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

const FOLDER: &str = "FEWBITS_LINK_TEST_FOLDER";
const ADDRESS: &str = "FEWBITS_LINK_TEST_ADDRESS";

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

/// Reports that the journal has.
fn reports_in(journal: &std::path::Path) -> usize {
    let text = std::fs::read_to_string(journal).unwrap_or_default();
    text.matches("Received").count()
}

fn wait_for_reports(journal: &std::path::Path, beyond: usize) {
    let began = std::time::Instant::now();
    // The first line of a life may repeat the last step of the life before.
    while reports_in(journal) <= beyond + SENSORS as usize {
        assert!(began.elapsed() < Duration::from_secs(60), "no report is received");
        std::thread::sleep(Duration::from_millis(5));
    }
}

fn kill(times: u64) {
    let folder = tempfile::tempdir().unwrap();
    // A port that was free a moment ago.
    let address = Udp::bind("127.0.0.1:0").unwrap().address();
    let stop = Arc::new(AtomicBool::new(false));
    let threads = sensors(Reports::Signs, address, &stop, &Default::default());
    for i in 0..times {
        let reports = reports_in(&folder.path().join("journal"));
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "stops::centre_process", "--nocapture"])
            .env(FOLDER, folder.path())
            .env(ADDRESS, address.to_string())
            .stdout(Stdio::null())
            .spawn()
            .unwrap();
        // Each life has received reports when it ends, at some moment of a slot of 10 ms.
        wait_for_reports(&folder.path().join("journal"), reports);
        std::thread::sleep(Duration::from_micros(7_919 * (i * i % 31)));
        // SIGKILL.
        child.kill().unwrap();
        child.wait().unwrap();
    }
    stop.store(true, Ordering::Relaxed);
    for thread in threads {
        thread.join().unwrap();
    }
    // A line that was cut off is written again by the next process, from the store.
    let text = std::fs::read_to_string(folder.path().join("journal")).unwrap();
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
    let received = steps
        .iter()
        .flat_map(|step| &step.observed)
        .filter(|o| matches!(o, fewbits_core::Observation::Received(_)))
        .count();
    println!("killed {times} times: {} steps, {received} reports", steps.len());
    assert!(steps.len() as u64 >= times && received as u64 >= times);
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
