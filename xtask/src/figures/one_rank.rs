//! Without feature `mpi`: one process.

use super::select::Job;
use super::write::Made;

pub(super) struct Ranks;

pub(super) struct Order;

impl Order {
    pub(super) fn of(_: &Job) -> Self {
        Self
    }

    pub(super) fn job(self) -> Option<Job> {
        None
    }
}

impl Ranks {
    pub(super) fn start() -> Self {
        Self
    }

    pub(super) fn is_first(&self) -> bool {
        true
    }

    pub(super) fn size(&self) -> usize {
        1
    }

    pub(super) fn work(&self, _: usize, _: impl Fn(Order) -> Option<Made> + Sync) {}

    pub(super) fn serve(&self, _: impl FnMut() -> Option<Vec<Order>>, _: impl FnMut(&str, Option<Made>)) {}
}
