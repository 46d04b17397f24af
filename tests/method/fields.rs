//! Fields of unknowns beside the displacement: multipliers, whose equilibrium is a saddle point, and the backends that a
//! library provides for them.

use std::any::Any;
use std::sync::Arc;

use mpm::assembly::{System, Wanted};
use mpm::basis::Method;
use mpm::dofs::{Field, Fields};
use mpm::grid::Structured;
use mpm::linear::{Backends, Divided, Engine, Engines, Factorisation};
use mpm::material::Hencky;
use mpm::model::{Builder, Fill, Model};
use mpm::points::Points;
use mpm::solver::{Kernels, Silent, SolveError, Stepper};
use mpm::step::{At, StepContext};
use mpm::stress::PlaneStrain;
use mpm::terms::{BeginError, Character, EvaluateError, Term};

const YOUNG: f64 = 1e6;
const POISSON: f64 = 0.3;
/// Bulk modulus that the pressure adds, [force/length²].
const BULK: f64 = 1e8;
/// Strain along y, [-]; the sides are held.
const STRAIN: f64 = -1e-7;

/// A pressure field that keeps the volume: ∫ N_a (div Δd − p/κ) dV = 0, with the force ∫ p ∇N_a dV.
struct KeptVolume;

impl Term<2, 3> for KeptVolume {
    fn name(&self) -> &'static str {
        "kept volume"
    }

    fn character(&self, _: &Model<2>) -> Character {
        Character::SMOOTH
    }

    fn begin(&mut self, _: &StepContext<2>, _: &Points<2>) -> Result<(), BeginError> {
        Ok(())
    }

    fn evaluate(
        &mut self,
        step: &StepContext<2>,
        points: &mut Points<2>,
        at: At<3>,
        wanted: Wanted,
        sum: &mut System<3>,
    ) -> Result<(), EvaluateError> {
        for group in 0..step.links.n_groups() {
            let nodes = step.links.nodes_of(group);
            for p in step.links.points_of(group) {
                let (mut links, volume) = (Vec::new(), points.original_volume[p]);
                step.links.for_each_link(p, |local, value, gradient| {
                    links.push((nodes[local] as usize, value, *gradient));
                });
                let (mut pressure, mut growth) = (0.0, 0.0);
                for (node, value, gradient) in &links {
                    let u = at.delta_d[*node];
                    pressure += value * u[2];
                    growth += gradient[0] * u[0] + gradient[1] * u[1];
                }
                for &(row, value, row_slope) in &links {
                    let force = &mut sum.internal_force_mut()[row];
                    (0..2).for_each(|d| force[d] += volume * pressure * row_slope[d]);
                    force[2] += volume * value * (growth - pressure / BULK);
                    for &(column, column_value, column_slope) in &links {
                        if wanted == Wanted::Stiffness
                            && let Some(place) = sum.place(row, column)
                        {
                            let mut block = [[0.0; 3]; 3];
                            for d in 0..2 {
                                block[d][2] = volume * row_slope[d] * column_value;
                                block[2][d] = volume * value * column_slope[d];
                            }
                            block[2][2] = -volume * value * column_value / BULK;
                            sum.add_block(place, &block);
                        }
                    }
                }
            }
        }
        Ok(())
    }
}

/// A block between rigid sides, compressed from above in one step.
fn block() -> (Model<2>, Points<2>) {
    let fill = Fill { method: Method::Mpm, points_per_cell: 4, ..Fill::default() };
    Builder::new(Structured::new([0.0; 2], [0.5; 2], [4, 6]))
        .material("clay", Hencky::new(YOUNG, POISSON))
        .body("block", "clay", fill, |x| x[0] < 2.0 && x[1] < 2.0)
        .fix("sides", [true, false], |x| x[0] == 0.0 || x[0] == 2.0)
        .fix("floor", [false, true], |x| x[1] == 0.0)
        .prescribe("top", [None, Some(2.0 * STRAIN)], |x| x[1] == 2.0)
        .steps(1)
        .build()
        .unwrap()
}

fn stepper<'a>(
    model: &'a Model<2>,
    points: &'a mut Points<2>,
    pressure: Field,
) -> Result<Stepper<'a, 2, 3>, SolveError> {
    let fields = Fields::displacement(2).and_field(pressure);
    Stepper::with_fields(model, points, Kernels::new::<PlaneStrain>(), fields)?
        .with_terms(vec![Box::new(KeptVolume)])
}

/// The matrix of a saddle point is indefinite, and shows an instability only if nobody has declared it. The pressure
/// adds its modulus to that of the law.
#[test]
fn a_saddle_point_is_no_instability() {
    let pressure = Field::new("pressure", 1).with_units("force/length²", "volume");
    for is_declared in [true, false] {
        let (model, mut points) = block();
        let pressure = if is_declared { pressure.clone().as_multiplier() } else { pressure.clone() };
        let mut stepper = stepper(&model, &mut points, pressure).unwrap();
        let report = stepper.step(&mut Silent).unwrap().unwrap().clone();
        let modulus = YOUNG * (1.0 - POISSON) / ((1.0 + POISSON) * (1.0 - 2.0 * POISSON)) + BULK;
        let expected = modulus * STRAIN * 2.0;
        assert!((report.reactions[2][1] / expected - 1.0).abs() < 1e-6, "{:?}", report.reactions);
        for p in &report.grid.further[0].values {
            assert!((p / (BULK * STRAIN) - 1.0).abs() < 1e-6, "{p}");
        }
        assert_eq!(report.field_residuals.len(), 2);
        assert!(report.field_residuals.iter().all(|r| *r <= model.newton.tolerance));
        assert!(report.factorisations.contains(&Factorisation::Ldlt), "{:?}", report.factorisations);
        assert_eq!(report.is_unstable, !is_declared);
        assert_eq!(stepper.reached().summary.indefinite_solves == 0, is_declared);
    }
}

/// Damping looks for a minimum, so it is refused.
#[test]
fn multipliers_are_not_damped() {
    let (mut model, mut points) = block();
    model.stepping.damping = true;
    let refused = stepper(&model, &mut points, Field::new("pressure", 1).as_multiplier()).err().unwrap();
    assert!(refused.to_string().contains("damped"), "{refused}");
}

/// A library with solvers for three components at each node, or only for the displacement.
#[derive(Debug)]
struct Library {
    has_further: bool,
}

impl Engine<2> for Library {
    fn backends(&self) -> Backends<2> {
        Backends::default()
    }

    fn backends_with_fields(&self, components: usize) -> Option<Box<dyn Any>> {
        let direct = Box::new(Divided::<2, 3>::default());
        let backends = Backends::<2, 3> { direct: Some(direct), ..Backends::default() };
        (self.has_further && components == 3).then(|| Box::new(backends) as _)
    }
}

/// A library that has no solver for the number of components is not replaced in silence.
#[test]
fn a_library_without_solvers_for_the_fields_is_refused() {
    let pressure = Field::new("pressure", 1).as_multiplier();
    for has_further in [true, false] {
        let (mut model, mut points) = block();
        model.engines = Engines(Some(Arc::new(Library { has_further })));
        match stepper(&model, &mut points, pressure.clone()) {
            Ok(mut stepper) => assert!(has_further && stepper.step(&mut Silent).unwrap().is_some()),
            Err(error) => assert!(!has_further && error.to_string().contains("3 unknowns"), "{error}"),
        }
    }
}
