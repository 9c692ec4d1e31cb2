//! Tracks a vehicle from recorded ranges, in full and with 1 to 4 bits a range, and compares with the true track.
//!
//! ```text
//! cargo run --release -p fewbits-pf-mpa --example plaza -- ANCHORS.csv RANGES.csv TRUTH.csv
//! ```
//! Columns `anchor,x_m,y_m`; `t_s,anchor,range_m`, one anchor at a time; `t_s,x_m,y_m`.

use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use nalgebra::Vector2;
use std::error::Error;

fn column(row: &csv::StringRecord, at: usize) -> Result<f64, Box<dyn Error>> {
    Ok(row.get(at).unwrap_or_default().trim().parse()?)
}

fn rows(file: &str) -> Result<Vec<csv::StringRecord>, Box<dyn Error>> {
    Ok(csv::Reader::from_path(file)?.records().collect::<Result<_, _>>()?)
}

/// Rows in order of their first column.
fn in_order(rows: Vec<csv::StringRecord>) -> Result<Vec<csv::StringRecord>, Box<dyn Error>> {
    let mut timed = rows
        .into_iter()
        .map(|row| Ok((column(&row, 0)?, row)))
        .collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    timed.sort_by(|a, b| a.0.total_cmp(&b.0));
    Ok(timed.into_iter().map(|(_, row)| row).collect())
}

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let [anchors, ranges, truth] = files.as_slice() else {
        return Err("usage: plaza ANCHORS.csv RANGES.csv TRUTH.csv".into());
    };
    let place = |row: &csv::StringRecord| Ok((row[0].to_owned(), Vector2::new(column(row, 1)?, column(row, 2)?)));
    let anchors = rows(anchors)?
        .iter()
        .map(place)
        .collect::<Result<Vec<_>, Box<dyn Error>>>()?;
    let (ranges, truth) = (in_order(rows(ranges)?)?, in_order(rows(truth)?)?);
    println!("ranges      RMS error / m   NEES   losses   bits per range   speed / m/s");
    for travel in [
        Travel::Full,
        Travel::Bits(1),
        Travel::Bits(2),
        Travel::Bits(3),
        Travel::Bits(4),
    ] {
        let mut tracker = RangeTracker::new(anchors.clone(), travel, RangeSettings::default())?;
        let (mut rng, mut at, mut scores, mut speed) = (fewbits_monte_carlo::Stream::new(1).rng(), 0, Vec::new(), 0.0);
        for row in &ranges {
            let time = column(row, 0)?;
            let Some(found) = tracker.push(&mut rng, time, &row[1], column(row, 2)?)? else {
                continue;
            };
            while at + 1 < truth.len() && column(&truth[at], 0)? < time {
                at += 1
            }
            let error = found.position - Vector2::new(column(&truth[at], 1)?, column(&truth[at], 2)?);
            let nees = found
                .covariance
                .cholesky()
                .map_or(f64::NAN, |factor| 0.5 * error.dot(&factor.solve(&error)));
            scores.push((error.norm_squared(), nees));
            speed = found.speed;
        }
        let mean = |score: fn(&(f64, f64)) -> f64| scores.iter().map(score).sum::<f64>() / scores.len().max(1) as f64;
        let bits = tracker.bits() as f64 / ranges.len().max(1) as f64;
        println!(
            "{travel:<10?}  {:13.3}   {:4.2}   {:6}   {bits:14.2}   {speed:11.2}",
            mean(|s| s.0).sqrt(),
            mean(|s| s.1),
            tracker.losses()
        );
    }
    Ok(())
}
