//! Likelihoods that the user states as Python functions, and the observations that go to them.

use crate::error::{Outcome, refused};
use crate::given::key;
use crate::table::{Cells, Given, Times};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// One function, or one per name of a column.
pub(crate) enum Likelihoods {
    One(Py<PyAny>),
    ByName(Vec<(String, Py<PyAny>)>),
}

impl Likelihoods {
    pub(crate) fn parsed(argument: &'static str, given: &Bound<'_, PyAny>) -> Outcome<Self> {
        let expected = "a function of states and observation, or a dictionary of such functions by column";
        if given.is_callable() {
            return Ok(Self::One(given.clone().unbind()));
        }
        let Ok(named) = given.cast::<PyDict>() else {
            return refused(argument, given.get_type().name()?, expected);
        };
        let mut functions = Vec::with_capacity(named.len());
        for (name, function) in named {
            if !function.is_callable() {
                return refused(argument, function.get_type().name()?, expected);
            }
            functions.push((key(argument, &name)?, function.unbind()));
        }
        if functions.is_empty() {
            return refused(argument, "an empty dictionary", expected);
        }
        Ok(Self::ByName(functions))
    }

    /// As it was given.
    pub(crate) fn given<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        match self {
            Self::One(function) => Ok(function.bind(py).clone()),
            Self::ByName(functions) => {
                let all = PyDict::new(py);
                for (name, function) in functions {
                    all.set_item(name, function)?;
                }
                Ok(all.into_any())
            }
        }
    }

    /// The names of the columns; one without a name if there is one function.
    pub(crate) fn names(&self) -> Vec<Option<&str>> {
        match self {
            Self::One(_) => vec![None],
            Self::ByName(functions) => functions.iter().map(|(name, _)| Some(name.as_str())).collect(),
        }
    }

    /// The functions of one instant with their places and observations; none if all are missing.
    pub(crate) fn of<'py>(
        &self,
        observation: Option<&Bound<'py, PyAny>>,
    ) -> Outcome<Vec<(usize, &Py<PyAny>, Bound<'py, PyAny>)>> {
        let Some(observation) = observation.filter(|observation| !is_missing(observation)) else {
            return Ok(Vec::new());
        };
        match self {
            Self::One(function) => Ok(vec![(0, function, observation.clone())]),
            Self::ByName(functions) => {
                let Ok(observed) = observation.cast::<PyDict>() else {
                    let expected = "a dictionary of observations by name, as the likelihoods";
                    return refused("observation", observation.get_type().name()?, expected);
                };
                let mut all = Vec::with_capacity(observed.len());
                for (name, one) in observed {
                    let name = key("observation", &name)?;
                    let Some(at) = functions.iter().position(|(known, _)| *known == name) else {
                        let known: Vec<&str> = functions.iter().map(|(known, _)| known.as_str()).collect();
                        return refused("observation", format!("'{name}'"), format!("one of {}", known.join(", ")));
                    };
                    if !is_missing(&one) {
                        all.push((at, &functions[at].1, one));
                    }
                }
                Ok(all)
            }
        }
    }

    /// What the table has for the functions.
    pub(crate) fn observed(&self, given: &Given, time: &str) -> Outcome<Observed> {
        let names: Vec<String> = match self {
            Self::ByName(functions) => functions.iter().map(|(name, _)| name.clone()).collect(),
            Self::One(_) => {
                let others: Vec<String> = given.names().into_iter().filter(|name| name != time).collect();
                if others.len() != 1 {
                    let expected = "a table of one column besides the time, or likelihoods by column";
                    return refused("table", format!("of {} columns besides the time", others.len()), expected);
                }
                others
            }
        };
        let columns = names.into_iter().map(|name| Ok((name.clone(), given.numbers(&name)?)));
        Ok(Observed {
            columns: columns.collect::<Outcome<_>>()?,
            is_named: matches!(self, Self::ByName(_)),
        })
    }
}

/// The columns of a table that functions are for.
pub(crate) struct Observed {
    columns: Vec<(String, Cells)>,
    is_named: bool,
}

impl Observed {
    /// The observation of one row, as [`Likelihoods::of`] takes it.
    pub(crate) fn row<'py>(&self, py: Python<'py>, row: usize) -> Outcome<Bound<'py, PyAny>> {
        if !self.is_named {
            let cell = self.columns.first().and_then(|(_, cells)| cells[row]);
            return Ok(cell.into_pyobject(py).map_err(PyErr::from)?.into_any());
        }
        let observed = PyDict::new(py);
        for (name, cells) in &self.columns {
            observed.set_item(name, cells[row])?;
        }
        Ok(observed.into_any())
    }
}

/// None and NaN are observations that are missing.
fn is_missing(observation: &Bound<'_, PyAny>) -> bool {
    observation.is_none() || observation.extract::<f64>().is_ok_and(f64::is_nan)
}

/// Times of a table in seconds since the first, which must not decrease.
pub(crate) fn rising(times: &Times) -> Outcome<Vec<f64>> {
    let Some(origin) = times.origin() else {
        return Ok(Vec::new());
    };
    let seconds = times.since(origin)?;
    if let Some(row) = (1..seconds.len()).find(|row| seconds[*row] < seconds[row - 1]) {
        return refused("time", format!("decreasing in row {row}"), "times that do not decrease: sort the table");
    }
    Ok(seconds)
}

/// Numbers that a callback returned, one per particle or node.
pub(crate) fn returned<'py>(
    name: &'static str,
    what: &str,
    given: &Bound<'py, PyAny>,
    count: usize,
) -> Outcome<PyReadonlyArray1<'py, f64>> {
    let expected = || format!("{count} numbers, one per {what}");
    let given = &crate::array::unmasked(given).or_else(|_| refused(name, crate::array::shown(given), expected()))?;
    let Ok(array) = given.cast::<PyArray1<f64>>() else {
        // Integers, single precision, lists: NumPy converts them.
        return match crate::array::numbers::<f64>(given) {
            Ok(array) if array.as_array().len() == count => Ok(array),
            _ => refused(name, crate::array::shown(given), expected()),
        };
    };
    let array = array.try_readonly().map_err(PyErr::from)?;
    if array.as_array().len() == count {
        return Ok(array);
    }
    refused(name, crate::array::shown(given), expected())
}
