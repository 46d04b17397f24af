#![allow(warnings)]
use mpm_core::basis::Method;
use mpm_core::domain::DomainUpdate;
use mpm_core::grid::Structured;
use mpm_core::material::*;
use mpm_core::model::*;
use mpm_core::points::Points;
use mpm_core::solver::{Silent, Stepper};
use mpm_core::stress::CellStrain;

fn report<const D: usize>(name: &str, model: &Model<D>, points: &mut Points<D>)
where
    Model<D>: mpm_core::solver::Solvable<D>,
{
    let start = points.momentum(|_| true);
    let total0 = start.kinetic;
    let mut cells = points.cell.clone();
    let mut ids = points.id.clone();
    let mut crossings = 0;
    let mut its = 0;
    let mut worst: f64 = 0.0;
    let mut worst_defect: f64 = 0.0;
    let n = points.len();
    let mut cell_of = vec![0u32; n];
    let mut stepper = Stepper::new(model, points);
    for p in 0..n {
        cell_of[stepper.points().id[p] as usize] = stepper.points().cell[p];
    }
    let t = std::time::Instant::now();
    let mut all = 0.0;
    loop {
        match stepper.step(&mut Silent) {
            Ok(Some(r)) => {
                its += r.residuals.len() - 1;
                if std::env::var("V").is_ok() {
                    println!("   {:?} {:?}", r.step, r.residuals);
                }
            }
            Ok(None) => break,
            Err(e) => {
                println!("{name}: {e}");
                break;
            }
        }
        let pts = stepper.points();
        for p in 0..n {
            let id = pts.id[p] as usize;
            if cell_of[id] != pts.cell[p] {
                crossings += 1;
                cell_of[id] = pts.cell[p];
            }
        }
        let s = &stepper.reached().summary;
        worst = worst.max(s.unexplained_energy().abs());
        for e in &s.further_energies {
            if e.name == "defect" {
                worst_defect = worst_defect.max(e.amount.value().abs());
            }
            if e.name == "kinetic" && all == 0.0 {
                if let mpm_core::terms::Amount::State { start, .. } = e.amount {
                    all = start;
                }
            }
        }
    }
    let s = stepper.reached().summary.clone();
    let end = stepper.points().momentum(|_| true);
    let scale = total0.max(s.gross_work);
    println!(
        "{name}: steps {} iterations {its} crossings {crossings} time {:.2}s failed {}",
        s.steps,
        t.elapsed().as_secs_f64(),
        s.failed_attempts
    );
    println!(
        "   K {:.6e} -> {:.6e}  elastic {:.3e}  unexplained {:.2e} defect {:.2e} (relative to {scale:.3e})",
        start.kinetic,
        end.kinetic,
        s.strain_energy,
        worst / scale,
        worst_defect / scale
    );
    for e in &s.further_energies {
        println!("   {} {:?}", e.name, e.amount);
    }
    println!("   stabilisation {:.3e} external {:.6e}", s.stabilisation_work, s.external_work);
    let size = start.mass * start.speed.max(end.speed);
    let dl = (0..3).map(|d| (end.linear[d] - start.linear[d]).abs()).fold(0.0, f64::max);
    println!(
        "   momentum {:.2e}  angular {:.9} -> {:.9} ({:.2e})",
        dl / size,
        start.angular[2],
        end.angular[2],
        (end.angular[2] - start.angular[2]) / start.angular[2]
    );
}

fn block(
    method: Method,
    update: DomainUpdate,
    steps: usize,
    end: f64,
    spin: f64,
    fly: [f64; 2],
    strain: CellStrain,
    scheme: Scheme,
) -> (Model<2>, Points<2>) {
    let fill = Fill {
        method,
        domain_update: update,
        points_per_cell: 2,
        density: 1000.0,
        strain,
        ..Fill::default()
    };
    let (mut model, mut points) = Builder::new(Structured::new([0.0, 0.0], [0.25; 2], [24, 24]))
        .material("rubber", Hencky::new(1e6, 0.3))
        .body("block", "rubber", fill, |x| (1.0..2.0).contains(&x[0]) && (1.5..2.5).contains(&x[1]))
        .steps(steps)
        .build()
        .unwrap();
    model.stepping.end_time = end;
    model.stepping.smallest = 0.01;
    model.newton.tolerance = 1e-11;
    model.stepping.dynamics = Some(Dynamics { scheme, ..Dynamics::default() });
    let x: Vec<[f64; 2]> = points.converged.position.clone();
    points.set_velocity(|p| [fly[0] - spin * (x[p][1] - 2.0), fly[1] + spin * (x[p][0] - 1.5)]);
    (model, points)
}

fn main() {
    let arg: Vec<String> = std::env::args().collect();
    let which = arg.get(1).map(|s| s.as_str()).unwrap_or("all");
    let cases = [
        ("mpm", Method::Mpm, DomainUpdate::default()),
        ("gimp", Method::Gimp, DomainUpdate::default()),
        ("cpdi1", Method::Cpdi1, DomainUpdate::default()),
        ("cpdi2", Method::Cpdi2, DomainUpdate::default()),
    ];
    if which == "all" || which == "flight" {
        for (name, method, update) in cases {
            let (m, mut p) =
                block(method, update, 100, 0.5, 5.0, [4.0, 1.0], CellStrain::Standard, Scheme::Midpoint);
            report(&format!("flight {name}"), &m, &mut p);
        }
        let (m, mut p) = block(
            Method::Cpdi2,
            DomainUpdate::default(),
            100,
            0.5,
            5.0,
            [4.0, 1.0],
            CellStrain::MeanDilatation,
            Scheme::Midpoint,
        );
        report("flight cpdi2 mean dilatation", &m, &mut p);
        for scheme in [Scheme::BackwardEuler, Scheme::GeneralisedAlpha { spectral_radius: 0.8 }] {
            let (m, mut p) = block(
                Method::Cpdi2,
                DomainUpdate::default(),
                100,
                0.5,
                5.0,
                [4.0, 1.0],
                CellStrain::Standard,
                scheme,
            );
            report(&format!("flight cpdi2 {scheme:?}"), &m, &mut p);
        }
    }
}
