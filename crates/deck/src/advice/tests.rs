use mpm_core::linear::LinearError;
use mpm_core::quality::{Code, Detail, Location, Warning};
use mpm_core::solver::{Circumstances, Diagnosis, Kind, Loss, NoPath, Obstacle, SolveError};

use super::{Means, on_error, on_warning};
use crate::schema::deck_schema;
use mpm_files::summary::Wording;

fn about(code: Code, detail: Option<Detail>) -> String {
    let location = Location::body("block");
    let message = "body `block` leaves".to_owned();
    on_warning(&Warning { code, step: 1, location, value: None, threshold: None, message, detail })
}

fn against_kind(kind: Kind, circumstances: Circumstances) -> String {
    Means::default().on_failure(&failure(kind, circumstances))
}

fn failure(kind: Kind, circumstances: Circumstances) -> Diagnosis {
    Diagnosis {
        kind,
        step: 1,
        time: 0.0,
        largest_load_factor: None,
        body: None,
        point: None,
        cell: None,
        node: None,
        filling: None,
        flowing: 0.0,
        refusal: None,
        experiments: Vec::new(),
        circumstances,
    }
}

const CODES: [Code; 17] = {
    use Code::*;
    [
        DomainUpdate,
        DomainOutside,
        PartitionOfUnity,
        Factorised,
        Apart,
        LeftNodes,
        AcrossGap,
        Regridding,
        Energy,
        Crossings,
        TurnedBoxes,
        Locking,
        Damped,
        ReplacedDomains,
        HiddenResidual,
        Stiffened,
        Unstable,
    ]
};

const KINDS: [Kind; 20] = {
    use Kind::*;
    [
        RigidBodyMode,
        FreeTool,
        SmallCutCell,
        Sliding,
        PlasticCollapse,
        Flow,
        Friction,
        Contact,
        Instability,
        Locking,
        Hourglass,
        Creeping,
        LargeSteps,
        ElementInversion,
        RefusedByLaw,
        LostDomain,
        LostPath,
        BadScaling,
        Setting,
        Unknown,
    ]
};

/// The advice on all warnings, failures of all kinds, and some errors.
fn all() -> Vec<String> {
    let details = [
        None,
        Some(Detail::ReachingBox),
        Some(Detail::Tolerance(1e-11)),
        Some(Detail::RoundOff),
        Some(Detail::StandardDilatation),
        Some(Detail::DilatingFlow),
    ];
    let mut all: Vec<String> =
        CODES.iter().flat_map(|code| details.iter().map(|detail| about(*code, *detail))).collect();
    let yes = Circumstances {
        is_stabilised: true,
        is_driven: true,
        has_constant_loads: true,
        has_one_material: true,
        has_few_points: true,
        is_in_collapse: true,
        has_standard_dilatation: true,
        cut_to: Some(0.5),
        precedes_reduction: true,
        enough_iterations: Some(40),
        loss: Some(Loss::Torn { is_replaceable: true }),
        obstacle: Some(Obstacle::LooseAxis),
    };
    let mixed = Circumstances {
        loss: Some(Loss::Collapsed),
        obstacle: Some(Obstacle::Memory),
        ..Circumstances::default()
    };
    for of in [Circumstances::default(), yes, mixed] {
        all.extend(KINDS.iter().map(|kind| against_kind(*kind, of)));
    }
    let errors = [
        SolveError::NotConverged { step: 1, residuals: Vec::new(), worst: None },
        SolveError::Iterative { step: 1, error: LinearError::Unsymmetric },
        SolveError::NoPath { step: 1, reason: NoPath::Reversed },
        SolveError::OutOfMemory { step: 1, needed: None },
    ];
    all.extend(errors.iter().map(|error| on_error(error).unwrap().to_owned()));
    all
}

