//! HTML page with embedded pictures, without external resources.

use std::fmt::Write as _;
use std::io::Write;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::{Check, Finding, Item};
use subaperture_io::atomic::{WriteError, write_atomically};
use subaperture_io::ours::TEXT_MARK;
use subaperture_io::written::{FileKind, WrittenFile};

const STYLE: &str = "\
:root { color-scheme: light dark; --ink: #1b1b1b; --soft: #5c5c5c; --paper: #fff; --line: #d8d8d8; --good: #1a6b32; --bad: #a33b00 }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --soft: #a8a8a8; --paper: #16181a; --line: #3a3d40; --good: #6fcf8a; --bad: #ff9d66 } }
body { margin: 2rem auto; padding: 0 1rem; max-width: 72rem; font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper) }
h1 { font-size: 1.7rem; margin-bottom: .3rem } h2 { font-size: 1.2rem; margin: 0 }
section { border-top: 1px solid var(--line); padding: 1.5rem 0 }
.source, figcaption, nav { color: var(--soft) }
.source { margin: 0 0 .6rem }
table { border-collapse: collapse; margin: .8rem 0 } th, td { text-align: left; padding: .25rem 1.2rem .25rem 0; border-bottom: 1px solid var(--line); vertical-align: top }
.scroll { overflow-x: auto }
.yes { color: var(--good) } .no { color: var(--bad) }
figure { display: inline-block; margin: .8rem 1rem .8rem 0; max-width: 100%; vertical-align: top }
img { max-width: 100%; max-height: 36rem; background: #fff } figcaption { max-width: 40rem; font-size: .9rem }
nav li { margin: .1rem 0 } a { color: inherit }
";

/// Escape text for HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// Verdict on one check; "agrees" needs a value of the thesis.
fn check_verdict(check: &Check) -> &'static str {
    match check.agrees && !check.has_thesis_value() {
        true => "no value to compare with",
        false => verdict(check.agrees),
    }
}

fn verdict(agrees: bool) -> &'static str {
    match agrees {
        true => "<span class=\"yes\">agrees</span>",
        false => "<span class=\"no\">differs</span>",
    }
}

/// Render the page.
pub(super) fn page(done: &[(&Item, Finding)]) -> String {
    let agreeing = done.iter().filter(|(_, finding)| finding.agrees()).count();
    let mut html = format!(
        "<!doctype html> <!-- {TEXT_MARK} -->\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>Subaperture: two theses, reproduced</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
         <h1>Two theses, reproduced</h1>\n\
         <p>Figures and tables of Schone 2020 (sub-CPI range-Doppler backprojection) and Chim 2018 (L-band \
         SAR near the ground), simulated and computed by Subaperture {}, each compared with the thesis's \
         figure. {agreeing} of {} agree; the others state the reason.</p>\n<nav><ul>\n",
        env!("CARGO_PKG_VERSION"),
        done.len()
    );
    for (item, finding) in done {
        let _ = writeln!(
            html,
            "<li><a href=\"#{}\">{}</a>: {} ({})</li>",
            item.id,
            escaped(item.source),
            escaped(item.title),
            verdict(finding.agrees())
        );
    }
    html.push_str("</ul></nav>\n");
    for (item, finding) in done {
        section(&mut html, item, finding);
    }
    html.push_str("</body>\n</html>\n");
    html
}

fn section(html: &mut String, item: &Item, finding: &Finding) {
    let _ = write!(
        html,
        "<section id=\"{}\">\n<h2>{}</h2>\n<p class=\"source\">{}: {}</p>\n\
         <p><b>Thesis.</b> {}</p>\n<p><b>Here.</b> {}</p>\n",
        item.id,
        escaped(item.title),
        escaped(item.source),
        verdict(finding.agrees()),
        escaped(&finding.thesis),
        escaped(&finding.method),
    );
    if !finding.checks.is_empty() {
        html.push_str(
            "<div class=\"scroll\"><table>\n<tr><th></th><th>thesis</th><th>ours</th><th></th></tr>\n",
        );
        for check in &finding.checks {
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                escaped(&check.what),
                escaped(&check.thesis),
                escaped(&check.ours),
                check_verdict(check)
            );
        }
        html.push_str("</table></div>\n");
    }
    if let Some(why) = &finding.why {
        let _ = writeln!(
            html,
            "<p><b>Reason for the difference.</b> {}</p>",
            escaped(why)
        );
    }
    for picture in &finding.pictures {
        let _ = writeln!(
            html,
            "<figure><img alt=\"{0}\" src=\"data:image/png;base64,{1}\"><figcaption>{0}</figcaption></figure>",
            escaped(&picture.caption),
            STANDARD.encode(&picture.png)
        );
    }
    html.push_str("</section>\n");
}

/// Write the page atomically.
pub(super) fn write(folder: &Path, done: &[(&Item, Finding)]) -> Result<WrittenFile, WriteError> {
    let html = page(done);
    let (path, bytes) = (folder.join("index.html"), html.len() as u64);
    write_atomically(&path, bytes, |file| file.write_all(html.as_bytes()))?;
    Ok(WrittenFile::new(path, FileKind::Report))
}

#[cfg(test)]
mod tests {
    use super::super::{Check, NOT_DONE, NOT_GIVEN, Picture};
    use super::*;

    #[test]
    fn figure_without_thesis_value_is_not_said_to_agree() {
        let check = |thesis: &str, agrees| Check::claim("width", thesis, "1 m".to_owned(), agrees);
        for thesis in [NOT_GIVEN, NOT_DONE] {
            assert!(!check_verdict(&check(thesis, true)).contains("agrees"));
            assert!(check_verdict(&check(thesis, false)).contains("differs"));
        }
        assert!(check_verdict(&check("1 m", true)).contains("agrees"));
        assert!(check_verdict(&check("2 m", false)).contains("differs"));
    }

    #[test]
    fn page_escapes_text_and_embeds_pictures() {
        let item = Item {
            id: "x-1",
            source: "A & B",
            title: "a < b",
            work: 1.0,
            reproduce: |_| Ok(Finding::default()),
        };
        let finding = Finding {
            checks: vec![Check {
                what: "\"q\"".to_owned(),
                thesis: "1".to_owned(),
                ours: "2".to_owned(),
                agrees: false,
            }],
            why: Some("<script>".to_owned()),
            pictures: vec![Picture {
                name: "p".to_owned(),
                caption: "c".to_owned(),
                png: vec![1, 2, 3],
            }],
            ..Finding::default()
        };
        let html = page(&[(&item, finding)]);
        assert!(html.contains("a &lt; b") && html.contains("A &amp; B"));
        assert!(html.contains("&lt;script&gt;") && !html.contains("<script"));
        // 1, 2, 3 in base64: 000000 010000 001000 000011.
        assert!(html.contains("data:image/png;base64,AQID"));
        assert!(html.contains("0 of 1 agree") && html.contains("differs"));
        assert!(
            !html.contains("http"),
            "the page must not load external resources"
        );
    }
}
