//! What experiments with a failed step show: the changes of its equations with which it converges.

use serde::{Deserialize, Serialize};

use super::kind::Kind;
use crate::step::Experiment;

/// The outcome of an experiment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Finding {
    /// The change of the equations.
    pub experiment: Experiment,
    /// True if the step converges with this change.
    pub converges: bool,
}

impl Experiment {
    /// The change in words.
    pub fn words(self) -> &'static str {
        match self {
            Experiment::ElasticMaterials => "elastic materials",
            Experiment::FrozenContact => "frozen contact",
            Experiment::FrozenFriction => "frozen friction",
            Experiment::StrongerStabilisation => "ten times the stabilisation",
            Experiment::HalfStep => "half its size",
        }
    }
}

/// What the experiments show, as a sentence; `None` without experiments.
pub(super) fn evidence(findings: &[Finding]) -> Option<String> {
    let listed = |converges: bool, last: &str| {
        let of = findings.iter().filter(|finding| finding.converges == converges);
        let words: Vec<String> = of.map(|finding| format!("with {}", finding.experiment.words())).collect();
        let (end, before) = words.split_last()?;
        Some(if before.is_empty() { end.clone() } else { format!("{} {last} {end}", before.join(", ")) })
    };
    Some(match (listed(true, "and"), listed(false, "or")) {
        (Some(with), Some(without)) => format!("this step converges {with}, but not {without}"),
        (Some(with), None) => format!("this step converges {with}"),
        (None, Some(without)) => format!("this step does not converge {without} either"),
        (None, None) => return None,
    })
}

/// The kind of a failure after experiments: a kind that says little is replaced by the one change that lets the step
/// converge, and a kind that an experiment refutes gives way to the one that it shows.
pub(super) fn judged(kind: Kind, findings: &[Finding]) -> Kind {
    let converges = |experiment| findings.iter().any(|of| of.experiment == experiment && of.converges);
    let fails = |experiment| findings.iter().any(|of| of.experiment == experiment && !of.converges);
    let is_refuted = match kind {
        Kind::SmallCutCell | Kind::Hourglass => fails(Experiment::StrongerStabilisation),
        Kind::PlasticCollapse | Kind::Instability | Kind::Locking => fails(Experiment::ElasticMaterials),
        Kind::Setting | Kind::LargeSteps | Kind::Unknown => true,
        _ => false,
    };
    if !is_refuted {
        return kind;
    }
    if converges(Experiment::ElasticMaterials) {
        match kind {
            Kind::LargeSteps => kind,
            _ => Kind::Flow,
        }
    } else if converges(Experiment::FrozenFriction) {
        Kind::Friction
    } else if converges(Experiment::FrozenContact) {
        Kind::Contact
    } else if converges(Experiment::StrongerStabilisation) && kind != Kind::LargeSteps {
        Kind::SmallCutCell
    } else {
        kind
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Experiment::*;

    fn findings(converge: &[Experiment], fail: &[Experiment]) -> Vec<Finding> {
        let of =
            |converges: bool| move |experiment: &Experiment| Finding { experiment: *experiment, converges };
        converge.iter().map(of(true)).chain(fail.iter().map(of(false))).collect()
    }

    #[test]
    fn a_kind_that_says_little_is_replaced_by_what_experiments_show() {
        let all = [ElasticMaterials, FrozenFriction, FrozenContact, StrongerStabilisation, HalfStep];
        let shown = [
            (&all[..1], Kind::Flow),
            (&all[1..2], Kind::Friction),
            (&all[1..3], Kind::Friction),
            (&all[2..3], Kind::Contact),
            (&all[3..4], Kind::SmallCutCell),
            (&all[4..], Kind::Unknown),
        ];
        for (converge, expected) in shown {
            let fail: Vec<_> = all.iter().copied().filter(|of| !converge.contains(of)).collect();
            assert_eq!(judged(Kind::Unknown, &findings(converge, &fail)), expected, "{converge:?}");
        }
        assert_eq!(judged(Kind::Setting, &findings(&[], &all)), Kind::Setting);
        assert_eq!(judged(Kind::Unknown, &[]), Kind::Unknown);
        assert_eq!(judged(Kind::LargeSteps, &findings(&[ElasticMaterials, HalfStep], &[])), Kind::LargeSteps);
    }

    #[test]
    fn a_kind_stands_unless_an_experiment_refutes_it() {
        let elastic = findings(&[ElasticMaterials], &[FrozenContact, StrongerStabilisation]);
        assert_eq!(judged(Kind::PlasticCollapse, &elastic), Kind::PlasticCollapse);
        assert_eq!(judged(Kind::SmallCutCell, &elastic), Kind::Flow, "more stabilisation did not help");
        assert_eq!(judged(Kind::RigidBodyMode, &elastic), Kind::RigidBodyMode);
        let contact = findings(&[FrozenContact], &[ElasticMaterials, StrongerStabilisation]);
        assert_eq!(
            judged(Kind::PlasticCollapse, &contact),
            Kind::Contact,
            "also without flow, the step fails"
        );
        let ghost = findings(&[StrongerStabilisation], &[]);
        assert_eq!(judged(Kind::SmallCutCell, &ghost), Kind::SmallCutCell);
    }

    #[test]
    fn the_evidence_is_a_sentence() {
        assert_eq!(evidence(&[]), None);
        let text =
            |converge: &[Experiment], fail: &[Experiment]| evidence(&findings(converge, fail)).unwrap();
        assert_eq!(
            text(&[ElasticMaterials, FrozenContact], &[FrozenFriction, StrongerStabilisation, HalfStep]),
            "this step converges with elastic materials and with frozen contact, but not with frozen friction, with ten \
             times the stabilisation or with half its size"
        );
        assert_eq!(text(&[HalfStep], &[]), "this step converges with half its size");
        assert_eq!(text(&[], &[HalfStep]), "this step does not converge with half its size either");
    }
}
