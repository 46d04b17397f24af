use mpm_core::linear::LinearError;
use mpm_core::quality::{Code, Detail, Location, Warning};
use mpm_core::solver::{Circumstances, Diagnosis, Kind, Loss, NoPath, Obstacle, SolveError};

use super::{on_error, on_failure, on_warning};
use crate::schema::deck_schema;

fn about(code: Code, detail: Option<Detail>) -> String {
    let location = Location::body("block");
    let message = "body `block` leaves".to_owned();
    on_warning(&Warning { code, step: 1, location, value: None, threshold: None, message, detail })
}

fn against_kind(kind: Kind, circumstances: Circumstances) -> String {
    on_failure(&Diagnosis {
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
        circumstances,
    })
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

const KINDS: [Kind; 16] = {
    use Kind::*;
    [
        RigidBodyMode,
        FreeTool,
        SmallCutCell,
        PlasticCollapse,
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
    ];
    let mut all: Vec<String> =
        CODES.iter().flat_map(|code| details.iter().map(|detail| about(*code, *detail))).collect();
    let yes = Circumstances {
        is_stabilised: true,
        is_driven: true,
        is_unloaded: true,
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
        for quoted in text.split('`').skip(1).step_by(2).filter(|quoted| !quoted.starts_with("mpm ")) {
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
    let cure = "`volumetric: mean-dilatation`";
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
    assert_eq!(lost(Loss::Torn { is_replaceable: false }), lost(Loss::Collapsed));
    let flows = Circumstances { is_in_collapse: true, ..of };
    assert!(against_kind(Kind::Locking, flows).contains("; since most points have yielded"));
    let standard = Circumstances { has_standard_dilatation: true, ..of };
    assert!(against_kind(Kind::Locking, standard).contains("`volumetric: mean-dilatation`"));
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
    assert_eq!(against_kind(Kind::Setting, of), "see the message");
}
