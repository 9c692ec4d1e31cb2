//! Results that several figures of one run look at: computed once.

use std::any::Any;
use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

/// Results by name. Figures that name the same world are run one after the other, so that the later ones find what the first computed.
#[derive(Default)]
pub struct Kept(Mutex<HashMap<String, Box<dyn Any + Send>>>);

impl Kept {
    /// What was stored under this name, if it is of this type.
    pub fn get<T: Clone + 'static>(&self, name: &str) -> Option<T> {
        let all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.get(name)?.downcast_ref().cloned()
    }

    /// Stores a value under a name that says all that it depends on.
    pub fn put<T: Send + 'static>(&self, name: String, value: T) {
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.insert(name, Box::new(value));
    }
}

#[cfg(test)]
mod tests {
    use super::Kept;

    #[test]
    fn a_value_comes_back_under_its_name_and_type_alone() {
        let kept = Kept::default();
        kept.put("tracks".to_owned(), vec![1.0, 2.0]);
        assert_eq!(kept.get::<Vec<f64>>("tracks"), Some(vec![1.0, 2.0]));
        assert_eq!(kept.get::<Vec<u8>>("tracks"), None);
        assert_eq!(kept.get::<Vec<f64>>("other"), None);
    }
}
