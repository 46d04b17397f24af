//! The measures of the quality of a run.

use serde_json::{Map, Value, json};

use mpm_core::model::Model;
use mpm_core::quality::{Balance, Quality, Worst};

/// Measures of quality; a measure is null if no step has it.
pub(super) fn quality<const D: usize>(model: &Model<D>, quality: &Quality) -> Value {
    let worst = |worst: Option<Worst>| {
        worst.map(|Worst { value, step, body, point }| {
            let mut entry = json!({"value": value, "step": step, "body": model.bodies[body].name});
            if let Some(point) = point {
                entry["point"] = json!(point);
            }
            entry
        })
    };
    let balance = |of: &Balance| json!({"total": of.now, "relative_change": of.relative_change()});
    let slowest = quality.smallest_newton_order();
    json!({
        "partition_of_unity_loss": worst(quality.partition_of_unity_loss),
        "domain_outside_grid": worst(quality.domain_outside_grid),
        "smallest_cell_filling": quality.smallest_cell_filling.map(|filling| {
            json!({"value": filling.value, "step": filling.step, "cell": filling.cell})
        }),
        "det_f": quality.det_f.map(|[min, max]| json!({"min": min, "max": max})),
        "mass": balance(&quality.mass),
        "volume": balance(&quality.volume),
        "domain_overlap": quality.domain_overlap,
        "domain_volume_excess": worst(quality.domain_volume_excess),
        "newton_order": quality.median_newton_order().map(|median| json!({
            "median": median,
            "smallest": slowest.map(|(_, order)| order),
            "step": slowest.map(|(step, _)| step),
            "steps": quality.newton_orders.len(),
        })),
        "rotation": worst(quality.rotation),
        "shear": worst(quality.shear),
        "box_rotation": worst(quality.box_rotation),
        "crossings": by_body(model, |body| quality.mean_crossings(body)),
        "pressure_oscillation": quality.pressure_oscillation.map(at_step),
        "overstress": quality.overstress.map(at_step),
        "held_by_nodes": held_by_nodes(model, quality),
    })
}

/// A measure, keyed by the names of the bodies that have it; null if none has.
fn by_body<const D: usize>(model: &Model<D>, of: impl Fn(usize) -> Option<f64>) -> Value {
    let entries =
        model.bodies.iter().enumerate().filter_map(|(k, body)| Some((body.name.clone(), json!(of(k)?))));
    let map: Map<String, Value> = entries.collect();
    if map.is_empty() { Value::Null } else { Value::Object(map) }
}

/// Share of the material that the nodes of each moving boundary condition still hold; null if there is none.
fn held_by_nodes<const D: usize>(model: &Model<D>, quality: &Quality) -> Value {
    let entries = model
        .boundary_conditions
        .iter()
        .enumerate()
        .filter_map(|(k, condition)| Some((condition.name.clone(), json!(quality.held_by_nodes(k)?))));
    let map: Map<String, Value> = entries.collect();
    if map.is_empty() { Value::Null } else { Value::Object(map) }
}

/// A value and its step.
pub(super) fn at_step((value, step): (f64, usize)) -> Value {
    json!({"value": value, "step": step})
}
