//! A hundred random scenes: the design on request against multi-start Nelder-Mead of the same time.
//!
//! `cargo run --release -p fewbits-quantizer-design --example random_scenes -- 100`

#[path = "../tests/it/nelder_mead.rs"]
mod nelder_mead;
#[path = "../tests/it/scenes.rs"]
mod scenes;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let mut number = |default: u64| arguments.next().map_or(Ok(default), |a| a.parse::<u64>());
    let (count, first) = (number(100)?, number(0)?);
    let limit = std::time::Duration::from_secs(5);
    let (mut worse, mut failed, mut compared, mut unscaled) = (0, 0, 0, 0);
    for i in first..first + count {
        let scale = [1.0, 1e-4, 1e4][i as usize % 3];
        let task = scenes::task(i, scale, 5, 4)?;
        let (found, time) = match task.solve(Some(limit)) {
            Ok(found) => found,
            Err(error) => {
                failed += 1;
                println!("FAILED {}: {error}", task.what);
                continue;
            }
        };
        let reference = task.nelder_mead(time)?;
        let ratio = found.value() / reference;
        // The same scene in another unit, where that is quick.
        let mut scaled = String::new();
        if time.as_secs() < 3 {
            let unit = [1e4, 1.0, 1e-4][i as usize % 3];
            let other = scenes::task(i, unit, 5, 4)?.solve(Some(limit))?.0.value() * (scale / unit).powi(2);
            compared += 1;
            unscaled += u32::from((other / found.value() - 1.0).abs() > 1e-6);
            scaled = format!(", scaled {:.1e}", other / found.value() - 1.0);
        }
        worse += u32::from(ratio > 1.0 + 1e-9);
        let (seconds, certificate) = (time.as_secs_f64(), found.certificate());
        println!("{:.5} of Nelder-Mead in {seconds:.2} s, {certificate:?}{scaled}  {}", ratio, task.what);
    }
    println!(
        "{count} scenes: {failed} failed, {worse} worse than Nelder-Mead of the same time, {unscaled} of {compared} depend on the unit"
    );
    Ok(())
}
