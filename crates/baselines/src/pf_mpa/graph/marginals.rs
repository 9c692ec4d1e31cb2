//! Exact marginals of a tree by sum-product.

use super::FactorGraph;
use fewbits_numerics::error::refuse;
use fewbits_pf_mpa::Error;

impl FactorGraph {
    fn check_finite(&self) -> Result<(), Error> {
        match self.variables.iter().find(|v| v.states == 0) {
            Some(v) => refuse("variable", &v.name, "a variable with states"),
            None => Ok(()),
        }
    }

    /// The exact marginal of every variable, by messages to and from all nodes. Time `O(sum |table|)`.
    ///
    /// ```text
    /// variable to function: product of all other incoming messages
    /// function to variable: sum over the other variables of the table times their messages
    /// ```
    ///
    /// # Errors
    /// If the graph has a cycle or a variable without states; [`Error::Impossible`] if all products are zero.
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
        // to_variable[f][slot] and to_function[f][slot]. On a tree the messages are final after as many rounds as there are functions.
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
}

/// Advances to the next choice of states, the last entry fastest.
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
        return Err(Error::Impossible);
    }
    message.iter_mut().for_each(|m| *m /= total);
    Ok(message)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pf_mpa::graph::Function;
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

    /// The marginals by summing over every choice of all variables.
    fn enumerated(graph: &FactorGraph) -> Result<Vec<Vec<f64>>, Error> {
        let sizes: Vec<usize> = graph.variables.iter().map(|v| v.states).collect();
        let mut marginals: Vec<Vec<f64>> = sizes.iter().map(|s| vec![0.0; *s]).collect();
        let mut choice = vec![0; sizes.len()];
        for _ in 0..sizes.iter().product::<usize>() {
            let place = |f: &Function| f.scope.iter().fold(0, |place, v| place * sizes[*v] + choice[*v]);
            let value: f64 = graph.functions.iter().map(|f| f.table[place(f)]).product();
            for (marginal, state) in marginals.iter_mut().zip(&choice) {
                marginal[*state] += value;
            }
            advance(&mut choice, &sizes);
        }
        marginals.into_iter().map(normalised).collect()
    }

    proptest! {
        #[test]
        fn sum_product_is_enumeration(
            states in prop::array::uniform5(1_usize..5),
            values in prop::collection::vec(0.01..1.0_f64, 64),
        ) {
            let graph = random(states, &values);
            let (fast, slow) = (graph.marginals().unwrap(), enumerated(&graph).unwrap());
            for (a, b) in fast.iter().flatten().zip(slow.iter().flatten()) {
                prop_assert!((a - b).abs() < 1e-12);
            }
        }
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
        assert_eq!(graph.marginals(), Err(Error::Impossible));
        assert_eq!(enumerated(&graph), Err(Error::Impossible));
        graph.function("again", &[a, b], &[1.0; 4]).unwrap();
        assert!(graph.marginals().is_err());
        assert!(crate::pf_mpa::graph::example().unwrap().marginals().is_err());
    }
}
