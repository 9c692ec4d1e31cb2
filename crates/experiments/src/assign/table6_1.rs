//! `assign-table6-1`: eight sensors, three assignments.

use crate::prelude::*;
use fewbits_baselines::sensor_assignment::{all_errors, by_precision};
use fewbits_sensor_assignment::{CodedSensors, Estimator, pair_costs, quantization_error};

pub struct Table;

parameters! {
    pub struct Parameters {
        /// Noise variances of the sensors, in units of V^2; all their assignments are enumerated.
        variances: Vec<f64> [1e-9..=1e3; 1..=8] = vec![0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001],
    }
}

rows! {
    pub struct Rows {
        assignments: Vec<Row> => "Assignments.",
        costs: Vec<Cost> => "Costs of the linear assignment problem, with the dual variables that prove its optimum.",
        as_deviations: Vec<Row> => "The same with the variances read as standard deviations.",
    }

    struct Row by "{assign}" {
        assign: &'static str => "Assignment.",
        sensors: List<usize> => "Sensor of each bit, coarsest first, counted from 1.",
        approx: f64 ["V^2"] => "Equation 6.6.",
        center: f64 ["V^2"] => "Exact error of the cell's centre.",
        mmse: f64 ["V^2"] => "Exact error of the posterior mean, a fifth below that of the cell's centre (erratum assign-2).",
    }

    struct Cost {
        bit: usize => "Bit, coarsest first, from 1.",
        sensor: usize => "Sensor, from 1.",
        gamma: f64 ["V^2"] => "Cost of giving the bit to the sensor.",
        dual_bit: f64 ["V^2"] => "Dual variable of the bit.",
        dual_sensor: f64 ["V^2"] => "Dual variable of the sensor.",
    }
}

fn row(assign: &'static str, sensors: &CodedSensors, assignment: &[usize]) -> Result<Row, Error> {
    let cost = pair_costs(sensors).cost(assignment)?;
    Ok(Row {
        assign,
        // Counted from 1, as the thesis does.
        sensors: List(assignment.iter().map(|n| n + 1).collect()),
        approx: quantization_error(sensors.half_width(), sensors.sensors()) + cost,
        center: sensors.mse(assignment, Estimator::CellCentre)?,
        mmse: sensors.mse(assignment, Estimator::PosteriorMean)?,
    })
}

/// The three assignments of the thesis.
fn three(sensors: &CodedSensors, variances: &[f64]) -> Result<Vec<Row>, Error> {
    let best = pair_costs(sensors).solve();
    Ok(vec![
        row("I", sensors, &(0..variances.len()).collect::<Vec<_>>())?,
        row("II", sensors, &by_precision(variances))?,
        row("optimal", sensors, &best)?,
    ])
}

impl Figure for Table {
    figure!(Parameters => Rows, "assign-table6-1", "Three assignments of eight Gray bits to eight sensors", "Movaghati, thesis, table 6.1",
        "The optimum of the linear assignment problem gives middling sensors the coarse bits and keeps the noisy ones for the fine \
         bits, which are lost anyway; it is the exact optimum of the centre decoder among all 40 320. The row of the thesis headed \
         sigma holds variances. The posterior mean of the same bits has a fifth less error.");

    fn run(&self, p: &Parameters, _: &Context<'_>) -> Result<Rows, Error> {
        let variances = &p.variances;
        let sensors = CodedSensors::with_variances(1.0, variances)?;
        let mut assignments = three(&sensors, variances)?;
        for (name, criterion) in [
            ("best, centre", Estimator::CellCentre),
            ("best, posterior mean", Estimator::PosteriorMean),
        ] {
            assignments.push(row(name, &sensors, &all_errors(&sensors, criterion)?.best)?);
        }
        let squares: Vec<f64> = variances.iter().map(|v| v * v).collect();
        let as_deviations = three(&CodedSensors::with_variances(1.0, &squares)?, variances)?;
        let matrix = pair_costs(&sensors);
        let proof = matrix.certificate(&matrix.solve())?;
        let cells = (0..matrix.size()).flat_map(|bit| (0..matrix.size()).map(move |sensor| (bit, sensor)));
        let cost = |(bit, sensor): (usize, usize)| Cost {
            bit: bit + 1,
            sensor: sensor + 1,
            gamma: matrix.get(bit, sensor).unwrap_or(f64::NAN),
            dual_bit: proof.rows[bit],
            dual_sensor: proof.columns[sensor],
        };
        Ok(Rows {
            assignments,
            costs: cells.map(cost).collect(),
            as_deviations,
        })
    }

