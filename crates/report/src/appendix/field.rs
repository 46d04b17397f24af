//! The choice of the field that colours a picture, and of the steps that are shown.

use std::fmt;
use std::str::FromStr;

use mpm_files::vtu::read::{Array, MeshFile, Section};

use super::error::ReportError;
use super::run::{Snapshot, read_mesh};
use super::units::Quantity;

/// A field by its name in the files, with a component if it has several.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FieldChoice {
    name: String,
    component: Option<String>,
}

impl FromStr for FieldChoice {
    type Err = String;

    /// Reads `NAME` or `NAME:COMPONENT`, for example `cauchy_stress:XX`.
    fn from_str(text: &str) -> Result<FieldChoice, String> {
        let (name, component) = match text.split_once(':') {
            Some((name, component)) => (name, Some(component)),
            None => (text, None),
        };
        if name.is_empty() || component == Some("") {
            return Err("expected a field, for example pressure or cauchy_stress:XX".to_owned());
        }
        Ok(FieldChoice { name: name.to_owned(), component: component.map(str::to_owned) })
    }
}

impl fmt::Display for FieldChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        self.component.iter().try_for_each(|component| write!(f, ":{component}"))
    }
}

impl FieldChoice {
    /// The default field for some states: the first field of a fixed list that all these states have.
    pub(super) fn usual(snapshots: &[Snapshot]) -> Result<FieldChoice, ReportError> {
        let mut names =
            vec!["von_mises_stress", "equivalent_plastic_strain", "pressure", "J", "displacement"];
        // Reads one mesh at a time, since meshes may be large.
        for snapshot in snapshots {
            let mesh = read_mesh(&snapshot.path)?;
            names.retain(|name| mesh.arrays(Section::PointData).any(|array| array.name == *name));
        }
        // Every file has the volume.
        Ok(FieldChoice { name: names.first().copied().unwrap_or("volume").to_owned(), component: None })
    }

    /// The fields that show a mechanism, displacement and equivalent plastic strain, if a state has them.
    pub(super) fn mechanism(snapshot: &Snapshot) -> Result<Vec<FieldChoice>, ReportError> {
        let mesh = read_mesh(&snapshot.path)?;
        let is_there = |name: &&str| mesh.arrays(Section::PointData).any(|array| array.name == *name);
        let names = ["displacement", "equivalent_plastic_strain"].into_iter().filter(is_there);
        Ok(names.map(|name| FieldChoice { name: name.to_owned(), component: None }).collect())
    }

    /// Name of the field in words.
    pub(super) fn title(&self) -> String {
        let words = match self.name.as_str() {
            "von_mises_stress" => "von Mises stress".to_owned(),
            "cauchy_stress" => "Cauchy stress".to_owned(),
            name => name.replace('_', " "),
        };
        match &self.component {
            Some(component) => format!("{words} {}", component.to_uppercase()),
            None if self.name == "displacement" => format!("{words} magnitude"),
            None => words,
        }
    }

    /// The quantity of the field; a plain number if it is unknown.
    pub(super) fn quantity(&self) -> Quantity {
        Quantity::from_field(&self.name).unwrap_or(Quantity::Number)
    }

    /// One number for each point of a mesh.
    pub(super) fn values(&self, mesh: &MeshFile) -> Result<Vec<f64>, ReportError> {
        let Some(array) = mesh.arrays(Section::PointData).find(|array| array.name == self.name) else {
            let known = mesh.arrays(Section::PointData).map(|array| array.name.clone()).collect();
            return Err(ReportError::NoField { name: self.name.clone(), known });
        };
        let values = mesh.decode(array).map_err(ReportError::from_reader)?;
        if array.components == 1 && self.component.is_none() {
            return Ok(values);
        }
        let tuples = values.chunks_exact(array.components);
        match &self.component {
            None if array.components == 3 => {
                Ok(tuples.map(|v| v.iter().map(|c| c * c).sum::<f64>().sqrt()).collect())
            }
            _ => self.component_of(array).map(|index| tuples.map(|tuple| tuple[index]).collect()),
        }
    }

