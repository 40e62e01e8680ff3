//! Suggestion for a misspelt name.

/// Candidate nearest to `word` by edit distance (letters added, omitted, replaced, or two swapped; case is ignored),
/// if at most a third of the word's letters differ (at least one may). The first of equals.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Longer words are not misspelt names, and the distance is quadratic in length.
    if word.len() > 40 {
        return None;
    }
    let word = word.to_lowercase();
    let allowed = (word.chars().count() / 3).max(1);
    let near = candidates
        .into_iter()
        .filter(|candidate| !candidate.is_empty())
        .map(|candidate| {
            (
                strsim::osa_distance(&word, &candidate.to_lowercase()),
                candidate,
            )
        })
        .filter(|&(distance, _)| distance <= allowed);
    near.min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn misspelt_names_are_matched_and_other_words_are_not() {
        let known = ["position", "velocity", "pri", "prf"];
        assert_eq!(nearest("postion", known), Some("position"));
        assert_eq!(nearest("Velocity", known), Some("velocity"));
        assert_eq!(nearest("pry", known), Some("pri"));
        assert_eq!(nearest("colour", known), None);
        assert_eq!(nearest("rpi", known), Some("pri"));
    }
}
