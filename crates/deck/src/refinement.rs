//! The same deck on other grids: with cells of another size, or with its inner grid lines at other places.
//!
//! Cells change through the parameter of the deck that sets them, if there is one, so that everything else that depends
//! on it changes alike; otherwise `spacing` is replaced in the text. Either way the result is a deck like any other.

use serde_json::Value;

use crate::load::{LoadedDeck, load_text, values};
use crate::per_axis::per_axis;
use crate::quoting::{list, quote};
use crate::span::Span;
use crate::{
    AXES, AxisSpacing, BodyDeck, GridDeck, IntervalDeck, PerAxis, RefineDeck, Shape, SpacingDeck, Unrefined,
};
use mpm_core::grid::Axis;

/// Largest relative deviation at which sides of cells count as scaled by a factor, [-].
const SAME: f64 = 1e-6;
/// Largest number of intervals of an axis of a grid.
const MAX_INTERVALS: usize = 1000;
/// Distance by which inner grid lines move along each axis, as a fraction of the cell above them, [-]. The fractions are
/// unlike simple ratios, so that sides that lay on grid lines do not lie on them along any axis.
pub const SHIFT: [f64; 3] = [0.31, 0.44, 0.37];

/// The text of a deck, with names and values of parameters that replace those in the text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeckText {
    /// Name of the file, for messages.
    pub name: String,
    /// The text.
    pub text: Vec<u8>,
    /// Names and values of parameters.
    pub overrides: Vec<(String, String)>,
}

/// What sets the size of the cells of a deck.
#[derive(Debug, Clone, PartialEq)]
pub enum CellControl {
    /// A parameter.
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Its value.
        value: f64,
        /// True if it is a number of cells, so that cells grow as it falls.
        counts: bool,
    },
    /// The key `spacing` of the grid.
    Spacing,
}

impl DeckText {
    /// Reads the deck; `None` if it has errors.
    fn loaded(&self) -> Option<LoadedDeck> {
        load_text(&self.name, &self.text, &self.overrides).ok()
    }

    /// The deck with another value of a parameter.
    pub fn with(&self, parameter: &str, value: &str) -> DeckText {
        let mut changed = self.clone();
        changed.overrides.retain(|(name, _)| name != parameter);
        changed.overrides.push((parameter.to_owned(), value.to_owned()));
        changed
    }

    /// Finds what sets the size of the cells: the only parameter, given as a number, that scales all cell sides when it
    /// is doubled or halved, or else the spacing of the grid.
    ///
    /// # Errors
    /// In words, if the grid is a mesh, or if several parameters would do.
    pub fn cell_control(&self) -> Result<CellControl, String> {
        const BY_HAND: &str = "name the parameter that refines it, with its values from coarse to fine: \
                               --over segments=9,18,36";
        let deck = self.loaded().ok_or("the deck has errors")?;
        let sides = deck.cell_sides().ok_or_else(|| format!("the grid is a mesh; {BY_HAND}"))?;
        let written = values(&self.name, &self.text).map_err(|_| "the deck has errors")?;
        let mut found = Vec::new();
        for (name, written) in written["parameters"].as_object().into_iter().flatten() {
            let set = self.overrides.iter().rev().find(|(set, _)| set == name).map(|(_, value)| value);
            let value = match set {
                Some(value) => value.parse().ok(),
                None => written.as_f64(),
            };
            let Some(value) = value.filter(|value| *value > 0.0) else { continue };
            for counts in [false, true] {
                let control = CellControl::Parameter { name: name.clone(), value, counts };
                if self.scales_cells(&control, &deck, &sides) {
                    found.push(control);
                    break;
                }
            }
        }
        let name = |control: &CellControl| match control {
            CellControl::Parameter { name, .. } => name.clone(),
            CellControl::Spacing => String::new(),
        };
        match &found[..] {
            [] => Ok(CellControl::Spacing),
            [only] => Ok(only.clone()),
            several => {
                let names: Vec<String> = several.iter().map(name).collect();
                let names = list(names.iter().map(String::as_str));
                Err(format!("several parameters scale the cells: {names}; {BY_HAND}"))
            }
        }
    }

