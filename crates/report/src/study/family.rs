//! The grids of a convergence study: the same deck with smaller and smaller cells.

use mpm_deck::load::{LoadedDeck, load_text, parameter_names};
use mpm_deck::quoting::joined;
use mpm_deck::refinement::{CellControl, DeckText, SHIFT, unlike};

use super::{Axis, Study};

/// Cells of the finest of three grids relative to those of the deck, [-], in the order in which they are tried.
const FINEST: [f64; 3] = [1.0, 0.5, 0.25];
/// Cells of three grids relative to the finest of them, [-].
const THREE: [f64; 3] = [4.0, 2.0, 1.0];
/// What helps if no grids are found.
const BY_HAND: &str = "list grids that fit, for example over h with the values 1, 0.5 and 0.25";

/// A deck on one grid.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// What distinguishes it, such as `h=0.5`.
    pub label: String,
    /// The deck.
    pub deck: DeckText,
    /// Size of the cells: the geometric mean of their sides, [length]; `None` for a mesh.
    pub size: Option<f64>,
}

impl Grid {
    /// Name of its results directory, such as `h=0.5`.
    pub fn directory_name(&self) -> String {
        let usual = |c: char| if c.is_alphanumeric() || "=.-".contains(c) { c } else { ' ' };
        let words: String = self.label.chars().map(usual).collect();
        words.split_whitespace().collect::<Vec<_>>().join("_")
    }
}

/// Checks that the first load step of a deck can begin; otherwise it returns the reason.
pub type FirstStep<'a> = &'a dyn Fn(LoadedDeck) -> Result<(), String>;

/// The same deck on at least three grids.
#[derive(Debug, Clone)]
pub struct Family {
    base: DeckText,
    /// What sets the size of the cells; `None` where the values of a parameter are listed.
    control: Option<CellControl>,
    /// The grids from coarse to fine.
    pub grids: Vec<Grid>,
    /// Why the grids are finer than that of the deck, in words.
    pub note: Option<String>,
    dimensions: usize,
}

impl Family {
    /// The grids that `over` lists from coarse to fine. Without it, three grids, each with cells half as long as the one
    /// before: the last has the cells of the deck or, if the deck cannot be used with so much larger cells, half or a
    /// quarter of them. `can_begin` checks the deck on each grid.
    ///
    /// # Errors
    /// In words, if there are no such grids, or the bodies are not refined alike.
    pub fn new(base: DeckText, over: Option<Axis>, can_begin: FirstStep) -> Result<Family, String> {
        let loaded = load_text(&base.name, &base.text, &base.overrides);
        let dimensions = loaded.map_err(|failure| failure.in_one_line())?.deck.dimensions();
        let mut family = Family { base, control: None, grids: Vec::new(), note: None, dimensions };
        match over {
            Some(axis) if axis.values().len() < 3 => {
                return Err("a study needs at least three grids, from coarse to fine".to_owned());
            }
            Some(axis) => family.list(&axis, can_begin)?,
            None => {
                family.control = Some(family.base.cell_control()?);
                family.choose(can_begin)?;
            }
        }
        Ok(family)
    }

    /// Takes the grids that a parameter sets.
    fn list(&mut self, axis: &Axis, can_begin: FirstStep) -> Result<(), String> {
        let base = &self.base;
        let known = parameter_names(&base.name, &base.text).map_err(|failure| failure.in_one_line())?;
        let study = Study::new(vec![axis.clone()], base.overrides.clone());
        study.and_then(|study| study.check_names(&known)).map_err(|error| error.to_string())?;
        let grid = |value: &String| (format!("{}={value}", axis.name()), base.with(axis.name(), value));
        self.grids = checked(axis.values().iter().map(grid).collect(), can_begin)?;
        Ok(())
    }

    /// Chooses three grids.
    fn choose(&mut self, can_begin: FirstStep) -> Result<(), String> {
        let mut refused = None;
        for finest in FINEST {
            let grids: Result<Vec<_>, _> = THREE.iter().map(|factor| self.scaled(factor * finest)).collect();
            match grids.and_then(|grids| checked(grids, can_begin)) {
                Ok(grids) => {
                    self.grids = grids;
                    self.note =
                        refused.map(|why| format!("the grids are finer than that of the deck: {why}"));
                    return Ok(());
                }
                Err(error) => refused = refused.or(Some(error)),
            }
        }
        Err(format!("{}; {BY_HAND}", refused.unwrap_or_default()))
    }