#[test]
fn advice_names_keys_and_words_that_decks_have() {
    let schema = deck_schema().to_string();
    let known: Vec<&str> = schema.split(|c: char| !(c.is_alphanumeric() || "_-".contains(c))).collect();
    for text in all() {
        assert!(text.len() > 10, "{text}");
        // Commands and files of results are no words of decks.
        let is_of_decks = |quoted: &&str| !quoted.starts_with("mpm ") && !quoted.ends_with(".json");
        for quoted in text.split('`').skip(1).step_by(2).filter(is_of_decks) {
            let words = quoted.split(|c: char| !(c.is_alphanumeric() || "_-".contains(c)));
            for word in words.filter(|word| word.starts_with(|c: char| c.is_ascii_lowercase())) {
                assert!(known.contains(&word), "no deck knows `{word}`: {text}");
            }
        }
    }
}

#[test]
fn advice_on_warnings_depends_on_the_details() {
    assert_eq!(about(Code::DomainUpdate, None), "use `domain_update: corners`");
    assert_eq!(about(Code::DomainOutside, None), "use a larger grid");
    let boxes = about(Code::PartitionOfUnity, Some(Detail::ReachingBox));
    assert_eq!(boxes, "use a larger grid or `domain_update: corners`, which keeps domains inside the body");
    let tolerance = about(Code::HiddenResidual, Some(Detail::Tolerance(2e-12)));
    assert_eq!(tolerance, "use a smaller tolerance, `solver: {tolerance: 2e-12}`");
    assert!(about(Code::HiddenResidual, Some(Detail::RoundOff)).contains("round-off hides it"));
    let cure = "`strain: mean-dilatation`";
    assert!(about(Code::Locking, Some(Detail::StandardDilatation)).contains(cure));
    assert!(!about(Code::Locking, None).contains(cure), "the bodies have it already");
}

#[test]
fn advice_on_failures_depends_on_the_circumstances() {
    let of = Circumstances::default();
    let creeping = against_kind(Kind::Creeping, Circumstances { enough_iterations: Some(30), ..of });
    assert_eq!(creeping, "allow more iterations, `solver: {max_iterations: 30}`, or use smaller steps");
    let stabilised = against_kind(Kind::SmallCutCell, Circumstances { is_stabilised: true, ..of });
    assert!(stabilised.starts_with("use a larger `stabilisation: {parameter}`"));
    let few = Circumstances { has_few_points: true, is_driven: true, ..of };
    let collapse = against_kind(Kind::PlasticCollapse, few);
    assert!(collapse.starts_with("use more points per cell (4 in the plane"), "{collapse}");
    assert!(collapse.ends_with("changes with the prescribed motion"), "{collapse}");
    let lost = |loss| against_kind(Kind::LostDomain, Circumstances { loss: Some(loss), ..of });
    assert!(lost(Loss::OffGrid).starts_with("make the grid larger"));
    assert!(lost(Loss::Torn { is_replaceable: true }).starts_with("leave `steps: {damping}` out"));
    assert!(lost(Loss::Torn { is_replaceable: false }).contains("`method: gimp`"));
    assert!(lost(Loss::Collapsed).starts_with("use `domain_update: corners`"));
    let flows = Circumstances { is_in_collapse: true, ..of };
    assert!(against_kind(Kind::Locking, flows).contains("; since most points have yielded"));
    let standard = Circumstances { has_standard_dilatation: true, ..of };
    assert!(against_kind(Kind::Locking, standard).contains("`strain: mean-dilatation`"));
    assert!(against_kind(Kind::Locking, of).contains("finer grid"));
    let tried = against_kind(Kind::LargeSteps, Circumstances { cut_to: Some(1e-3), ..of });
    assert!(tried.contains("still smaller steps"), "{tried}");
    let weak = Circumstances { precedes_reduction: true, ..of };
    for kind in [Kind::PlasticCollapse, Kind::LargeSteps] {
        assert!(against_kind(kind, weak).contains("their factor of safety is below 1"));
        assert!(!against_kind(kind, of).contains("factor of safety"));
    }
    let memory = Circumstances { obstacle: Some(Obstacle::Memory), ..of };
    assert!(against_kind(Kind::Setting, memory).ends_with("`solver: {linear: iterative}`"));
    assert_eq!(
        against_kind(Kind::Setting, of),
        "change what the error names, which no step size removes (its reason is in `summary.json`)"
    );
}

