//! One node's update of the posteriors of all models.

use super::Search;
use super::alternatives::{Alternative, EXCLUDED};
use super::outcome::{Status, failure};
use crate::belief::{Prior, SentBelief, Travelling};
use crate::best_fit::best_fit;
use crate::posterior::Posterior;
use crate::search_box::SearchBox;
use crate::target::Target;
use crate::{Error, RateModel, SourceLikelihood};
use fewbits_densities::Mixture;

impl Search {
    /// Updates the posterior of every remaining model, and the models' probabilities. Returns a status if the search ends here.
    pub(super) fn update(
        &self,
        alternatives: &mut [Alternative],
        received: Option<&Travelling>,
    ) -> Result<Option<Status>, Error> {
        let mut end = None;
        for alternative in alternatives.iter_mut().filter(|a| a.log_weight > f64::NEG_INFINITY) {
            let (prior, likelihood, near) = self.terms(alternative, received)?;
            match Posterior::new(&prior, &likelihood, &self.search, near, &self.cells) {
                Ok(posterior) => {
                    alternative.log_evidence = posterior.cells.log_evidence();
                    alternative.posterior = Some(posterior);
                }
                Err(error) => {
                    let status = failure(&error).ok_or(error)?;
                    let status = self.explained(status, &prior, &likelihood, received.is_some())?;
                    if status == Status::Unresolved {
                        // Without the evidence of this model the probabilities of the others are unknown.
                        return Ok(Some(status));
                    }
                    alternative.log_weight = f64::NEG_INFINITY;
                    end = Some(status);
                }
            }
        }
        let largest = alternatives
            .iter()
            .map(Alternative::log_posterior)
            .fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return Ok(Some(end.unwrap_or(Status::Misfit)));
        }
        // Bayes' rule over the models, relative to the most probable one.
        let mut total = 0.0;
        for alternative in alternatives.iter_mut() {
            let log = alternative.log_posterior() - largest;
            if log < -EXCLUDED {
                alternative.log_weight = f64::NEG_INFINITY;
            }
            alternative.probability = log.exp();
            total += alternative.probability;
        }
        alternatives.iter_mut().for_each(|a| a.probability /= total);
        Ok(None)
    }

    /// Prior and likelihood of one model's update, and a box that holds the posterior.
    fn terms(
        &self,
        alternative: &Alternative,
        received: Option<&Travelling>,
    ) -> Result<(Prior, SourceLikelihood, Option<SearchBox>), Error> {
        let all = alternative.records.as_slice();
        let last = &all[all.len() - 1..];
        let (prior, records) = match (received, &self.rate) {
            (None, _) => (Prior::Exact(self.prior), all),
            (Some(Travelling::WithRate(belief)), RateModel::Joint(range)) => {
                (Prior::WithRate(belief.clone(), *range), last)
            }
            (Some(Travelling::WithRate(belief)), _) => {
                let position = Mixture::single(&belief.position())?;
                (Prior::Position(SentBelief::Mixture(position)), last)
            }
            (Some(Travelling::Position(position)), _) => (Prior::Position(position.clone()), last),
        };
        let near = match (received, &alternative.posterior) {
            (None, Some(posterior)) => Some(posterior.around(&self.search)),
            _ => None,
        };
        Ok((prior, SourceLikelihood::new(records.to_vec(), self.rate)?, near))
    }

    /// The status of an update that failed. If even the best position does not explain the samples, it is a misfit.
    pub(super) fn explained(
        &self,
        status: Status,
        prior: &Prior,
        likelihood: &SourceLikelihood,
        carried: bool,
    ) -> Result<Status, Error> {
        let Some(level) = self.refusal else {
            return Ok(status);
        };
        let fit = best_fit(&Target::new(prior, likelihood)?, likelihood, &self.search);
        Ok(match (status, fit) {
            // If the belief was received, it may be the belief that is wrong and not the model.
            (Status::BeliefMiss, None) if carried => status,
            (_, None) => Status::Misfit,
            (_, Some(fit)) if fit.is_refused(level) => Status::Misfit,
            _ => status,
        })
    }
}
