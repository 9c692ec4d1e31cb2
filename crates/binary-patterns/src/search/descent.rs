//! Coordinate descent: one sensor at a time gets its best pattern; all candidates are evaluated in one matrix product.

use super::outcomes::{Candidates, Outcomes};
use crate::Error;
use crate::observation::bank::MAX_OUTCOMES;
use crate::{Bank, BinaryQuantizer, PatternSensor, Source};
use fewbits_monte_carlo::Stream;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{at_least_one, positive, refuse};
use fewbits_quantizer_design::outcomes::Table;
use nalgebra::DMatrix;
use rand::RngExt;

/// Smallest relative improvement for which a move is made.
const IMPROVEMENT: f64 = 1e-11;
/// Largest number of sweeps over all sensors; a few are usually enough.
const MAX_SWEEPS: usize = 60;

/// The search problem: each sensor, with its own noise, uses one of several quantizers.
///
/// ```text
/// choose a start
/// repeat for every sensor n:
///     W(outcome of the others, x) <- product over the others
///     for all candidates c at once: (M0, M1)(outcome, bit, c) <- int W P_bit,c,n (1, x) dx
///     choice_n <- argmax_c sum M1^2 / M0
/// until a sweep changes nothing
/// ```
///
/// Of equal sensors with equal choices only the count matters. If all candidates are symmetric about zero, half of the
/// nodes are used. The result is a local optimum. With several starts it was the global one in every case that can be checked
/// exhaustively (three bits, eight and ten sensors). Good starts: the same pattern for all sensors, and a repeated basis.
#[derive(Debug, Clone)]
pub struct Descent {
    source: Source,
    noise: Vec<f64>,
    candidates: Vec<BinaryQuantizer>,
}

/// A local optimum.
#[derive(Debug, Clone, PartialEq)]
pub struct Descended {
    /// Index of the candidate that each sensor uses.
    pub choice: Vec<usize>,
    /// The sensors with their chosen quantizers.
    pub sensors: Vec<PatternSensor>,
    /// Exact mean squared error of the posterior mean.
    pub mse: f64,
}

impl Descent {
    /// The problem for sensors of these noise standard deviations, with the quantizers to choose from.
    ///
    /// # Errors
    /// If either list is empty or a noise is not positive and finite.
    pub fn with_deviations(
        source: Source,
        noise_deviations: Vec<f64>,
        candidates: Vec<BinaryQuantizer>,
    ) -> Result<Self, Error> {
        at_least_one("noise_deviations", noise_deviations.len())?;
        at_least_one("candidates", candidates.len())?;
        for &noise in &noise_deviations {
            positive("noise_deviation", noise)?;
        }
        Ok(Self {
            source,
            noise: noise_deviations,
            candidates,
        })
    }

    /// The bank of a choice, one candidate index per sensor.
    fn bank(&self, choice: &[usize]) -> Result<Bank, Error> {
        Bank::new(self.source, self.sensors(choice)?)
    }

    /// The sensors of a choice.
    fn sensors(&self, choice: &[usize]) -> Result<Vec<PatternSensor>, Error> {
        self.check(choice)?;
        choice
            .iter()
            .zip(&self.noise)
            .map(|(&c, &noise)| PatternSensor::with_deviation(self.candidates[c].clone(), noise))
            .collect()
    }

    fn check(&self, choice: &[usize]) -> Result<(), Error> {
        let known = |c: &usize| *c < self.candidates.len();
        if choice.len() == self.noise.len() && choice.iter().all(known) {
            return Ok(());
        }
        let expected = format!("{} indices below {}", self.noise.len(), self.candidates.len());
        refuse("choice", format!("{choice:?}"), expected)
    }