/// A deck whose top is pushed down by nodes of a structured grid.
fn pushed(changes: &[(&str, &str)]) -> Means {
    let mut text = "
version: 1
grid: {type: structured, origin: [0, 0], size: [4, 4], spacing: 1}
materials: {sand: {model: mohr-coulomb, young: 1e6, poisson: 0.3, cohesion: 0, friction_angle: 30, density: 2000}}
bodies:
  - {name: block, material: sand, shape: {type: box, min: [0, 0], max: [4, 2]}, method: gimp, points_per_cell: 2}
boundary_conditions:
  - {name: base, nodes: {y: 0}, fix: [x, y]}
  - {name: push, nodes: {y: 2}, uy: -0.1}
loads:
  - {name: weight, type: gravity, acceleration: [0, -10]}
steps: {count: 1}
"
    .to_owned();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let loaded = crate::load::load_text("pushed.yaml", text.as_bytes(), &[]);
    Means::new(&loaded.unwrap_or_else(|failure| panic!("{failure}")).deck)
}

#[test]
fn advice_depends_on_the_deck() {
    let about = |means: &Means, code: Code| {
        let location = Location { boundary_condition: Some("push".to_owned()), ..Location::default() };
        let message = String::new();
        means.on_warning(&Warning {
            code,
            step: 1,
            location,
            value: None,
            threshold: None,
            message,
            detail: None,
        })
    };
    let by_nodes = pushed(&[]);
    let follow = "`grid: {follow: [{axis: y, from: ..., condition: push}]}`";
    assert!(about(&by_nodes, Code::LeftNodes).contains(follow), "{}", about(&by_nodes, Code::LeftNodes));
    let regridding = about(&by_nodes, Code::Regridding);
    assert!(regridding.contains(follow) && regridding.contains("; or use `method: cpdi2`"), "{regridding}");
    let lines = "spacing: 1, follow: [{axis: y, from: 2, condition: push}]}";
    let followed = pushed(&[("spacing: 1}", lines), ("method: gimp", "method: cpdi2")]);
    assert_eq!(about(&followed, Code::Regridding), "use more points per cell, or a finer grid");
    assert!(about(&followed, Code::LeftNodes).starts_with("move a body"));
    let varying = pushed(&[("uy: -0.1", "uy: -0.1*x")]);
    assert!(!about(&varying, Code::LeftNodes).contains("follow"));
    let mpm = pushed(&[("method: gimp", "method: mpm"), ("uy: -0.1", "fix: [y]")]);
    assert!(about(&mpm, Code::Regridding).starts_with("use `method: gimp` or"));
    // Only loads can follow a path.
    let path = "`steps: {control: {type: arc-length}}`";
    assert!(about(&mpm, Code::Damped).contains(path) && !about(&by_nodes, Code::Damped).contains(path));
    let stressed = pushed(&[
        ("method: gimp", "method: gimp, initial_stress: {type: geostatic, surface: 2, k0: 0.5}"),
        ("uy: -0.1", "fix: [y]"),
    ]);
    let collapse = failure(Kind::PlasticCollapse, Circumstances::default());
    assert!(mpm.on_failure(&collapse).contains(path) && !stressed.on_failure(&collapse).contains(path));
}

#[test]
fn soil_without_cohesion_needs_some_first() {
    let cohesive = pushed(&[("cohesion: 0", "cohesion: 10")]);
    for kind in [Kind::PlasticCollapse, Kind::SmallCutCell, Kind::LargeSteps] {
        let flows = Diagnosis { flowing: 0.1, ..failure(kind, Circumstances::default()) };
        let advice = pushed(&[]).on_failure(&flows);
        assert!(advice.starts_with("give the material `sand` a small `cohesion`"), "{advice}");
        assert!(!cohesive.on_failure(&flows).contains("`cohesion`"), "{kind:?}");
        assert!(!pushed(&[]).on_failure(&failure(kind, Circumstances::default())).contains("`cohesion`"));
    }
}
