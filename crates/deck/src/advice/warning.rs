//! Advice on warnings of a run.

use mpm_core::quality::{Code, Detail, Warning};

use super::Means;
use crate::Method;

/// Advice on a warning.
pub fn on_warning(warning: &Warning, means: &Means) -> String {
    let advice = match (warning.code, warning.detail) {
        (Code::HiddenResidual, Some(Detail::Tolerance(tolerance))) => {
            return format!("use a smaller tolerance, `solver: {{tolerance: {tolerance:.0e}}}`");
        }
        (Code::HiddenResidual, Some(Detail::RoundOff)) => {
            "analyse this body separately: the forces on the other bodies are so much larger that round-off hides its \
             residual"
        }
        (Code::HiddenResidual, _) => "use a smaller tolerance, `solver: {tolerance}`",
        (Code::DomainUpdate, _) => "use `domain_update: corners`",
        (Code::DomainOutside | Code::PartitionOfUnity, Some(Detail::ReachingBox)) => {
            "use a larger grid or `domain_update: corners`, which keeps domains inside the body"
        }
        (Code::DomainOutside | Code::PartitionOfUnity, _) => "use a larger grid",
        (Code::Factorised, _) => {
            "the results are not affected; to save memory and time, find out why the iterative solver fails (`mpm explain \
             W004`)"
        }
        (Code::Apart, _) => {
            "from this step on, the results are those of separate parts: end the analysis before this step, or use a \
             coarser grid, more points per cell, or `method: cpdi2`, whose domains stretch with the material"
        }
        (Code::LeftNodes | Code::PassedNodes, _) => return on_left_nodes(warning, means),
        (Code::AcrossGap, _) => {
            "use a finer grid: bodies are joined wherever they share a node, even across a gap of up to two cells; the \
             forces between these bodies are not contact forces"
        }
        (Code::Regridding, _) => return on_regridding(means),
        (Code::Energy, _) => {
            "use more load steps (`steps: count`): the error of the balance decreases with the square of the step size"
        }
        (Code::Crossings, _) => {
            "use `method: gimp` or `method: cpdi2`, or a grid so coarse that points stay in their cells"
        }
        (Code::TurnedBoxes, _) => "use `method: cpdi2`, whose domains turn with the body",
        (Code::Locking, Some(Detail::StandardDilatation)) => {
            "use `strain: mean-dilatation` for the bodies that yield; it prevents locking with any method and any \
             number of points"
        }
        (Code::Locking, Some(Detail::DilatingFlow)) => {
            "use `strain: mean` for the bodies that yield: it requires the flow rule only once per cell"
        }
        (Code::Locking, _) => {
            "do not rely on the pressures of single points; use `output: {fields: [pressure_smoothed]}`, and compare \
             grids"
        }
        (Code::Damped, _) if means.is_known && !means.can_follow_path => {
            "note the largest load or reaction before this step, and use more load steps (`steps: count`) to locate it; with \
             `steps: {damping: false}` the run stops instead"
        }
        (Code::Damped, _) => {
            "note the largest load before this step, and follow the path with `steps: {control: {type: arc-length}}`; with \
             `steps: {damping: false}` the run stops instead"
        }
        (Code::ReplacedDomains, _) => {
            "inspect this location in the VTU files; use more load steps, or a finer or larger grid"
        }
        (Code::Stiffened, _) => {
            "use a finer grid, because up to one row of cells moves with the stiff body; or replace the stiff body by a \
             boundary condition on these nodes"
        }
        (Code::Crawls, _) => {
            "change what the cause names; `steps: {smallest: 0.05}` ends such a run with a diagnosis at the first step \
             below this size"
        }
        (Code::Viscous, _) => {
            "repeat the run with a smaller `steps: {viscosity}` or with more steps: the overstress is proportional to \
             `viscosity` and to the size of a step. A little cohesion, or a dilation angle closer to the friction angle, makes \
             such flow easier to follow; with `viscosity: 0` the run stops instead"
        }
        (Code::TimeIntegration, _) => {
            "use shorter steps: a smaller `size` under `steps`, or a smaller `error` under `dynamic`; the error falls with the \
             square of the step"
        }
        (Code::Unstable, _) => {
            "disturb the bodies with a small load or an imperfection and compare; more load steps show where the path \
             branches; if cells hold one point each, use more points, because this may be an hourglass mode"
        }
        (Code::Slides, _) => {
            "use the smaller of these factors as the factor of safety, not the last one with equilibrium. Plot displacement \
             against the factor (`mpm report`), and bring the two factors closer together with a smaller `tolerance` of the \
             control. With smaller cells, a slope that has slid is less likely to come to rest again; with a larger \
             `young`, the bodies settle very little before they slide"
        }
        (Code::Slumped, _) => {
            "the factor of safety of the original shape is below 1 if the bodies slumped at full strength: multiply \
             `cohesion` and the tangent of `friction_angle` by a number k for which the bodies stand, and divide the \
             resulting factor by k"
        }
        (Code::OffGround, _) => return on_body_off_ground(warning),
        (Code::StoppedShort, _) => {
            "the factor of safety may be larger: compare with a coarser grid, and set `solver: {tolerance: 1e-4}`, \
             since iterations may stall close to equilibrium if cells are small and flow is non-associated; if the \
             largest factor with equilibrium and the smallest without it lie far apart, use a smaller `tolerance` of \
             the control"
        }
    };
    advice.to_owned()
}

/// Advice on nodes that lose their material or pull it beyond them: lines of a structured grid may follow them.
fn on_left_nodes(warning: &Warning, means: &Means) -> String {
    let body =
        "model the part that moves as a separate, stiff body and prescribe the motion of its `outer_layer`";
    let name = warning.location.boundary_condition.as_deref();
    let condition = means.could_be_followed.iter().find(|(other, _)| Some(other.as_str()) == name);
    match condition {
        Some((condition, axis)) => format!("{}; or {body}", follow(condition, axis)),
        None if means.is_known => format!("move a body instead of grid nodes: {body}"),
        None => format!("let grid lines follow the nodes, `grid: {{follow: ...}}`; or {body}"),
    }
}

/// Advice on a body that a stage adds above or below the current surface of the ground.
fn on_body_off_ground(warning: &Warning) -> String {
    let [body, ground] = match warning.location.bodies.as_slice() {
        [body, ground] => [body.as_str(), ground.as_str()],
        _ => ["BODY", "GROUND"],
    };
    format!("move its lower side onto the current surface, `add: [{{body: {body}, onto: {ground}}}]`")
}

/// Advice on regridding work. Nodes that leave their material are a common cause.
fn on_regridding(means: &Means) -> String {
    let methods = &means.methods;
    let finer = match methods.iter().all(|method| *method == Method::Cpdi2) {
        _ if methods.is_empty() || methods.contains(&Method::Mpm) => {
            "use `method: gimp` or `method: cpdi2`, more points per cell, or a finer grid"
        }
        true => "use more points per cell, or a finer grid",
        false => "use `method: cpdi2`, more points per cell, or a finer grid",
    };
    match means.could_be_followed.first() {
        Some((condition, axis)) => format!("{}; or {finer}", follow(condition, axis)),
        None => finer.to_owned(),
    }
}

/// Advice to let grid lines across an axis follow a condition.
fn follow(condition: &str, axis: &str) -> String {
    format!(
        "let the grid lines at the nodes of the condition follow it, `grid: {{follow: [{{axis: {axis}, from: ..., condition: \
         {condition}}}]}}`"
    )
}
