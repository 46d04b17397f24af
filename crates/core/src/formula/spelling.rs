//! What a misspelt name was meant to be.

/// The candidate most like a misspelt name, if any is like it.
pub fn closest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = name.to_lowercase();
    let close = |candidate: &'a str| Some((slips(&lower, &candidate.to_lowercase())?, candidate));
    candidates.into_iter().filter_map(close).min_by_key(|(slips, _)| *slips).map(|(_, candidate)| candidate)
}

/// Letters that are wrong, missing, too many or exchanged with their neighbour between two words, where they are so few
/// for the length of the words that one may stand for the other; fewest where one word begins with the other.
fn slips(a: &str, b: &str) -> Option<usize> {
    let (shorter, longer) = if a.len() <= b.len() { (a, b) } else { (b, a) };
    let [short, long] = [shorter, longer].map(|word| word.chars().count());
    let most = match long {
        0 | 1 => 0,
        2 => usize::from(short == 1),
        _ => (long / 4).clamp(1, 3),
    };
    let slips = strsim::osa_distance(a, b);
    // What is cut short, or has a word behind it: `tol`, `poisson_ratio`.
    let goes_on = short >= 3 && longer.starts_with(shorter);
    // A slip hardly ever takes the first letter, too.
    let begins_alike = slips <= 1 || a.chars().next() == b.chars().next();
    (slips <= most && begins_alike || goes_on).then_some(if goes_on { slips.min(most) } else { slips })
}
