//! The page about an element test: the material, and curves of stress and strain.

use serde_json::Value;

use mpm_core::element_test::{ElementState, Path};
use mpm_core::material::Material;
use mpm_deck::MaterialDeck;
use mpm_deck::quoting::counted;

use super::chart::{Axis, Chart, Curve, Look};
use super::number::html;
use super::page::{Cell, Page, Table, escape};
use super::sections::{in_words, now, title_block, units_in_words};
use super::units::{Naming, Quantity, Units};

/// Height of a chart.
const HEIGHT: f64 = 300.0;
/// Changes of strain below this count as round-off, [-].
const ROUND_OFF: f64 = 1e-12;

/// An element test and its results.
#[derive(Debug, Clone, Copy)]
pub struct ElementReport<'a> {
    /// File of the deck.
    pub deck: &'a str,
    /// Title of the deck; empty if it has none.
    pub title: &'a str,
    /// Name of the material.
    pub material: &'a str,
    /// The material in the deck.
    pub parameters: &'a MaterialDeck,
    /// The law of the material.
    pub law: &'a dyn Material,
    /// Name of the path.
    pub path_name: &'a str,
    /// The path; `None` for a history from a file.
    pub path: Option<Path>,
    /// The initial state, and the state at the end of each step.
    pub states: &'a [ElementState],
    /// Why the test ended early.
    pub failure: Option<&'a str>,
    /// The unit system of the deck.
    pub units: Option<&'a Units>,
}

/// Makes the page about an element test.
pub fn element_page(test: &ElementReport) -> String {
    let naming = Naming { units: test.units.cloned(), per_thickness: false };
    let mut page = Page::default();
    outcome(&mut page, test, &naming);
    material(&mut page, test);
    page.section("Curves");
    for (caption, chart) in charts(test) {
        page.figure(&caption, &chart.svg(&naming));
    }
    let title = format!("{}: {}", test.material, path_in_words(test.path, test.path_name));
    let code = |text: &str| Some(format!("<code>{}</code>", escape(text)));
    let head = format!(
        "<header>\n<p class=\"kind\">Element test</p>\n<h1>{}</h1>\n{}</header>\n",
        escape(&title),
        title_block(&[
            ("Deck", code(test.deck)),
            ("Title of the deck", (!test.title.is_empty()).then(|| escape(test.title))),
            ("Material", code(test.material)),
            ("Path", code(test.path_name)),
            ("Program", Some(format!("mpm\u{a0}{}", mpm_files::summary::VERSION))),
        ])
    );
    let foot = format!(
        "<p>Written by mpm\u{a0}{} on {}. Stresses are Cauchy stresses. Pressure, axial strain and normal stresses in the \
         charts are positive in compression; ln J is positive in expansion.{}</p>\n",
        mpm_files::summary::VERSION,
        now(),
        units_in_words(&naming)
    );
    page.finish(&title, &head, &foot)
}

fn path_in_words(path: Option<Path>, name: &str) -> String {
    match path {
        Some(Path::Oedometer) => "oedometer test".to_owned(),
        Some(Path::Isotropic) => "isotropic compression".to_owned(),
        Some(Path::TriaxialDrained) => "drained triaxial test".to_owned(),
        Some(Path::TriaxialUndrained) => "undrained triaxial test".to_owned(),
        Some(Path::Biaxial) => "biaxial test in plane strain".to_owned(),
        Some(Path::SimpleShear { constant_normal_stress: false }) => {
            "simple shear at constant height".to_owned()
        }
        Some(Path::SimpleShear { constant_normal_stress: true }) => {
            "simple shear at constant normal stress".to_owned()
        }
        None => format!("history of {name}"),
    }
}

