//! Advice on failed runs.

use mpm_core::solver::{Circumstances, Diagnosis, Kind, Loss};

use super::{Means, against};
use crate::quoting::quote;

/// Advice on the probable cause of a failure.
pub fn on_failure(diagnosis: &Diagnosis, means: &Means) -> String {
    let advice = by_kind(diagnosis, means);
    match means.cohesionless.first().filter(|_| may_lack_cohesion(diagnosis)) {
        Some(material) => format!(
            "give the material {} a small `cohesion`, about 1 % of the largest stress: without cohesion, points at a free \
             surface have no stiffness once they yield. If that does not help, {advice}",
            quote(material)
        ),
        None => advice,
    }
}

/// True if points have yielded and the failure is of a kind that points without stiffness may cause.
fn may_lack_cohesion(diagnosis: &Diagnosis) -> bool {
    let is_about_stiffness = matches!(
        diagnosis.kind,
        Kind::RigidBodyMode
            | Kind::SmallCutCell
            | Kind::PlasticCollapse
            | Kind::Flow
            | Kind::Instability
            | Kind::Hourglass
            | Kind::LargeSteps
            | Kind::ElementInversion
            | Kind::Unknown
    );
    is_about_stiffness && diagnosis.flowing > 0.0
}

/// Advice that depends on the kind of the failure and its circumstances.
fn by_kind(diagnosis: &Diagnosis, means: &Means) -> String {
    let at = &diagnosis.circumstances;
    let advice = advice(diagnosis.kind, at, means);
    match diagnosis.kind {
        Kind::Creeping => match at.enough_iterations {
            Some(enough) => {
                format!("allow more iterations, `solver: {{max_iterations: {enough}}}`, or use smaller steps")
            }
            None => advice.to_owned(),
        },
        Kind::PlasticCollapse if at.has_few_points => format!(
            "use more points per cell (4 in the plane, 8 in space): a body with one per cell may collapse early; \
             {advice}"
        ),
        Kind::PlasticCollapse | Kind::LargeSteps if at.precedes_reduction => format!(
            "{advice}. If the bodies fail under this load before their strength is reduced, their factor of safety is below 1: \
             multiply `cohesion`, the tangent of `friction_angle` and every other strength by a number, and divide the \
             factor that the reduction finds by this number"
        ),
        Kind::Hourglass | Kind::Locking if at.is_in_collapse => format!(
            "{advice}; since most points have yielded, the load may also exceed what the bodies can carry"
        ),
        _ => advice.to_owned(),
    }
}

