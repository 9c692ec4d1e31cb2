//! Results that several figures of one run look at: computed once.

use std::any::Any;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Results by name. Figures that name the same world are run one after the other, so that the later ones find what the first computed.
#[derive(Default)]
pub struct Kept(Mutex<HashMap<String, Box<dyn Any + Send>>>);

impl Kept {
    /// What was stored under this name and is of this type, or what `make` returns. The name says all that the value depends on.
    pub(crate) fn once<T: Clone + Send + 'static, E>(
        &self,
        name: String,
        make: impl FnOnce() -> Result<T, E>,
    ) -> Result<T, E> {
        let all = || self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let known = all().get(&name).and_then(|known| known.downcast_ref::<T>().cloned());
        if let Some(known) = known {
            return Ok(known);
        }
        let made = make()?;
        all().insert(name, Box::new(made.clone()));
        Ok(made)
    }
}

#[cfg(test)]
mod tests {
    use super::Kept;

    #[test]
    fn a_value_comes_back_under_its_name_and_type_alone() {
        let kept = Kept::default();
        let numbers = |name: &str, made: f64| kept.once(name.to_owned(), || Ok::<_, ()>(vec![made]));
        assert_eq!(numbers("tracks", 1.0), Ok(vec![1.0]));
        assert_eq!(numbers("tracks", 2.0), Ok(vec![1.0]));
        assert_eq!(numbers("other", 2.0), Ok(vec![2.0]));
        assert_eq!(kept.once("tracks".to_owned(), || Err::<Vec<u8>, _>(())), Err(()));
    }
}
