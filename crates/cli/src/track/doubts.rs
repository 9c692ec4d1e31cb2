//! What the values of a table say against the noise that is stated.

use super::first::values_of;
use super::instant::Instant;
use super::settings::Settings;
use crate::numbers::short;
use fewbits_filters::calibration::Number;

/// The stated noise is doubted if another explains the rows better by so many nats, and is so many times as large or small.
const FAR_LIKELIER: f64 = 20.0;
const FAR: f64 = 1.25;
/// Share of values that equal the one before them, above which a sensor may hold its values.
const HELD: f64 = 0.25;

impl Settings {
    /// A line for each sensor whose values have another noise than the stated one. Of reports of few bits nothing else would tell it: those whose
    /// threshold is the prediction are as likely under any noise.
    pub(super) fn doubts(&self, rows: &[Instant], names: &[String]) -> Vec<String> {
        let stated: Vec<f64> = (0..names.len()).map(|i| self.seat(i, &names[i]).noise).collect();
        let known: Vec<Number> = stated.iter().map(|noise| Number::Known(*noise)).collect();
        let free = stated.iter().map(|noise| Number::Unknown {
            guess: *noise,
            least: 0.0,
        });
        let free: Vec<Number> = free.collect();
        let (change, readings) = (self.world.change, self.readings(rows, names));
        let found = |noises: &[Number]| self.world.calibrate(&readings, Number::Known(change), change, noises);
        let (Ok(stated_fit), Ok(found)) = (found(&known), found(&free)) else {
            return Vec::new();
        };
        if found.log_likelihood - stated_fit.log_likelihood < FAR_LIKELIER {
            return Vec::new();
        }
        let is_far = |ratio: f64| ratio.max(1.0 / ratio) > FAR;
        let sensors = names.iter().zip(&stated).zip(&found.noises);
        // Repeated values are no measurements, and say nothing of the noise.
        let is_held = |sensor: usize| {
            let values = values_of(rows, sensor);
            let equal = values.windows(2).filter(|pair| pair[0] == pair[1]).count();
            equal as f64 > HELD * values.len() as f64
        };
        sensors
            .enumerate()
            .filter(|(sensor, ((_, stated), found))| is_far(*found / *stated) && !is_held(*sensor))
            .map(|(_, ((name, stated), found))| {
                format!(
                    "{name}: under the supposed change its values are far likelier with a noise of {} than with the stated {}: bands are too {}",
                    short(*found),
                    short(*stated),
                    if found > stated { "narrow" } else { "wide" }
                )
            })
            .collect()
    }
}