fn advice(kind: Kind, at: &Circumstances, means: &Means) -> &'static str {
    let has_no_path = means.is_known && !means.can_follow_path;
    match kind {
        Kind::RigidBodyMode => {
            "hold every part of the bodies along every axis and against rotation; a body that only contact holds must touch \
             at the start, or move with inertia (`dynamic: {}`)"
        }
        Kind::FreeTool => {
            "place and load the tool so that the bodies resist its motion in every free component (by friction where it turns or \
             slides); or prescribe some of these components"
        }
        Kind::SmallCutCell if at.is_stabilised => {
            "use a larger `stabilisation: {parameter}`, more points per cell, or another grid"
        }
        Kind::SmallCutCell => {
            "stabilise such cells, `analysis: {stabilisation: {mode: auto}}`; or use more points per cell, or another grid"
        }
        Kind::Sliding => {
            "the last step in equilibrium shows about the largest load that contact holds; to go on, prescribe the motion of \
             the bodies or the tool in place of the load, give the tools more `friction` or `adhesion`, or hold the bodies"
        }
        Kind::PlasticCollapse | Kind::Instability if at.is_driven => {
            "use smaller steps (`steps: {count, smallest}`) or a coarser grid, because the region that flows plastically \
             changes with the prescribed motion"
        }
        Kind::Flow if at.is_driven => {
            "use smaller steps (`steps: {count, smallest}`), more viscosity (`steps: {viscosity: 0.05}`), or a coarser grid"
        }
        Kind::Flow => "use smaller steps (`steps: {count, smallest}`) or a coarser grid",
        Kind::Friction => {
            "use smaller steps (`steps: {count, smallest}`), a finer grid along the tool, or `friction: rough` if the surfaces \
             hardly slide"
        }
        Kind::Contact => {
            "use smaller steps (`steps: {count, smallest}`), or more points per cell or `method: cpdi2` for the body, so that \
             more contact points follow the surface of the tool"
        }
        Kind::PlasticCollapse if has_no_path => {
            "the bodies collapse at about the largest load factor with equilibrium; check how this factor changes with \
             more points per cell and a finer grid. To continue beyond it, prescribe displacements"
        }
        Kind::PlasticCollapse => {
            "the bodies collapse at about the largest load factor with equilibrium; check how this factor changes with \
             more points per cell and a finer grid. To continue beyond it, prescribe displacements or use `steps: \
             {control: {type: arc-length}}`"
        }
        Kind::Instability if has_no_path => {
            "use smaller steps (`steps: {count, smallest}`), or prescribe displacements"
        }
        Kind::Instability => {
            "follow the path with `steps: {control: {type: arc-length}}`, or prescribe displacements"
        }
        Kind::Locking if at.has_standard_dilatation => {
            "use `strain: mean-dilatation` for the bodies that hardly change their volume"
        }
        Kind::Locking => "use a finer grid with fewer points per cell, or a more compressible material",
        Kind::Hourglass => {
            "use more points per cell (4 in the plane, 8 in space), or `analysis: {stabilisation: {mode: on}}`"
        }
        Kind::Creeping => "allow more iterations, `solver: {max_iterations}`, or use smaller steps",
        Kind::LargeSteps if at.cut_to.is_some() => {
            "check that the bodies can carry the first part of the load: soil without cohesion yields under any load; \
             otherwise use still smaller steps (`steps: {count, smallest}`)"
        }
        Kind::LargeSteps => {
            "use smaller steps: a larger `steps: {count}`, and a small `smallest` such as 1e-3, so that steps that fail are cut"
        }
        Kind::RefusedByLaw => {
            "use smaller steps (`steps: {count, smallest}`), and check the properties of the material and the range of \
             strains that its law accepts"
        }
        Kind::ElementInversion => "use smaller steps (`steps: {count, smallest}`) or a coarser grid",
        Kind::LostDomain => match at.loss {
            Some(Loss::Torn { is_replaceable: true }) => {
                "leave `steps: {damping}` out, so that torn domains are replaced; or use more points per cell, or `method: gimp`"
            }
            Some(Loss::Torn { .. }) => {
                "use a larger grid if the domain reaches outside it; otherwise use more points per cell, smaller steps \
                 (`steps: {count, smallest}`), or `method: gimp`"
            }
            Some(Loss::Collapsed) => {
                "use `domain_update: corners`, or smaller steps (`steps: {count, smallest}`) with \
                 `diagonal-incremental`"
            }
            Some(Loss::OffGrid) | None => "make the grid larger, or use another method or domain update",
        },
        Kind::LostPath => {
            "use a different number of steps, or another control (`type: displacement` with another probe, or `arc-length`)"
        }
        Kind::BadScaling if at.has_one_material => {
            "check that units, loads and cell size fit together, and that Poisson's ratio is not close to 0.5 or -1"
        }
        Kind::BadScaling => {
            "give the stiffest material a modulus that is at most about 1e6 times that of the softest, or, to model a rigid \
             part, prescribe its motion with a boundary condition"
        }
        Kind::Setting => at.obstacle.map_or(
            "change what the error names, which no step size removes (its reason is in `summary.json`)",
            against,
        ),
        Kind::Unknown => {
            "use smaller steps (`steps: {count, smallest}`), and check that loads and boundary conditions do not contradict \
             each other"
        }
    }
}
