//! Factor graphs: variables, functions, exact sum-product over finite alphabets, and their pictures.

use crate::Error;
use crate::error::refuse;
use fewbits_numerics::error::at_least_one;
use serde::{Deserialize, Serialize};
use std::fmt::Write;

/// A bipartite graph of variables and functions.
///
/// ```
/// use fewbits_pf_mpa::graph::FactorGraph;
/// let mut graph = FactorGraph::new();
/// let (a, b) = (graph.variable("a", 2)?, graph.variable("b", 3)?);
/// graph.function("f", &[a], &[0.2, 0.8])?;
/// graph.function("g", &[a, b], &[1.0, 2.0, 3.0, 3.0, 2.0, 1.0])?;
/// let marginal = graph.marginals()?.remove(b);
/// assert!((marginal[0] - (0.2 * 1.0 + 0.8 * 3.0) / 6.0).abs() < 1e-15);
/// assert!(graph.dot().contains("\"g\" -- \"b\""));
/// # Ok::<(), fewbits_pf_mpa::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct FactorGraph {
    variables: Vec<Variable>,
    functions: Vec<Function>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Variable {
    name: String,
    /// Size of the alphabet; 0 where only the structure is known.
    states: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Function {
    name: String,
    scope: Vec<usize>,
    /// Values, the last variable of the scope fastest.
    table: Vec<f64>,
}

/// A node as it is listed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node<'a> {
    /// Its name.
    pub name: &'a str,
    /// Whether it is a variable.
    pub is_variable: bool,
    /// Number of edges.
    pub degree: usize,
}

impl FactorGraph {
    /// An empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a variable with `states` values, and returns its number. With 0, only the structure is meant.
    ///
    /// # Errors
    /// If the name is taken.
    pub fn variable(&mut self, name: &str, states: usize) -> Result<usize, Error> {
        self.check_name(name)?;
        self.variables.push(Variable {
            name: name.to_owned(),
            states,
        });
        Ok(self.variables.len() - 1)
    }

    /// Adds a non-negative function of the variables `scope`, its values listed with the last variable fastest.
    ///
    /// # Errors
    /// If the name is taken, the scope is empty, repeats a variable or names none, or the table has not one finite non-negative
    /// value per choice.
    pub fn function(&mut self, name: &str, scope: &[usize], table: &[f64]) -> Result<usize, Error> {
        self.check_name(name)?;
        at_least_one("scope", scope.len())?;
        let mut size = 1_usize;
        for (i, v) in scope.iter().enumerate() {
            let Some(variable) = self.variables.get(*v).filter(|_| !scope[..i].contains(v)) else {
                let expected = format!("different variables below {}", self.variables.len());
                return refuse("scope", format!("{scope:?}"), expected);
            };
            size = size.saturating_mul(variable.states);
        }
        if table.len() != size {
            return refuse("table", format!("{} values", table.len()), format!("{size}, one per choice"));
        }
        if let Some(bad) = table.iter().find(|v| !(**v >= 0.0 && v.is_finite())) {
            return refuse("table", bad, "finite values, 0 or above");
        }
        self.functions.push(Function {
            name: name.to_owned(),
            scope: scope.to_vec(),
            table: table.to_vec(),
        });
        Ok(self.functions.len() - 1)
    }

    /// Adds a function of which only the scope is known, to a graph of structure.
    ///
    /// # Errors
    /// As [`function`](Self::function), for variables without states.
    pub fn structure(&mut self, name: &str, scope: &[usize]) -> Result<usize, Error> {
        self.function(name, scope, &[])
    }

    fn check_name(&self, name: &str) -> Result<(), Error> {
        let taken = self
            .variables
            .iter()
            .map(|v| &v.name)
            .chain(self.functions.iter().map(|f| &f.name));
        if taken.into_iter().any(|n| n == name) || name.contains(['"', '\\', '\n']) {
            return refuse("name", name, "a name that no other node has, without quotes");
        }
        Ok(())
    }

