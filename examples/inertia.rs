//! A user-defined term, implemented outside the library: inertia, integrated in time by the rule of Newmark with
//! constant average acceleration.
//!
//! ```sh
//! cargo run --example inertia
//! ```
//!
//! A bar flies across the cells of a grid and vibrates. Velocity and acceleration are fields of the points, which follow
//! the grid but are never transferred to it, so nothing is lost between points and grid. The rule conserves energy: in a
//! step, m (a₀ + a₁)/2 · Δu is exactly the growth of ½ m v².
#![allow(clippy::print_stdout, reason = "a program")]

use mpm::assembly::{System, Wanted};
use mpm::basis::Method;
use mpm::grid::Structured;
use mpm::material::{Material, MaterialError, Response, StateField};
use mpm::model::{BuildError, Builder, Fill, Model};
use mpm::points::{FieldError, FieldHandle, FieldKind, PointFieldSpec, Points};
use mpm::solver::{Silent, SolveError, Stepper, Summary};
use mpm::step::{At, Nodal, StepContext};
use mpm::tensor::{Sym3, dyad};
use mpm::terms::{BeginError, Character, EvaluateError, Ledger, NamedEnergy, Term};

/// Inertia of the points: the external force −m a.
struct Inertia {
    velocity: FieldHandle,
    acceleration: FieldHandle,
    /// −m a on the active nodes at the start of the step, [force].
    at_start: Nodal<2>,
    /// Work that inertia takes from the loads in the step, [energy].
    work: f64,
}

impl Inertia {
    /// Declares velocity, [length/time], and acceleration, [length/time²]; they start with these values for each point.
    fn new(
        points: &mut Points<2>,
        velocity: impl Fn([f64; 2]) -> [f64; 2],
        acceleration: [f64; 2],
    ) -> Result<Inertia, FieldError> {
        let mut order: Vec<usize> = (0..points.len()).collect();
        order.sort_by_key(|p| points.id[*p]);
        let v = order.iter().flat_map(|p| velocity(points.converged.position[*p])).collect();
        let a = order.iter().flat_map(|_| acceleration).collect();
        let mut declare = |name: &str, unit: &str, start| {
            let (name, unit) = (name.to_owned(), unit.to_owned());
            points.declare(PointFieldSpec { name, unit, components: 2, kind: FieldKind::Motion, start })
        };
        let velocity = declare("velocity", "length/time", v)?;
        let acceleration = declare("acceleration", "length/time^2", a)?;
        Ok(Inertia { velocity, acceleration, at_start: Vec::new(), work: 0.0 })
    }

    /// Kinetic energy ½ Σ m v² for these velocities, [energy].
    fn kinetic(points: &Points<2>, velocity: &[f64]) -> f64 {
        let kinetic = |(v, m): (&[f64], &f64)| 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
        velocity.chunks_exact(2).zip(&points.mass).map(kinetic).sum()
    }
}

/// Calls `visit` with each point, and with the active nodes that it touches and the values of their basis functions.
fn for_each_point(step: &StepContext<2>, mut visit: impl FnMut(usize, &[(usize, f64)])) {
    let mut links = Vec::new();
    for group in 0..step.links.n_groups() {
        let nodes = step.links.nodes_of(group);
        for p in step.links.points_of(group) {
            links.clear();
            step.links.for_each_value(p, |local, value| links.push((nodes[local] as usize, value)));
            visit(p, &links);
        }
    }
}

