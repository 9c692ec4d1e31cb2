//! The value of a criterion for a system, and its derivatives.

use crate::criterion::Criterion;
use crate::derivatives::Derivatives;
use crate::error::Error;
use crate::newton::Objective;
use crate::problem::Problem;
use crate::system::System;

impl System {
    /// Value of a criterion: nats, squared units of the unknown, or a probability. The quadrature error is about 1e-12.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there are more outcomes than the limit; [`Error::Argument`] for a Bayes error under a continuous prior.
    pub fn value(&self, criterion: Criterion) -> Result<f64, Error> {
        let problem = Problem::new(self, criterion, &[])?;
        Ok((problem.value(&[]) + problem.offset()) * criterion.sense())
    }

    /// Value, gradient and Hessian of a criterion with respect to all breakpoints, group by group.
    ///
    /// The Bayes error is smooth except at breakpoints where a decision changes; its derivatives are those of the smooth piece.
    ///
    /// # Errors
    /// As [`System::value`].
    pub fn derivatives(&self, criterion: Criterion) -> Result<Derivatives, Error> {
        let all: Vec<usize> = (0..self.groups().len()).collect();
        let problem = Problem::new(self, criterion, &all)?;
        let sense = criterion.sense();
        let found = problem.derivatives(&problem.start());
        Ok(Derivatives {
            value: (found.value + problem.offset()) * sense,
            gradient: found.gradient * sense,
            hessian: found.hessian * sense,
        })
    }
}