    /// All nodes, variables first.
    pub fn nodes(&self) -> Vec<Node<'_>> {
        let degree = |v: usize| self.functions.iter().filter(|f| f.scope.contains(&v)).count();
        let variables = self.variables.iter().enumerate().map(|(i, v)| Node {
            name: &v.name,
            is_variable: true,
            degree: degree(i),
        });
        let functions = self.functions.iter().map(|f| Node {
            name: &f.name,
            is_variable: false,
            degree: f.scope.len(),
        });
        variables.chain(functions).collect()
    }

    /// All edges as `(function, variable)`.
    pub fn edges(&self) -> Vec<(&str, &str)> {
        let of = |f: &'_ Function| f.scope.clone();
        self.functions
            .iter()
            .flat_map(|f| {
                of(f)
                    .into_iter()
                    .map(|v| (f.name.as_str(), self.variables[v].name.as_str()))
            })
            .collect()
    }

    /// Whether there is exactly one path between any two connected nodes: sum-product is then exact.
    pub fn is_tree(&self) -> bool {
        // A forest has as many edges as nodes, less its components.
        let count = self.variables.len() + self.functions.len();
        let mut group: Vec<usize> = (0..count).collect();
        fn root(group: &mut [usize], mut i: usize) -> usize {
            while group[i] != i {
                group[i] = group[group[i]];
                i = group[i];
            }
            i
        }
        for (f, function) in self.functions.iter().enumerate() {
            for v in &function.scope {
                let (a, b) = (root(&mut group, *v), root(&mut group, self.variables.len() + f));
                if a == b {
                    return false;
                }
                group[a] = b;
            }
        }
        true
    }

    /// The graph in the DOT language: circles for variables, boxes for functions.
    pub fn dot(&self) -> String {
        let mut text = String::from("graph {\n");
        for node in self.nodes() {
            let shape = if node.is_variable { "circle" } else { "box" };
            let _ = writeln!(text, "  \"{}\" [shape={shape}];", node.name);
        }
        for (function, variable) in self.edges() {
            let _ = writeln!(text, "  \"{function}\" -- \"{variable}\";");
        }
        text + "}\n"
    }

    fn check_finite(&self) -> Result<(), Error> {
        match self.variables.iter().find(|v| v.states == 0) {
            Some(v) => refuse("variable", &v.name, "a variable with states"),
            None => Ok(()),
        }
    }

    /// The marginal of every variable, exactly, by messages to and from all nodes: `O(sum |table|)`.
    ///
    /// ```text
    /// variable to function: product of all other incoming messages
    /// function to variable: sum over the other variables of the table times their messages
    /// ```
    ///
    /// # Errors
    /// If the graph has a cycle or a variable without states; [`fewbits_core::Error::Impossible`] if all products are zero.
    pub fn marginals(&self) -> Result<Vec<Vec<f64>>, Error> {
        self.check_finite()?;
        if !self.is_tree() {
            return refuse("graph", "one with a cycle", "a tree");
        }
        let ones = |v: &usize| vec![1.0; self.variables[*v].states];
        let start: Vec<Vec<Vec<f64>>> = self
            .functions
            .iter()
            .map(|f| f.scope.iter().map(ones).collect())
            .collect();
        // to_variable[f][slot] and to_function[f][slot]; a tree settles within as many rounds as it has functions.
        let (mut to_variable, mut to_function) = (start.clone(), start);
        for _ in 0..=self.functions.len() {
            for (f, function) in self.functions.iter().enumerate() {
                for (slot, v) in function.scope.iter().enumerate() {
                    let mut message = ones(v);
                    for (g, other) in self.functions.iter().enumerate().filter(|(g, _)| *g != f) {
                        if let Some(s) = other.scope.iter().position(|w| w == v) {
                            message.iter_mut().zip(&to_variable[g][s]).for_each(|(m, x)| *m *= x);
                        }
                    }
                    to_function[f][slot] = normalised(message)?;
                }
            }
            for (f, function) in self.functions.iter().enumerate() {
                for slot in 0..function.scope.len() {
                    to_variable[f][slot] = normalised(self.summed(f, slot, &to_function[f]))?;
                }
            }
        }
        (0..self.variables.len())
            .map(|v| {
                let mut product = ones(&v);
                for (g, function) in self.functions.iter().enumerate() {
                    if let Some(s) = function.scope.iter().position(|w| *w == v) {
                        product.iter_mut().zip(&to_variable[g][s]).for_each(|(m, x)| *m *= x);
                    }
                }
                normalised(product)
            })
            .collect()
    }

    /// `sum over all but slot of table * messages of the other slots`.
    fn summed(&self, f: usize, slot: usize, incoming: &[Vec<f64>]) -> Vec<f64> {
        let function = &self.functions[f];
        let sizes: Vec<usize> = function.scope.iter().map(|v| self.variables[*v].states).collect();
        let mut out = vec![0.0; sizes[slot]];
        let mut choice = vec![0; sizes.len()];
        for value in &function.table {
            let weight: f64 = (0..sizes.len())
                .filter(|s| *s != slot)
                .map(|s| incoming[s][choice[s]])
                .product();
            out[choice[slot]] += value * weight;
            advance(&mut choice, &sizes);
        }
        out
    }

    /// The same marginals by summing over every choice of all variables, at most ten million.
    ///
    /// # Errors
    /// If there are more, or a variable has no states; [`fewbits_core::Error::Impossible`] if all products are zero.
    pub fn marginals_by_enumeration(&self) -> Result<Vec<Vec<f64>>, Error> {
        const MOST: usize = 10_000_000;
        self.check_finite()?;
        let sizes: Vec<usize> = self.variables.iter().map(|v| v.states).collect();
        let choices = sizes
            .iter()
            .try_fold(1_usize, |n, s| n.checked_mul(*s).filter(|n| *n <= MOST));
        let Some(choices) = choices else {
            return refuse("graph", format!("variables of {sizes:?} states"), format!("at most {MOST} choices"));
        };
        let mut marginals: Vec<Vec<f64>> = sizes.iter().map(|s| vec![0.0; *s]).collect();
        let mut choice = vec![0; sizes.len()];
        for _ in 0..choices {
            let value: f64 = self.functions.iter().map(|f| f.table[self.place(f, &choice)]).product();
            for (marginal, state) in marginals.iter_mut().zip(&choice) {
                marginal[*state] += value;
            }
            advance(&mut choice, &sizes);
        }
        marginals.into_iter().map(normalised).collect()
    }

    fn place(&self, function: &Function, choice: &[usize]) -> usize {
        function
            .scope
            .iter()
            .fold(0, |place, v| place * self.variables[*v].states + choice[*v])
    }
}