fn outcome(page: &mut Page, test: &ElementReport, naming: &Naming) {
    page.section("Outcome");
    let steps = test.states.len().saturating_sub(1);
    match test.failure {
        None => page.push(&format!(
            "<p class=\"outcome completed\" role=\"status\"><strong>Completed.</strong> {}.</p>\n",
            match steps {
                1 => "The only step has a solution".to_owned(),
                _ => format!("All {steps} steps have a solution"),
            }
        )),
        Some(reason) => page.push(&format!(
            "<p class=\"outcome failed\" role=\"status\"><strong>The test ended early</strong> after {}: {}. \
             This page shows only the steps before the failure.</p>\n",
            counted(steps, "step", "steps"),
            escape(reason)
        )),
    }
    let (Some(first), Some(last)) = (test.states.first(), test.states.last()) else { return };
    let strongest = test
        .states
        .iter()
        .reduce(|best, state| if state.deviatoric_stress() > best.deviatoric_stress() { state } else { best })
        .unwrap_or(last);
    let mut table = Table::new(["", "#At the start", "#At the largest q", "#At the end"]);
    let mut row = |measure: Measure| {
        let shown = [first, strongest, last].map(|state| Cell::Html(html((measure.value)(state), 5)));
        let name = naming.label(&capitalised(&measure.name), measure.quantity, 0);
        table.row(std::iter::once(Cell::text(&name)).chain(shown));
    };
    row(pressure());
    row(deviatoric_stress());
    if test.path != Some(Path::Isotropic) {
        row(driver(test.path));
    }
    row(expansion());
    history(test).into_iter().for_each(row);
    page.table("Key numbers of the test.", &table);
}

fn material(page: &mut Page, test: &ElementReport) {
    page.section("Material");
    let mut table = Table::new(["Parameter", "#Value"]);
    let value = serde_json::to_value(test.parameters).unwrap_or_default();
    for (key, value) in value.as_object().into_iter().flatten().filter(|(_, value)| !value.is_null()) {
        let shown = match value {
            Value::Number(number) => Cell::Html(html(number.as_f64().unwrap_or(f64::NAN), 9)),
            other => Cell::Html(in_words(other)),
        };
        table.row([Cell::text(&in_plain_words(key)), shown]);
    }
    page.table("The law and its parameters, as the deck gives them.", &table);
}

/// A name from a deck or a file, with its underscores replaced.
fn in_plain_words(name: &str) -> String {
    name.replace('_', " ")
}

/// A name with a capital first letter.
pub(super) fn capitalised(name: &str) -> String {
    let mut letters = name.chars();
    let first: String = letters.next().into_iter().flat_map(char::to_uppercase).collect();
    format!("{first}{}", letters.as_str())
}

fn quantity_of(unit: &str) -> Quantity {
    if unit == "stress" { Quantity::Stress } else { Quantity::Number }
}

fn axial_strain(state: &ElementState) -> f64 {
    -state.strain.0[1]
}

fn compression(state: &ElementState) -> f64 {
    -state.log_volume_ratio()
}

/// A quantity of a state along an axis of a chart.
struct Measure<'a> {
    name: String,
    quantity: Quantity,
    value: Box<dyn Fn(&ElementState) -> f64 + 'a>,
}

impl<'a> Measure<'a> {
    fn new(name: &str, quantity: Quantity, value: impl Fn(&ElementState) -> f64 + 'a) -> Self {
        Measure { name: name.to_owned(), quantity, value: Box::new(value) }
    }

    fn stress(name: &str, value: impl Fn(&ElementState) -> f64 + 'a) -> Self {
        Measure::new(name, Quantity::Stress, value)
    }

    fn strain(name: &str, value: impl Fn(&ElementState) -> f64 + 'a) -> Self {
        Measure::new(name, Quantity::Number, value)
    }
}

fn pressure() -> Measure<'static> {
    Measure::stress("pressure p", ElementState::pressure)
}

fn deviatoric_stress() -> Measure<'static> {
    Measure::stress("deviatoric stress q", ElementState::deviatoric_stress)
}

fn expansion() -> Measure<'static> {
    Measure::strain("volumetric strain ln J", ElementState::log_volume_ratio)
}

/// The history variables of the law.
fn history(test: &ElementReport) -> Vec<Measure<'static>> {
    let fields = test.law.state_fields().iter().enumerate();
    fields
        .map(|(index, field)| {
            let value = move |state: &ElementState| state.history.get(index).copied().unwrap_or(f64::NAN);
            Measure::new(&in_plain_words(&field.name), quantity_of(&field.unit), value)
        })
        .collect()
}

/// The strain that drives a test.
fn driver(path: Option<Path>) -> Measure<'static> {
    match path {
        Some(Path::Isotropic) => Measure::strain("volumetric compression −ln J", compression),
        Some(Path::SimpleShear { .. }) => Measure::strain("shear strain γ", |state| state.shear),
        Some(_) => Measure::strain("axial strain", axial_strain),
        None => Measure::strain("deviatoric strain", ElementState::deviatoric_strain),
    }
}

