//! Factors of safety of the members of a study, and how they depend on the size of the cells.

use mpm_core::solver::StrengthBracket;

use super::{Row, Study};

/// Largest relative difference of a ratio from 2 at which a parameter still counts as halved, [-].
const SAME: f64 = 1e-9;

/// The largest factor of a member with equilibrium in about its original shape, if a larger one has ended that.
fn factor_of(row: &Row) -> Option<f64> {
    let StrengthBracket { stands, fails, slides, .. } = row.record.as_ref()?.strength()?;
    slides.map(|[before, _]| before).or(fails.and(stands))
}

/// One sentence for each pair of members that differ only in a parameter whose two smallest values are one and two, such
/// as the size of the cells: how the factor of safety changes from the coarser to the finer of them.
pub fn dependence_on_cells<'a>(study: &Study, rows: impl IntoIterator<Item = &'a Row>) -> Vec<String> {
    let rows: Vec<&Row> = rows.into_iter().collect();
    let mut sentences = Vec::new();
    for (place, name) in study.names().enumerate() {
        let value = |row: &Row| row.member.settings[place].1.parse::<f64>().ok();
        let mut values: Vec<f64> = rows.iter().filter_map(|row| value(row)).filter(|v| *v > 0.0).collect();
        values.sort_by(f64::total_cmp);
        values.dedup();
        let [fine, coarse, ..] = values[..] else { continue };
        if (coarse / fine - 2.0).abs() > 2.0 * SAME {
            continue;
        }
        for of_fine in rows.iter().filter(|row| value(row) == Some(fine)) {
            let is_partner = |row: &&&Row| {
                let mut pairs = row.member.settings.iter().zip(&of_fine.member.settings).enumerate();
                value(row) == Some(coarse) && pairs.all(|(other, (a, b))| other == place || a == b)
            };
            let Some(of_coarse) = rows.iter().find(is_partner) else { continue };
            let (Some(before), Some(after)) = (factor_of(of_coarse), factor_of(of_fine)) else { continue };
            let percent = 100.0 * (after - before) / before;
            sentences.push(format!(
                "from {} to {name}={} the factor of safety changes by {percent:+.1} %, from {before:.3} to {after:.3}: \
                 an estimate of its dependence on `{name}`",
                of_coarse.member, of_fine.member.settings[place].1
            ));
        }
    }
    sentences
}