    /// Adds a grid with cells half as long as those of the finest one.
    ///
    /// # Errors
    /// In words, if the grids are listed, or the deck cannot be used with such cells.
    pub fn halve(&mut self, can_begin: FirstStep) -> Result<(), String> {
        let (Some(first), Some(size)) = (self.base_size(), self.grids.last().and_then(|grid| grid.size))
        else {
            return Err("the list of grids ends here".to_owned());
        };
        let finer = checked(vec![self.scaled(0.5 * size / first)?], can_begin)?;
        self.grids.extend(finer);
        Ok(())
    }

    /// Size of the cells of the deck itself, if they can be scaled, [length].
    fn base_size(&self) -> Option<f64> {
        self.control.as_ref()?;
        let base = &self.base;
        cell_size(&load_text(&base.name, &base.text, &base.overrides).ok()?)
    }

    /// The deck with all cells `factor` times as long, and what distinguishes it.
    fn scaled(&self, factor: f64) -> Result<(String, DeckText), String> {
        let label = match &self.control {
            None => return Err("the list of grids ends here".to_owned()),
            Some(CellControl::Parameter { name, value, counts }) => {
                format!("{name}={}", if *counts { value / factor } else { value * factor })
            }
            Some(CellControl::Spacing) => format!("spacing x {factor}"),
        };
        let control = self.control.as_ref().unwrap_or(&CellControl::Spacing);
        let deck = self
            .base
            .scaled(control, factor)
            .map_err(|why| format!("there is no grid with {label}: {why}"))?;
        Ok((label, deck))
    }

    /// A grid with its inner lines moved along all axes or, if the deck cannot be used so, along one axis; and why it is
    /// not moved along all axes.
    pub fn moved(&self, grid: &Grid, can_begin: FirstStep) -> (Option<Grid>, Option<String>) {
        let all = vec![true; self.dimensions];
        let single = |axis: usize| (0..self.dimensions).map(|other| other == axis).collect();
        let choices = std::iter::once(all).chain((0..self.dimensions).map(single));
        let mut refused = None;
        for axes in choices {
            let named = ["x", "y", "z"].iter().zip(SHIFT).zip(&axes).filter(|(_, is_moved)| **is_moved);
            let parts: Vec<String> = named.map(|((name, shift), _)| format!("{name} by {shift}")).collect();
            let label = format!("{}, moved along {}", grid.label, joined(&parts, "and"));
            let moved = grid.deck.shifted(&axes).and_then(|deck| {
                can_begin(load_text(&deck.name, &deck.text, &deck.overrides).map_err(|e| e.in_one_line())?)?;
                Ok(Grid { label, deck, size: grid.size })
            });
            match moved {
                Ok(moved) => {
                    let part = |why: String| format!("the grid is not moved along all axes: {why}");
                    return (Some(moved), refused.map(part));
                }
                Err(why) => refused = refused.or(Some(why)),
            }
        }
        (None, refused.map(|why| format!("the grid is not moved: {why}")))
    }
}

/// Decks from coarse to fine as grids, if all can begin and their bodies follow the cells.
///
/// # Errors
/// In words.
fn checked(decks: Vec<(String, DeckText)>, can_begin: FirstStep) -> Result<Vec<Grid>, String> {
    let load = |(label, deck): &(String, DeckText)| {
        let loaded = load_text(&deck.name, &deck.text, &deck.overrides);
        loaded.map_err(|failure| format!("the deck cannot be used with {label}: {}", failure.in_one_line()))
    };
    let loaded: Vec<LoadedDeck> = decks.iter().map(load).collect::<Result<_, _>>()?;
    let sizes: Vec<_> = loaded.iter().map(cell_size).collect();
    for (index, pair) in loaded.windows(2).enumerate() {
        let (Some(coarse), Some(fine)) = (sizes[index], sizes[index + 1]) else { continue };
        if coarse <= fine {
            let [first, second] = [index, index + 1].map(|index| &decks[index].0);
            return Err(format!(
                "{second} does not have smaller cells than {first}: list grids from coarse to fine"
            ));
        }
        let unlike = unlike(&pair[0], &pair[1], coarse / fine);
        if !unlike.is_empty() {
            return Err(format!("not everything is refined alike: {}", unlike.join("; ")));
        }
    }
    for ((label, _), loaded) in decks.iter().zip(loaded) {
        can_begin(loaded).map_err(|why| format!("the deck cannot be used with {label}: {why}"))?;
    }
    Ok(decks.into_iter().zip(sizes).map(|((label, deck), size)| Grid { label, deck, size }).collect())
}