    /// True if a parameter makes all cells longer or shorter, and changes neither the grid as a whole nor the shape of a
    /// body.
    fn scales_cells(&self, control: &CellControl, deck: &LoadedDeck, sides: &[f64]) -> bool {
        let scales = |factor: f64| {
            let Some(scaled) = self.scaled(control, factor).ok().and_then(|deck| deck.loaded()) else {
                return false;
            };
            let is_same_shape = |(a, b): (&BodyDeck, &BodyDeck)| a.shape == b.shape;
            scaled.cell_sides().is_some_and(|scaled| are_scaled(sides, &scaled, factor))
                && extent(&scaled) == extent(deck)
                && scaled.deck.bodies.iter().zip(&deck.deck.bodies).all(is_same_shape)
        };
        // Larger cells may not fit.
        scales(2.0) || scales(0.5)
    }

    /// The deck with all cells `factor` times as long, [-].
    ///
    /// # Errors
    /// In words, if `spacing` cannot be scaled by this factor or has no place of its own in the text.
    pub fn scaled(&self, control: &CellControl, factor: f64) -> Result<DeckText, String> {
        match control {
            CellControl::Parameter { name, value, counts } => {
                let scaled = if *counts { value / factor } else { value * factor };
                Ok(self.with(name, &number(scaled)))
            }
            CellControl::Spacing => {
                let deck = self.loaded().ok_or("the deck has errors")?;
                let GridDeck::Structured { spacing, .. } = &deck.deck.grid else {
                    return Err("the grid is a mesh".to_owned());
                };
                let entries = spacing.entries(deck.deck.dimensions());
                let entries: Result<_, _> = entries.iter().map(|entry| scaled_entry(entry, factor)).collect();
                self.with_spacing(&deck, entries?)
            }
        }
    }

    /// The deck with its inner grid lines moved along some axes, by the fractions [`SHIFT`] of the cell above them. The
    /// ends of the grid, and with them the supports there, stay in place.
    ///
    /// # Errors
    /// In words, if there are too many different cells, or `spacing` has no place of its own in the text.
    pub fn shifted(&self, axes: &[bool]) -> Result<DeckText, String> {
        let deck = self.loaded().ok_or("the deck has errors")?;
        let GridDeck::Structured { origin, size, spacing, .. } = &deck.deck.grid else {
            return Err("the grid is a mesh".to_owned());
        };
        let mut entries = spacing.entries(deck.deck.dimensions());
        for (axis, entry) in entries.iter_mut().enumerate() {
            if axes.get(axis) != Some(&true) {
                continue;
            }
            let lines = entry.axis(origin[axis], size[axis]).map_err(|_| "grid lines coincide")?;
            *entry = AxisSpacing::Intervals(moved_lines(entry, &lines, SHIFT[axis])?);
        }
        self.with_spacing(&deck, entries)
    }

    /// The deck with another `spacing`, which replaces that in the text.
    fn with_spacing(&self, deck: &LoadedDeck, entries: Vec<AxisSpacing>) -> Result<DeckText, String> {
        let spacing =
            serde_json::to_string(&SpacingDeck::Each(entries)).map_err(|error| error.to_string())?;
        let place = |pointer: &str| deck.source.span_of(pointer);
        let at = place("/grid/spacing").ok_or("`spacing` of the grid is not written out in the deck")?;
        // The spacing contains what `refine` means.
        let mut changes = vec![(at, spacing)];
        changes.extend(place("/grid/refine").map(|at| (at, "[]".to_owned())));
        changes.sort_by_key(|(at, _)| std::cmp::Reverse(at.start));
        let mut text = deck.source.text().to_owned();
        for (Span { start, end }, new) in changes {
            let kept = text.get(start..end).ok_or("the deck has no such text")?.trim_end().len();
            text.replace_range(start..start + kept, &new);
        }
        Ok(DeckText { text: text.into_bytes(), ..self.clone() })
    }
}

/// What does not follow the cells from a coarse grid to a fine one: parts of a graded grid, and bodies, each with the
/// reason, in words. `ratio` is the side of a coarse cell relative to a fine one, [-].
pub fn unlike(coarse: &LoadedDeck, fine: &LoadedDeck, ratio: f64) -> Vec<String> {
    let mut found = unlike_grids(coarse, fine, ratio);
    found.extend(unlike_bodies(coarse, fine, ratio));
    found
}

