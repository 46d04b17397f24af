//! Suggestions for misspelt names.

/// The candidate closest to a misspelt name; `None` if none is close.
pub fn closest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    let close = |candidate: &'a str| Some((edit_distance(&lower, &candidate.to_lowercase())?, candidate));
    candidates
        .into_iter()
        .filter_map(close)
        .min_by_key(|(distance, _)| *distance)
        .map(|(_, candidate)| candidate)
}

/// Edit distance between two words (wrong, missing, extra or swapped letters); `None` if it is too large for their
/// length to be a typing error. Two words also count as close if one of them has at least three letters and begins the
/// other.
fn edit_distance(a: &str, b: &str) -> Option<usize> {
    let (shorter, longer) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    let [short, long] = [shorter, longer].map(|word| word.chars().count());
    let most = match long {
        0 | 1 => 0,
        2 => usize::from(short == 1),
        _ => (long / 4).clamp(1, 3),
    };
    let distance = strsim::osa_distance(a, b);
    // An abbreviated or extended name: `tol`, `poisson_ratio`.
    let extended = short >= 3 && longer.starts_with(shorter);
    // Typing errors rarely affect the first letter as well.
    let begins_alike = distance <= 1 || a.chars().next() == b.chars().next();
    (distance <= most && begins_alike || extended).then_some(if extended {
        distance.min(most)
    } else {
        distance
    })
}
