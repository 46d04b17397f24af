//! The force of water at rest: its stiffness, its resultant and its independence of how points are sorted.

use mpm::assembly::Wanted;
use mpm::basis::Method;
use mpm::model::{Water as WaterOfModel, WaterLevel};
use mpm::step::{At, StepContext};
use mpm::stress::{Mechanics, PlaneStrain, Solid};
use mpm::terms::{Sum, Water};

use super::states::{Law, State, random_state};

const METHODS: [Method; 4] = [Method::Mpm, Method::Gimp, Method::Cpdi1, Method::Cpdi2];

/// A random state with a level in the middle of its points.
fn wet<const D: usize, M: Mechanics<D>>(method: Method, level: WaterLevel) -> State<D> {
    let mut state = random_state::<D, M>(method, Law::Hencky, 60, 3);
    let grains = vec![0.6; state.model.materials.len()];
    state.model.water = Some(WaterOfModel { unit_weight: 1e4, levels: vec![(0.0, level)], grains });
    state
}

fn middle<const D: usize>(state: &State<D>) -> f64 {
    let heights = state.points.converged.position.iter().map(|x| x[D - 1]);
    heights.sum::<f64>() / state.points.len() as f64
}

fn water_alone<const D: usize>(state: &State<D>) -> Sum<D> {
    let context = StepContext::first(&state.model, &state.links);
    Sum::begun(vec![Box::new(Water::default())], &context, &state.points).unwrap()
}

fn force<const D: usize>(sum: &mut Sum<D>, state: &mut State<D>, delta_d: &[[f64; D]]) -> Vec<[f64; D]> {
    let State { model, points, links, .. } = state;
    sum.evaluate(&StepContext::first(model, links), points, At::new(delta_d), Wanted::Stiffness).unwrap();
    sum.system().external_force().clone()
}

fn check_derivative<const D: usize, M: Mechanics<D>>() {
    const STEP: f64 = 1e-6;
    for method in METHODS {
        let level = middle(&wet::<D, M>(method, WaterLevel::even(0.0)));
        let mut state = wet::<D, M>(method, WaterLevel::even(level));
        let mut sum = water_alone(&state);
        let base = state.delta_d.clone();
        force(&mut sum, &mut state, &base);
        let n = base.len();
        let mut largest = 0.0f64;
        let mut columns = Vec::new();
        for b in 0..n {
            let mut unit = vec![[0.0; D]; n];
            unit[b][D - 1] = 1.0;
            let mut column = unit.clone();
            sum.system_mut().multiply(&unit, &mut column);
            largest = column.iter().flatten().fold(largest, |most, entry| most.max(entry.abs()));
            columns.push(column);
        }
        assert!(largest > 0.0, "{method:?}: the level cuts no domain");
        for (b, column) in columns.iter().enumerate() {
            let mut shifted = |by: f64| {
                let mut delta_d = base.clone();
                delta_d[b][D - 1] += by;
                force(&mut sum, &mut state, &delta_d)
            };
            let (plus, minus) = (shifted(STEP), shifted(-STEP));
            for a in 0..n {
                for i in 0..D {
                    // The term adds to the external force.
                    let numeric = (minus[a][i] - plus[a][i]) / (2.0 * STEP);
                    let error = (numeric - column[a][i]).abs() / largest;
                    assert!(error < 1e-6, "{method:?}, node {a}, {b}: {error:e}");
                }
            }
        }
    }
}

#[test]
fn the_stiffness_of_water_is_the_derivative_of_its_force() {
    check_derivative::<2, PlaneStrain>();
    check_derivative::<3, Solid>();
}

/// Wholly below the level, water lifts the grains; wholly above, it does nothing. A slope of the level drags along.
#[test]
fn water_lifts_grains_and_drags_the_ground_down_its_slope() {
    for method in METHODS {
        let mut state = wet::<2, PlaneStrain>(method, WaterLevel::even(-1e3));
        let mut sum = water_alone(&state);
        let base = state.delta_d.clone();
        assert!(force(&mut sum, &mut state, &base).iter().flatten().all(|f| *f == 0.0));
        let mut state = wet::<2, PlaneStrain>(method, WaterLevel::line(vec![[-1e3, 200.0], [1e3, 0.0]]));
        let mut sum = water_alone(&state);
        let found = force(&mut sum, &mut state, &base);
        let resultant = |d: usize| found.iter().map(|force| force[d]).sum::<f64>();
        let shares: f64 = (0..state.points.len())
            .map(|p| {
                let mut sum = 0.0;
                state.links.for_each_value(p, |_, value| sum += value);
                sum * 0.6 * 1e4 * state.points.original_volume[p]
            })
            .sum();
        assert!((resultant(1) - shares).abs() < 1e-10 * shares, "{method:?}: {} {shares}", resultant(1));
        let dragged: f64 = (0..state.points.len())
            .map(|p| {
                let mut sum = 0.0;
                state.links.for_each_value(p, |_, value| sum += value);
                sum * 0.1 * 1e4 * state.model.volume(&state.points, p)
            })
            .sum();
        assert!((resultant(0) - dragged).abs() < 1e-10 * dragged, "{method:?}: {} {dragged}", resultant(0));
    }
}

/// The points that the level may cut are evaluated in each iteration, the others once; where the line is drawn does not
/// matter.
#[test]
fn larger_increments_on_the_way_change_nothing() {
    for method in METHODS {
        let level = middle(&wet::<2, PlaneStrain>(method, WaterLevel::even(0.0)));
        let mut state = wet::<2, PlaneStrain>(method, WaterLevel::even(level));
        let base: Vec<[f64; 2]> = state.delta_d.iter().map(|u| u.map(|u| 0.1 * u)).collect();
        let mut sum = water_alone(&state);
        let before = force(&mut sum, &mut state, &base);
        let far: Vec<[f64; 2]> = base.iter().map(|u| u.map(|u| 20.0 * u)).collect();
        force(&mut sum, &mut state, &far);
        let after = force(&mut sum, &mut state, &base);
        let scale = before.iter().flatten().fold(0.0, |most: f64, f| most.max(f.abs()));
        for (before, after) in before.iter().flatten().zip(after.iter().flatten()) {
            assert!((before - after).abs() < 1e-12 * scale, "{method:?}: {before} {after}");
        }
    }
}
