//! `speed FILE PERCENT`: seconds in which the numbers of a table of one column are packed fast within a share of their range,
//! the least of three.

use fewbits_recipes::source::Columns;
use fewbits_recipes::{Batch, bounds, pack};
use fewbits_record::{Effort, Recorder, Schema, TimeBase};
use std::error::Error;
use std::ops::ControlFlow;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(file), Some(percent)) = (arguments.next(), arguments.next()) else {
        return Err("expected a file and per cent of the range".into());
    };
    let text = std::fs::read_to_string(file)?;
    let names = [text.lines().next().ok_or("no line of names")?];
    let cells = text
        .lines()
        .skip(1)
        .map(|line| line.parse::<f64>().map(Some))
        .collect::<Result<Vec<_>, _>>()?;
    let finite = || cells.iter().flatten().copied();
    let range = finite().reduce(f64::min).zip(finite().reduce(f64::max));
    let columns = bounds::columns(&names, &bounds::parse(&format!("{percent}%"), &names)?, &[range])?;
    let batch = Batch {
        ticks: None,
        columns: vec![cells.clone()],
    };
    let mut least = f64::INFINITY;
    for _ in 0..3 {
        let mut source = Columns::new(batch.clone());
        let mut recorder =
            Recorder::new(Vec::new(), Schema::new(columns.clone(), TimeBase::Numbered)?).with_effort(Effort::Fast);
        let began = Instant::now();
        pack::fill(&mut source, &mut recorder, &mut |_| ControlFlow::Continue(()))?;
        recorder.finish()?;
        least = least.min(began.elapsed().as_secs_f64());
    }
    println!("{least}");
    Ok(())
}
