//! Count of words and phrases that hide what a sentence means, held to a budget for each package.
//!
//! Words are counted in all text of a source or Markdown file: comments, strings and names, with names split at `_`
//! and at capitals, so that a name and a phrase with the same words count alike. The budgets are in `words.json`. A
//! count above its budget fails; `--lower` writes today's counts where they are below the budget and never raises
//! one. A low count is only a lower limit of quality: a reader must judge the sentences.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use subaperture_xtask::root;

/// Words and phrases counted, lower case; a phrase is matched across punctuation and line ends.
const HABITS: [(&str, &[&str]); 9] = [
    ("tell", &["tell", "tells", "told", "telling"]),
    ("way", &["way", "ways"]),
    ("what", &["what"]),
    ("of which", &["of which", "by which", "of whom", "of whose"]),
    (
        "is none",
        &[
            "is none",
            "are none",
            "was none",
            "none is",
            "none are",
            "none of",
            "no number",
        ],
    ),
    ("beside", &["beside", "besides"]),
    ("itself", &["it itself", "themselves"]),
    (
        "as it is",
        &["as it is", "as they are", "such that are", "those that are"],
    ),
    ("nothing", &["nothing", "nobody", "whoever", "manieth"]),
];

/// Heading of the count of `///` blocks with three words or fewer.
const SHORT: &str = "short doc";

const BUDGETS: &str = "tests/xtask/words.json";

/// Counts by package, then by habit.
type Counts = BTreeMap<String, BTreeMap<String, u64>>;

/// Fail if any package exceeds its budget. With `lower`, write lower budgets where counts have fallen.
pub(crate) fn check(lower: bool) -> Result<(), String> {
    let counts = count_all()?;
    print_table(&counts);
    let path = root().join(BUDGETS);
    let budgets: Counts = match fs::read_to_string(&path) {
        Ok(text) => serde_json::from_str(&text).map_err(|error| format!("{BUDGETS}: {error}"))?,
        Err(error) if lower && error.kind() == std::io::ErrorKind::NotFound => Counts::new(),
        Err(error) => return Err(format!("{BUDGETS}: {error}")),
    };
    let exceeded = match path.exists() {
        true => exceeded(&counts, &budgets),
        false => Vec::new(),
    };
    if lower {
        let text = serde_json::to_string_pretty(&lowered(counts, &budgets));
        let text = text.expect("numbers and names can be written") + "\n";
        fs::write(&path, text).map_err(|error| format!("{BUDGETS}: {error}"))?;
    }
    if exceeded.is_empty() {
        Ok(())
    } else {
        Err(format!(
            "{}\nrewrite the sentences in plain English (CONTRIBUTING.md, \"Language\"); `cargo xtask words FOLDER` lists the lines",
            exceeded.join("\n")
        ))
    }
}

/// Print every counted line under `folder`.
pub(crate) fn list(folder: &str) -> Result<(), String> {
    for path in files(&root().join(folder))? {
        let text = read(&path)?;
        let name = path.strip_prefix(root()).unwrap_or(&path).display();
        for (number, line) in text.lines().enumerate() {
            let words = words(line);
            for (habit, phrases) in HABITS {
                if phrases.iter().any(|phrase| occurrences(&words, phrase) > 0) {
                    println!("{name}:{}: {habit}: {}", number + 1, line.trim());
                }
            }
        }
        for (number, doc) in short_docs(&text) {
            println!("{name}:{number}: {SHORT}: {doc}");
        }
    }
    Ok(())
}

/// Each count above its budget, as a line of text. A package without budgets has none to spend.
fn exceeded(counts: &Counts, budgets: &Counts) -> Vec<String> {
    let mut lines = Vec::new();
    for (package, habits) in counts {
        for (habit, &count) in habits {
            let budget = budgets.get(package).and_then(|budget| budget.get(habit));
            let budget = budget.copied().unwrap_or(0);
            if count > budget {
                lines.push(format!("{package}: '{habit}': {count}, budget {budget}"));
            }
        }
    }
    lines
}

/// The lower of count and budget; the count where there was no budget file.
fn lowered(counts: Counts, budgets: &Counts) -> Counts {
    let lower = |package: &str, habit: &str, count: u64| {
        if budgets.is_empty() {
            return count;
        }
        let budget = budgets.get(package).and_then(|budget| budget.get(habit));
        count.min(budget.copied().unwrap_or(0))
    };
    let mut result = Counts::new();
    for (package, habits) in counts {
        let habits = habits.into_iter().map(|(habit, count)| {
            let count = lower(&package, &habit, count);
            (habit, count)
        });
        let habits: BTreeMap<_, _> = habits.filter(|(_, count)| *count > 0).collect();
        result.insert(package, habits);
    }
    result
}

fn count_all() -> Result<Counts, String> {
    let mut counts = Counts::new();
    for package in packages()? {
        let mut habits: BTreeMap<String, u64> = BTreeMap::new();
        for path in files(&root().join(&package))? {
            let text = read(&path)?;
            let words = words(&text);
            for (habit, phrases) in HABITS {
                let count: u64 = phrases.iter().map(|p| occurrences(&words, p)).sum();
                *habits.entry(habit.to_owned()).or_default() += count;
            }
            *habits.entry(SHORT.to_owned()).or_default() += short_docs(&text).len() as u64;
        }
        counts.insert(package, habits);
    }
    Ok(counts)
}