/// Graded axes, and places of `refine`, whose cells do not follow the others.
fn unlike_grids(coarse: &LoadedDeck, fine: &LoadedDeck, ratio: f64) -> Vec<String> {
    let grids = (&coarse.deck.grid, &fine.deck.grid);
    let (
        GridDeck::Structured { spacing: coarse_spacing, unrefined: coarse_stated, .. },
        GridDeck::Structured { spacing: fine_spacing, unrefined: fine_stated, .. },
    ) = grids
    else {
        return Vec::new();
    };
    let is_same = |a: f64, b: f64| (a / b - 1.0).abs() <= SAME;
    let places =
        |stated: &Option<Unrefined>| stated.as_ref().map_or(Vec::new(), |stated| stated.places.clone());
    let (from, to) = (places(coarse_stated), places(fine_stated));
    let follows = |(from, to): (&RefineDeck, &RefineDeck)| is_same(from.to / to.to, ratio);
    if from.len() != to.len() || !from.iter().zip(&to).all(follows) {
        return vec![
            "the cells of `refine` do not change with the others: write `to` as a multiple of the parameter that sets \
             them"
            .to_owned(),
        ];
    }
    let stated = |stated: &Option<Unrefined>, spacing: &SpacingDeck| {
        stated.as_ref().map_or(spacing, |stated| &stated.spacing).entries(coarse.deck.dimensions())
    };
    let pairs = stated(coarse_stated, coarse_spacing).into_iter().zip(stated(fine_stated, fine_spacing));
    let is_unlike = |(coarse, fine): (AxisSpacing, AxisSpacing)| match (coarse, fine) {
        (AxisSpacing::Even(coarse), AxisSpacing::Even(fine)) => !is_same(coarse / fine, ratio),
        (AxisSpacing::Intervals(coarse), AxisSpacing::Intervals(fine)) => {
            let follows = |(coarse, fine): (&IntervalDeck, &IntervalDeck)| {
                is_same(f64::from(fine.cells) / f64::from(coarse.cells), ratio)
                    && (fine.ratio.powf(ratio) / coarse.ratio - 1.0).abs() <= 1e-3
            };
            coarse.len() != fine.len() || !coarse.iter().zip(&fine).all(follows)
        }
        _ => true,
    };
    let axes = pairs.zip(AXES).filter_map(|(pair, axis)| is_unlike(pair).then_some(axis));
    let reason = |axis| {
        format!(
            "the cells along {axis} are not all divided alike: with r times as many cells in each interval, its `ratio` must \
             become its r-th root"
        )
    };
    axes.map(reason).collect()
}

/// The bodies whose points do not follow the cells from a coarse grid to a fine one, each with the reason, in words.
fn unlike_bodies(coarse_deck: &LoadedDeck, fine_deck: &LoadedDeck, ratio: f64) -> Vec<String> {
    let pairs = coarse_deck.deck.bodies.iter().zip(&fine_deck.deck.bodies);
    let reason = |(coarse, fine): (&BodyDeck, &BodyDeck)| {
        let why = if matches!(fine.shape, Shape::Mesh { .. }) {
            "the cells of its own mesh are its domains on every grid".to_owned()
        } else if point_counts(coarse) != point_counts(fine) {
            "the number of points in a cell changes from grid to grid".to_owned()
        } else {
            let (from, to) = (coarse.point_spacing.as_ref()?, fine.point_spacing.as_ref()?);
            let follows = |(from, to): (f64, f64)| (from / to / ratio - 1.0).abs() <= SAME;
            let axes = coarse_deck.deck.dimensions();
            let [from, to] = [from, to].map(per_axis::<f64, 3>);
            if from.into_iter().zip(to).take(axes).all(follows) {
                return None;
            }
            "its `point_spacing` does not change with the cells: write it as a multiple of the parameter that sets them"
                .to_owned()
        };
        Some(format!("the body {}: {why}", quote(&fine.name)))
    };
    pairs.filter_map(reason).collect()
}

/// Numbers of points in cells of each kind.
fn point_counts(body: &BodyDeck) -> (Option<PerAxis<u32>>, Option<u32>, Option<u32>) {
    (body.points_per_cell.clone(), body.points_per_triangle, body.points_per_tetrahedron)
}

impl LoadedDeck {
    /// Why results need not tend to a value as cells shrink, in words; `None` if nothing in the deck says so.
    pub fn without_order(&self) -> Option<String> {
        let used = self.deck.used_materials();
        let materials = || self.deck.materials.iter().filter(|(name, _)| used.contains(name.as_str()));
        let softens = materials().find(|(_, material)| material.softening().is_some());
        if let Some((name, _)) = softens {
            return Some(format!(
                "the material {} softens, in bands whose width follows the cells",
                quote(name)
            ));
        }
        let (name, _) = materials().find(|(_, material)| !material.is_associated())?;
        let name = quote(name);
        Some(format!(
            "the dilation angle of the material {name} differs from its friction angle: its limit loads have no limit as \
             cells shrink"
        ))
    }
}

