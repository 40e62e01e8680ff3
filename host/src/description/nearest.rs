//! The name that was meant by a misspelt one.

/// The candidate nearest to `word` by edit distance, if a third of the word's letters or fewer differ
/// (at least one may); the first of equals.
pub(crate) fn nearest<'a>(
    word: &str,
    candidates: impl IntoIterator<Item = &'a str>,
) -> Option<&'a str> {
    // Longer ones are no slip of the finger, and the distance is quadratic in length.
    if word.len() > 40 {
        return None;
    }
    let allowed = (word.chars().count() / 3).max(1);
    let near = candidates
        .into_iter()
        .filter(|candidate| !candidate.is_empty())
        .map(|candidate| (distance(word, candidate), candidate))
        .filter(|&(distance, _)| distance <= allowed);
    near.min_by_key(|&(distance, _)| distance)
        .map(|(_, candidate)| candidate)
}

/// Levenshtein's edit distance; letters that differ in case only are alike.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(!x.eq_ignore_ascii_case(y));
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slips_are_recognised_and_other_words_are_not() {
        let known = ["position", "velocity", "pri", "prf"];
        assert_eq!(nearest("postion", known), Some("position"));
        assert_eq!(nearest("Velocity", known), Some("velocity"));
        assert_eq!(nearest("pry", known), Some("pri"));
        assert_eq!(nearest("colour", known), None);
        // kitten to sitting: the textbook's three.
        assert_eq!(distance("kitten", "sitting"), 3);
    }
}