/// The size of the cells of a structured grid, [length].
fn cell_size(deck: &LoadedDeck) -> Option<f64> {
    let sides = deck.cell_sides()?;
    Some(sides.iter().product::<f64>().powf(1.0 / sides.len() as f64))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deck(spacing: &str, points: &str) -> DeckText {
        let text = format!(
            "version: 1\nparameters: {{h: 0.5, n: 2}}\n\
             grid: {{type: structured, origin: [0, 0], size: [8, 5], spacing: {spacing}}}\n\
             materials: {{m: {{model: hencky, young: 1, poisson: 0}}}}\n\
             bodies: [{{name: b, material: m, shape: {{type: box, min: [0, 0], max: [4, 4]}}, method: mpm, {points}}}]\n\
             steps: {{count: 1}}\n"
        );
        DeckText { name: "deck.yaml".to_owned(), text: text.into_bytes(), overrides: Vec::new() }
    }

    fn begins(_: LoadedDeck) -> Result<(), String> {
        Ok(())
    }

    fn labels(family: &Family) -> Vec<&str> {
        family.grids.iter().map(|grid| grid.label.as_str()).collect()
    }

    #[test]
    fn grids_are_coarser_than_that_of_the_deck_if_they_can_be() {
        let mut family = Family::new(deck("0.25", "points_per_cell: 2"), None, &begins).unwrap();
        assert_eq!(labels(&family), ["spacing x 4", "spacing x 2", "spacing x 1"]);
        assert_eq!(family.note, None);
        family.halve(&begins).unwrap();
        assert_eq!(labels(&family)[3], "spacing x 0.5");
        // A side of 2 does not divide 5.
        let family = Family::new(deck("\"${h}\"", "points_per_cell: 2"), None, &begins).unwrap();
        assert_eq!(labels(&family), ["h=1", "h=0.5", "h=0.25"]);
        assert!(family.note.unwrap().contains("h=2"));
    }

    #[test]
    fn bodies_that_do_not_follow_the_cells_are_named() {
        let why = Family::new(deck("0.25", "point_spacing: 0.125"), None, &begins).unwrap_err();
        assert!(why.contains("the body `b`: its `point_spacing`"), "{why}");
        let follows = deck("\"${h}\"", "point_spacing: \"${h/2}\"");
        assert!(Family::new(follows, None, &begins).is_ok());
    }

    #[test]
    fn listed_grids_ascend_in_fineness() {
        let over = |text: &str| {
            Family::new(deck("\"${h}\"", "points_per_cell: 2"), Some(text.parse().unwrap()), &begins)
        };
        let mut family = over("h=1,0.5,0.25").unwrap();
        assert_eq!(labels(&family), ["h=1", "h=0.5", "h=0.25"]);
        assert!(family.halve(&begins).is_err());
        assert!(over("h=0.25,0.5,1").unwrap_err().contains("from coarse to fine"));
        assert!(over("h=1,0.5").unwrap_err().contains("three"));
        assert!(over("k=1,0.5,0.25").unwrap_err().contains("no parameter `k`"));
    }

    #[test]
    fn a_moved_grid_keeps_the_edges_of_boxes_on_lines() {
        let family = Family::new(deck("0.25", "points_per_cell: 2"), None, &begins).unwrap();
        let (moved, why) = family.moved(&family.grids[1], &begins);
        assert!(moved.is_none() && why.is_some_and(|why| why.contains("D028")));
    }

    #[test]
    fn grids_on_which_the_first_step_cannot_begin_are_left_out() {
        let fine = |deck: LoadedDeck| match cell_size(&deck) {
            Some(size) if size > 0.5 => Err("too coarse".to_owned()),
            _ => Ok(()),
        };
        let family = Family::new(deck("0.25", "points_per_cell: 2"), None, &fine).unwrap();
        assert_eq!(labels(&family), ["spacing x 2", "spacing x 1", "spacing x 0.5"]);
        assert!(family.note.unwrap().contains("too coarse"));
        let never = |_| Err("never".to_owned());
        assert!(Family::new(deck("0.25", "points_per_cell: 2"), None, &never).unwrap_err().contains("never"));
    }
}