/// The next choice, the last entry fastest.
fn advance(choice: &mut [usize], sizes: &[usize]) {
    for (c, size) in choice.iter_mut().zip(sizes).rev() {
        *c += 1;
        if *c < *size {
            break;
        }
        *c = 0;
    }
}

fn normalised(mut message: Vec<f64>) -> Result<Vec<f64>, Error> {
    let total: f64 = message.iter().sum();
    if !(total > 0.0 && total.is_finite()) {
        return Err(Error::IMPOSSIBLE);
    }
    message.iter_mut().for_each(|m| *m /= total);
    Ok(message)
}

/// The example of the thesis's Figure 2.1: five variables, four functions, eight edges.
///
/// # Errors
/// None.
pub fn example() -> Result<FactorGraph, Error> {
    let mut graph = FactorGraph::new();
    for i in 1..=5 {
        graph.variable(&format!("x{i}"), 0)?;
    }
    for (i, scope) in [&[0, 1][..], &[2], &[1, 2, 3], &[3, 4]].into_iter().enumerate() {
        graph.structure(&format!("f{}", i + 1), scope)?;
    }
    Ok(graph)
}

/// The graph of one tracking step (Figure 3.2): the state before, the acceleration, the state now and its position, with one
/// likelihood per sensor. The position's variable has one edge per sensor and one to the dynamics.
///
/// # Errors
/// If there is no sensor.
pub fn tracking_step(sensors: usize) -> Result<FactorGraph, Error> {
    at_least_one("sensors", sensors)?;
    let mut graph = FactorGraph::new();
    let before = graph.variable("position before", 0)?;
    let velocity_before = graph.variable("velocity before", 0)?;
    let acceleration = graph.variable("acceleration", 0)?;
    let velocity = graph.variable("velocity", 0)?;
    let position = graph.variable("position", 0)?;
    graph.structure("prior", &[before, velocity_before])?;
    graph.structure("manoeuvre", &[acceleration])?;
    graph.structure("velocity step", &[velocity_before, acceleration, velocity])?;
    graph.structure("position step", &[before, velocity_before, acceleration, position])?;
    for s in 1..=sensors {
        graph.structure(&format!("level {s}"), &[position])?;
    }
    Ok(graph)
}

