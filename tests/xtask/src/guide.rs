//! The guide as a book: `cargo xtask guide` writes `target/guide/book`.
//!
//! The sources are the pages of `host/guide/src`. The tests that run their blocks (`tests/cli/guide.rs`) make the pictures; the reference
//! of commands is the help of `subap` and of each of its commands.

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use subaperture_xtask::{root, target_folder};

use crate::checks::cargo;
use crate::prerequisites::mdbook;
use crate::wasm;

/// Folders of pages that show pictures.
const WITH_PICTURES: [&str; 2] = ["tutorials", "howto"];

/// Assemble the sources and run mdBook.
///
/// # Errors
/// A file that is missing, a command that failed, or mdBook's warnings.
pub(crate) fn build() -> Result<(), String> {
    let place = target_folder().join("guide");
    let source = place.join("src");
    if source.exists() {
        fs::remove_dir_all(&source).map_err(|error| at(&source, &error))?;
    }
    let guide = root().join("host/guide");
    copy_all(&guide.join("src"), &source)?;
    let book = place.join("book.toml");
    fs::copy(guide.join("book.toml"), &book).map_err(|error| at(&book, &error))?;
    for folder in WITH_PICTURES {
        copy_all(
            &place.join("pictures"),
            &source.join(folder).join("pictures"),
        )
        .map_err(|error| format!("{error}: run first: cargo test --test cli guide::"))?;
    }
    copy_all(&wasm::page(), &source.join("howto/browser"))
        .map_err(|error| format!("{error}: run first: cargo xtask wasm"))?;
    let commands = source.join("reference/commands.md");
    fs::write(&commands, commands_page(&subap()?)?).map_err(|error| at(&commands, &error))?;
    let program = mdbook().ok_or("mdbook is missing: cargo install mdbook")?;
    let output = Command::new(program).arg("build").arg(&place).output();
    let output = output.map_err(|error| format!("mdbook does not start: {error}"))?;
    let said = String::from_utf8_lossy(&output.stderr) + String::from_utf8_lossy(&output.stdout);
    let warned = said.contains("WARN") || said.contains("ERROR");
    if !output.status.success() || warned {
        return Err(format!("mdbook: {said}"));
    }
    println!("{}", place.join("book/index.html").display());
    Ok(())
}

/// Help of every command, in Markdown.
fn commands_page(program: &Path) -> Result<String, String> {
    let mut page = "# Commands\n\n".to_owned();
    let help = help(program, &[])?;
    let _ = writeln!(page, "```text\n{}\n```", help.trim_end());
    for command in subcommands(&help) {
        add(&mut page, program, &[command])?;
    }
    Ok(page)
}

fn add(page: &mut String, program: &Path, words: &[&str]) -> Result<(), String> {
    let help = help(program, words)?;
    let level = "#".repeat(words.len() + 1);
    let _ = writeln!(
        page,
        "\n{level} subap {}\n\n```text\n{}\n```",
        words.join(" "),
        help.trim_end()
    );
    for command in subcommands(&help) {
        add(page, program, &[words, &[command]].concat())?;
    }
    Ok(())
}

/// Names under "Commands:", without `help`.
pub(crate) fn subcommands(help: &str) -> Vec<&str> {
    let lines = help.lines().skip_while(|line| *line != "Commands:").skip(1);
    let lines = lines.take_while(|line| !line.is_empty());
    // Names of groups are indented by one column, continued descriptions by more than two.
    let names = lines.filter(|line| line.starts_with("  ") && !line.starts_with("   "));
    let names = names.filter_map(|line| line.split_whitespace().next());
    names.filter(|name| *name != "help").collect()
}

fn help(program: &Path, words: &[&str]) -> Result<String, String> {
    let mut command = Command::new(program);
    let output = command
        .args(words)
        .arg("--help")
        .env("COLUMNS", "100")
        .output();
    let output = output.map_err(|error| at(program, &error))?;
    if !output.status.success() {
        return Err(format!("subap {words:?} --help failed"));
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

/// The command, built with the packages of the tests, so that nothing is compiled twice.
fn subap() -> Result<PathBuf, String> {
    let mut command = cargo(&["build", "--workspace", "--exclude", "subaperture-firmware"]);
    let status = command.args(["--bin", "subap", "--locked"]).status();
    if !status.is_ok_and(|status| status.success()) {
        return Err("subap does not build".to_owned());
    }
    Ok(target_folder().join("debug/subap"))
}

fn copy_all(from: &Path, to: &Path) -> Result<(), String> {
    fs::create_dir_all(to).map_err(|error| at(to, &error))?;
    for entry in fs::read_dir(from).map_err(|error| at(from, &error))? {
        let path = entry.map_err(|error| at(from, &error))?.path();
        let target = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy_all(&path, &target)?;
        } else {
            fs::copy(&path, &target).map_err(|error| at(&path, &error))?;
        }
    }
    Ok(())
}

fn at(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use super::subcommands;

    #[test]
    fn subcommands_are_the_names_under_their_heading() {
        let help = "A tool\n\nCommands:\n form\n  focus  Form an image\n         of recordings\n plan\n  plan   Plan\n  help   Print\n\nOptions:\n  -h  Print\n";
        assert_eq!(subcommands(help), ["focus", "plan"]);
    }
}
