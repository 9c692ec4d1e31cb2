//! The steps from a request to its solutions: bits per sensor, search, Newton's method.

use super::control::{Control, Stage};
use super::participant::{SensorDesign, WordedCells, gray, plain};
use super::polish::polish;
use super::request::{BitBudget, MAX_BITS, MAX_TOTAL, Request};
use super::share;
use super::solution::{Solution, Solutions};
use super::starts::Search;
use crate::criterion::Criterion;
use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use fewbits_numerics::error::entries;

impl Request<'_> {
    /// Computes the designs, best first.
    ///
    /// # Errors
    /// If a number of bits is above [`MAX_BITS`], all are zero, there is not one per sensor, or the total is more than
    /// the sensors can send; [`Error::TooLarge`] if the sensors have more joint symbols than can be enumerated.
    pub fn run(mut self) -> Result<Solutions, Error> {
        let mut control = Control::new(self.clock, self.time_limit, self.progress.take());
        let searched = self.model.searched()?;
        let exact = std::mem::replace(&mut self.model, searched);
        let bits = self.checked_bits(&mut control)?;
        let mut found = self.solve(&exact, &bits, &mut control)?;
        let sense = self.criterion.sense();
        found.sort_by(|a, b| (sense * b.value).total_cmp(&(sense * a.value)));
        Ok(Solutions {
            all: found,
            steps: control.steps,
            is_cut_short: control.is_cut_short,
        })
    }

    /// Bits of every sensor.
    fn checked_bits(&self, control: &mut Control<'_>) -> Result<Vec<u32>, Error> {
        let sensors = self.model.sensors();
        entries("links", self.links.len(), sensors)?;
        let bits = match &self.bits {
            BitBudget::Each(bits) => vec![*bits; sensors],
            BitBudget::PerSensor(bits) => bits.clone(),
            BitBudget::Total(total) => {
                let most = (MAX_BITS * sensors as u32).min(MAX_TOTAL);
                if !(1..=most).contains(total) {
                    return refuse("bits", total, format!("1 to {most} bits in all"));
                }
                share::shared_out(self, *total, control)?
            }
        };
        entries("bits", bits.len(), sensors)?;
        if let Some(bits) = bits.iter().find(|b| **b > MAX_BITS) {
            return refuse("bits", bits, format!("at most {MAX_BITS} bits per sensor"));
        }
        // The words of a given start must fit the bits of their sensors.
        if let Some(start) = &self.start {
            entries("start", start.len(), sensors)?;
        }
        for (bits, cells) in bits.iter().zip(self.start.iter().flatten()) {
            cells.check()?;
            if let Some(word) = cells.words.iter().find(|w| **w >= 1 << bits) {
                return refuse("word", word, format!("a word of {bits} bits"));
            }
        }
        if bits.iter().all(|b| *b == 0) {
            return refuse("bits", "0 for every sensor", "at least one bit");
        }
        Ok(bits)
    }

    /// Solutions of the `exact` model, from a search on that of the request.
    fn solve(&self, exact: &ObservationModel, bits: &[u32], control: &mut Control<'_>) -> Result<Vec<Solution>, Error> {
        let participants = SensorDesign::all(bits, &self.links);
        let sensors: Vec<usize> = participants.iter().map(|p| p.sensor).collect();
        let (model, exact) = (self.model.subset(&sensors)?, exact.subset(&sensors)?);
        let given = self
            .start
            .as_ref()
            .map(|all| sensors.iter().map(|n| all[*n].clone()).collect::<Vec<WordedCells>>());
        let search = Search {
            model: &model,
            criterion: self.criterion,
            participants: &participants,
            shape: self.cells,
            starts: self.starts,
            given: given.as_deref(),
        };
        let mut searched = search.run(control)?;
        control.enter(Stage::Certificate, 1);
        if self.criterion == Criterion::BayesError {
            // The error probability has kinks and flat regions; the design of largest information is a good start.
            let cells = plain(&model, &participants, gray)?;
            let deadline = control.deadline();
            let informed = polish(&model, Criterion::MutualInformation, &participants, cells, false, deadline)?;
            searched.designs.push(informed.cells());
        }
        let parts = searched.designs.len();
        let mut found: Vec<Solution> = Vec::new();
        for (done, cells) in searched.designs.into_iter().enumerate() {
            control.report(Stage::Certificate, done, parts);
            let deadline = control.deadline();
            found.push(polish(&exact, self.criterion, &participants, cells, searched.apart, deadline)?);
        }
        control.report(Stage::Certificate, parts, parts);
        Ok(found)
    }
}