    fn component_of(&self, array: &Array) -> Result<usize, ReportError> {
        let is_it = |name: &String| self.component.as_ref().is_some_and(|c| c.eq_ignore_ascii_case(name));
        array.component_names.iter().position(is_it).ok_or_else(|| ReportError::NoComponent {
            field: self.name.clone(),
            component: self.component.clone(),
            known: array.component_names.clone(),
        })
    }
}

/// A load step among those that were written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StepChoice {
    /// The first step written, usually the undeformed state.
    First,
    /// The step whose number is closest to the mean of the first and the last.
    Middle,
    /// The last step written.
    Last,
    /// A step by its number.
    Number(usize),
}

impl FromStr for StepChoice {
    type Err = String;

    /// Reads a number, `first`, `middle` or `last`.
    fn from_str(text: &str) -> Result<StepChoice, String> {
        match text.trim() {
            "first" => Ok(StepChoice::First),
            "middle" => Ok(StepChoice::Middle),
            "last" => Ok(StepChoice::Last),
            other => other
                .parse()
                .map(StepChoice::Number)
                .map_err(|_| "expected step numbers, or the words first, middle or last".to_owned()),
        }
    }
}

impl StepChoice {
    /// Index of the step among the steps that were written, which are in ascending order.
    fn find(self, written: &[Snapshot]) -> Option<usize> {
        let (first, last) = (written.first()?.step, written.last()?.step);
        match self {
            StepChoice::First => Some(0),
            StepChoice::Last => Some(written.len() - 1),
            StepChoice::Middle => {
                let off = |snapshot: &Snapshot| (2 * snapshot.step).abs_diff(first + last);
                (0..written.len()).min_by_key(|index| off(&written[*index]))
            }
            StepChoice::Number(step) => written.iter().position(|snapshot| snapshot.step == step),
        }
    }

    /// The chosen steps, each once, in order.
    pub(super) fn find_all(
        choices: &[StepChoice],
        written: &[Snapshot],
    ) -> Result<Vec<Snapshot>, ReportError> {
        let mut found = Vec::new();
        for choice in choices {
            match (choice.find(written), choice) {
                (Some(index), _) => found.push(index),
                (None, StepChoice::Number(step)) => {
                    let known = written.iter().map(|snapshot| snapshot.step).collect();
                    return Err(ReportError::NoStep { step: *step, known });
                }
                (None, _) => {}
            }
        }
        found.sort_unstable();
        found.dedup();
        Ok(found.into_iter().map(|index| written[index].clone()).collect())
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn written(steps: &[usize]) -> Vec<Snapshot> {
        steps.iter().map(|&step| Snapshot { step, time: step as f64, path: PathBuf::new() }).collect()
    }

    fn chosen(choices: &str, steps: &[usize]) -> Result<Vec<usize>, String> {
        let choices: Vec<StepChoice> = choices.split(',').map(|text| text.parse().unwrap()).collect();
        let found = StepChoice::find_all(&choices, &written(steps)).map_err(|error| error.to_string())?;
        Ok(found.iter().map(|snapshot| snapshot.step).collect())
    }

    #[test]
    fn steps_are_found_among_those_written() {
        assert_eq!(chosen("first,middle,last", &[0, 5, 10, 15, 20, 23]), Ok(vec![0, 10, 23]));
        assert_eq!(chosen("last,10,first,10", &[0, 10, 20]), Ok(vec![0, 10, 20]));
        assert_eq!(chosen("first,middle,last", &[7]), Ok(vec![7]));
        assert_eq!(chosen("first,middle,last", &[]), Ok(vec![]));
        let error = chosen("3", &[0, 10, 20]).unwrap_err();
        assert!(error.contains("step 3") && error.contains("0, 10, 20"), "{error}");
        assert!("half".parse::<StepChoice>().is_err());
    }

    #[test]
    fn fields_are_read_as_they_are_written() {
        for text in ["pressure", "cauchy_stress:XX"] {
            assert_eq!(text.parse::<FieldChoice>().unwrap().to_string(), text);
        }
        for text in ["", ":", "a:", ":XX"] {
            assert!(text.parse::<FieldChoice>().is_err(), "{text}");
        }
        let stress: FieldChoice = "cauchy_stress:xy".parse().unwrap();
        assert_eq!((stress.title(), stress.quantity()), ("Cauchy stress XY".to_owned(), Quantity::Stress));
    }
}
