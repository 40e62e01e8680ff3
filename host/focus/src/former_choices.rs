//! Parameters that a former chose for an image.

use std::any::Any;
use std::fmt::Debug;
use std::sync::Arc;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use super::error::FormError;

/// Parameters that a former chose for one image: of the former's own type where they were decided, JSON in a stored plan.
#[derive(Clone, Debug)]
pub struct FormerChoices(Held);

#[derive(Clone, Debug)]
enum Held {
    Typed(Arc<dyn Typed>),
    Stored(Value),
}

trait Typed: Any + Debug + Send + Sync {
    fn to_json(&self) -> Value;
}

impl<T: Serialize + Debug + Send + Sync + 'static> Typed for T {
    fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("choices are numbers and text")
    }
}

impl FormerChoices {
    /// Choices of a type whose JSON is stored with a plan.
    ///
    /// # Panics
    /// When stored, if the JSON of `T` has keys that are not text.
    pub fn new<T: Serialize + Debug + Send + Sync + 'static>(choices: T) -> Self {
        Self(Held::Typed(Arc::new(choices)))
    }

    /// The choices as the type of `former`.
    ///
    /// # Errors
    /// [`FormError::Choices`] if they belong to another former.
    pub fn of<T: DeserializeOwned + Clone + 'static>(
        &self,
        former: &'static str,
    ) -> Result<T, FormError> {
        let parsed = match &self.0 {
            Held::Typed(typed) => match (&**typed as &dyn Any).downcast_ref::<T>() {
                Some(choices) => return Ok(choices.clone()),
                None => T::deserialize(typed.to_json()),
            },
            Held::Stored(json) => T::deserialize(json),
        };
        parsed.map_err(|error| misfit(former, &error.to_string()))
    }

    /// The choices as stored with a plan.
    pub fn to_json(&self) -> Value {
        match &self.0 {
            Held::Typed(typed) => typed.to_json(),
            Held::Stored(json) => json.clone(),
        }
    }
}

/// Choices of a former without parameters.
impl Default for FormerChoices {
    fn default() -> Self {
        Self(Held::Stored(serde_json::json!({})))
    }
}

impl PartialEq for FormerChoices {
    fn eq(&self, other: &Self) -> bool {
        self.to_json() == other.to_json()
    }
}

impl Serialize for FormerChoices {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.to_json().serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for FormerChoices {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Value::deserialize(deserializer).map(|json| Self(Held::Stored(json)))
    }
}

/// Error for choices that do not belong to this former and image.
pub(crate) fn misfit(former: &'static str, mismatch: &str) -> FormError {
    FormError::Choices {
        former,
        mismatch: mismatch.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
    struct Taps {
        taps: usize,
    }

    #[test]
    fn choices_are_equal_from_memory_and_from_a_stored_plan() {
        let made = FormerChoices::new(Taps { taps: 6 });
        let stored: FormerChoices =
            serde_json::from_str(&serde_json::to_string(&made).unwrap()).unwrap();
        assert_eq!(made, stored);
        for choices in [made, stored] {
            assert_eq!(choices.of::<Taps>("pfa").unwrap(), Taps { taps: 6 });
            let error = choices.of::<Vec<usize>>("ffbp").unwrap_err();
            assert!(matches!(error, FormError::Choices { former: "ffbp", .. }));
        }
    }
}
