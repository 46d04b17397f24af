//! Fills bodies with material points.

use crate::per_axis::{array, per_axis};
use crate::quoting::quote;
use crate::region::DeckRegion;
use crate::{AXES, BodyDeck, Shape};
use mpm_core::grid::Grid;
use mpm_core::grid::element::ElementShape;
use mpm_core::model::{FillError, Fillable, Filling, Fit, MAX_POINTS, Placement};
use mpm_core::points::Seed;
use mpm_core::region::{Accuracy, Region, Volume};

/// The reason why a body cannot be filled: the code, the key in the entry of the body that is at fault, the message and
/// the remedy.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) code: &'static str,
    pub(crate) key: String,
    pub(crate) message: String,
    pub(crate) help: String,
}

/// The points of a body.
pub(crate) struct Filled<const D: usize> {
    /// The points that this rank creates; the shares of the ranks follow one another.
    pub(crate) seeds: Vec<Seed<D>>,
    /// Number of points that ranks below this one create, and number of points that all ranks create.
    pub(crate) before: usize,
    pub(crate) all: usize,
    /// Volume (area) of the region, if it is known.
    pub(crate) exact: Option<Volume>,
    /// How the domains follow the boundary.
    pub(crate) fit: Fit,
    /// A position on the boundary that the domains do not follow, if one is known.
    pub(crate) apart: Option<[f64; D]>,
}

/// Fills a body with points as its deck requests. Collective: every rank must call this.
///
/// # Errors
/// The fault that prevents it; `None` if only other ranks found one.
pub(crate) fn fill<const D: usize>(
    region: &Region<D>,
    filling: &Filling<D>,
    deck: &BodyDeck,
) -> Result<Filled<D>, Option<Fault>>
where
    Region<D>: DeckRegion<D>,
{
    let ranks = filling.ranks;
    let found = placement(region, filling.grid, deck)
        .and_then(|placement| region.fill(filling, &placement).map_err(|error| fault::<D>(error, deck)));
    if ranks.any(found.is_err()) {
        return Err(found.err());
    }
    let found = found.map_err(Some)?;
    let counts = ranks.gather_all(found.seeds.len());
    let (before, all) = (counts[..ranks.own()].iter().sum(), counts.iter().sum());
    if all == 0 {
        return Err(Some(Fault {
            code: "D028",
            key: String::new(),
            message: format!("the body {} contains no material point", quote(&deck.name)),
            help:
                "its region must lie in the grid and contain the centre of at least one subdivision of a cell"
                    .to_owned(),
        }));
    }
    let exact = region.volume(Accuracy::default());
    let exact = exact.or_else(|| found.is_by_cells.then(|| region.volume_in_grid(filling)));
    Ok(Filled { seeds: found.seeds, before, all, exact, fit: found.fit, apart: found.apart })
}

/// How the deck places the points of a body.
fn placement<const D: usize>(
    region: &Region<D>,
    grid: &dyn Grid<D>,
    deck: &BodyDeck,
) -> Result<Placement<D>, Fault> {
    if matches!(deck.shape, Shape::Stl { .. }) {
        surface_in_grid(region, grid, deck)?;
    }
    let Some(spacing) = &deck.point_spacing else {
        let per_simplex = if D == 3 { deck.points_per_tetrahedron } else { deck.points_per_triangle };
        let counts = deck.points_per_cell.as_ref();
        return Ok(Placement::PerCell {
            boxes: counts.map(|counts| per_axis::<u32, D>(counts).map(|n| n as usize)),
            simplices: per_simplex.map(|n| n as usize),
            brick: match &deck.shape {
                Shape::Box { min, max } => Some([array(min), array(max)]),
                _ => None,
            },
        });
    };
    if deck.shape.any(&|part| matches!(part, Shape::Cells { .. })) {
        return Err(Fault {
            code: "D023",
            key: "/point_spacing".to_owned(),
            message: "a region of type `cells` cannot be filled with `point_spacing`".to_owned(),
            help: format!("give {}", placed_in_cells(D)),
        });
    }
    Ok(Placement::Lattice(per_axis(spacing)))
}

/// Checks that an STL surface lies in the grid; its extent is known only once its file has been read.
fn surface_in_grid<const D: usize>(
    region: &Region<D>,
    grid: &dyn Grid<D>,
    deck: &BodyDeck,
) -> Result<(), Fault> {
    let ([low, high], [from, to]) = (region.bounds(), grid.bounds());
    for d in 0..D {
        let slack = 1e-6 * (to[d] - from[d]);
        if low[d] < from[d] - slack || high[d] > to[d] + slack {
            return Err(Fault {
                code: "D028",
                key: "/shape".to_owned(),
                message: format!(
                    "the surface of the body {} extends from {} to {} along {}, beyond the grid, which \
                     covers {} to {}",
                    quote(&deck.name),
                    low[d],
                    high[d],
                    AXES[d],
                    from[d],
                    to[d]
                ),
                help: "make the grid larger, or move the body; an `intersection` with a box keeps a part of \
                    it"
                .to_owned(),
            });
        }
    }
    Ok(())
}

/// The fault of a body that cannot be filled.
fn fault<const D: usize>(error: FillError, deck: &BodyDeck) -> Fault {
    let name = quote(&deck.name);
    let (code, key, message, help) = match error {
        FillError::TooFine { count, most } => (
            "D028",
            "/point_spacing",
            format!(
                "the lattice of points over the extent of the body {name} would have {count:.1e} points; at most {most:.0e} are \
                 possible"
            ),
            "give a larger spacing",
        ),
        FillError::TooManyParts => (
            "D028",
            "",
            format!(
                "the cells that the body {name} covers would be divided into more than {MAX_POINTS:.0e} points"
            ),
            "use fewer points per cell",
        ),
        FillError::NoCount(shape) => (
            "D023",
            "",
            format!(
                "the grid has {}, but the body does not state the number of points in each",
                shape.plural::<D>()
            ),
            match (shape, D) {
                (ElementShape::Simplex, 3) => "give `points_per_tetrahedron`",
                (ElementShape::Simplex, _) => "give `points_per_triangle`",
                _ => "give `points_per_cell`",
            },
        ),
        FillError::Uneven(n) if D == 3 => (
            "D009",
            "/points_per_tetrahedron",
            format!("a tetrahedron cannot be divided evenly into {n} parts"),
            "use 4, or a cube number: 1, 8, 27, …",
        ),
        FillError::Uneven(n) => (
            "D009",
            "/points_per_triangle",
            format!("a triangle cannot be divided evenly into {n} parts"),
            "use 8, or a square number: 1, 4, 9, 16, …",
        ),
        other => ("D028", "", format!("the body {name} cannot be filled: {other}"), "change its shape"),
    };
    Fault { code, key: key.to_owned(), message, help: help.to_owned() }
}

/// The keys that place points in cells.
pub(crate) fn placed_in_cells(dimensions: usize) -> &'static str {
    match dimensions {
        3 => "`points_per_cell` or `points_per_tetrahedron`",
        _ => "`points_per_cell` or `points_per_triangle`",
    }
}
