//! Tracks a vehicle from recorded ranges, in full and with 1 to 4 bits a range, and compares with the true track.
//! `plaza ANCHORS.csv RANGES.csv TRUTH.csv`: columns `anchor,x_m,y_m`; `t_s,anchor,range_m`; `t_s,x_m,y_m,...`.

use fewbits_pf_mpa::{RangeSettings, RangeTracker, Travel};
use nalgebra::{Vector2, Vector3};
use std::error::Error;

fn rows<T: serde::de::DeserializeOwned>(file: Option<&String>) -> Result<Vec<T>, Box<dyn Error>> {
    let file = file.ok_or("usage: plaza ANCHORS.csv RANGES.csv TRUTH.csv")?;
    Ok(csv::Reader::from_path(file)?.deserialize().collect::<Result<_, _>>()?)
}

/// The true position at a time, on the straight line between its neighbours; the nearest end outside.
fn place_at(truth: &[(f64, f64, f64)], time: f64) -> Option<Vector2<f64>> {
    let next = truth
        .partition_point(|row| row.0 < time)
        .min(truth.len().checked_sub(1)?);
    let ((t0, x0, y0), (t1, x1, y1)) = (truth[next.saturating_sub(1)], truth[next]);
    let share = if t1 > t0 {
        ((time - t0) / (t1 - t0)).clamp(0.0, 1.0)
    } else {
        1.0
    };
    Some(Vector2::new(x0, y0).lerp(&Vector2::new(x1, y1), share))
}

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let anchors: Vec<(String, f64, f64)> = rows(files.first())?;
    let mut ranges: Vec<(f64, String, f64)> = rows(files.get(1))?;
    let truth: Vec<(f64, f64, f64)> = rows(files.get(2))?;
    ranges.sort_by(|a, b| a.0.total_cmp(&b.0));
    println!("RMS error / m   NEES   losses   bits per range   speed / m/s   ranges");
    for travel in std::iter::once(Travel::Full).chain((1..=4).map(Travel::Bits)) {
        let places = anchors
            .iter()
            .map(|(name, x, y)| (name.clone(), Vector3::new(*x, *y, 0.0)));
        let mut tracker = RangeTracker::new(places, travel, RangeSettings::default())?;
        let (mut squares, mut nees, mut speed) = (Vec::new(), Vec::new(), 0.0);
        for (time, anchor, range) in &ranges {
            if let Some(found) = tracker.push(*time, anchor, *range)? {
                let place = place_at(&truth, *time).ok_or("no true positions")?;
                squares.push((found.position.xy() - place).norm_squared());
                nees.extend(found.normalised_error(&place.push(0.0)));
                speed = found.speed;
            }
        }
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let bits = tracker.bits() as f64 / ranges.len() as f64;
        let (error, losses, nees) = (mean(&squares).sqrt(), tracker.losses(), mean(&nees));
        println!("{error:13.3}   {nees:4.2}   {losses:6}   {bits:14.2}   {speed:11.2}   {travel:?}");
    }
    Ok(())
}