    fn claims(&self, p: &Parameters, rows: &Rows, claims: &mut Claims) {
        let here = claims.at_defaults();
        let all = &rows.assignments;
        let values =
            |r: &Row| [("approx", r.approx), ("center", r.center)].map(|(what, v)| (format!("{what} {}", r.assign), v));
        let cells = all.iter().flat_map(values);
        let what = "the printed values, to their digits (the simulated 0.0392 of assignment I lies within its noise of 0.0391)";
        claims.references("printed", what, cells, |cell| cell);
        let best = [5, 6, 7, 8, 4, 3, 2, 1];
        for (id, what, name, expected) in [
            ("optimum", "the optimal assignment is 5 6 7 8 4 3 2 1", "optimal", best),
            ("exact", "it is the exact optimum of the centre decoder among all", "best, centre", best),
            (
                "exact-mmse",
                "the posterior mean prefers 5 6 7 8 4 1 2 3",
                "best, posterior mean",
                [5, 6, 7, 8, 4, 1, 2, 3],
            ),
        ] {
            here.all(id, what, find(all, name), |r| r.sensors.0 == expected);
        }
        let pair = find(all, "optimal").zip(find(all, "best, posterior mean"));
        let gain = pair.map(|(linear, best)| linear.mmse / best.mmse - 1.0);
        here.near("exact-mmse-error", "by 7e-6 only", gain, 7e-6, 0.05 * 7e-6);
        let bits: f64 = select(&rows.costs, |c| c.sensor == 1).map(|c| c.dual_bit).sum();
        let dual = bits + select(&rows.costs, |c| c.bit == 1).map(|c| c.dual_sensor).sum::<f64>();
        let matched = find(all, "optimal").map_or(f64::NAN, |r| r.approx - quantization_error(1.0, p.variances.len()));
        let what = "the dual variables prove the optimum: their sum is the cost (erratum binary-20)";
        claims.near("duality", what, dual, matched, 1e-15 + 1e-12 * matched);
        let what = "and none exceeds a cost";
        claims.all("dual-feasible", what, &rows.costs, |c| c.dual_bit + c.dual_sensor <= c.gamma + 1e-12);
        let what = "read as standard deviations the error of assignment I would be 2e-4 (erratum assign-1)";
        let other = find(&rows.as_deviations, "I").map(|r| r.center);
        here.near("deviations", what, other, 2.0e-4, 1e-5);
        let what = "and another assignment optimal";
        let other = find(&rows.as_deviations, "optimal");
        here.all("deviations-optimum", what, other, |r| r.sensors.0 != best);
    }

    fn plot(&self, p: &Parameters, rows: &Rows) -> Plot {
        let n = p.variances.len();
        let index: Vec<f64> = (1..=n).map(|i| i as f64).collect();
        // The coarsest bit on top.
        let field = rows.costs.rchunks(n).flatten().map(|c| c.gamma.log10());
        let names = (1..=n).map(|b| ((n + 1 - b) as f64, format!("bit {b}")));
        let optimal = find(&rows.assignments, "optimal")
            .into_iter()
            .flat_map(|r| &r.sensors.0)
            .enumerate();
        let chosen = optimal
            .map(|(bit, sensor)| (*sensor as f64, (n - bit) as f64))
            .collect();
        let three = &rows.assignments[..3.min(rows.assignments.len())];
        let errors = |value: fn(&Row) -> f64, shift: f64| {
            points(three.iter().enumerate(), |(i, r)| (i as f64 + shift, value(r)))
        };
        let costs = Panel::new(
            "Cost of giving a bit to a sensor",
            Axis::linear("sensor, noisiest first").named((1..=n).map(|s| (s as f64, s.to_string()))),
            Axis::linear("").named(names),
        )
        .with(Layer::heat("lg(cost / V²)", index.clone(), index, field))
        .with(Layer::points("optimal assignment", chosen).styled(1, Marker::Cross));
        let exact = Panel::new(
            "Error of the assignments",
            Axis::categories("assignment", three.iter().map(|r| r.assign)),
            Axis::log("mean squared error / V²").between(2e-3, 0.1),
        )
        .with(Layer::points("equation 6.6", errors(|r| r.approx, -0.1)).coloured(7))
        .with(Layer::points("cell's centre", errors(|r| r.center, 0.0)).coloured(0))
        .with(Layer::points("posterior mean", errors(|r| r.mmse, 0.1)).coloured(2));
        Plot::grid(2, vec![costs, exact])
    }
}