    /// The best result of the descents from the given starts and `extra` random ones.
    ///
    /// `allowed` restricts the choices, for instance to full rank. A start that it does not allow is kept until a move to an
    /// allowed choice.
    ///
    /// # Errors
    /// If there is no start, one is not a valid choice, or there are too many outcomes.
    pub fn run(
        &self,
        starts: &[Vec<usize>],
        extra: usize,
        allowed: impl Fn(&[usize]) -> bool,
    ) -> Result<Descended, Error> {
        // Descend from each given and each random start; keep the best allowed result, by its exact error on fine nodes.
        let kernel = Kernel::new(self);
        let sensors = self.noise.len();
        let kinds = self.candidates.len();
        let mut rng = Stream::new(0).named("descent-starts").rng();
        let mut draw = || (rng.random::<f64>() * kinds as f64) as usize;
        let more = (0..extra).map(|_| (0..sensors).map(|_| draw()).collect());
        let mut best: Option<Descended> = None;
        for start in starts.iter().cloned().chain(more) {
            self.check(&start)?;
            let found = kernel.descend(start, &allowed)?;
            let mse = self.bank(&found)?.mmse()?;
            if allowed(&found) && best.as_ref().is_none_or(|b| mse < b.mse * (1.0 - IMPROVEMENT)) {
                best = Some(Descended {
                    sensors: self.sensors(&found)?,
                    choice: found,
                    mse,
                });
            }
        }
        best.ok_or_else(|| {
            ArgumentError::new("starts", "none allowed", "a start that leads to an allowed choice").into()
        })
    }
}

struct Kernel<'a> {
    descent: &'a Descent,
    candidates: Candidates,
    /// Index of each sensor's noise among the distinct noises.
    class: Vec<usize>,
    /// Probabilities of the bits for every noise class and candidate.
    p: Vec<Vec<Table>>,
    /// For each noise class, a matrix with rows (candidate, bit, moment).
    products: Vec<DMatrix<f64>>,
}

impl<'a> Kernel<'a> {
    fn new(descent: &'a Descent) -> Self {
        let mut noises: Vec<f64> = Vec::new();
        let class: Vec<usize> = descent
            .noise
            .iter()
            .map(|&noise| {
                noises.iter().position(|&n| n == noise).unwrap_or_else(|| {
                    noises.push(noise);
                    noises.len() - 1
                })
            })
            .collect();
        // Tabulate every candidate's bit probabilities for each distinct noise, and their rows of the matrix product.
        let candidates = Candidates::new(&descent.source, &descent.candidates, &noises);
        let of_noise = |noise: &f64| -> Vec<Table> {
            let quantizers = descent.candidates.iter();
            quantizers
                .map(|q| q.probabilities_at(&candidates.nodes.points, *noise))
                .collect()
        };
        let p: Vec<Vec<Table>> = noises.iter().map(of_noise).collect();
        Self {
            descent,
            class,
            products: p.iter().map(|p| candidates.integrands(p.iter())).collect(),
            p,
            candidates,
        }
    }

    fn descend(&self, mut choice: Vec<usize>, allowed: &impl Fn(&[usize]) -> bool) -> Result<Vec<usize>, Error> {
        let variance = self.descent.source.variance();
        for _ in 0..MAX_SWEEPS {
            let mut changed = false;
            for n in 0..choice.len() {
                let explained = self.respond(&choice, n)?;
                let present = choice[n];
                // A start that is not allowed must be left, even if the error increases.
                let mut best = if allowed(&choice) {
                    (present, explained[present])
                } else {
                    (present, f64::NEG_INFINITY)
                };
                for (c, &value) in explained.iter().enumerate() {
                    if value > best.1 + IMPROVEMENT * (variance - best.1).max(0.0) {
                        choice[n] = c;
                        if allowed(&choice) {
                            best = (c, value);
                        }
                    }
                }
                choice[n] = best.0;
                changed |= best.0 != present;
            }
            if !changed {
                break;
            }
        }
        Ok(choice)
    }

