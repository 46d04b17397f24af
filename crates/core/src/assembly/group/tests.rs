use super::*;
use crate::kinematics::Increment;
use crate::material::Hencky;
use crate::stress::{Axisymmetric, Mechanics, PlaneStrain, Solid, StartOfStep};
use crate::tensor::Sym3;
use proptest::prelude::*;

/// Values and gradients of the basis functions of one point at `N` nodes.
type Functions<const D: usize, const N: usize> = ([f64; N], [[f64; D]; N]);

fn number() -> impl Strategy<Value = f64> {
    -1.0..1.0f64
}

/// Points that all `N` nodes of a group affect, with their basis functions.
fn points<const D: usize, const N: usize>() -> impl Strategy<Value = Vec<Functions<D, N>>> {
    let values = prop::collection::vec(number(), N * (D + 1));
    let functions = values.prop_map(|x| {
        (std::array::from_fn(|a| x[a]), std::array::from_fn(|a| std::array::from_fn(|d| x[N + D * a + d])))
    });
    prop::collection::vec(functions, 3)
}

/// Adds the contributions of points and of a coupling to one form of the stiffness; returns the nodal forces.
fn sum<const D: usize, const N: usize, W: WeakForm<D>>(
    dense: &mut impl Dense<D>,
    weak: &W,
    points: &[Functions<D, N>],
    symmetric: bool,
) -> [[f64; D]; N] {
    let local: Vec<u32> = (0..N as u32).collect();
    let mut force = [[0.0; D]; N];
    for (value, gradient) in points {
        dense.add(weak, &Links { local: &local, value, gradient }, gradient, &mut force, &|_, _| ());
    }
    let (mean, column) = (&points[0].1, &points[1].1);
    let row = if symmetric { column } else { &points[2].1 };
    dense.couple(&Coupling { mean, row, column });
    force
}

fn bits<const D: usize>(blocks: &[Block<D>]) -> Vec<u64> {
    blocks.as_flattened().as_flattened().iter().map(|x| x.to_bits()).collect()
}

/// Compares all forms for a group of `N` nodes; `C` vectors of lanes contain the rows.
fn check<const D: usize, const N: usize, const C: usize, W: WeakForm<D>>(
    weak: &W,
    points: &[Functions<D, N>],
) -> Result<(), TestCaseError> {
    let zero = [[0.0; D]; D];
    let (mut triangle, mut square) = (vec![zero; N * (N + 1) / 2], vec![zero; N * N]);
    let force = sum(&mut Triangle(&mut triangle), weak, points, true);
    prop_assert_eq!(sum(&mut Square { blocks: &mut square, nodes: N }, weak, points, false), force);
    prop_assert_eq!(sum(&mut Cell::<D, N, C>::zero(true), weak, points, true), force);
    for (symmetric, general) in [(true, &triangle), (false, &square)] {
        let (mut cell, mut blocks) = (Cell::<D, N, C>::zero(symmetric), vec![zero; general.len()]);
        prop_assert_eq!(sum(&mut cell, weak, points, symmetric), force);
        cell.store(&mut blocks);
        prop_assert_eq!(bits(&blocks), bits(general));
    }
    let (mut whole, mut blocks) = (Whole::<D, N>::zero(), vec![zero; triangle.len()]);
    prop_assert_eq!(sum(&mut whole, weak, points, true), force);
    whole.store(&mut blocks);
    prop_assert_eq!(bits(&blocks), bits(&triangle));
    Ok(())
}

/// The weak form of a point in a deformed state after an increment.
fn weak<const D: usize, M: Mechanics<D>>(increment: &Increment<D>) -> M::Previous {
    let law = Hencky::new(7.0, 0.3);
    let start = StartOfStep { b_n: Sym3([1.1, 0.9, 1.2, 0.0, 0.0, 0.1]), J_n: 1.1, volume_n: 0.7 };
    M::respond(&start, increment, &law, &[], &mut []).unwrap().weak
}

/// ΔF = I + `entry`/4.
fn increment<const D: usize>(entry: &[f64]) -> Increment<D> {
    Increment::flat(std::array::from_fn(|i| {
        std::array::from_fn(|j| f64::from(u8::from(i == j)) + entry[D * i + j] / 4.0)
    }))
}

proptest! {
    /// Groups whose points touch all nodes have special forms, which only processors with vector instructions use. The
    /// result must not depend on the processor.
    #[test]
    fn all_forms_of_the_stiffness_have_the_same_bits(
        entry in prop::collection::vec(number(), 9),
        triangles in points::<2, 3>(),
        quadrilaterals in points::<2, 4>(),
        tetrahedra in points::<3, 4>(),
        hexahedra in points::<3, 8>(),
    ) {
        let plane = weak::<2, PlaneStrain>(&increment(&entry));
        check::<2, 3, 1, _>(&plane, &triangles)?;
        check::<2, 4, 1, _>(&plane, &quadrilaterals)?;
        let ring = weak::<2, Axisymmetric>(&Increment { hoop: 1.1, radius: 0.4, ..increment(&entry) });
        check::<2, 3, 1, _>(&ring, &triangles)?;
        check::<2, 4, 1, _>(&ring, &quadrilaterals)?;
        let solid = weak::<3, Solid>(&increment(&entry));
        check::<3, 4, 1, _>(&solid, &tetrahedra)?;
        check::<3, 8, 2, _>(&solid, &hexahedra)?;
    }
}
