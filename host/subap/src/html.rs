//! HTML page with text, tables and embedded pictures; it needs no other file and no network.

use std::fmt::Write as _;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use subaperture::io::ours::TEXT_MARK;

/// Style for screens of any width in light and dark mode, and for paper, in light mode and without clipping.
const STYLE: &str = "\
:root { color-scheme: light dark; --ink: #1b1b1b; --soft: #5a5a5a; --paper: #fff; --raised: #f5f6f7; --line: #d8d8d8; --good: #1a6b32; --bad: #9a3400 }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --soft: #a8a8a8; --paper: #16181a; --raised: #1f2225; --line: #3a3d40; --good: #6fcf8a; --bad: #ff9d66 } }
* { box-sizing: border-box }
body { margin: 0 auto; padding: 1.5rem 1rem 4rem; max-width: 72rem; font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); overflow-wrap: anywhere }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0 0 .3rem } h2 { font-size: 1.2rem; margin: 0 0 .6rem }
section { border-top: 1px solid var(--line); padding: 1.3rem 0; margin-top: 1.3rem }
p { margin: .4rem 0 } .soft, figcaption { color: var(--soft) } .small { font-size: .9rem }
.good { color: var(--good) } .bad { color: var(--bad); font-weight: 600 }
.facts { display: grid; grid-template-columns: repeat(auto-fill, minmax(13rem, 1fr)); gap: .6rem; margin: 1rem 0 0 }
.facts div { background: var(--raised); border-radius: .4rem; padding: .5rem .7rem }
.facts dt { color: var(--soft); font-size: .85rem } .facts dd { margin: 0; font-weight: 600 }
.scroll { overflow-x: auto } table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { text-align: right; padding: .25rem .9rem .25rem 0; border-bottom: 1px solid var(--line); white-space: nowrap; vertical-align: top }
th:first-child, td:first-child, .words th, .words td { text-align: left } .words td { white-space: normal; min-width: 6rem }
th { color: var(--soft); font-weight: 600; font-size: .85rem } tr.theory td { color: var(--soft) }
code { font: .9em ui-monospace, monospace }
figure { margin: .8rem 0 } figure img { display: block; max-width: 100%; height: auto; background: #fff }
.row { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(20rem, 100%), 1fr)); gap: 0 1rem }
.row figure img { max-height: 22rem } figcaption { font-size: .9rem; margin-top: .3rem }
ul { padding-left: 1.2rem; margin: .4rem 0 }
@media print {
  :root { color-scheme: light; --ink: #000; --soft: #444; --paper: #fff; --raised: #fff; --line: #bbb; --good: #000; --bad: #000 }
  body { max-width: none; padding: 0; font-size: 10pt } .scroll { overflow: visible } .facts div { border: 1px solid var(--line) }
  th, td { white-space: normal; padding-right: .5rem } figure, tr, .facts div { break-inside: avoid } h2 { break-after: avoid }
}
";

/// Escape text for HTML.
pub(crate) fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}

/// A page as it grows.
pub(crate) struct Page {
    html: String,
    open: bool,
}

/// How a table's cells are set.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Cells {
    /// To the right but the first.
    Numbers,
    /// Left-aligned cells of text.
    Words,
}

/// A row of a table: its cells, as HTML, and its class.
pub(crate) type Row = (&'static str, Vec<String>);

impl Page {
    /// Begins a page of this title.
    pub(crate) fn new(title: &str) -> Self {
        let title = escaped(title);
        Self {
            html: format!(
                "<!doctype html> <!-- {TEXT_MARK} -->\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
                 <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
                 <link rel=\"icon\" href=\"data:,\">\n<title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n\
                 <h1>{title}</h1>\n"
            ),
            open: false,
        }
    }

    /// Begin a section of the page.
    pub(crate) fn section(&mut self, id: &str, title: &str) {
        self.close();
        self.open = true;
        let _ = write!(
            self.html,
            "<section id=\"{id}\">\n<h2>{}</h2>\n",
            escaped(title)
        );
    }

    fn close(&mut self) {
        if self.open {
            self.html.push_str("</section>\n");
        }
    }

    /// A paragraph, of HTML.
    pub(crate) fn paragraph(&mut self, class: &str, html: &str) {
        let _ = writeln!(self.html, "<p class=\"{class}\">{html}</p>");
    }

    /// Facts, each a name and text.
    pub(crate) fn facts(&mut self, facts: &[(&str, String)]) {
        self.html.push_str("<dl class=\"facts\">\n");
        for (name, value) in facts {
            let (name, value) = (escaped(name), escaped(value));
            let _ = writeln!(self.html, "<div><dt>{name}</dt><dd>{value}</dd></div>");
        }
        self.html.push_str("</dl>\n");
    }

    /// A list of texts.
    pub(crate) fn list(&mut self, items: &[String]) {
        self.html.push_str("<ul>\n");
        for item in items {
            let _ = writeln!(self.html, "<li>{}</li>", escaped(item));
        }
        self.html.push_str("</ul>\n");
    }

    /// A table; cells are HTML.
    pub(crate) fn table(&mut self, cells: Cells, header: &[&str], rows: &[Row]) {
        let class = match cells {
            Cells::Numbers => "",
            Cells::Words => " class=\"words\"",
        };
        let _ = write!(self.html, "<div class=\"scroll\"><table{class}>\n<tr>");
        for title in header {
            let _ = write!(self.html, "<th>{}</th>", escaped(title));
        }
        self.html.push_str("</tr>\n");
        for (class, row) in rows {
            let class = match *class {
                "" => String::new(),
                class => format!(" class=\"{class}\""),
            };
            let _ = write!(self.html, "<tr{class}>");
            for cell in row {
                let _ = write!(self.html, "<td>{cell}</td>");
            }
            self.html.push_str("</tr>\n");
        }
        self.html.push_str("</table></div>\n");
    }

    /// Row of pictures: PNG and caption.
    pub(crate) fn pictures(&mut self, pictures: &[(Vec<u8>, String)]) {
        self.html.push_str(match pictures.len() {
            1 => "<div>\n",
            _ => "<div class=\"row\">\n",
        });
        for (png, caption) in pictures {
            let caption = escaped(caption);
            let _ = writeln!(
                self.html,
                "<figure><img alt=\"{caption}\" src=\"data:image/png;base64,{}\"><figcaption>{caption}</figcaption></figure>",
                STANDARD.encode(png)
            );
        }
        self.html.push_str("</div>\n");
    }

    /// Close the page and return its HTML.
    pub(crate) fn finish(mut self) -> String {
        self.close();
        self.html.push_str("</body>\n</html>\n");
        self.html
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped_and_nothing_comes_from_elsewhere() {
        let mut page = Page::new("a < b & \"c\"");
        page.facts(&[("<x>", "1 & 2".to_owned())]);
        page.section("s", "<script>");
        page.list(&["<script>alert(1)</script>".to_owned()]);
        page.pictures(&[(vec![1, 2, 3], "<p>".to_owned())]);
        page.section("t", "end");
        let html = page.finish();
        assert!(html.contains("<h1>a &lt; b &amp; &quot;c&quot;</h1>"));
        assert!(!html.contains("<script") && html.contains("&lt;script&gt;alert"));
        // 1, 2, 3 in base 64: 000000 010000 001000 000011.
        assert!(html.contains("data:image/png;base64,AQID"));
        assert!(!html.contains("http") && !html.contains("url("));
        assert_eq!(
            html.matches("<section").count(),
            html.matches("</section>").count()
        );
        assert!(html.lines().next().unwrap().contains(TEXT_MARK));
    }
}
