//! Factor graphs: variables and functions, exact sum-product for finite alphabets, and lists of nodes and edges for drawing.

mod marginals;

use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::Error;
use serde::{Deserialize, Serialize};

/// A bipartite graph of variables and functions.
///
/// ```
/// use fewbits_baselines::pf_mpa::graph::FactorGraph;
/// let mut graph = FactorGraph::new();
/// let (a, b) = (graph.variable("a", 2)?, graph.variable("b", 3)?);
/// graph.function("f", &[a], &[0.2, 0.8])?;
/// graph.function("g", &[a, b], &[1.0, 2.0, 3.0, 3.0, 2.0, 1.0])?;
/// let marginal = graph.marginals()?.remove(b);
/// assert!((marginal[0] - (0.2 * 1.0 + 0.8 * 3.0) / 6.0).abs() < 1e-15);
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
    /// Size of the alphabet; 0 if only the structure is known.
    states: usize,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Function {
    name: String,
    scope: Vec<usize>,
    /// Values for every choice of states, the last variable of the scope fastest.
    table: Vec<f64>,
}

/// A node in the list of [`FactorGraph::nodes`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Node<'a> {
    /// Name of the node.
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

    /// Adds a variable with `states` values and returns its number. With 0 the graph describes only the structure.
    ///
    /// # Errors
    /// If the name is already used.
    pub fn variable(&mut self, name: &str, states: usize) -> Result<usize, Error> {
        self.check_name(name)?;
        self.variables.push(Variable {
            name: name.to_owned(),
            states,
        });
        Ok(self.variables.len() - 1)
    }

    /// Adds a non-negative function of the variables `scope`. `table` lists its values with the last variable fastest. Returns its number.
    ///
    /// # Errors
    /// If the name is already used, the scope is empty, repeats a variable or has an unknown one, or the table has not one finite
    /// non-negative value per choice of states.
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

    /// Adds a function of which only the scope is known.
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

    /// Whether there is at most one path between any two nodes. Sum-product is then exact.
    pub fn is_tree(&self) -> bool {
        // A forest has as many edges as nodes minus components.
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
}

/// The example of the thesis's Figure 2.1: five variables, four functions, eight edges.
///
/// # Errors
/// Never: the graph is fixed.
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

/// The graph of one tracking step (Figure 3.2): the state before, the acceleration, the new state and its position, with one
/// likelihood per sensor. The position has one edge per sensor and one to the dynamics.
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
/// Never: the graph is fixed.
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

    #[test]
    fn figures_have_their_degrees() {
        let figure = example().unwrap();
        let (variables, functions): (Vec<_>, Vec<_>) = figure.nodes().into_iter().partition(|n| n.is_variable);
        assert_eq!((variables.len(), functions.len(), figure.edges().len()), (5, 4, 8));
        assert!(figure.is_tree());
        let step = tracking_step(5).unwrap();
        assert!(step.nodes().iter().any(|n| n.name == "position" && n.degree == 6));
        assert!(!step.is_tree(), "velocity and acceleration act on both halves of the state");
        assert_eq!(association_step().unwrap().edges().len(), 8);
    }
}
