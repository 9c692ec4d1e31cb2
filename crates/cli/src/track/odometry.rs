//! Odometry of `ranges`: columns of what the target moved since the row before.

use super::anchors::Anchor;
use super::rows::Instants;
use crate::arguments::RangesOptions;
use crate::error::Error;
use fewbits_tracking::Instant;
use nalgebra::Vector3;

/// Names of the columns, one for each axis.
pub(super) struct Odometry(Vec<String>);

impl Odometry {
    pub(super) fn new(options: &RangesOptions, anchors: &[Anchor], instants: &Instants) -> Result<Self, Error> {
        let names = &options.odometry;
        if !matches!(names.len(), 0 | 2 | 3) {
            return Err(Error::option("--odometry", &names.join(","), "two columns, as `dx,dy`, or three"));
        }
        for name in names {
            if anchors.iter().any(|(anchor, _)| anchor == name) {
                return Err(Error::option("--odometry", name, "no anchor's name"));
            }
            if options.table.by.is_none() && !instants.names().contains(name) {
                let problem = format!("no column `{name}` of --odometry: there are {}", instants.names().join(", "));
                return Err(Error::content(instants.source().file(), problem));
            }
        }
        Ok(Self(names.clone()))
    }

    /// The axis of a column.
    pub(super) fn axis(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|known| known == name)
    }

    /// What the target moved since the row before; `None` if the row does not say it.
    pub(super) fn moved(&self, instant: &Instant, names: &[String]) -> Option<Vector3<f64>> {
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
