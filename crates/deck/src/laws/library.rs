//! Laws from shared libraries that a deck names: loading, parameters, and a test of the law before the run.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::LawDeck;
use crate::diagnostic::{Diagnostic, Severity};
use crate::formulas::Fault;
use crate::material::{Faults, Reading, StatedLaw};
use crate::quoting::quote;
use crate::references::{Noun, existing};
use crate::source::Source;
use crate::span::escape;
use crate::{Drainage, Expression};
use mpm_core::formula::{FormulaError, closest};
use mpm_core::input_file;
use mpm_core::material::Material;
use mpm_core::material::conformance::{Property, check};
use mpm_core::points::Points;
use mpm_core::tensor::Sym3;
use mpm_files::fields::PointField;
use mpm_foreign::{Described, Kind, Library, LibraryError, LibraryLaw, differs_between_threads};

/// A law of your own in a shared library, written in C, Fortran or another compiled language; its code runs as part
/// of the program.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LibraryDeck {
    /// Path of the library, relative to the deck.
    #[schemars(extend("examples" = ["./law.so"]))]
    pub file: String,
    /// Values of the parameters of the law, with the names and in the units that the library states.
    #[serde(default)]
    #[schemars(extend("examples" = [{"young": 12e6, "poisson": 0.3}]))]
    pub parameters: BTreeMap<String, f64>,
    /// Initial mass density ρ₀, [mass/volume], without the water of a `level` in the pores; needed if gravity or a
    /// force per mass acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("minimum" = 0.0, "examples" = [2000]))]
    pub density: Option<Expression>,
    /// Share n₀ of the pores in the initial volume, [-]; needed in bodies that the water of the deck reaches.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0.0, "exclusiveMaximum" = 1.0, "examples" = [0.4]))]
    pub porosity: Option<f64>,
    /// What the water in the pores does; `drained` by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("examples" = ["undrained"]))]
    pub drainage: Option<Drainage>,
}

/// Largest component of the strains at which a law is tested, [-].
const LARGEST: f64 = 0.01;

impl LawDeck for LibraryDeck {
    fn density(&self) -> Option<&Expression> {
        self.density.as_ref()
    }

    // The deck that names a library loads it.
    fn read(&self, _: Reading) -> Result<StatedLaw, Faults> {
        let message = "only a deck can load the law of a library".to_owned();
        let error = FormulaError { message, offset: 0, length: 0, help: None };
        Err(vec![Fault { key: "file".to_owned(), text: self.file.clone(), error }])
    }

    fn keeps_strength(&self) -> bool {
        true
    }

    fn library(&self) -> Option<&LibraryDeck> {
        Some(self)
    }
}

/// A library that a material of a deck names, and what its messages need.
pub(crate) struct NamedLibrary<'a> {
    pub(crate) source: &'a Source,
    /// Directory of the deck.
    pub(crate) directory: &'a Path,
    /// Name of the material.
    pub(crate) name: &'a str,
    /// Path of the library, and the values of its parameters.
    pub(crate) deck: &'a LibraryDeck,
    /// True if code of the library may run.
    pub(crate) is_allowed: bool,
}

/// Largest library that is read, [byte].
const MAX_BYTES: u64 = 1 << 30;

/// The variable of the environment that allows libraries if its value is 1.
pub const ALLOW_LIBRARIES: &str = "MPM_ALLOW_LIBRARIES";

/// True if code of the libraries that decks name may run: the user asks for it, or [`ALLOW_LIBRARIES`] is 1.
pub fn may_run_libraries(is_asked: bool) -> bool {
    is_asked || std::env::var_os(ALLOW_LIBRARIES).is_some_and(|value| value == "1")
}

