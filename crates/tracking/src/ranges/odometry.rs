//! Odometry: columns of what the target moved since the row before.

use super::settings::Anchor;
use crate::error::Error;
use crate::rows::instant::Instant;
use nalgebra::Vector3;

/// Names of the columns, one for each axis.
pub(crate) struct Odometry(Vec<String>);

impl Odometry {
    /// `names`: of the columns, unless each row is a range by itself.
    pub(crate) fn new(columns: &[String], anchors: &[Anchor], names: Option<&[String]>) -> Result<Self, Error> {
        let refused = |value: String, expected: &'static str| Error::Argument {
            argument: "odometry",
            value,
            expected,
        };
        if !matches!(columns.len(), 0 | 2 | 3) {
            return Err(refused(columns.join(","), "two columns, as `dx,dy`, or three"));
        }
        for name in columns {
            if anchors.iter().any(|(anchor, _)| anchor == name) {
                return Err(refused(name.clone(), "no anchor's name"));
            }
            if names.is_some_and(|names| !names.contains(name)) {
                return Err(refused(name.clone(), "a column of the rows"));
            }
        }
        Ok(Self(columns.to_vec()))
    }

    /// The axis of a column.
    pub(crate) fn axis(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|known| known == name)
    }

    /// What the target moved since the row before; `None` if the row does not say it.
    pub(crate) fn moved(&self, instant: &Instant, names: &[String]) -> Option<Vector3<f64>> {
        let mut by = None;
        for (sensor, value) in &instant.reports {
            let axis = names.get(*sensor).and_then(|name| self.axis(name));
            if let (Some(axis), Some(value)) = (axis, value.filter(|value| value.is_finite())) {
                by.get_or_insert_with(Vector3::zeros)[axis] += value;
            }
        }
        by
    }
}
