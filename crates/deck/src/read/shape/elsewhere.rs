//! Keys that other programs have and decks have not.

/// What to do instead of a key that other programs of the trade have; `None` for other keys. Plurals count as well.
pub(super) fn instead_of(key: &str) -> Option<&'static str> {
    let word = key.to_lowercase().replace(['-', ' '], "_");
    let word = word.strip_suffix('s').unwrap_or(&word);
    Some(match word {
        "plate" | "shell" | "wall" | "beam" | "pile" | "lining" => {
            "model it as a body of its own with several points across its thickness (`mpm new beam`), or, if it is stiff \
             beside the soil, as a rigid tool: `tools: [{name, shape: {type: polyline, vertices, thickness}}]`"
        }
        "anchor" | "strut" | "spring" | "prop" | "truss" | "bolt" | "nail" => {
            "apply its force with a load of type `traction` or `point-force`, or hold its head with a boundary condition, \
             whose reaction is then its force"
        }
        "geogrid" | "geotextile" | "membrane" => {
            "model it as a thin body with the stiffness of the layer, or give the soil the cohesion that the reinforcement adds"
        }
        "phase" | "construction_stage" | "initial_phase" => {
            "`stages` are the phases of an analysis: bodies that appear or go, loads, and their steps"
        }
        "water_table" | "phreatic_level" | "groundwater" | "water_level" | "pore_pressure" => {
            "use effective stresses with the buoyant unit weight below the water, or undrained strengths with the full one"
        }
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::instead_of;

    #[test]
    fn keys_of_others_are_known_in_any_form() {
        for key in ["plate", "Plates", "geogrid", "construction-stage", "Water Table"] {
            assert!(instead_of(key).is_some(), "{key}");
        }
        assert!(instead_of("youngs").is_none());
    }
}
