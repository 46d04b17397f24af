//! Numbers with nouns, for messages.

/// A number with a noun in the singular or the plural.
pub fn counted(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}
