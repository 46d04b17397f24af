//! The state of a term as checkpoints store it.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

/// The state of a term at the end of a converged step. Its value is formed only when it is read, because most
/// steps store no checkpoint.
#[derive(Clone)]
pub struct Saved(Arc<dyn Fn() -> Value + Send + Sync>);

impl Saved {
    /// The state with the value that `form` returns.
    pub fn new(form: impl Fn() -> Value + Send + Sync + 'static) -> Self {
        Saved(Arc::new(form))
    }

    /// The value of the state.
    pub fn value(&self) -> Value {
        (self.0)()
    }
}

impl From<Value> for Saved {
    fn from(value: Value) -> Self {
        Saved::new(move || value.clone())
    }
}

impl PartialEq for Saved {
    fn eq(&self, other: &Self) -> bool {
        self.value() == other.value()
    }
}

impl fmt::Debug for Saved {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.value().fmt(f)
    }
}

impl Serialize for Saved {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        self.value().serialize(to)
    }
}

impl<'de> Deserialize<'de> for Saved {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        Ok(Value::deserialize(from)?.into())
    }
}
