//! What is found at the end of a run: forces, and the extreme values of the fields.

use serde_json::{Map, Value, json};

use crate::findings::{Extreme, Extremes, ForceBalance};

/// Loads and reactions at the end.
pub(super) fn forces(balance: &ForceBalance) -> Value {
    let by_name = |forces: &[(String, Vec<f64>)]| -> Map<String, Value> {
        forces.iter().map(|(name, force)| (name.clone(), json!(force))).collect()
    };
    let moments: Map<String, Value> = (balance.reactions.iter().zip(&balance.moments))
        .map(|((name, _), of)| (name.clone(), json!({"about": of.about, "moment": of.moment})))
        .collect();
    let mut forces = json!({
        "applied": balance.applied,
        "loads": by_name(&balance.loads),
        "reactions": by_name(&balance.reactions),
        "moments": moments,
        "difference": balance.difference(),
        "relative_difference": balance.relative_difference(),
    });
    if !balance.further.is_empty() {
        forces["further"] = by_name(&balance.further).into();
    }
    forces
}

/// The extreme values of the fields at the end.
pub(super) fn largest(extremes: &Extremes) -> Value {
    let Extremes { displacement, von_mises_stress, lowest_pressure, highest_pressure } = extremes;
    let place = |extreme: &Extreme| {
        let Extreme { value, body, point, position } = extreme;
        json!({"value": value, "body": body, "point": point, "position": position})
    };
    json!({
        "displacement": place(displacement),
        "von_mises_stress": place(von_mises_stress),
        "lowest_pressure": place(lowest_pressure),
        "highest_pressure": place(highest_pressure),
    })
}
