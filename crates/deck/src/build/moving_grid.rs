//! Grid lines that follow boundary conditions.

use super::Builder;
use crate::quoting::quote;
use crate::region::DeckRegion;
use crate::{AXES, FollowDeck, GridDeck};
use mpm_core::grid::{Lines, MIN_SIZE};
use mpm_core::model::{FollowError, FollowingLines, GridMotionError, Model};
use mpm_core::region::Region;

impl<const D: usize> Builder<'_, D>
where
    Region<D>: DeckRegion<D>,
{
    /// Makes the lines under `follow` follow their conditions, and checks the motion of the lines over all stages.
    pub(super) fn follow(&mut self, model: &mut Model<D>) {
        let GridDeck::Structured { follow, .. } = &self.deck.grid else { return };
        // If a condition was left out, the indices of the others are not those in the deck.
        if follow.is_empty() || model.boundary_conditions.len() < self.deck.boundary_conditions.len() {
            return;
        }
        let Some(lines) = model.grid.lines().cloned() else { return };
        let following = (follow.iter().enumerate()).map(|(number, entry)| self.lines(&lines, number, entry));
        let following: Vec<Option<FollowingLines>> = following.collect();
        let Some(following) = following.into_iter().collect() else { return };
        match model.follow(following) {
            Err(faults) => {
                faults.into_iter().for_each(|(number, error)| self.cannot_follow(follow, number, error));
            }
            Ok(()) => {
                if let Err(error) = model.check_grid_motion() {
                    self.cannot_move(&error);
                }
            }
        }
    }

    /// The indices of the grid lines of an entry; reports coordinates at which there is no line.
    fn lines(&mut self, lines: &Lines<D>, number: usize, entry: &FollowDeck) -> Option<FollowingLines> {
        let (axis, pointer) = (entry.axis as usize, format!("/grid/follow/{number}"));
        if axis >= D {
            return None;
        }
        let first = self.line("D054", lines, axis, entry.from, &format!("{pointer}/from"));
        let last = match entry.to {
            Some(to) => self.line("D054", lines, axis, to, &format!("{pointer}/to")),
            None => first,
        };
        let mut conditions = self.deck.boundary_conditions.iter();
        let condition = conditions.position(|condition| condition.name == entry.condition)?;
        Some(FollowingLines { axis, first: first?, last: last?, condition })
    }

    fn cannot_follow(&mut self, follow: &[FollowDeck], number: usize, error: FollowError) {
        let lines = &follow[number];
        let (axis, condition) = (AXES[lines.axis as usize], quote(&lines.condition));
        let (key, message, help) = match error {
            FollowError::NotPrescribed => (
                "/condition",
                format!("the boundary condition {condition} prescribes no displacement along {axis}"),
                format!("give it `u{axis}`, or a `move` along {axis}"),
            ),
            FollowError::DependsOnPosition => (
                "/condition",
                format!(
                    "the displacement that {condition} prescribes along {axis} depends on the position, but grid lines \
                     move as a whole"
                ),
                "use a number, or a formula in `factor` and parameters".to_owned(),
            ),
            FollowError::Overlap { with } => {
                let other = quote(&follow[with].condition);
                let message = format!("some of these lines of constant {axis} already follow {other}");
                ("", message, "let each line follow only one boundary condition".to_owned())
            }
            FollowError::OnAxis => (
                "/from",
                "the grid line on the axis of revolution cannot move".to_owned(),
                "begin with a line at a larger x".to_owned(),
            ),
            FollowError::Unstructured | FollowError::Missing => {
                ("", error.to_string(), "remove it".to_owned())
            }
        };
        self.error("D054", &format!("/grid/follow/{number}{key}"), message, help);
    }

    fn cannot_move(&mut self, error: &GridMotionError) {
        let (pointer, help) = match error {
            GridMotionError::NotFinite { entry, .. } => {
                let help = "change the formula of this boundary condition: at this time the formula divides by zero, \
                            overflows, or evaluates a function outside its domain";
                (format!("/grid/follow/{entry}/condition"), help.to_owned())
            }
            GridMotionError::BeyondAxis { .. } => {
                ("/grid/follow".to_owned(), "prescribe a smaller displacement".to_owned())
            }
            _ => {
                let help = format!(
                    "keep cells above {MIN_SIZE} of their original size: prescribe smaller displacements, leave more cells \
                     between lines that move and those that stay, or let the end of the grid follow as well"
                );
                ("/grid/follow".to_owned(), help)
            }
        };
        self.error("D054", &pointer, error.to_string(), help);
    }
}
