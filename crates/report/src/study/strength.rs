//! Factors of safety of the members of a study, and how they depend on the cell size.

use mpm_core::solver::StrengthBracket;

use super::{Member, Row, Study};

/// Largest relative deviation of a ratio from 2 at which cells still count as halved, [-].
const SAME: f64 = 1e-6;

/// The factors between which the bodies of a stage cease to stand in about their original shape; `None` if they stand
/// throughout or have never stood.
pub(super) fn ends_of(bracket: &StrengthBracket) -> Option<[f64; 2]> {
    let StrengthBracket { stands, fails, slides, .. } = *bracket;
    slides.or(stands.zip(fails).map(|(stands, fails)| [stands, fails]))
}

/// True if all cell sides of the fine grid are half as long as those of the coarse grid; both arguments are cell sides
/// along each axis.
fn are_halved(coarse: &[f64], fine: &[f64]) -> bool {
    coarse.len() == fine.len()
        && coarse.iter().zip(fine).all(|(coarse, fine)| (coarse / fine / 2.0 - 1.0).abs() <= SAME)
}

/// One sentence for each stage that reduces the strength and each pair of members that differ only in a parameter that
/// halves the cells. It states how the factor of safety changes from the coarser to the finer member, and within which
/// bounds, since each factor is known only to within its bracket. `sides` gives the cell sides of a member along each
/// axis, if it has a structured grid.
pub fn dependence_on_cells<'a>(
    study: &Study,
    rows: impl IntoIterator<Item = &'a Row>,
    sides: impl Fn(&Member) -> Option<Vec<f64>>,
) -> Vec<String> {
    let reductions = |row: &'a Row| {
        let stages = row.record.as_ref()?.strengths();
        (!stages.is_empty()).then_some((&row.member, stages))
    };
    let found = rows.into_iter().filter_map(reductions);
    let found: Vec<_> = found.filter_map(|(member, stages)| Some((member, stages, sides(member)?))).collect();
    let mut sentences = Vec::new();
    for (place, name) in study.names().enumerate() {
        for (fine, fine_stages, fine_sides) in &found {
            let is_partner = |member: &Member| {
                let mut pairs = member.settings.iter().zip(&fine.settings).enumerate();
                pairs.all(|(other, (a, b))| (a == b) != (other == place))
            };
            let partner =
                found.iter().find(|(member, _, sides)| is_partner(member) && are_halved(sides, fine_sides));
            let Some((coarse, coarse_stages, _)) = partner else { continue };
            let finer = format!("{name}={}", fine.settings[place].1);
            for (stage, after) in fine_stages {
                let before = coarse_stages.iter().find(|(other, _)| other == stage);
                let ends = before.and_then(|(_, before)| Some([ends_of(before)?, ends_of(after)?]));
                let Some([before, after]) = ends else { continue };
                let stage = match stage {
                    Some(stage) if fine_stages.len() > 1 => format!("in stage `{stage}`, "),
                    _ => String::new(),
                };
                let percent = |from: f64, to: f64| 100.0 * (to / from - 1.0);
                sentences.push(format!(
                    "{stage}from {coarse} to {finer} the factor of safety changes by {:+.1} %, from {:.3} to {:.3}, and by \
                     {:+.1} to {:+.1} % within the brackets: an estimate of its dependence on the cell size",
                    percent(before[0], after[0]),
                    before[0],
                    after[0],
                    percent(before[1], after[0]),
                    percent(before[0], after[1]),
                ));
            }
        }
    }
    sentences
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::{Outcome, Record};

    fn row(settings: &[(&str, &str)], summary: &str) -> Row {
        let directory = tempfile::tempdir().unwrap();
        std::fs::write(directory.path().join("summary.json"), summary).unwrap();
        std::fs::write(directory.path().join("history.csv"), "step,time,converged\n1,1,1\n").unwrap();
        let record = Record::read(directory.path()).unwrap();
        let settings = settings.iter().map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
        Row {
            member: Member { settings: settings.collect() },
            outcome: Outcome::Completed,
            record: Some(record),
        }
    }

    fn stage_json(stage: &str, [stands, fails]: [f64; 2]) -> String {
        format!("{{\"stage\": \"{stage}\", \"stands\": {stands}, \"fails\": {fails}, \"slides\": null}}")
    }

    /// Cell sides that depend on the parameter `h` only.
    fn sides(member: &Member) -> Option<Vec<f64>> {
        let h: f64 = member.settings.iter().find(|(name, _)| name == "h")?.1.parse().ok()?;
        Some(vec![h, 0.5 * h])
    }

    #[test]
    fn only_a_parameter_that_halves_the_cells_counts() {
        let study = Study::new(vec!["h=1,0.5".parse().unwrap(), "c=2,1".parse().unwrap()], vec![]).unwrap();
        let of = |h: &str, c: &str, ends: [f64; 2]| {
            let summary = format!("{{\"strength_reduction\": {}}}", stage_json("safety", ends));
            row(&[("h", h), ("c", c)], &summary)
        };
        let rows = [
            of("1", "2", [1.4, 1.42]),
            of("1", "1", [1.0, 1.01]),
            of("0.5", "2", [1.3, 1.33]),
            of("0.5", "1", [0.9, 0.91]),
        ];
        let sentences = dependence_on_cells(&study, &rows, sides);
        assert_eq!(sentences.len(), 2, "{sentences:?}");
        let first = "from h=1, c=2 to h=0.5 the factor of safety changes by -7.1 %, from 1.400 to 1.300, and by -8.5 to \
                     -5.0 % within the brackets: an estimate of its dependence on the cell size";
        assert_eq!(sentences[0], first);
        assert!(dependence_on_cells(&study, &rows, |_| None).is_empty(), "the cells of a mesh are unknown");
    }

    #[test]
    fn every_stage_has_its_own_sentence() {
        let study = Study::new(vec!["h=1,0.5".parse().unwrap()], vec![]).unwrap();
        let of = |h: &str, first: [f64; 2], second: [f64; 2]| {
            let [dry, wet] = [stage_json("dry", first), stage_json("wet", second)];
            row(
                &[("h", h)],
                &format!("{{\"strength_reduction\": {wet}, \"strength_reductions\": [{dry}, {wet}]}}"),
            )
        };
        let rows = [of("1", [1.4, 1.41], [1.2, 1.21]), of("0.5", [1.3, 1.31], [1.1, 1.11])];
        let sentences = dependence_on_cells(&study, &rows, sides);
        assert_eq!(sentences.len(), 2, "{sentences:?}");
        assert!(
            sentences[0]
                .starts_with("in stage `dry`, from h=1 to h=0.5 the factor of safety changes by -7.1 %")
        );
        assert!(
            sentences[1]
                .starts_with("in stage `wet`, from h=1 to h=0.5 the factor of safety changes by -8.3 %")
        );
    }
}