/// All charts with their captions.
fn charts(test: &ElementReport) -> Vec<(String, Chart)> {
    let driver = driver(test.path);
    let is_isotropic = test.path == Some(Path::Isotropic);
    let mut charts = Vec::new();
    if matches!(test.path, Some(Path::SimpleShear { .. })) {
        let shear = |state: &ElementState| state.cauchy_stress().component(0, 1);
        charts.push(chart(test, &driver, &[Measure::stress("shear stress σ_xy", shear)]));
    }
    if !is_isotropic {
        charts.push(chart(test, &driver, &[deviatoric_stress()]));
        charts.push(chart(test, &pressure(), &[deviatoric_stress()]));
    }
    let has_volume = test.states.iter().any(|state| compression(state).abs() > ROUND_OFF);
    if has_volume && !is_isotropic {
        charts.push(chart(test, &driver, &[expansion()]));
    }
    let volume = Measure::strain("volumetric compression \u{2212}ln J", compression);
    charts.push(chart(test, if has_volume { &volume } else { &driver }, &[pressure()]));
    let normal = |axis: usize| move |state: &ElementState| -state.cauchy_stress().0[axis];
    let names = ["\u{2212}σ_xx", "\u{2212}σ_yy", "\u{2212}σ_zz"];
    let normal = [0, 1, 2].map(|axis| Measure::stress(names[axis], normal(axis)));
    charts.push(chart(test, &driver, &normal));
    for variable in history(test) {
        charts.push(chart(test, &driver, &[variable]));
    }
    charts
}

/// A chart of one quantity, or of several normal stresses with their names, and its caption.
fn chart(test: &ElementReport, x: &Measure, curves: &[Measure]) -> (String, Chart) {
    let (name, is_single) = match curves {
        [single] => (single.name.as_str(), true),
        _ => ("normal stresses", false),
    };
    let quantity = curves.first().map_or(Quantity::Number, |curve| curve.quantity);
    let curve = |(number, y): (usize, &Measure)| Curve {
        name: if is_single { String::new() } else { y.name.clone() },
        points: test.states.iter().map(|state| [(x.value)(state), (y.value)(state)]).collect(),
        look: Look::Number(number),
    };
    let description = format!("{name} against {}", x.name);
    let chart = Chart {
        x: axis(&x.name, x.quantity),
        y: axis(name, quantity),
        curves: curves.iter().enumerate().map(curve).collect(),
        levels: Vec::new(),
        bands: Vec::new(),
        height: HEIGHT,
        description: description.clone(),
    };
    (format!("{}.", escape(&capitalised(&description))), chart)
}

/// An axis that contains 0, so that the size of a change can be judged.
fn axis(name: &str, quantity: Quantity) -> Axis {
    Axis { contains: vec![0.0], ..Axis::new(name, quantity) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mpm_core::element_test::ElementTest;
    use mpm_core::tensor::Sym3;

    #[test]
    fn every_path_has_its_charts() {
        let parameters = serde_json::json!(
            {"model": "von-mises", "young": 1e6, "poisson": 0.3, "deviatoric_yield_stress": 20e3}
        );
        let parameters: MaterialDeck = serde_json::from_value(parameters).unwrap();
        let law = parameters.law_alone().unwrap();
        for (path, expected) in [
            (Path::Oedometer, 6),
            (Path::Isotropic, 3),
            (Path::TriaxialDrained, 6),
            (Path::TriaxialUndrained, 5),
            (Path::SimpleShear { constant_normal_stress: false }, 6),
        ] {
            let test = ElementTest::new(law.as_ref(), &[0.0], &(Sym3::IDENTITY * -1e5)).unwrap();
            let initial = *test.initial_stress();
            let states: Vec<ElementState> = std::iter::once(test.state().clone())
                .chain(test.follow([path.target(0.1, &initial)], 5).map(Result::unwrap))
                .collect();
            let report = ElementReport {
                deck: "a <b>.yaml",
                title: "",
                material: "clay",
                parameters: &parameters,
                law: law.as_ref(),
                path_name: "path",
                path: Some(path),
                states: &states,
                failure: Some("<reason>"),
                units: None,
            };
            let page = element_page(&report);
            assert_eq!(page.matches("<svg class=\"chart\"").count(), expected, "{path:?}");
            assert!(page.contains("a &lt;b&gt;.yaml") && page.contains("&lt;reason&gt;"));
            assert!(page.contains("<td>deviatoric yield stress</td>") && !page.contains("NaN"));
        }
    }
}