impl NamedLibrary<'_> {
    /// Loads the library and creates the law.
    ///
    /// # Errors
    /// All faults of the library or, if it can be loaded, of the parameters.
    pub(crate) fn law(&self) -> Result<LibraryLaw, Vec<Diagnostic>> {
        let library = self.open().map_err(|fault| vec![*fault])?;
        let values = self.values(library.parameters())?;
        let law = LibraryLaw::new(library, values).map_err(|reason| {
            let reason: String = reason.chars().filter(|c| !c.is_control()).take(200).collect();
            let message =
                format!("the law of the material {} rejects its parameters: {reason}", quote(self.name));
            vec![
                Diagnostic::at_key(self.source, "D062", &self.at("parameters"), message)
                    .help("change the values of `parameters`; the law decides which values it accepts"),
            ]
        })?;
        match law.state_fields().iter().find(|field| is_field_of_points(&field.name)) {
            None => Ok(law),
            Some(field) => {
                let message = format!(
                    "the library {} cannot be used: its history variable {} has the name of another field of the points",
                    quote(&self.deck.file),
                    quote(&field.name)
                );
                let found = Diagnostic::at(self.source, "D061", &self.at("file"), message);
                Err(vec![
                    found.help("give it another name in `mpm_law_history` in the source of the library"),
                ])
            }
        }
    }

    fn at(&self, key: &str) -> String {
        format!("/materials/{}/{key}", escape(self.name))
    }

    fn open(&self) -> Result<std::sync::Arc<Library>, Box<Diagnostic>> {
        let path = self.directory.join(&self.deck.file);
        let fault = |what: String, help: String| {
            let message = format!("the library {} {what}", quote(&self.deck.file));
            Box::new(Diagnostic::at(self.source, "D061", &self.at("file"), message).help(help))
        };
        let unreadable = |why: String| {
            let help = format!("the path is relative to the deck; here it means `{}`", path.display());
            fault(format!("cannot be read: {why}"), help)
        };
        let contents = input_file::read(&path, MAX_BYTES).map_err(|error| unreadable(error.to_string()))?;
        if !self.is_allowed {
            let what = format!(
                "of the material {} has not been loaded: its code would run as part of this program, with all that you \
                 may do on this computer, and nobody has allowed that",
                quote(self.name)
            );
            let help = format!(
                "if you trust `{}`, add `--allow-libraries`, set {ALLOW_LIBRARIES}=1 in the environment or, in Python, \
                 give `allow_libraries=True`",
                path.display()
            );
            return Err(fault(what, help));
        }
        Library::open(&path, contents).map_err(|error| {
            let message = format!("cannot be used: {error}");
            fault(message, remedy(&error).to_owned())
        })
    }

    /// The values of the parameters in the order of the library.
    fn values(&self, known: &[Described]) -> Result<Vec<f64>, Vec<Diagnostic>> {
        let names = || known.iter().map(|parameter| parameter.name.as_str());
        let all = match known {
            [] => "the law has no parameters".to_owned(),
            _ => {
                let kind = Noun::new("parameter of the law", "parameters of the law");
                existing(kind, &names().collect::<Vec<_>>())
            }
        };
        let (mut found, mut meant) = (Vec::new(), Vec::new());
        for given in self.deck.parameters.keys().filter(|given| !names().any(|name| name == *given)) {
            let message =
                format!("the law of the material {} has no parameter {}", quote(self.name), quote(given));
            let best = closest(given, names());
            meant.extend(best);
            let help = match best {
                Some(best) => format!("did you mean {}? {all}", quote(best)),
                None => all.clone(),
            };
            let at = self.at(&format!("parameters/{}", escape(given)));
            found.push(Diagnostic::at_key(self.source, "D062", &at, message).help(help));
        }
        let mut values = Vec::with_capacity(known.len());
        for Described { name, unit } in known {
            match self.deck.parameters.get(name) {
                Some(value) => values.push(*value),
                // A misspelt parameter explains a missing one.
                None if meant.contains(&name.as_str()) => {}
                None => {
                    let message = format!(
                        "the law of the material {} needs the parameter {}",
                        quote(self.name),
                        quote(name)
                    );
                    let help = format!("add `{name}`, [{unit}], to `parameters`; {all}");
                    let at = self.at("parameters");
                    found.push(Diagnostic::at_key(self.source, "D062", &at, message).help(help));
                }
            }
        }
        if found.is_empty() { Ok(values) } else { Err(found) }
    }
}

/// True if the result files or the arrays of the points have a field of this name that is not a history variable.
pub fn is_field_of_points(name: &str) -> bool {
    let fields = PointField::ALL.into_iter().filter(|field| *field != PointField::EquivalentPlasticStrain);
    let mut fields = fields.map(PointField::name).chain(["body_id", "material_id", "point_id"]);
    fields.any(|taken| taken == name) || Points::<3>::reserves(name)
}

/// Advice on a library that cannot be used.
fn remedy(error: &LibraryError) -> &'static str {
    match error {
        LibraryError::NotLoaded(_) => {
            "build the law as a shared library for this computer, linked with all libraries that it calls, for example \
             with `cc -O2 -shared -fPIC law.c -o law.so -lm`"
        }
        LibraryError::NoFunction(_) | LibraryError::Version { .. } | LibraryError::Size { .. } => {
            "build the library with the header `mpm_law.h` of this version of the program, which describes its functions"
        }
        LibraryError::Count { .. } => "correct `mpm_law_sizes` in the source of the library",
        LibraryError::NoName { kind, .. }
        | LibraryError::NotText { kind, .. }
        | LibraryError::NotWord { kind, .. }
        | LibraryError::Twice { kind, .. } => match kind {
            Kind::Parameter => "correct `mpm_law_parameter` in the source of the library",
            Kind::History => "correct `mpm_law_history` in the source of the library",
        },
        LibraryError::NotFinite { .. } => "correct `mpm_law_history` in the source of the library",
        LibraryError::Arithmetic => "build the library without `-ffast-math` and `-Ofast`",
        LibraryError::Changed => {
            "restart the program or the Python session, or give the new library another name"
        }
        _ => "correct the source of the library, and build it again",
    }
}

