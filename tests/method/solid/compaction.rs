//! Compaction of an elastic column under its own weight in space, compared with the closed form of Coombs et al.
//! (2020), section 7.1, and with the errors in the plane.

use mpm::basis::Method;
use mpm::domain::DomainUpdate;
use mpm::grid::Structured;
use mpm::material::Hencky;
use mpm::model::{Action, Load, LoadCurve};
use mpm::points::Points;

use super::bodies::{Filling, cells_in, fill, fixed, model, nodes_where, watch};

const HEIGHT: f64 = 50.0;
const WEIGHT: f64 = 800.0; // ρ₀ g, per original volume

/// Eq. (42) for a column one cell wide and deep, with `n` points per cell along the column and two across, which keep
/// cross-sections plane; σ_a of eq. (41) is compressive.
fn stress_error(method: Method, update: DomainUpdate, n: usize, elements: usize) -> f64 {
    let h = HEIGHT / elements as f64;
    let grid = Structured::<3>::new([0.0; 3], [h; 3], [1, 1, elements]);
    let law = Hencky::new(1e6, 0.0);
    let filling = Filling { method, n: [2, 2, n], density: 80.0 };
    let seeds = fill(&grid, &cells_in(&grid, [0.0; 3], [h, h, HEIGHT]), filling, &law);
    let mut points = Points::new(&seeds);
    let side = |d: usize| nodes_where(&grid, move |x| x[d] == 0.0 || x[d] == h);
    let sides = [fixed("x", side(0), [true, false, false]), fixed("y", side(1), [false, true, false])];
    let base = fixed("base", nodes_where(&grid, |x| x[2] == 0.0), [false, false, true]);
    let mut model = model(grid, law, method, update, 20);
    model.boundary_conditions = sides.into_iter().chain([base]).collect();
    model.loads = vec![Load {
        name: "weight".into(),
        action: Action::Gravity([0.0, 0.0, -10.0]),
        acts_on: vec![true],
        curve: LoadCurve::ramp(1.0),
    }];
    let mut carried = 0.0;
    let outcome = watch(&model, &mut points, |_, report| carried = report.reactions[2][2]);
    outcome.unwrap_or_else(|error| panic!("{method:?} {update:?} {elements}: {error}"));
    let weight = WEIGHT * HEIGHT * h * h;
    // Domains that are not updated extend through the base; the part outside the grid has no weight.
    let inside = update != DomainUpdate::None || method == Method::Mpm;
    assert!(!inside || (carried / weight - 1.0).abs() < 1e-8, "the base carries {carried} of {weight}");
    let (mut sum, mut volume) = (0.0, 0.0);
    for p in 0..points.len() {
        let j = points.converged.deformation_gradient[p].determinant();
        let sigma = points.converged.kirchhoff_stress[p].0[2] / j;
        let exact = -WEIGHT * (HEIGHT - points.original_position[p][2]);
        sum += (sigma - exact).abs() * points.original_volume[p];
        volume += points.original_volume[p];
    }
    sum / (WEIGHT * HEIGHT * volume)
}

/// The error in the plane, computed with an independent program or with AMPLE.
fn in_the_plane(method: &str, update: &str, n: usize, elements: usize) -> f64 {
    let text = include_str!("../../data/compaction_error.csv");
    let found = text.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>()).find(|cells| {
        cells[1..3] == [method, update]
            && cells[3].parse::<usize>().unwrap() == n
            && cells[4].parse::<usize>().unwrap() == elements
    });
    found.unwrap_or_else(|| panic!("no row {method} {update} {n} {elements}"))[5].parse().unwrap()
}

/// The column and its domains deform along its axis only if the update treats each axis separately. The errors must
/// then equal those in the plane.
#[test]
fn errors_are_those_in_the_plane() {
    for (method, name, update, update_name) in [
        (Method::Mpm, "mpm", DomainUpdate::None, ""),
        (Method::Gimp, "gimp", DomainUpdate::Stretch, "stretch"),
        (Method::Gimp, "gimp", DomainUpdate::Diagonal, "diagonal"),
        (Method::Gimp, "gimp", DomainUpdate::None, "none"),
    ] {
        for elements in [4, 16, 64] {
            let (error, plane) =
                (stress_error(method, update, 2, elements), in_the_plane(name, update_name, 2, elements));
            assert!(
                (error / plane - 1.0).abs() < 1e-4,
                "{name} {update_name} {elements}: {error:e} {plane:e}"
            );
        }
    }
}

/// As in the plane (Fig. 7), the error keeps decreasing, with an order that approaches two.
#[test]
fn the_stress_converges_when_domains_follow_the_deformation() {
    for (method, update) in [
        (Method::Gimp, DomainUpdate::Corners),
        (Method::Gimp, DomainUpdate::Stretch),
        (Method::Gimp, DomainUpdate::DiagonalIncremental),
        (Method::Cpdi1, DomainUpdate::Corners),
        (Method::Cpdi2, DomainUpdate::Corners),
    ] {
        let errors: Vec<f64> = (0..9).map(|k| stress_error(method, update, 2, 1 << k)).collect();
        let orders: Vec<f64> = errors.windows(2).map(|e| (e[0] / e[1]).log2()).collect();
        println!("{method:?} {update:?}: {:.2e}, orders {orders:.2?}", errors[8]);
        assert!(orders.iter().all(|order| *order > 0.9), "{method:?} {update:?}: {orders:?}");
        assert!(orders[5..].iter().all(|order| *order > 1.5), "{method:?} {update:?}: {orders:?}");
    }
}
