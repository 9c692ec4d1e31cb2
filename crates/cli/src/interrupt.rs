//! Signals that end the command: SIGINT, SIGTERM, SIGHUP, and their likes elsewhere.
//!
//! A task that reads a live source stops reading, writes what it has, and ends well. Any other task ends at once, and its unfinished
//! output is removed. A second signal ends a live task at once too.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, Once, PoisonError};

/// Exit code of a task that a signal ended.
const INTERRUPTED: i32 = 130;

type Stop = Box<dyn Fn() + Send>;

struct State {
    /// Unfinished outputs.
    temporaries: Vec<PathBuf>,
    /// Stops the live task.
    stop: Option<Stop>,
}

static STATE: Mutex<State> = Mutex::new(State {
    temporaries: Vec::new(),
    stop: None,
});
static INSTALL: Once = Once::new();

fn state() -> MutexGuard<'static, State> {
    STATE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn install() {
    // If another part of the command handles signals, that part decides.
    INSTALL.call_once(|| {
        let _ = ctrlc::set_handler(|| {
            let mut state = state();
            match state.stop.take() {
                Some(stop) => stop(),
                None => {
                    for path in &state.temporaries {
                        let _ = std::fs::remove_file(path);
                    }
                    std::process::exit(INTERRUPTED);
                }
            }
        });
    });
}

/// Makes a file that is removed if a signal ends the command. A signal waits until it is made and known.
pub(crate) fn remember<T, E>(make: impl FnOnce() -> Result<(T, PathBuf), E>) -> Result<(T, PathBuf), E> {
    install();
    let mut state = state();
    let made = make()?;
    state.temporaries.push(made.1.clone());
    Ok(made)
}

/// The file is finished or removed.
pub(crate) fn forget(path: &Path) {
    state().temporaries.retain(|known| known != path);
}

/// Calls `stop` at the first signal instead of ending the command.
pub(crate) fn on_stop(stop: impl Fn() + Send + 'static) {
    install();
    state().stop = Some(Box::new(stop));
}