/// The graph of the association step (Figure 3.6): two targets, two measurements, their order.
///
/// # Errors
/// None.
pub fn association_step() -> Result<FactorGraph, Error> {
    let mut graph = FactorGraph::new();
    let ids = ["T1", "T2", "zA", "zB", "r"].map(|name| graph.variable(name, 0));
    let [t1, t2, za, zb, r] = ids;
    let (t1, t2, za, zb, r) = (t1?, t2?, za?, zb?, r?);
    graph.structure("walk 1", &[t1])?;
    graph.structure("walk 2", &[t2])?;
    graph.structure("p(zA, zB | T1, T2, r)", &[t1, t2, za, zb, r])?;
    graph.structure("p(r)", &[r])?;
    Ok(graph)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn random(states: [usize; 5], values: &[f64]) -> FactorGraph {
        let mut graph = FactorGraph::new();
        for (i, s) in states.iter().enumerate() {
            graph.variable(&format!("x{i}"), *s).unwrap();
        }
        let scopes: [&[usize]; 4] = [&[0, 1], &[2], &[1, 2, 3], &[3, 4]];
        for (i, scope) in scopes.into_iter().enumerate() {
            let size: usize = scope.iter().map(|v| states[*v]).product();
            graph.function(&format!("f{i}"), scope, &values[..size]).unwrap();
        }
        graph
    }

    proptest! {
        #[test]
        fn sum_product_is_enumeration(
            states in prop::array::uniform5(1_usize..5),
            values in prop::collection::vec(0.01..1.0_f64, 64),
        ) {
            let graph = random(states, &values);
            let (fast, slow) = (graph.marginals().unwrap(), graph.marginals_by_enumeration().unwrap());
            for (a, b) in fast.iter().flatten().zip(slow.iter().flatten()) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn figures_have_their_degrees() {
        let figure = example().unwrap();
        assert_eq!((figure.nodes().iter().filter(|n| n.is_variable).count(), figure.edges().len()), (5, 8));
        assert!(figure.is_tree());
        let step = tracking_step(5).unwrap();
        assert!(step.nodes().iter().any(|n| n.name == "position" && n.degree == 6));
        assert!(!step.is_tree(), "velocity and acceleration act on both halves of the state");
        assert_eq!(association_step().unwrap().edges().len(), 8);
    }

    #[test]
    fn cycles_zeros_and_bad_tables_are_refused() {
        let mut graph = FactorGraph::new();
        let (a, b) = (graph.variable("a", 2).unwrap(), graph.variable("b", 2).unwrap());
        assert!(graph.variable("a", 2).is_err());
        assert!(graph.function("f", &[a, a], &[1.0; 4]).is_err() && graph.function("f", &[7], &[1.0; 2]).is_err());
        assert!(graph.function("f", &[a], &[1.0, -1.0]).is_err() && graph.function("f", &[a], &[1.0]).is_err());
        graph.function("f", &[a, b], &[1.0, 0.0, 0.0, 1.0]).unwrap();
        graph.function("g", &[a], &[1.0, 0.0]).unwrap();
        graph.function("h", &[b], &[0.0, 1.0]).unwrap();
        assert_eq!(graph.marginals(), Err(Error::IMPOSSIBLE));
        assert_eq!(graph.marginals_by_enumeration(), Err(Error::IMPOSSIBLE));
        graph.function("again", &[a, b], &[1.0; 4]).unwrap();
        assert!(graph.marginals().is_err());
        assert!(example().unwrap().marginals().is_err());
    }
}
