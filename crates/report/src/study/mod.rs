//! Parameter studies: one deck, run for every combination of values from several lists.
//!
//! This module defines the members of a study, their results, and the table of all results; the caller runs the
//! members. `family` and `convergence` are about the grids of a convergence study and what follows
//! from their results.

pub mod convergence;
pub mod family;
mod record;
mod strength;
mod table;

use std::fmt::{self, Write};
use std::str::FromStr;

use mpm_core::formula::closest;
use mpm_deck::Parameter;
use mpm_deck::quoting::{list, quote};

pub use record::Record;
pub use strength::dependence_on_cells;
pub use table::{Outcome, Row, headings, may_be_replaced, write_table};

/// An invalid study.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StudyError {
    /// The input is not a list of values.
    #[error("expected NAME=VALUE,VALUE,..., for example h=1,0.5,0.25")]
    NoList,
    /// No parameter varies.
    #[error("a study needs at least one list of values")]
    Empty,
    /// A parameter has two lists.
    #[error("the parameter {} is varied twice", quote(.0))]
    VariedTwice(String),
    /// A parameter has a list and a fixed value.
    #[error("the parameter {} is both varied and set", quote(.0))]
    VariedAndSet(String),
    /// A value is repeated in a list.
    #[error("the value {} appears twice in the list of {}", quote(.1), quote(.0))]
    RepeatedValue(String, String),
    /// The deck lacks a parameter that the study changes.
    #[error("the deck has no parameter {}; {help}", quote(.name))]
    Unknown {
        /// Name of the parameter.
        name: String,
        /// A similar parameter of the deck, or all its parameters.
        help: String,
    },
    /// There are more members than can be counted.
    #[error("the study has too many members")]
    TooLarge,
}

/// A parameter of the deck and its values, as they were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Axis {
    name: String,
    values: Vec<String>,
}

impl FromStr for Axis {
    type Err = StudyError;

    /// Reads `name=value,value,...`.
    fn from_str(text: &str) -> Result<Axis, StudyError> {
        let (name, values) = text.split_once('=').ok_or(StudyError::NoList)?;
        let name = name.trim().to_owned();
        let values: Vec<String> = entries(values).into_iter().map(|value| value.trim().to_owned()).collect();
        if name.is_empty() || values.iter().any(String::is_empty) {
            return Err(StudyError::NoList);
        }
        Axis::new(name, values)
    }
}

impl Axis {
    /// Name of the parameter.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The values, as they were written.
    pub fn values(&self) -> &[String] {
        &self.values
    }

    /// A parameter that takes these values, which are written as in `--set`.
    ///
    /// # Errors
    /// [`StudyError::RepeatedValue`].
    pub fn new(name: String, values: Vec<String>) -> Result<Axis, StudyError> {
        let meant: Vec<Parameter> = values.iter().map(|value| Parameter::from_text(value)).collect();
        if let Some(index) = (1..meant.len()).find(|&i| meant[..i].contains(&meant[i])) {
            return Err(StudyError::RepeatedValue(name, values[index].clone()));
        }
        Ok(Axis { name, values })
    }
}

/// The entries of a list, separated by commas; commas inside `${...}` belong to an expression.
fn entries(list: &str) -> Vec<&str> {
    let (mut found, mut begin, mut is_inside) = (Vec::new(), 0, false);
    for (at, character) in list.char_indices() {
        match character {
            '$' if list[at..].starts_with("${") => is_inside = true,
            '}' => is_inside = false,
            ',' if !is_inside => {
                found.push(&list[begin..at]);
                begin = at + 1;
            }
            _ => {}
        }
    }
    found.push(&list[begin..]);
    found
}

/// All combinations of the values of some parameters, with the others fixed.
#[derive(Debug, Clone)]
pub struct Study {
    axes: Vec<Axis>,
    fixed: Vec<(String, String)>,
    size: usize,
}

impl Study {
    /// A study over some parameters; `fixed` holds the names and values of parameters that all members share.
    ///
    /// # Errors
    /// If no parameter varies, a parameter that varies is given more than once, or the members are too many to count.
    pub fn new(axes: Vec<Axis>, fixed: Vec<(String, String)>) -> Result<Study, StudyError> {
        if axes.is_empty() {
            return Err(StudyError::Empty);
        }
        for (index, axis) in axes.iter().enumerate() {
            if axes[..index].iter().any(|other| other.name == axis.name) {
                return Err(StudyError::VariedTwice(axis.name.clone()));
            }
            if fixed.iter().any(|(name, _)| *name == axis.name) {
                return Err(StudyError::VariedAndSet(axis.name.clone()));
            }
        }
        let size = axes.iter().try_fold(1usize, |size, axis| size.checked_mul(axis.values.len()));
        Ok(Study { axes, fixed, size: size.ok_or(StudyError::TooLarge)? })
    }

    /// Checks that a deck with these parameters has every parameter that the study varies.
    ///
    /// # Errors
    /// The first parameter that the deck does not have.
    pub fn check_names(&self, known: &[String]) -> Result<(), StudyError> {
        let changed = self.axes.iter().map(|axis| &axis.name).chain(self.fixed.iter().map(|(name, _)| name));
        for name in changed {
            if known.contains(name) {
                continue;
            }
            let known = || known.iter().map(String::as_str);
            let help = match closest(name, known()) {
                Some(best) => format!("did you mean {}?", quote(best)),
                None if known().next().is_none() => "it has no parameters".to_owned(),
                None if known().nth(1).is_none() => format!("its only parameter is {}", list(known())),
                None => format!("its parameters are {}", list(known())),
            };
            return Err(StudyError::Unknown { name: name.clone(), help });
        }
        Ok(())
    }