/// Messages about the law of a library that lacks a property on which the solver relies. Only a law without a response
/// in the unstrained state, in which the points begin, is refused.
pub(crate) fn remarks(source: &Source, name: &str, law: &dyn Material) -> Vec<Diagnostic> {
    let at = format!("/materials/{}/file", escape(name));
    let remark = |severity: Severity, what: String, help: &str| {
        let message = format!("the law of the material {}: {what}", quote(name));
        Diagnostic::at(source, "D063", &at, message).severity(severity).help(help)
    };
    let old = law.initial_history();
    if let Err(reason) = law.update(&Sym3::ZERO, &old, &mut old.clone()) {
        let help = "correct the source of the library: at zero strain and with the initial history variables, `mpm_law_update` \
            must return 0 and finite numbers";
        return vec![remark(
            Severity::Error,
            format!("it cannot be evaluated at zero strain: {reason}"),
            help,
        )];
    }
    let mut found = Vec::new();
    for lacking in check(law, LARGEST) {
        let (severity, what, help) = in_words(lacking.property);
        let strain = lacking.strain.to_matrix();
        let strain = [(0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1)].map(|at| format!("{:.2e}", strain[at]));
        let numbers = match lacking.error.is_finite() {
            true => {
                format!(" (relative error {:.1e}; {:.1e} is tolerated)", lacking.error, lacking.tolerance)
            }
            false => String::new(),
        };
        let place = format!("at the logarithmic strain xx, yy, zz, yz, xz, xy = {}", strain.join(", "));
        found.push(remark(severity, format!("{what}{numbers}, {place}"), help));
    }
    if differs_between_threads(law, LARGEST) {
        let what = "its results change when several threads evaluate it at once".to_owned();
        let help = "use local variables only: no static or global ones and, in Fortran, no SAVE, COMMON, DATA or initialised \
            local variables, with the option `-frecursive`";
        found.push(remark(Severity::Warning, what, help));
    }
    found
}

/// How serious it is that a law lacks a property, what that means, and the remedy.
fn in_words(property: Property) -> (Severity, &'static str, &'static str) {
    use Severity::{Note, Warning};
    match property {
        Property::Response => (
            Note,
            "it has no response to some small strains",
            "this may be intended, for example if the law has no stiffness in tension; steps in which it happens are \
             cut",
        ),
        Property::Purity => (
            Warning,
            "equal arguments give different results",
            "let results depend on the arguments alone: iterations are repeated, and points are evaluated in any order",
        ),
        Property::Tangent => (
            Warning,
            "its tangent is not the derivative of the stress",
            "correct the tangent, including its shear components; otherwise iterations converge slowly or fail",
        ),
        Property::Symmetry => (
            Warning,
            "its tangent is not symmetric, although it is declared symmetric",
            "let `mpm_law_tangent_is_symmetric` return 0, or correct the tangent",
        ),
        Property::Isotropy => (
            Warning,
            "a rotated strain does not give the rotated stress",
            "correct the stress, including its shear components; laws must be isotropic",
        ),
        Property::Inverse => (
            Warning,
            "`mpm_law_elastic_strain` is not the inverse of the elastic law",
            "correct it: the law must return the given stress for the returned strain",
        ),
        Property::Admissibility => (
            Note,
            "a second update from the returned elastic strain gives a different stress",
            "check the elastic strain and the history variables that the law returns; inexact return mappings drift",
        ),
        Property::Potential => (
            Note,
            "the energy is not the potential of the stress",
            "add or correct `mpm_law_energy`; without it, the energy columns assume linear elasticity",
        ),
        _ => (
            Warning,
            "it lacks a property on which the solver relies",
            "compare it with the header `mpm_law.h`",
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::is_field_of_points;

    #[test]
    fn history_variables_have_names_of_their_own() {
        let taken = ["pressure", "material_id", "position", "displacement_datum", "half_lengths", "history"];
        assert!(taken.into_iter().all(is_field_of_points));
        assert!(!["equivalent_plastic_strain", "hardening"].into_iter().any(is_field_of_points));
    }
}