/// Folders counted one by one, and the Markdown files of the root by name.
fn packages() -> Result<Vec<String>, String> {
    let mut packages = vec!["core".to_owned(), "firmware".to_owned(), "tests".to_owned()];
    for (folder, keep) in [
        ("host", Path::is_dir as fn(&Path) -> bool),
        ("", |path| {
            let markdown = path.extension().is_some_and(|e| e == "md");
            // It lists the words to avoid.
            markdown && !path.ends_with("CONTRIBUTING.md")
        }),
    ] {
        for path in entries(&root().join(folder))? {
            if keep(&path) {
                let name = path.strip_prefix(root()).unwrap_or(&path);
                packages.push(name.display().to_string());
            }
        }
    }
    packages.sort();
    Ok(packages)
}

/// Rust and Markdown files at or under `path`, sorted; this file, which lists the words, is left out.
fn files(path: &Path) -> Result<Vec<PathBuf>, String> {
    if path.is_file() {
        return Ok(vec![path.to_owned()]);
    }
    let mut found = Vec::new();
    for entry in entries(path)? {
        let text = entry.extension().is_some_and(|e| e == "rs" || e == "md");
        if entry.is_dir() {
            found.extend(files(&entry)?);
        } else if text && !entry.ends_with("xtask/src/words.rs") {
            found.push(entry);
        }
    }
    Ok(found)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let error = |error: std::io::Error| format!("{}: {error}", folder.display());
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        if !name.starts_with('.') && name != "target" {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// Lower-case words of `text`. Names are split at `_` and before capitals; "two-way" stays one word.
fn words(text: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let mut splits_before_capital = false;
    // A method of the standard library, not a habit.
    let text = text.replace("is_none", "isnone");
    for c in text.chars().chain([' ']) {
        let joined = c.is_alphanumeric() || c == '-';
        if !word.is_empty() && (!joined || (c.is_uppercase() && splits_before_capital)) {
            words.push(std::mem::take(&mut word));
        }
        if joined {
            word.extend(c.to_lowercase());
        }
        splits_before_capital = c.is_lowercase() || c.is_numeric();
    }
    words
}

fn occurrences(words: &[String], phrase: &str) -> u64 {
    let phrase: Vec<&str> = phrase.split(' ').collect();
    let windows = words.windows(phrase.len());
    windows.filter(|window| window.iter().eq(&phrase)).count() as u64
}

/// `///` blocks of three words or fewer, with the number of their first line.
fn short_docs(text: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut block: Option<(usize, String)> = None;
    for (number, line) in text.lines().chain([""]).enumerate() {
        match line.trim_start().strip_prefix("///") {
            Some(doc) => {
                let (_, text) = block.get_or_insert((number + 1, String::new()));
                text.push_str(doc);
            }
            // Text of the key reference (`describe::declare`).
            None if ["#[key", "#[section"]
                .iter()
                .any(|of| line.trim_start().starts_with(of)) =>
            {
                block = None;
            }
            None => found.extend(block.take()),
        }
    }
    found.retain(|(_, text)| text.split_whitespace().count() <= 3);
    found
}

fn print_table(counts: &Counts) {
    let habits = || HABITS.iter().map(|(name, _)| *name).chain([SHORT]);
    print!("{:<20}", "");
    habits().for_each(|habit| print!("{habit:>10}"));
    println!();
    let mut totals: BTreeMap<&str, u64> = BTreeMap::new();
    for (package, counts) in counts {
        print!("{package:<20}");
        for habit in habits() {
            let count = counts.get(habit).copied().unwrap_or(0);
            *totals.entry(habit).or_default() += count;
            print!("{count:>10}");
        }
        println!();
    }
    print!("{:<20}", "total");
    habits().for_each(|habit| print!("{:>10}", totals[habit]));
    println!();
}

#[cfg(test)]
mod tests {
    use super::*;

    fn count(text: &str, phrase: &str) -> u64 {
        occurrences(&words(text), phrase)
    }

    #[test]
    fn words_are_counted_in_names_and_sentences() {
        let text = "/// As it is\n/// told: `AsTold`, what_is_told, two-way, anyway, ways.";
        assert_eq!(count(text, "told"), 3);
        assert_eq!(count(text, "as it is"), 1);
        assert_eq!(count(text, "way"), 0);
        assert_eq!(count(text, "ways"), 1);
        assert_eq!(count("HTTPServer X1Way", "way"), 1);
        assert_eq!(count("if x.is_none() { the rest is none }", "is none"), 1);
    }

    #[test]
    fn short_docs_are_blocks_of_three_words_or_fewer() {
        let text = "/// It itself.\nfn a() {}\n\n    /// Range,\n    /// in m, one way.\n    b: f64,\n/// Unit: m\n";
        let found = short_docs(text);
        assert_eq!(found, [(1, " It itself.".into()), (7, " Unit: m".into())]);
    }

    #[test]
    fn budgets_fall_and_never_rise() {
        let counts = |n: u64| Counts::from([("core".into(), [("way".into(), n)].into())]);
        assert_eq!(
            exceeded(&counts(3), &counts(2)),
            ["core: 'way': 3, budget 2"]
        );
        assert!(exceeded(&counts(2), &counts(2)).is_empty());
        assert_eq!(exceeded(&counts(1), &Counts::new()).len(), 1);
        assert_eq!(lowered(counts(1), &counts(2)), counts(1));
        assert_eq!(lowered(counts(3), &counts(2)), counts(2));
    }
}
