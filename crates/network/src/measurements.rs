//! Measurements of all sensors, slot by slot.

use crate::error::Error;
use fewbits_numerics::error::refuse;
use fewbits_protocol::SLOT_BITS;
use std::fmt;
use std::sync::Arc;

/// Measurements of all sensors in all slots, from a table or a function. Any of them may be missing.
///
/// A table is made from `Vec<Vec<M>>` (entry `[k][i]`: sensor `i` in slot `k + 1`) or `Vec<Vec<Option<M>>>`, or collected from an iterator
/// over slots.
#[derive(Clone)]
pub struct Measurements<M>(Source<M>);

#[derive(Clone)]
enum Source<M> {
    Table(Arc<Vec<Vec<Option<M>>>>),
    Function {
        slots: u32,
        measure: Arc<dyn Fn(u32, usize) -> Option<M> + Send + Sync>,
    },
}

impl<M> Measurements<M> {
    /// Measurements of `slots` slots from a function. `measure(slot, sensor)` is called when the sensor measures; slots count from 1,
    /// sensors from 0. It may never be called for a slot, or again after a snapshot is restored.
    pub fn from_fn(slots: u32, measure: impl Fn(u32, usize) -> Option<M> + Send + Sync + 'static) -> Self {
        Self(Source::Function {
            slots,
            measure: Arc::new(measure),
        })
    }

    /// Number of slots.
    pub(crate) fn slots(&self) -> u32 {
        match &self.0 {
            Source::Table(table) => u32::try_from(table.len()).unwrap_or(u32::MAX),
            Source::Function { slots, .. } => *slots,
        }
    }

    /// Applies `used` to the measurement; `None` if there is none.
    pub(crate) fn with<T>(&self, slot: u32, sensor: usize, used: impl FnOnce(&M) -> T) -> Option<T> {
        match &self.0 {
            Source::Table(table) => {
                let slot = (slot as usize).checked_sub(1)?;
                table.get(slot)?.get(sensor)?.as_ref().map(used)
            }
            Source::Function { slots, measure } => (1..=*slots)
                .contains(&slot)
                .then(|| measure(slot, sensor))
                .flatten()
                .as_ref()
                .map(used),
        }
    }

    /// # Errors
    /// If a slot of a table has not one entry per sensor, or there are more slots than a frame can number.
    pub(crate) fn check(&self, sensors: usize) -> Result<(), Error> {
        if let Source::Table(table) = &self.0
            && let Some(slot) = table.iter().find(|slot| slot.len() != sensors)
        {
            return refuse("measurements", slot.len(), format!("{sensors} in every slot, one per sensor"));
        }
        if self.slots() >= 1 << (SLOT_BITS - 1) {
            return refuse("measurements", self.slots(), "fewer than 2^23 slots");
        }
        Ok(())
    }
}

impl<M> fmt::Debug for Measurements<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Measurements")
            .field("slots", &self.slots())
            .finish_non_exhaustive()
    }
}

impl<M> FromIterator<Vec<Option<M>>> for Measurements<M> {
    fn from_iter<I: IntoIterator<Item = Vec<Option<M>>>>(slots: I) -> Self {
        Self(Source::Table(Arc::new(slots.into_iter().collect())))
    }
}

impl<M> From<Vec<Vec<Option<M>>>> for Measurements<M> {
    fn from(table: Vec<Vec<Option<M>>>) -> Self {
        Self(Source::Table(Arc::new(table)))
    }
}

impl<M> From<Vec<Vec<M>>> for Measurements<M> {
    fn from(table: Vec<Vec<M>>) -> Self {
        table
            .into_iter()
            .map(|slot| slot.into_iter().map(Some).collect())
            .collect()
    }
}