    /// Variance explained by the bits, for each candidate quantizer at sensor `n`.
    fn respond(&self, choice: &[usize], n: usize) -> Result<Vec<f64>, Error> {
        // The other sensors, grouped as exchangeable: (noise class, candidate, count).
        let mut groups: Vec<(usize, usize, usize)> = Vec::new();
        for (other, &c) in choice.iter().enumerate().filter(|(other, _)| *other != n) {
            let class = self.class[other];
            match groups.iter_mut().find(|g| (g.0, g.1) == (class, c)) {
                Some(group) => group.2 += 1,
                None => groups.push((class, c, 1)),
            }
        }
        let outcomes = groups.iter().fold(1u128, |o, g| o.saturating_mul(g.2 as u128 + 1));
        Error::at_most("the table of outcomes", outcomes, MAX_OUTCOMES)?;
        let mut others = Outcomes::new(&self.candidates.nodes.weights);
        for (class, c, count) in groups {
            others = others.with(&self.p[class][c].of_counts(count), self.candidates.flips[c]);
        }
        let product = &self.products[self.class[n]];
        let sums = others.integrals(product);
        let explained = |c| {
            self.candidates
                .explained(&others, &sums, [product.nrows(), 4 * c], 1, c)
        };
        Ok((0..self.descent.candidates.len()).map(explained).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::super::LinearSearch;
    use super::*;
    use crate::{Pattern, linear_pattern, rank, uniform_cells};
    use approx::assert_relative_eq;
    use fewbits_quantizers::Quantizer;

    fn masks(grid: &Quantizer) -> Vec<BinaryQuantizer> {
        let bits = grid.cells().trailing_zeros() as usize;
        (1..1 << bits)
            .map(|m| linear_pattern(m, bits).unwrap().on(grid).unwrap())
            .collect()
    }

    #[test]
    fn it_finds_the_exhaustive_optimum() {
        let source = Source::uniform(1.0).unwrap();
        let grid = uniform_cells(1.0, 3).unwrap();
        for snr in [5.0, 18.2] {
            let noise = source.noise_deviation(snr).unwrap();
            let exact = LinearSearch::with_deviation(source, grid.clone(), noise, 6)
                .unwrap()
                .best()
                .unwrap();
            let descent = Descent::with_deviations(source, vec![noise; 6], masks(&grid)).unwrap();
            let full = |choice: &[usize]| rank(&choice.iter().map(|&c| c as u32 + 1).collect::<Vec<_>>()) == 3;
            let start = vec![3, 5, 2, 3, 5, 2];
            let found = descent.run(&[start], 6, full).unwrap();
            assert_relative_eq!(found.mse, exact.mse, max_relative = 1e-10);
        }
    }

    #[test]
    fn unequal_sensors_and_asymmetric_patterns_are_evaluated_exactly() {
        let source = Source::uniform(1.0).unwrap();
        let grid = uniform_cells(1.0, 2).unwrap();
        let all: Vec<_> = Pattern::all(4).unwrap().iter().map(|p| p.on(&grid).unwrap()).collect();
        let descent = Descent::with_deviations(source, vec![0.1, 0.4, 0.4], all.clone()).unwrap();
        let kernel = Kernel::new(&descent);
        let choice = [2, 5, 5];
        for (c, explained) in kernel.respond(&choice, 0).unwrap().into_iter().enumerate() {
            let exact = descent.bank(&[c, 5, 5]).unwrap().mmse().unwrap();
            assert_relative_eq!(source.variance() - explained, exact, max_relative = 1e-8);
        }
        let constant: Vec<_> = (0..7).map(|c| vec![c; 3]).collect();
        let found = descent.run(&constant, 3, |_| true).unwrap();
        let mut least = f64::INFINITY;
        for a in 0..7 {
            for b in 0..7 {
                for c in b..7 {
                    least = least.min(descent.bank(&[a, b, c]).unwrap().mmse().unwrap());
                }
            }
        }
        assert_relative_eq!(found.mse, least, max_relative = 1e-10);
    }

    #[test]
    fn bad_input_is_refused() {
        let source = Source::uniform(1.0).unwrap();
        let candidates = masks(&uniform_cells(1.0, 2).unwrap());
        assert!(Descent::with_deviations(source, vec![], candidates.clone()).is_err());
        assert!(Descent::with_deviations(source, vec![0.1], vec![]).is_err());
        assert!(Descent::with_deviations(source, vec![-0.1], candidates.clone()).is_err());
        let descent = Descent::with_deviations(source, vec![0.1; 2], candidates).unwrap();
        assert!(descent.run(&[], 0, |_| true).is_err());
        assert!(descent.run(&[vec![0, 3]], 0, |_| true).is_err());
        assert!(descent.bank(&[0]).is_err());
    }
}
