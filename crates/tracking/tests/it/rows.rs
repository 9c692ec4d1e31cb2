//! Rows as instants.

use crate::rows;
use fewbits_tracking::{Error, Failure, Instant, Instants, RowOptions, Rows, Transform};

struct Given(std::vec::IntoIter<Instant>, Vec<String>);

impl Rows for Given {
    fn next(&mut self) -> Result<Option<Instant>, Failure> {
        Ok(self.0.next())
    }

    fn names(&self) -> &[String] {
        &self.1
    }
}

fn given(rows: Vec<Instant>, options: RowOptions) -> Instants<Given> {
    Instants::new(Given(rows.into_iter(), vec!["a".to_owned(), "b".to_owned()]), options)
}

fn times(mut rows: Instants<Given>) -> Result<Vec<f64>, Error> {
    let mut times = Vec::new();
    while let Some(row) = rows.next()? {
        times.push(row.seconds);
    }
    Ok(times)
}

#[test]
fn late_rows_are_put_in_order() {
    let mixed = |times: &[f64]| -> Vec<Instant> {
        times
            .iter()
            .map(|seconds| Instant::new(1, *seconds, &[Some(*seconds)]))
            .collect()
    };
    let late = |late: f64| RowOptions {
        late,
        ..RowOptions::default()
    };
    let swapped = mixed(&[0.0, 2.0, 1.0, 3.0, 5.0, 4.0]);
    assert_eq!(times(given(swapped, late(2.0))).unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    // The row of 2 s was used when that of 4 s came.
    let refused = times(given(mixed(&[0.0, 2.0, 4.0, 1.0]), late(1.5))).unwrap_err();
    assert!(matches!(refused, Error::Content { .. }), "{refused}");
}

#[test]
fn single_reports_of_one_time_are_one_instant() {
    let report = |row: u64, seconds: f64, sensor: usize, value: f64| Instant {
        reports: vec![(sensor, Some(value))],
        ..Instant::new(row, seconds, &[None])
    };
    let all = vec![
        report(1, 0.0, 0, 1.0),
        report(2, 0.0, 1, 2.0),
        report(3, 0.0, 1, 2.0),
        report(4, 1.0, 1, 3.0),
    ];
    let options = RowOptions {
        single_reports: true,
        filled: true,
        ..RowOptions::default()
    };
    let mut rows = given(all, options);
    assert_eq!(rows.peek(9).unwrap().len(), 2);
    assert_eq!(rows.next().unwrap().unwrap().reports, [(0, Some(1.0)), (1, Some(2.0))]);
    assert_eq!(rows.next().unwrap().unwrap().reports, [(1, Some(3.0)), (0, None)]);
    assert_eq!((rows.next().unwrap(), rows.copies()), (None, 1));
}

#[test]
fn value_without_a_transform_is_refused_with_its_row() {
    let options = RowOptions {
        transform: Some(Transform::Log),
        ..RowOptions::default()
    };
    let mut rows = given(rows([vec![Some(1.0)], vec![Some(-1.0)]]), options);
    assert_eq!(rows.next().unwrap().unwrap().reports, [(0, Some(0.0))]);
    assert!(matches!(rows.next(), Err(Error::Content { row: 2, .. })));
}
