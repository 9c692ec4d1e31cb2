//! Signals that end the command: SIGINT, SIGTERM, SIGHUP, and their likes elsewhere.
//!
//! A task that reads a live source stops reading, writes what it has, and ends well. Any other task ends at once, and its unfinished
//! output is removed. A second signal ends a live task at once too.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
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

/// Creates a file that is removed if a signal ends the command. A signal that comes meanwhile waits until the file is known.
pub(crate) fn create<T, E>(create: impl FnOnce() -> Result<(T, PathBuf), E>) -> Result<(T, PathBuf), E> {
    install();
    let mut state = state();
    let (file, path) = create()?;
    state.temporaries.push(path.clone());
    Ok((file, path))
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

/// Whether the first signal came, for tasks that look for it.
static IS_STOPPED: AtomicBool = AtomicBool::new(false);

/// The task looks for the first signal with [`is_stopped`], instead of ending at it.
pub(crate) fn watch() {
    on_stop(|| IS_STOPPED.store(true, Ordering::Relaxed));
}

/// Whether a signal came since [`watch`].
pub(crate) fn is_stopped() -> bool {
    IS_STOPPED.load(Ordering::Relaxed)
}
