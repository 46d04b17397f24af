//! The state of contact in checkpoints.

use std::collections::HashMap;

use serde_json::{Value, json};

use super::candidates::Key;
use super::interface::Multiplier;
use super::motion::Moving;
use super::multipliers::Kept;
use crate::tool::Pose;

/// Poses, what places keep, and whether each body has begun.
type State<const D: usize> = (Vec<Pose<D>>, HashMap<Key, Kept<D>>, Vec<bool>);

/// The state at the end of the last step in equilibrium.
pub(super) fn save<const D: usize>(
    tools: &[Moving<D>],
    converged: &HashMap<Key, Kept<D>>,
    has_begun: &[bool],
) -> Value {
    let poses: Vec<Vec<f64>> = tools.iter().map(|moving| moving.start.to_numbers()).collect();
    let mut places: Vec<(&Key, &Kept<D>)> = converged.iter().collect();
    places.sort_by_key(|(key, _)| **key);
    let keys: Vec<[u32; 3]> = places.iter().map(|(key, _)| [key.tool, key.point, key.corner]).collect();
    let kept = || places.iter().map(|(_, kept)| *kept);
    let forces: Vec<Vec<f64>> = kept()
        .map(|Kept { multiplier, .. }| [multiplier.normal].into_iter().chain(multiplier.shear).collect())
        .collect();
    let motions: Vec<f64> = kept().map(|kept| kept.motion).collect();
    json!({"poses": poses, "places": keys, "forces": forces, "motions": motions, "bodies": has_begun})
}

/// Restores the state that [`save`] returned, for these numbers of tools and bodies.
pub(super) fn restore<const D: usize>(
    saved: &Value,
    tools: usize,
    bodies: usize,
) -> Result<State<D>, String> {
    fn part<T: serde::de::DeserializeOwned>(saved: &Value, key: &str) -> Result<T, String> {
        serde_json::from_value(saved[key].clone()).map_err(|error| error.to_string())
    }
    let poses: Vec<Vec<f64>> = part(saved, "poses")?;
    let keys: Vec<[u32; 3]> = part(saved, "places")?;
    let forces: Vec<Vec<f64>> = part(saved, "forces")?;
    let motions: Vec<f64> = part(saved, "motions")?;
    let has_begun: Vec<bool> = part(saved, "bodies")?;
    let poses: Option<Vec<Pose<D>>> = poses.iter().map(|numbers| Pose::from_numbers(numbers)).collect();
    let poses = poses.filter(|poses| poses.len() == tools).ok_or("its poses are not those of the tools")?;
    if keys.len() != forces.len() || keys.len() != motions.len() || has_begun.len() != bodies {
        return Err("its places are not those of the bodies".to_owned());
    }
    let mut converged = HashMap::new();
    for (([tool, point, corner], force), motion) in keys.into_iter().zip(forces).zip(motions) {
        let of_place = match force.split_first() {
            Some((normal, shear)) if force.iter().all(|f| f.is_finite()) => {
                shear.try_into().ok().map(|shear| Multiplier { normal: *normal, shear })
            }
            _ => None,
        };
        let is_known = (tool as usize) < tools && motion >= 0.0;
        let multiplier = of_place.filter(|_| is_known).ok_or("a force on its places is invalid")?;
        converged.insert(Key { tool, point, corner }, Kept { multiplier, motion });
    }
    Ok((poses, converged, has_begun))
}