impl Term<2> for Inertia {
    fn name(&self) -> &'static str {
        "inertia"
    }

    // A body in motion needs no support.
    fn character(&self, _: &Model<2>) -> Character {
        Character { may_hold: true, ..Character::SMOOTH }
    }

    fn begin(&mut self, step: &StepContext<2>, points: &Points<2>) -> Result<(), BeginError> {
        self.at_start = vec![[0.0; 2]; step.links.n_active()];
        let acceleration = points.further.converged(self.acceleration);
        for_each_point(step, |p, links| {
            for &(node, value) in links {
                for d in 0..2 {
                    self.at_start[node][d] -= value * points.mass[p] * acceleration[2 * p + d];
                }
            }
        });
        Ok(())
    }

    // The nodes of a point are in the same group, so the term couples no further nodes.
    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<2>,
        wanted: Wanted,
        sum: &mut System<2>,
    ) -> Result<(), EvaluateError> {
        let dt = step.step.duration();
        self.work = 0.0;
        for_each_point(step, |p, links| {
            let m = points.mass[p];
            let mut scale = [0.0; 2];
            for d in 0..2 {
                let du: f64 = links.iter().map(|(node, value)| value * at.delta_d[*node][d]).sum();
                let [v0, a0] = [self.velocity, self.acceleration]
                    .map(|field| points.further.converged(field)[2 * p + d]);
                let a1 = 4.0 * (du - dt * v0) / (dt * dt) - a0;
                let v1 = v0 + 0.5 * dt * (a0 + a1);
                points.further.trial_mut(self.velocity)[2 * p + d] = v1;
                points.further.trial_mut(self.acceleration)[2 * p + d] = a1;
                self.work += 0.5 * m * (a0 + a1) * du;
                for &(node, value) in links {
                    sum.external_force_mut()[node][d] -= value * m * a1;
                }
                // The force that would stop the point within the step: in free flight, nothing else has a size.
                scale[d] = m * (a1.abs() + v1.abs() / dt);
            }
            for &(node, value) in links {
                sum.add_scale(node, &scale.map(|force| value * force));
            }
            if wanted == Wanted::Force {
                return;
            }
            for &(row, row_value) in links {
                for &(column, column_value) in links {
                    // A symmetric system stores only the lower triangle.
                    if let Some(place) = sum.place(row, column) {
                        let k = 4.0 * m / (dt * dt) * row_value * column_value;
                        sum.add_block(place, &[[k, 0.0], [0.0, k]]);
                    }
                }
            }
        });
        Ok(())
    }

    fn force_at_start(&self, force: &mut Nodal<2>) {
        for (sum, own) in force.iter_mut().flatten().zip(self.at_start.iter().flatten()) {
            *sum += own;
        }
    }

    // As external forces, those of inertia take their work from the external work; it becomes kinetic energy.
    fn ledger(&self, _: &StepContext<2>, points: &Points<2>, _: At<2>) -> Ledger {
        let velocities = [points.further.converged(self.velocity), points.further.trial(self.velocity)];
        Ledger::from([
            NamedEnergy::stored("kinetic", velocities.map(|v| Inertia::kinetic(points, v))),
            NamedEnergy::supplied("inertia", self.work),
        ])
    }
}

/// τ = E (J − 1) J I. In a motion along one axis the force is linear in the displacement, so the work of a step by the
/// trapezoidal rule is exactly the growth of the stored energy ½ E (J − 1)².
#[derive(Debug, Clone, Copy)]
struct Spring(f64);

impl Material for Spring {
    fn state_fields(&self) -> &[StateField] {
        &[]
    }

    fn update(&self, trial: &Sym3, _: &[f64], _: &mut [f64]) -> Result<Response, MaterialError> {
        let j = trial.trace().exp();
        if !j.is_finite() {
            return Err(MaterialError::NotFinite);
        }
        Ok(Response {
            tau: Sym3::IDENTITY * (self.0 * (j - 1.0) * j),
            elastic_strain: *trial,
            tangent: dyad(&Sym3::IDENTITY, &Sym3::IDENTITY) * (self.0 * (2.0 * j - 1.0) * j),
        })
    }

    fn energy(&self, strain: &Sym3, _: &[f64]) -> f64 {
        0.5 * self.0 * (strain.trace().exp() - 1.0).powi(2)
    }
}

/// Length of the bar, from x = 1, [m]; its wave speed is √(E/ρ) = 10 m/s.
const LENGTH: f64 = 2.0;
const YOUNG: f64 = 1e5;
const DENSITY: f64 = 1e3;

/// The bar on a grid of cells of half a metre, analysed for this time, [s]; `guides` says which axes are held.
fn bar(steps: usize, end: f64, guides: [bool; 2]) -> Result<(Model<2>, Points<2>), BuildError> {
    let fill = Fill { method: Method::Gimp, points_per_cell: 2, density: DENSITY, ..Fill::default() };
    let (mut model, points) = Builder::new(Structured::new([0.0, -1.0], [0.5; 2], [16, 4]))
        .material("spring", Spring(YOUNG))
        .body("bar", "spring", fill, |x| (1.0..1.0 + LENGTH).contains(&x[0]) && x[1].abs() < 0.5)
        .fix("guides", guides, |_| true)
        .steps(steps)
        .build()?;
    model.stepping.end_time = end;
    model.newton.tolerance = 1e-12;
    Ok((model, points))
}

