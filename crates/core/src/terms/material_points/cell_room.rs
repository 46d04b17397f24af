//! Working space for the points of a material in a cell, which are evaluated together.
#![allow(non_snake_case)]

use crate::kinematics::Increment;
use crate::stress::{Mechanics, PointError};
use crate::terms::failure::PointFailure;

use super::mean_room::MeanRoom;

/// The weak form of a point at a multiple of its increment, and this multiple.
pub(super) type Responded<R> = (R, f64);

/// Working space for the points of a material in a cell.
pub(super) struct CellRoom<const D: usize, M: Mechanics<D>> {
    pub(super) moved: Vec<(usize, Motion<D>)>,
    pub(super) isotropic: Vec<Responded<M::AveragingIsotropic>>,
    pub(super) averaging: Vec<Responded<M::Averaging>>,
    pub(super) coupling: CouplingRoom<D>,
    pub(super) mean: MeanRoom<D, M>,
}

/// Working space for the vectors of a `Coupling`.
#[derive(Default)]
pub(super) struct CouplingRoom<const D: usize> {
    pub(super) gradient: Vec<[f64; D]>,
    pub(super) column: Vec<[f64; D]>,
    pub(super) row: Vec<[f64; D]>,
}

impl<const D: usize, M: Mechanics<D>> Default for CellRoom<D, M> {
    fn default() -> Self {
        CellRoom {
            moved: Vec::new(),
            isotropic: Vec::new(),
            averaging: Vec::new(),
            coupling: CouplingRoom::default(),
            mean: MeanRoom::default(),
        }
    }
}

/// The increment of a point and det(ΔF).
#[derive(Clone, Copy)]
pub(super) struct Motion<const D: usize> {
    pub(super) increment: Increment<D>,
    pub(super) dJ: f64,
}

impl<const D: usize> Motion<D> {
    #[inline(always)]
    pub(super) fn new(p: usize, increment: Increment<D>) -> Result<Self, PointFailure> {
        let dJ = increment.determinant();
        if dJ > 0.0 && increment.hoop > 0.0 {
            return Ok(Motion { increment, dJ });
        }
        Err(PointFailure { point: p, error: PointError::Inverted { determinant: dJ } })
    }
}

/// Factor on ΔF that changes the volume by `ratio`.
#[inline(always)]
fn stretch<const D: usize, M: Mechanics<D>>(ratio: f64) -> f64 {
    if M::DILATED == 2 { ratio.sqrt() } else { ratio.cbrt() }
}

/// The increment with the volume ratio `theta`, and the factor that scales ΔF.
#[inline(always)]
pub(super) fn barred<const D: usize, M: Mechanics<D>>(motion: &Motion<D>, theta: f64) -> (Increment<D>, f64) {
    let factor = stretch::<D, M>(theta / motion.dJ);
    (motion.increment.scaled(factor, M::REVOLVED), factor)
}