    /// Names of the parameters that vary.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.axes.iter().map(|axis| axis.name.as_str())
    }

    /// All members; the values of the last parameter vary fastest.
    pub fn members(&self) -> impl Iterator<Item = Member> {
        (0..self.size).map(|number| {
            let mut rest = number;
            let mut settings: Vec<(String, String)> = Vec::with_capacity(self.axes.len());
            for Axis { name, values } in self.axes.iter().rev() {
                settings.push((name.clone(), values[rest % values.len()].clone()));
                rest /= values.len();
            }
            settings.reverse();
            Member { settings }
        })
    }

    /// Number of members.
    pub fn size(&self) -> usize {
        self.size
    }

    /// Names and values of all parameters that a member changes in the deck.
    pub fn overrides(&self, member: &Member) -> Vec<(String, String)> {
        self.fixed.iter().chain(&member.settings).cloned().collect()
    }
}

/// One combination of values.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Member {
    settings: Vec<(String, String)>,
}

impl Member {
    /// Name of the member's directory, such as `h=0.25,n=6`. Bytes of a value that a file system might not accept are
    /// written as `%` and two hexadecimal digits, so that different members have different names.
    pub fn directory_name(&self) -> String {
        let mut text = String::new();
        for (name, value) in &self.settings {
            if !text.is_empty() {
                text.push(',');
            }
            text.push_str(name);
            text.push('=');
            for byte in value.bytes() {
                if byte.is_ascii_alphanumeric() || b"._+-".contains(&byte) {
                    text.push(char::from(byte));
                } else {
                    // Writing to a string cannot fail.
                    let _ = write!(text, "%{byte:02X}");
                }
            }
        }
        text
    }
}

impl fmt::Display for Member {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let settings: Vec<String> =
            self.settings.iter().map(|(name, value)| format!("{name}={value}")).collect();
        f.write_str(&settings.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn study(axes: &[&str], fixed: &[&str]) -> Result<Study, StudyError> {
        let axes = axes.iter().map(|text| text.parse()).collect::<Result<_, _>>()?;
        let fixed = fixed.iter().map(|name| ((*name).to_owned(), "1".to_owned())).collect();
        Study::new(axes, fixed)
    }

    #[test]
    fn members_in_order() {
        let study = study(&["h=1, 0.5", "method=mpm,gimp"], &["steps"]).unwrap();
        let members: Vec<String> = study.members().map(|member| member.to_string()).collect();
        let expected = ["h=1, method=mpm", "h=1, method=gimp", "h=0.5, method=mpm", "h=0.5, method=gimp"]
            .map(String::from);
        assert_eq!(members, expected);
        assert_eq!(study.size(), 4);
        let last = study.members().last().unwrap();
        assert_eq!(last.directory_name(), "h=0.5,method=gimp");
        let overrides: Vec<_> = study.overrides(&last).into_iter().map(|(n, v)| format!("{n}={v}")).collect();
        assert_eq!(overrides, ["steps=1", "h=0.5", "method=gimp"]);
    }

    #[test]
    fn commas_inside_an_expression_belong_to_it() {
        let study = study(&["h=${min(1,2)}, 2,${max(w, 3)/2}"], &[]).unwrap();
        let members: Vec<String> = study.members().map(|member| member.to_string()).collect();
        assert_eq!(members, ["h=${min(1,2)}", "h=2", "h=${max(w, 3)/2}"]);
    }

    #[test]
    fn directories_stay_inside() {
        let study = study(&["a=../x,..%2Fx,${b/2},é"], &[]).unwrap();
        let names: Vec<String> = study.members().map(|member| member.directory_name()).collect();
        assert_eq!(names, ["a=..%2Fx", "a=..%252Fx", "a=%24%7Bb%2F2%7D", "a=%C3%A9"]);
    }

    #[test]
    fn refuses_invalid_studies() {
        for text in ["h", "h=", "=1", "h=1,,2", "h=1,"] {
            assert_eq!(text.parse::<Axis>(), Err(StudyError::NoList), "{text}");
        }
        assert_eq!("h=1,1.0".parse::<Axis>(), Err(StudyError::RepeatedValue("h".into(), "1.0".into())));
        assert_eq!(study(&[], &[]).unwrap_err(), StudyError::Empty);
        assert_eq!(study(&["h=1", "h=2"], &[]).unwrap_err(), StudyError::VariedTwice("h".into()));
        assert_eq!(study(&["h=1"], &["h"]).unwrap_err(), StudyError::VariedAndSet("h".into()));
        let known = ["h".to_owned(), "steps".to_owned()];
        assert_eq!(study(&["h=1"], &["steps"]).unwrap().check_names(&known), Ok(()));
        let unknown = study(&["stesp=1"], &[]).unwrap().check_names(&known).unwrap_err();
        assert_eq!(unknown.to_string(), "the deck has no parameter `stesp`; did you mean `steps`?");
        let values: Vec<String> = (0..2000).map(|i| i.to_string()).collect();
        let axes: Vec<String> = (0..6).map(|i| format!("a{i}={}", values.join(","))).collect();
        let axes: Vec<&str> = axes.iter().map(String::as_str).collect();
        assert_eq!(study(&axes, &[]).unwrap_err(), StudyError::TooLarge);
    }
}