/// Origin and size of a structured grid.
fn extent(deck: &LoadedDeck) -> Option<(&[f64], &[f64])> {
    match &deck.deck.grid {
        GridDeck::Structured { origin, size, .. } => Some((origin, size)),
        GridDeck::Gmsh { .. } => None,
    }
}

/// True if all coarse sides are `factor` times as long as the fine ones.
fn are_scaled(fine: &[f64], coarse: &[f64], factor: f64) -> bool {
    let is_scaled = |(fine, coarse): (&f64, &f64)| (coarse / fine / factor - 1.0).abs() <= SAME;
    fine.len() == coarse.len() && fine.iter().zip(coarse).all(is_scaled)
}

/// Cells along an axis that are `factor` times as long.
fn scaled_entry(entry: &AxisSpacing, factor: f64) -> Result<AxisSpacing, String> {
    let intervals = match entry {
        AxisSpacing::Even(side) => return Ok(AxisSpacing::Even(side * factor)),
        AxisSpacing::Intervals(intervals) => intervals,
    };
    let scaled = intervals.iter().map(|interval| {
        let cells = f64::from(interval.cells) / factor;
        if cells < 1.0 || (cells - cells.round()).abs() > SAME {
            return Err(format!(
                "the interval of the grid to {} has {} cells, which cannot become {} as many",
                number(interval.to),
                interval.cells,
                number(1.0 / factor)
            ));
        }
        Ok(IntervalDeck { to: interval.to, cells: cells.round() as u32, ratio: interval.ratio.powf(factor) })
    });
    scaled.collect::<Result<_, _>>().map(AxisSpacing::Intervals)
}

/// Intervals between the ends of an axis and its moved inner lines.
fn moved_lines(entry: &AxisSpacing, lines: &Axis, shift: f64) -> Result<Vec<IntervalDeck>, String> {
    let n = lines.n_cells();
    let moved = |line: usize| lines.line(line) + shift * (lines.line(line + 1) - lines.line(line));
    let interval = |to: f64, cells: usize| IntervalDeck { to, cells: cells as u32, ratio: 1.0 };
    let end = interval(lines.line(n), 1);
    match entry {
        _ if n < 2 => Err("the grid has no inner lines".to_owned()),
        AxisSpacing::Even(_) if n == 2 => Ok(vec![interval(moved(1), 1), end]),
        AxisSpacing::Even(_) => Ok(vec![interval(moved(1), 1), interval(moved(n - 1), n - 2), end]),
        AxisSpacing::Intervals(_) if n > MAX_INTERVALS => {
            Err(format!("a graded axis has more than {MAX_INTERVALS} cells"))
        }
        AxisSpacing::Intervals(_) => Ok((1..n).map(|line| interval(moved(line), 1)).chain([end]).collect()),
    }
}

