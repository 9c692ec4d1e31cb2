//! Trials distributed over the ranks of an MPI job.

use crate::engine::{MonteCarlo, MonteCarloError, Trial};
use mpi::datatype::PartitionMut;
use mpi::traits::{Communicator, CommunicatorCollectives};
use serde::{Serialize, de::DeserializeOwned};
use std::fmt::Display;

impl MonteCarlo<'_> {
    /// [`MonteCarlo::run`] with the trials distributed over the ranks of `ranks`. Every rank returns the results of all trials. See
    /// [`MonteCarlo::fold_over`].
    ///
    /// # Errors
    /// As [`MonteCarlo::fold_over`].
    pub fn run_over<T: Send + Serialize + DeserializeOwned, E: Display>(
        &self,
        ranks: &impl Communicator,
        trial: impl Fn(Trial) -> Result<T, E> + Sync,
    ) -> Result<Vec<T>, MonteCarloError> {
        self.fold_over(
            ranks,
            Vec::new,
            |results, it| {
                results.push(trial(it)?);
                Ok::<_, E>(())
            },
            |all, mut chunk| all.append(&mut chunk),
        )
    }

    /// [`MonteCarlo::fold`] with the chunks of trials distributed over the ranks of `ranks`. Rank `i` modulo their number folds chunk `i`
    /// on its threads. Then all accumulators are sent to all ranks as CBOR, and each rank merges them in chunk order. Every rank returns
    /// bitwise the result of one process. A chunk has 64 trials, so more than `trials / 64` ranks are not faster.
    ///
    /// Every rank must make this call with the same arguments, as for any collective call of MPI. Only the calling thread calls MPI:
    /// `initialize_with_threading(Threading::Funneled)` is enough.
    ///
    /// ```no_run
    /// use fewbits_monte_carlo::mpi::{Threading, initialize_with_threading, traits::Communicator};
    /// use fewbits_monte_carlo::{Moments, MonteCarlo, Stream};
    /// use rand::RngExt;
    /// let (universe, _) = initialize_with_threading(Threading::Funneled).ok_or("MPI has been started already")?;
    /// let ranks = universe.world();
    /// let mean = MonteCarlo::new(Stream::new(1).named("mean of a uniform"), 1_000_000).fold_over(
    ///     &ranks,
    ///     Moments::default,
    ///     |sum, trial| Ok::<_, std::convert::Infallible>(sum.add(trial.stream.rng().random())),
    ///     |total, part| total.merge(&part),
    /// )?;
    /// if ranks.rank() == 0 {
    ///     println!("{:?}", mean.estimate());
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// If a trial fails or panics on any rank (every rank reports the one of lowest index), the run is cancelled on any rank, or the
    /// accumulators cannot be written or read as CBOR or have more than 2 GiB together.
    pub fn fold_over<A: Send + Serialize + DeserializeOwned, E: Display>(
        &self,
        ranks: &impl Communicator,
        empty: impl Fn() -> A + Sync,
        trial: impl Fn(&mut A, Trial) -> Result<(), E> + Sync,
        merge: impl Fn(&mut A, A),
    ) -> Result<A, MonteCarloError> {
        let (rank, size) = (ranks.rank() as u64, ranks.size() as usize);
        let own = (rank..self.chunks()).step_by(size).collect();
        let own = self.fold_chunks(own, &empty, trial);
        let mut message = Vec::new();
        if ciborium::into_writer(&own, &mut message).is_err() {
            // This byte is not CBOR: all ranks fail to read it and stop. If this rank returned here, the others would wait forever. The
            // message is not empty, because the address of an empty vector equals `MPI_IN_PLACE`.
            message = vec![0xff];
        }
        let mut parts = Vec::with_capacity(size);
        for part in all_gather(ranks, &message)? {
            let chunks: Vec<Result<A, MonteCarloError>> = ciborium::from_reader(&*part).map_err(exchange)?;
            parts.push(chunks.into_iter());
        }
        let mut total = empty();
        for chunk in 0..self.chunks() {
            let part = parts[(chunk % size as u64) as usize].next();
            merge(&mut total, part.ok_or_else(|| exchange("a rank had other trials"))??);
        }
        Ok(total)
    }
}

fn exchange(message: impl Display) -> MonteCarloError {
    MonteCarloError::Exchange {
        message: message.to_string(),
    }
}

/// The messages of all ranks, by rank.
fn all_gather(ranks: &impl Communicator, message: &[u8]) -> Result<Vec<Vec<u8>>, MonteCarloError> {
    let mut lengths = vec![0; ranks.size() as usize];
    ranks.all_gather_into(&(message.len() as u64), &mut lengths[..]);
    // MPI counts bytes by `i32`. All ranks see the same lengths, so either all stop here or none.
    let mut ends = Vec::with_capacity(lengths.len());
    let mut end = 0_i32;
    for &length in &lengths {
        let next = i32::try_from(length).ok().and_then(|length| end.checked_add(length));
        end = next.ok_or_else(|| exchange(format!("{} bytes, expected below 2 GiB", lengths.iter().sum::<u64>())))?;
        ends.push(end);
    }
    let starts: Vec<i32> = std::iter::once(0)
        .chain(ends.iter().copied())
        .take(ends.len())
        .collect();
    let counts: Vec<i32> = starts.iter().zip(&ends).map(|(start, end)| end - start).collect();
    let mut all = vec![0_u8; end as usize];
    ranks.all_gather_varcount_into(message, &mut PartitionMut::new(&mut all[..], counts, &starts[..]));
    Ok(starts
        .iter()
        .zip(&ends)
        .map(|(&start, &end)| all[start as usize..end as usize].to_vec())
        .collect())
}
