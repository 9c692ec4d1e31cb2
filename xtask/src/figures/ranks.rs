//! Figures shared by the ranks of an MPI job.
//!
//! Rank 0 holds the list of what is to be made. Another rank asks for work whenever one of its threads is free, and hands over what it
//! made. A figure is made whole on one rank by the same code as ever, so its files are the same. Every message of a rank is answered
//! before its next: neither side sends while the other does. Threads that wait sleep, so that figures that measure time have the
//! machine to themselves.

use super::select::Job;
use super::write::Made;
use mpi::environment::Universe;
use mpi::traits::{Communicator, Destination, MatchedReceiveVec, Source};
use mpi::{Rank, Threading, initialize_with_threading};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Map, Value as Json};
use std::cell::RefCell;
use std::sync::mpsc;
use std::time::Duration;

/// Sleep between two looks for a message.
const PAUSE: Duration = Duration::from_millis(2);

/// A figure to be made, with its parameters.
#[derive(Serialize, Deserialize)]
pub(super) struct Order {
    id: String,
    parameters: Map<String, Json>,
}

impl Order {
    pub(super) fn of(job: &Job) -> Self {
        Self {
            id: job.figure.about().id.to_owned(),
            parameters: job.run.parameters.clone(),
        }
    }

    /// None if this program has no such figure.
    pub(super) fn job(self) -> Option<Job> {
        let mut figures = fewbits_experiments::all().into_iter();
        let figure = figures.find(|figure| figure.about().id == self.id)?;
        let run = figure.with(self.parameters).ok()?;
        Some(Job { figure, run })
    }
}

/// What another rank tells rank 0.
#[derive(Serialize, Deserialize)]
enum Message {
    /// A thread is free. The answer is a list of orders, empty if nothing is left.
    Free,
    /// It begins the figure of this id. The answer is empty.
    Begun(String),
    /// It has made a figure. The answer is empty.
    Made(Box<Made>),
    /// It has no work any more. The answer comes when rank 0 has none either.
    Done,
}

/// The ranks of the job; one outside `mpirun`.
pub(super) struct Ranks {
    /// None if MPI cannot be started, or was in this process before.
    universe: Option<Universe>,
    /// Ranks that are done and wait for their release.
    done: RefCell<Vec<Rank>>,
}

impl Ranks {
    pub(super) fn start() -> Self {
        Self {
            universe: initialize_with_threading(Threading::Funneled).map(|(universe, _)| universe),
            done: RefCell::default(),
        }
    }

    pub(super) fn is_first(&self) -> bool {
        self.universe
            .as_ref()
            .is_none_or(|universe| universe.world().rank() == 0)
    }

    pub(super) fn size(&self) -> usize {
        self.universe
            .as_ref()
            .map_or(1, |universe| universe.world().size() as usize)
    }

    /// Works on `threads` threads until rank 0 has nothing left.
    pub(super) fn work(&self, threads: usize, make: impl Fn(Order) -> Option<Made> + Sync) {
        let Some(universe) = &self.universe else { return };
        let ask = |message: &Message| -> Vec<Order> {
            send(universe, 0, message);
            receive(universe).1.unwrap_or_default()
        };
        let (sender, messages) = mpsc::channel();
        std::thread::scope(|scope| {
            // This thread alone calls MPI.
            let mut working = threads;
            (0..threads).for_each(|_| drop(sender.send(Message::Free)));
            while working > 0
                && let Ok(message) = messages.recv()
            {
                let orders = ask(&message);
                match message {
                    Message::Free if orders.is_empty() => working -= 1,
                    Message::Free => {
                        let (sender, make) = (sender.clone(), &make);
                        scope.spawn(move || {
                            for order in orders {
                                // A receiver that is gone needs no message.
                                let _ = sender.send(Message::Begun(order.id.clone()));
                                if let Some(made) = make(order) {
                                    let _ = sender.send(Message::Made(Box::new(made)));
                                }
                            }
                            let _ = sender.send(Message::Free);
                        });
                    }
                    _ => (),
                }
            }
        });
        ask(&Message::Done);
    }

    /// Hands out `orders` until every other rank is done, and tells `news` of figures that are begun (without) and made.
    pub(super) fn serve(
        &self,
        mut orders: impl FnMut() -> Option<Vec<Order>>,
        mut news: impl FnMut(&str, Option<Made>),
    ) {
        let Some(universe) = &self.universe else { return };
        let mut done = self.done.borrow_mut();
        while done.len() + 1 < self.size() {
            let (rank, message) = receive(universe);
            let mut answer = Vec::new();
            match message {
                Some(Message::Free) => answer = orders().unwrap_or_default(),
                Some(Message::Begun(id)) => news(&id, None),
                Some(Message::Made(made)) => news(&made.record.id.clone(), Some(*made)),
                Some(Message::Done) => {
                    done.push(rank);
                    continue;
                }
                None => (),
            }
            send(universe, rank, &answer);
        }
    }
}

impl Drop for Ranks {
    /// Releases the other ranks, also where rank 0 had nothing to make.
    fn drop(&mut self) {
        if self.is_first() {
            self.serve(|| None, |_, _| ());
            if let Some(universe) = &self.universe {
                let nothing: [Order; 0] = [];
                self.done
                    .borrow()
                    .iter()
                    .for_each(|&rank| send(universe, rank, &nothing));
            }
        }
    }
}

fn send(universe: &Universe, rank: Rank, message: &(impl Serialize + ?Sized)) {
    // All messages can be written. An empty one would be answered by no orders.
    let text = serde_json::to_vec(message).unwrap_or_default();
    universe.world().process_at_rank(rank).send(&text[..]);
}

/// Sender and content of the next message; no content if it is not understood.
fn receive<M: DeserializeOwned>(universe: &Universe) -> (Rank, Option<M>) {
    let world = universe.world();
    loop {
        if let Some(found) = world.any_process().immediate_matched_probe() {
            let (text, status) = found.matched_receive_vec::<u8>();
            return (status.source_rank(), serde_json::from_slice(&text).ok());
        }
        std::thread::sleep(PAUSE);
    }
}
