//! The state of contact in checkpoints.

use rustc_hash::FxHashMap;
use serde_json::{Value, json};

use super::candidates::Key;
use super::interface::Multiplier;
use super::multipliers::Kept;
use crate::tool::Pose;

/// The poses of the tools, the state kept for the contact points, and whether each body has begun.
type State<const D: usize> = (Vec<Pose<D>>, FxHashMap<Key, Kept<D>>, Vec<bool>);

/// The state at the end of the last converged step.
pub(super) fn save<const D: usize>(
    poses: &[Pose<D>],
    converged: &FxHashMap<Key, Kept<D>>,
    has_begun: &[bool],
) -> Value {
    let poses: Vec<Vec<f64>> = poses.iter().map(Pose::to_numbers).collect();
    let mut places: Vec<(&Key, &Kept<D>)> = converged.iter().collect();
    places.sort_by_key(|(key, _)| **key);
    let keys: Vec<u32> = places.iter().flat_map(|(key, _)| [key.tool, key.point, key.corner]).collect();
    let kept = || places.iter().map(|(_, kept)| *kept);
    let forces: Vec<f64> =
        kept().flat_map(|kept| [kept.multiplier.normal].into_iter().chain(kept.multiplier.shear)).collect();
    let motions: Vec<f64> = kept().flat_map(|kept| [kept.motion, kept.excess]).collect();
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
    let keys: Vec<u32> = part(saved, "places")?;
    let forces: Vec<f64> = part(saved, "forces")?;
    let motions: Vec<f64> = part(saved, "motions")?;
    let has_begun: Vec<bool> = part(saved, "bodies")?;
    let poses: Option<Vec<Pose<D>>> = poses.iter().map(|numbers| Pose::from_numbers(numbers)).collect();
    let poses = poses.filter(|poses| poses.len() == tools).ok_or("its poses are not those of the tools")?;
    let (motions, rest) = motions.as_chunks::<2>();
    let n = motions.len();
    let fits = rest.is_empty() && keys.len() == 3 * n && forces.len() == (1 + D) * n;
    if !fits || has_begun.len() != bodies {
        return Err("its contact points are not those of the bodies".to_owned());
    }
    let mut converged = FxHashMap::default();
    for ((key, force), motion) in keys.chunks_exact(3).zip(forces.chunks_exact(1 + D)).zip(motions) {
        let [motion, excess] = *motion;
        let key = Key { tool: key[0], point: key[1], corner: key[2] };
        let multiplier = Multiplier { normal: force[0], shear: std::array::from_fn(|d| force[1 + d]) };
        let is_known = (key.tool as usize) < tools && motion >= 0.0 && excess >= 0.0;
        if !is_known || !force.iter().all(|f| f.is_finite()) {
            return Err("a force on its contact points is invalid".to_owned());
        }
        converged.insert(key, Kept { multiplier, motion, excess });
    }
    Ok((poses, converged, has_begun))
}
