//! A stock Prometheus collects the numbers of a centre, and every query of the dashboard has an answer. Says so and passes where Prometheus
//! is missing.

use fewbits_core::{BitString, Observation};
use fewbits_link::{Counts, LivePage, Step};
use fewbits_protocol::SensorHealth;
use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

struct Ended(Child);

impl Drop for Ended {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The answer to a query; `None` while the server does not answer.
fn query(port: u16, expression: &str) -> Option<serde_json::Value> {
    let encoded: String = expression.bytes().map(|byte| format!("%{byte:02X}")).collect();
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(10))).ok()?;
    write!(stream, "GET /api/v1/query?query={encoded} HTTP/1.0\r\n\r\n").ok()?;
    let mut answer = String::new();
    stream.read_to_string(&mut answer).ok()?;
    serde_json::from_str(answer.split_once("\r\n\r\n")?.1).ok()
}

fn value_of(answer: &serde_json::Value) -> Option<f64> {
    answer["data"]["result"][0]["value"][1].as_str()?.parse().ok()
}

#[test]
fn prometheus_collects_estimate_band_and_a_dead_sensor() {
    let page = LivePage::serve(([127, 0, 0, 1], 0).into(), vec![4, 7], 0.1).unwrap();
    let observed = vec![
        Observation::Received(BitString::from_bytes(vec![0x80], 1).unwrap()),
        Observation::Nothing,
    ];
    let mut step = Step::new(41, observed, vec![(1.5, 0.25)]);
    let health = |dead| SensorHealth {
        working: 0.25,
        dead,
        excluded: false,
    };
    step.health = vec![health(false), health(true)];
    page.show(&step, Counts::default());
    let folder = tempfile::tempdir().unwrap();
    let settings = format!(
        "scrape_configs:\n  - job_name: fewbits\n    scrape_interval: 1s\n    static_configs: [{{ targets: [\"{}\"] }}]\n",
        page.address()
    );
    std::fs::write(folder.path().join("prometheus.yml"), settings).unwrap();
    // A port that was free a moment ago.
    let port = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let started = Command::new("prometheus")
        .args(["--config.file=prometheus.yml", "--storage.tsdb.path=data"])
        .arg(format!("--web.listen-address=127.0.0.1:{port}"))
        .current_dir(&folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn();
    let Ok(server) = started else {
        println!("skipped: prometheus is not installed");
        return;
    };
    let _server = Ended(server);
    let began = Instant::now();
    let collected = loop {
        match query(port, "fewbits_estimate").and_then(|answer| value_of(&answer)) {
            Some(value) => break value,
            None => assert!(began.elapsed() < Duration::from_secs(60), "nothing was collected"),
        }
        std::thread::sleep(Duration::from_millis(100));
    };
    assert!((collected - 1.5).abs() < 1e-12);
    let number = |expression: &str| query(port, expression).and_then(|answer| value_of(&answer));
    assert_eq!(number("fewbits_deviation"), Some(0.25));
    assert_eq!(number("fewbits_sensor_dead{sensor=\"7\"}"), Some(1.0));
    assert_eq!(number("fewbits_sensor_dead{sensor=\"4\"}"), Some(0.0));
    assert_eq!(number("fewbits_reports_total{sensor=\"4\"}"), Some(1.0));
    let dashboard = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/grafana.json")).unwrap();
    let dashboard: serde_json::Value = serde_json::from_str(&dashboard).unwrap();
    let targets = dashboard["panels"].as_array().unwrap().iter();
    let targets: Vec<_> = targets
        .flat_map(|panel| panel["targets"].as_array().into_iter().flatten())
        .collect();
    assert!(targets.len() >= 8);
    for target in targets {
        let expression = target["expr"].as_str().unwrap();
        let answer = query(port, expression).unwrap();
        assert_eq!(answer["status"], "success", "{expression}");
    }
}
