//! Properties of a material that contradict each other.

use super::property::Setting;

/// A contradiction between properties at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct Inconsistency {
    /// Key of the property to change, such as `dilation_angle` or `softening/strain`; empty if a property is missing.
    pub key: String,
    /// The contradiction.
    pub message: String,
    /// The remedy.
    pub help: String,
}

impl Inconsistency {
    pub(crate) fn new(key: &str, message: String, help: &str) -> Option<Inconsistency> {
        Some(Inconsistency { key: key.to_owned(), message, help: help.to_owned() })
    }
}

/// Finds a contradiction between properties, given the values of the varying ones.
pub type Consistency = Box<dyn Fn(&[f64]) -> Option<Inconsistency> + Send + Sync>;

/// Two properties; the first must not exceed the second.
pub(super) struct AtMost {
    pub key: &'static str,
    pub value: Setting,
    pub of: &'static str,
    pub most: Setting,
    /// True if the first must be less than the second.
    pub strictly: bool,
}

impl AtMost {
    pub(super) fn check(&self, properties: &[f64]) -> Option<Inconsistency> {
        let [value, most] = [self.value, self.most].map(|setting| setting.at(properties));
        if value < most || value == most && !self.strictly {
            return None;
        }
        let (key, of) = (self.key, self.of);
        let name = key.rsplit('/').next().unwrap_or(key);
        let relation = if self.strictly { "not below" } else { "above" };
        let message = format!("`{name}` is {value}, {relation} `{of}`, {most}");
        let least = if self.strictly { "less than" } else { "at most" };
        Inconsistency::new(key, message, &format!("use {least} {most}, or change `{of}`"))
    }
}

/// The check of a law whose properties never contradict each other.
pub(crate) fn consistent(_: &[f64]) -> Option<Inconsistency> {
    None
}
