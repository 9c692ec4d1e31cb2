//! Shows how a table is understood: `cargo run -p fewbits-table --example look -- FILE`.

use fewbits_table::{Dialect, Table};
use std::fs::File;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for path in std::env::args().skip(1) {
        println!("== {path}");
        let survey = || -> Result<(), Box<dyn std::error::Error>> {
            let said = Dialect {
                skip_bad: u64::MAX,
                ..Dialect::default()
            };
            let mut table = Table::open(File::open(&path)?, &said)?;
            let time = table.find_time();
            println!("dialect: {} {}", table.dialect().format.as_deref().unwrap_or(""), table.dialect().as_options());
            println!("time: {time:?} {:?}", table.time());
            let columns = table.columns().to_vec();
            let survey = table.survey()?;
            println!("rows: {}, times {:?}, left out {:?}", survey.rows, survey.times, survey.skipped);
            for (column, profile) in columns.iter().zip(&survey.columns) {
                let range = profile
                    .range
                    .map_or(String::new(), |(low, high)| format!("{low} to {high}"));
                println!(
                    "  {} [{}] {}: {range} gaps {:?} suspicious {} {:?} sentinel {:?} words {}",
                    column.name,
                    column.unit,
                    profile.kind(),
                    profile.missing,
                    profile.suspicious(),
                    profile.first_text,
                    profile.sentinel(),
                    profile.words.len()
                );
            }
            Ok(())
        }();
        if let Err(error) = survey {
            println!("REFUSED {error}");
        }
    }
    Ok(())
}