/// Runs the bar with these velocities and this acceleration at the start.
fn run(
    model: &Model<2>,
    points: &mut Points<2>,
    velocity: impl Fn([f64; 2]) -> [f64; 2],
    acceleration: [f64; 2],
    mut watch: impl FnMut(&Summary),
) -> Result<Summary, SolveError> {
    let inertia = Inertia::new(points, velocity, acceleration)
        .map_err(|error| SolveError::Term { term: "inertia".to_owned(), reason: error.to_string() })?;
    let mut stepper = Stepper::new(model, points).with_terms(vec![Box::new(inertia)])?;
    while stepper.step(&mut Silent)?.is_some() {
        watch(&stepper.reached().summary);
    }
    Ok(stepper.reached().summary.clone())
}

/// Kinetic and elastic energy after each step, [J], and the summary.
type Flight = (Vec<[f64; 2]>, Summary);

/// The flight of the vibrating bar along x.
fn vibrate(steps: usize) -> Result<Flight, Box<dyn std::error::Error>> {
    let (model, mut points) = bar(steps, 1.6, [false, true])?;
    let phase = |x: f64| (x - 1.0) * std::f64::consts::PI / LENGTH;
    let mut energies = Vec::new();
    let summary = run(
        &model,
        &mut points,
        |[x, _]| [1.5 + phase(x).cos(), 0.0],
        [0.0; 2],
        |summary| {
            energies.push([summary.further_energies[0].amount.value(), summary.strain_energy]);
        },
    )?;
    Ok((energies, summary))
}

fn main() {
    match vibrate(200) {
        Ok((energies, summary)) => {
            for [kinetic, elastic] in energies.iter().step_by(10) {
                println!("kinetic {kinetic:9.3} J, elastic {elastic:9.3} J");
            }
            println!("unexplained: {:.1e} J", summary.unexplained_energy());
        }
        Err(error) => println!("{error}"),
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
    use super::*;
    use mpm::model::{Action, Load, LoadCurve};

    #[test]
    fn the_ledger_closes() {
        let (energies, summary) = vibrate(200).unwrap();
        let largest = |k: usize| energies.iter().map(|energy| energy[k]).fold(0.0, f64::max);
        println!("kinetic {}, elastic {}", largest(0), largest(1));
        println!("unexplained {:e}, regridding {:e}", summary.unexplained_energy(), summary.regridding_work);
        // The vibration turns into elastic energy and back, while the bar crosses cells.
        assert!(largest(1) > 0.1 * largest(0), "{energies:?}");
        assert!(
            summary.unexplained_energy().abs() < 1e-12 * largest(0),
            "{:e}",
            summary.unexplained_energy()
        );
        // Inertia gives as much as becomes kinetic energy.
        let [kinetic, inertia] = [0, 1].map(|k| summary.further_energies[k].amount.growth());
        assert!((kinetic - inertia).abs() < 1e-12 * largest(0), "{kinetic} {inertia}");
    }

    #[test]
    fn free_flight_is_exact() {
        let (mut model, mut points) = bar(8, 0.25, [false; 2]).unwrap();
        let (gravity, name) = ([3.0, -9.81], "weight".to_owned());
        let curve = LoadCurve::table(vec![[0.0, 1.0], [0.25, 1.0]]);
        model.loads.push(Load { name, action: Action::Gravity(gravity), acts_on: vec![true], curve });
        let start = points.converged.position.clone();
        let id = points.id.clone();
        let velocity = [3.0, 1.0];
        run(&model, &mut points, |_| velocity, gravity, |_| ()).unwrap();
        let field = points.field("velocity").unwrap().values;
        for (p, x) in points.converged.position.iter().enumerate() {
            let before = start[id.iter().position(|other| *other == points.id[p]).unwrap()];
            for d in 0..2 {
                let expected = before[d] + 0.25 * velocity[d] + 0.5 * 0.25 * 0.25 * gravity[d];
                assert!((x[d] - expected).abs() < 5e-14, "{} {expected}", x[d]);
            }
        }
        for v in field.chunks_exact(2) {
            (0..2).for_each(|d| assert!((v[d] - velocity[d] - 0.25 * gravity[d]).abs() < 5e-14, "{v:?}"));
        }
    }
}
