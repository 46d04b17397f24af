//! A user-defined constitutive law: elasticity whose bulk modulus grows as the material is compressed.
//!
//! ```sh
//! cargo run --example own_law
//! ```
//!
//! A column of this material settles under its own weight between smooth walls. The balance of forces gives the stress
//! at each depth, and the law gives the strain, so the exact settlement is known.
#![allow(clippy::print_stdout, reason = "a program")]

use mpm::deck::{build::build, load::load_text};
use mpm::material::{Material, MaterialError, Response, StateField};
use mpm::model::Model;
use mpm::points::Points;
use mpm::solver::{Silent, SolveError, Stepper};
use mpm::tensor::{Sym3, Tangent, dyad};

/// τ = K (1 − e^(−a ε_v)) / a I + 2 G dev ε, in the logarithmic elastic strain ε with ε_v = tr ε.
#[derive(Debug, Clone, Copy)]
struct Stiffening {
    /// K at zero strain, [stress].
    bulk: f64,
    /// G, [stress].
    shear: f64,
    /// a, [-].
    growth: f64,
}

impl Stiffening {
    /// Mean stress, [stress], and bulk modulus, [stress], at a volumetric strain.
    fn volumetric(&self, strain: f64) -> (f64, f64) {
        let stiffening = (-self.growth * strain).exp();
        (self.bulk * (1.0 - stiffening) / self.growth, self.bulk * stiffening)
    }
}

impl Material for Stiffening {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        let (mean, bulk) = self.volumetric(trial.trace());
        if !mean.is_finite() {
            return Err(MaterialError::NotFinite);
        }
        let deviator = *trial - Sym3::IDENTITY * (trial.trace() / 3.0);
        let volumetric = dyad(&Sym3::IDENTITY, &Sym3::IDENTITY);
        Ok(Response {
            tau: Sym3::IDENTITY * mean + deviator * (2.0 * self.shear),
            elastic_strain: *trial,
            tangent: Tangent::identity() * (2.0 * self.shear) + volumetric * (bulk - 2.0 / 3.0 * self.shear),
        })
    }

    fn energy(&self, strain: &Sym3, _: &[f64]) -> f64 {
        let (a, volume) = (self.growth, strain.trace());
        let deviator = *strain - Sym3::IDENTITY * (volume / 3.0);
        self.bulk * (volume + ((-a * volume).exp() - 1.0) / a) / a + self.shear * deviator.dot(&deviator)
    }
}

const LAW: Stiffening = Stiffening { bulk: 1e6, shear: 0.4e6, growth: 8.0 };
const HEIGHT: f64 = 20.0;
const WEIGHT: f64 = 2000.0 * 9.81;

/// The law in the deck is a placeholder.
const DECK: &str = r#"
version: 1
title: column
parameters: {h: 1}
grid: {type: structured, origin: [0, 0], size: ["${h}", 20], spacing: "${h}"}
materials: {soil: {model: hencky, young: 1e6, poisson: 0.3, density: 2000}}
bodies:
  - {name: column, material: soil, method: gimp, points_per_cell: 2, shape: {type: box, min: [0, 0], max: ['${h}', 20]}}
boundary_conditions:
  - {name: left, nodes: {x: 0}, fix: [x]}
  - {name: right, nodes: {x: "${h}"}, fix: [x]}
  - {name: floor, nodes: {y: 0}, fix: [y]}
loads:
  - {name: weight, type: gravity, acceleration: [0, -9.81]}
steps: {count: 10}
"#;

fn column(h: f64) -> Option<(Model<2>, Points<2>)> {
    let set = [("h".to_owned(), h.to_string())];
    let (mut model, points) = build(&load_text("column.yaml", DECK.as_bytes(), &set).ok()?).ok()?;
    model.materials[0].law = Box::new(LAW);
    Some((model, points))
}

/// Settlement of the uppermost points, [m].
fn settlement(h: f64) -> Result<f64, SolveError> {
    let Some((model, mut points)) = column(h) else { return Ok(f64::NAN) };
    Stepper::new(&model, &mut points).run(&mut Silent)?;
    let moved = (0..points.len()).map(|p| points.original_position[p][1] - points.converged.position[p][1]);
    Ok(moved.fold(0.0, f64::max))
}

/// The exact settlement from the balance of forces, by bisection for the strain at each depth: with rigid sides, the
/// axial force is the weight above, and the Cauchy stress is e^(−ε) τ.
fn exact_settlement(to: f64) -> f64 {
    let slices = 20_000;
    let strain_under = |weight: f64| {
        let (mut low, mut high) = (-2.0, 0.0f64);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            let axial = LAW.volumetric(middle).0 + 4.0 / 3.0 * LAW.shear * middle;
            *if (-middle).exp() * axial + weight > 0.0 { &mut high } else { &mut low } = middle;
        }
        0.5 * (low + high)
    };
    let slice = to / f64::from(slices);
    let middle = |k: i32| HEIGHT - (f64::from(k) + 0.5) * slice;
    (0..slices).map(|k| slice * (1.0 - strain_under(WEIGHT * middle(k)).exp())).sum()
}

fn main() {
    match settlement(1.0) {
        Ok(found) => {
            println!("settlement {found:.4} m, by the balance of forces {:.4} m", exact_settlement(HEIGHT))
        }
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;

    #[test]
    fn the_column_settles_as_the_balance_of_forces_says() {
        let error = |h: f64| {
            // The uppermost points are a quarter of a cell below the top.
            let exact = exact_settlement(HEIGHT - 0.25 * h);
            (settlement(h).unwrap() / exact - 1.0).abs()
        };
        let errors = [2.0, 1.0, 0.5].map(error);
        // GIMP domains and the number of steps leave an error of a few parts in ten thousand.
        assert!(errors.iter().all(|error| *error < 1e-3), "{errors:?}");
    }

    /// The tangent is the derivative of the stress, and the stress is the derivative of the energy.
    #[test]
    fn the_tangent_is_consistent() {
        let strain = Sym3([-0.1, 0.03, -0.2, 0.05, 0.02, -0.04]);
        let at = |strain: &Sym3| LAW.update(strain, &[], &mut []).unwrap();
        let step = 1e-6;
        for c in 0..6 {
            let shifted = |by: f64| {
                let mut shifted = strain;
                shifted.0[c] += by;
                shifted
            };
            let (high, low) = (shifted(step), shifted(-step));
            let stress = (LAW.energy(&high, &[]) - LAW.energy(&low, &[])) / (2.0 * step);
            assert!((stress - at(&strain).tau.0[c]).abs() < 1e-7 * LAW.bulk);
            for r in 0..6 {
                let entry = (at(&high).tau.0[r] - at(&low).tau.0[r]) / (2.0 * step);
                assert!((entry - at(&strain).tangent[(r, c)]).abs() < 1e-7 * LAW.bulk);
            }
        }
    }
}