/// A number as a deck writes it.
fn number(value: f64) -> String {
    Value::from(value).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn deck(grid: &str, parameters: &str, overrides: &[(&str, &str)]) -> DeckText {
        let text = format!(
            "version: 1\nparameters: {parameters}\ngrid:\n  {grid}\nmaterials: {{m: {{model: hencky, young: 1, poisson: 0}}}}\n\
             bodies: [{{name: b, material: m, shape: {{type: box, min: [0, 0], max: [4, 4]}}, method: mpm, \
             points_per_cell: 2}}]\nsteps: {{count: 1}}\n"
        );
        let overrides = overrides.iter().map(|(n, v)| ((*n).to_owned(), (*v).to_owned())).collect();
        DeckText { name: "deck.yaml".to_owned(), text: text.into_bytes(), overrides }
    }

    /// The text with a body that fills the grid, so that its edges stay on lines.
    fn whole_width(deck: &DeckText) -> Vec<u8> {
        String::from_utf8_lossy(&deck.text).replace("max: [4, 4]", "max: [8, 8]").into_bytes()
    }

    fn sides(deck: &DeckText) -> Vec<f64> {
        load_text(&deck.name, &deck.text, &deck.overrides).unwrap().cell_sides().unwrap()
    }

    const GRID: &str = "{type: structured, origin: [0, 0], size: [8, 8], spacing: ";

    #[test]
    fn the_parameter_that_sets_the_cells_is_found() {
        let parameter = |name: &str, value: f64, counts: bool| {
            Ok(CellControl::Parameter { name: name.to_owned(), value, counts })
        };
        let by_side = deck(&format!("{GRID}\"${{h}}\"}}"), "{h: 0.5, young: 2}", &[]);
        assert_eq!(by_side.cell_control(), parameter("h", 0.5, false));
        let set = deck(&format!("{GRID}\"${{h}}\"}}"), "{h: 0.5}", &[("h", "0.25")]);
        assert_eq!(set.cell_control(), parameter("h", 0.25, false));
        assert_eq!(sides(&set.scaled(&set.cell_control().unwrap(), 2.0).unwrap()), [0.5, 0.5]);
        let by_count = deck(&format!("{GRID}\"${{8/n}}\"}}"), "{n: 16}", &[]);
        assert_eq!(by_count.cell_control(), parameter("n", 16.0, true));
        assert_eq!(sides(&by_count.scaled(&by_count.cell_control().unwrap(), 4.0).unwrap()), [2.0, 2.0]);
    }

    #[test]
    fn a_length_that_scales_the_whole_grid_is_not_a_cell_size() {
        let grid = "{type: structured, origin: [0, 0], size: [\"${l}\", \"${l}\"], spacing: \"${l/16}\"}";
        assert_eq!(deck(grid, "{l: 8}", &[]).cell_control(), Ok(CellControl::Spacing));
    }

    #[test]
    fn two_candidates_are_a_question() {
        let both = deck(&format!("{GRID}\"${{h*k}}\"}}"), "{h: 0.5, k: 1}", &[]);
        assert!(both.cell_control().unwrap_err().contains("`h` and `k`"));
    }

    #[test]
    fn spacing_is_replaced_in_the_text() {
        let plain = deck(&format!("{GRID}0.5}}  # m"), "{}", &[]);
        assert_eq!(plain.cell_control(), Ok(CellControl::Spacing));
        let coarse = plain.scaled(&CellControl::Spacing, 2.0).unwrap();
        assert_eq!(sides(&coarse), [1.0, 1.0]);
        assert!(String::from_utf8(coarse.text).unwrap().contains("spacing: [1.0,1.0]}  # m\n"));
        let graded = "type: structured\n  origin: [0, 0]\n  size: [8, 8]\n  spacing:\n    - - {to: 4, cells: 8}\n      \
                      - {to: 8, cells: 4, ratio: 1.2}\n    - 1\n";
        let graded = deck(graded, "{}", &[]);
        let coarse = graded.scaled(&CellControl::Spacing, 2.0).unwrap();
        assert_eq!(sides(&coarse), [8.0 / 6.0, 2.0]);
        let why = graded.scaled(&CellControl::Spacing, 8.0).unwrap_err();
        assert!(why.contains("to 8") && why.contains("4 cells"), "{why}");
    }

    #[test]
    fn what_refine_means_is_written_out() {
        let refined = deck(&format!("{GRID}2, refine: [{{at: {{x: 4}}, to: 0.5}}]}}"), "{}", &[]);
        let loaded = |deck: &DeckText| load_text(&deck.name, &deck.text, &deck.overrides).unwrap();
        assert_eq!(sides(&refined), [2.0, 2.0]);
        let refined = DeckText { text: whole_width(&refined), ..refined };
        let moved = refined.shifted(&[false, true]).unwrap();
        let graded = |deck: &DeckText| match loaded(deck).deck.grid {
            GridDeck::Structured { spacing, .. } => spacing.entries(2)[0].clone(),
            GridDeck::Gmsh { .. } => panic!("structured"),
        };
        assert_eq!(graded(&moved), graded(&refined));
        assert!(String::from_utf8(moved.text).unwrap().contains("refine: []}"));
    }

    #[test]
    fn inner_lines_move_and_the_ends_stay() {
        let plain = deck(&format!("{GRID}\"${{h}}\"}}"), "{h: 2}", &[]);
        let plain = DeckText { text: whole_width(&plain), ..plain };
        let shifted = plain.shifted(&[true, false]).unwrap();
        let loaded = load_text("deck", &shifted.text, &[]).unwrap();
        let GridDeck::Structured { spacing, .. } = &loaded.deck.grid else { panic!("structured") };
        let lines = spacing.entries(2)[0].axis(0.0, 8.0).unwrap();
        let found: Vec<f64> = (0..=lines.n_cells()).map(|line| lines.line(line)).collect();
        for (found, expected) in found.iter().zip([0.0, 2.62, 4.62, 6.62, 8.0]) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
        assert_eq!(sides(&shifted)[1], 2.0);
        let graded = deck(&format!("{GRID}[[{{to: 8, cells: 4, ratio: 2}}], 2]}}"), "{}", &[]);
        let graded = DeckText { text: whole_width(&graded), ..graded };
        assert_eq!(sides(&graded.shifted(&[true, true]).unwrap()), [2.0, 2.0]);
    }
}
