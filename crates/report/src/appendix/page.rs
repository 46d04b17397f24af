//! One self-contained page of HTML: numbered sections, figures and tables.

use std::fmt::Write;

use mpm_files::escape_xml;

use super::number::Decimal;

/// Escapes text for HTML, also for use in quoted attributes.
pub(super) fn escape(text: &str) -> String {
    escape_xml(text)
}

/// A page under construction.
#[derive(Debug, Default)]
pub(super) struct Page {
    body: String,
    sections: Vec<String>,
    figures: usize,
    tables: usize,
}

impl Page {
    /// Begins a section; the title is plain text.
    pub fn section(&mut self, title: &str) {
        if !self.sections.is_empty() {
            self.body.push_str("</section>\n");
        }
        self.sections.push(title.to_owned());
        let number = self.sections.len();
        let title = escape(title);
        self.push(&format!(
            "<section id=\"s{number}\">\n<h2><span class=\"no\">{number}</span> {title}</h2>\n"
        ));
    }

    /// Adds HTML unchanged.
    pub fn push(&mut self, html: &str) {
        self.body.push_str(html);
    }

    /// Adds a paragraph of HTML.
    pub fn paragraph(&mut self, html: &str) {
        self.push(&format!("<p>{html}</p>\n"));
    }

    /// Adds a numbered figure; caption and content are HTML.
    pub fn figure(&mut self, caption: &str, content: &str) {
        self.figures += 1;
        let number = self.figures;
        self.push(&format!(
            "<figure id=\"f{number}\">\n{content}<figcaption><b>Figure {number}.</b> {caption}</figcaption>\n</figure>\n"
        ));
    }

    /// Adds a numbered table with an HTML caption; adds nothing if it has no rows.
    pub fn table(&mut self, caption: &str, table: &Table) {
        if table.rows.is_empty() {
            return;
        }
        self.tables += 1;
        let number = self.tables;
        self.push(&format!(
            "<figure class=\"table\" id=\"t{number}\">\n<figcaption><b>Table {number}.</b> {caption}</figcaption>\n\
             <div class=\"scroll\">{}</div>\n</figure>\n",
            table.html()
        ));
    }

    /// Completes the page: `title` is plain text, `head` and `foot` are the HTML before and after the sections.
    pub fn finish(mut self, title: &str, head: &str, foot: &str) -> String {
        if !self.sections.is_empty() {
            self.body.push_str("</section>\n");
        }
        let mut contents = String::new();
        for (index, section) in self.sections.iter().enumerate() {
            let number = index + 1;
            // Writing to a string cannot fail.
            let _ = writeln!(contents, "<li><a href=\"#s{number}\">{}</a></li>", escape(section));
        }
        // With this policy, the browser guarantees that nothing is fetched from elsewhere.
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
             style-src 'unsafe-inline'; script-src 'unsafe-inline'\">\n\
             <meta name=\"generator\" content=\"mpm {version}\">\n<title>{title}</title>\n\
             <style>\n{style}</style>\n</head>\n<body>\n{head}<nav aria-label=\"Contents\"><ol>\n{contents}</ol></nav>\n\
             <main>\n{body}</main>\n<footer>{foot}</footer>\n<script>\n{script}</script>\n</body>\n</html>\n",
            version = escape(mpm_files::summary::VERSION),
            title = escape(title),
            style = include_str!("style.css"),
            body = self.body,
            script = include_str!("readout.js"),
        )
    }
}

/// An entry of a table.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Cell {
    /// HTML.
    Html(String),
    /// A number, aligned at its decimal point.
    Number(Decimal),
    /// A share between 0 and 1, as a bar.
    Bar(f64),
    /// No value.
    Empty,
}

impl Cell {
    /// Plain text.
    pub fn text(text: &str) -> Cell {
        Cell::Html(escape(text))
    }

    /// A name from the deck.
    pub fn name(text: &str) -> Cell {
        Cell::Html(format!("<code>{}</code>", escape(text)))
    }

    /// A number with `decimals` decimals, including trailing zeros.
    pub fn fixed(value: Option<f64>, decimals: usize) -> Cell {
        value.map_or(Cell::Empty, |value| Cell::Number(Decimal::fixed(value, decimals)))
    }

    /// One of several numbers. If the largest is neither very large nor very small, it has `digits` significant digits
    /// and all have as many decimals; otherwise each has `digits` significant digits, or is 0 if negligible beside the
    /// largest.
    pub fn beside(value: Option<f64>, largest: f64, digits: usize) -> Cell {
        match value {
            None => Cell::Empty,
            Some(value) if (1e-3..1e7).contains(&largest) => {
                let decimals = digits as i32 - 1 - largest.log10().floor() as i32;
                Cell::fixed(Some(value), usize::try_from(decimals).unwrap_or(0))
            }
            Some(value) if value.abs() < 0.1f64.powi(digits as i32) * largest => Cell::rounded(0.0, 1),
            Some(value) => Cell::rounded(value, digits),
        }
    }

    /// A number with `digits` significant digits.
    pub fn rounded(value: f64, digits: usize) -> Cell {
        Cell::Number(Decimal::significant(value, digits))
    }

    /// A number that may be missing.
    pub fn maybe(value: Option<f64>, digits: usize) -> Cell {
        value.map_or(Cell::Empty, |value| Cell::rounded(value, digits))
    }
}

/// Rows under headings.
#[derive(Debug, Clone, Default)]
pub(super) struct Table {
    /// Headings as HTML; true for columns of numbers.
    head: Vec<(String, bool)>,
    rows: Vec<(Vec<Cell>, bool)>,
}

impl Table {
    /// A table with these headings (HTML); the headings of columns of numbers begin with `#`.
    pub fn new<S: AsRef<str>>(head: impl IntoIterator<Item = S>) -> Table {
        let heading = |text: S| match text.as_ref().strip_prefix('#') {
            Some(rest) => (rest.to_owned(), true),
            None => (text.as_ref().to_owned(), false),
        };
        Table { head: head.into_iter().map(heading).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push((cells.into_iter().collect(), false));
    }

    /// Adds a row with the sums of the rows above.
    pub fn total(&mut self, cells: impl IntoIterator<Item = Cell>) {
        self.rows.push((cells.into_iter().collect(), true));
    }

    fn html(&self) -> String {
        let tail = |column: usize| {
            let cells = self.rows.iter().filter_map(|(cells, _)| cells.get(column));
            let lengths = cells.map(|cell| if let Cell::Number(n) = cell { n.tail_length() } else { 0 });
            lengths.max().unwrap_or(0)
        };
        let tails: Vec<usize> = (0..self.head.len()).map(tail).collect();
        let mut html = "<table>\n<thead><tr>".to_owned();
        for (text, number) in &self.head {
            let class = if *number { " class=\"n\"" } else { "" };
            let _ = write!(html, "<th scope=\"col\"{class}>{text}</th>");
        }
        html.push_str("</tr></thead>\n<tbody>\n");
        for (cells, total) in &self.rows {
            html.push_str(if *total { "<tr class=\"total\">" } else { "<tr>" });
            for (column, cell) in cells.iter().enumerate() {
                let number = self.head.get(column).is_some_and(|(_, number)| *number);
                html.push_str(&cell_html(cell, number, tails.get(column).copied().unwrap_or(0)));
            }
            html.push_str("</tr>\n");
        }
        html.push_str("</tbody>\n</table>");
        html
    }
}

fn cell_html(cell: &Cell, number: bool, tail: usize) -> String {
    match cell {
        Cell::Number(decimal) if tail == 0 => format!("<td class=\"n\">{}</td>", decimal.whole),
        Cell::Number(decimal) => {
            let (whole, fraction) = (&decimal.whole, decimal.tail());
            format!("<td class=\"n\">{whole}<span class=\"f\" style=\"--f:{tail}\">{fraction}</span></td>")
        }
        Cell::Bar(share) => {
            let percent = 100.0 * share.clamp(0.0, 1.0);
            format!("<td class=\"bar\"><span style=\"width:{percent:.1}%\"></span></td>")
        }
        Cell::Html(html) if number => format!("<td class=\"n\">{html}</td>"),
        Cell::Html(html) => format!("<td>{html}</td>"),
        Cell::Empty if number => "<td class=\"n\">\u{2013}</td>".to_owned(),
        Cell::Empty => "<td>\u{2013}</td>".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_from_outside_is_escaped() {
        let evil = "<script>alert('x')</script> & \"quotes\"";
        let mut page = Page::default();
        page.section(evil);
        let mut table = Table::new(["name"]);
        table.row([Cell::text(evil)]);
        table.row([Cell::name(evil)]);
        page.table("A caption", &table);
        let html = page.finish(evil, "", "");
        assert_eq!(html.matches("<script").count(), 1, "only the page's own");
        assert!(
            html.contains(
                "<td>&lt;script&gt;alert(&apos;x&apos;)&lt;/script&gt; &amp; &quot;quotes&quot;</td>"
            )
        );
        assert!(html.contains("<title>&lt;script&gt;"));
    }

    #[test]
    fn numbers_beside_each_other_have_the_same_decimals() {
        let shown = |value, largest| match Cell::beside(Some(value), largest, 6) {
            Cell::Number(number) => number.html(),
            other => format!("{other:?}"),
        };
        assert_eq!([shown(-16_710.25, 16_710.3), shown(1e-5, 16_710.3)], ["\u{2212}16\u{202f}710.2", "0.0"]);
        assert_eq!(
            [shown(2.5e9, 2.5e9), shown(3.0, 2.5e9)],
            ["2.5\u{202f}\u{d7}\u{202f}10<sup>9</sup>", "0"]
        );
        assert_eq!(Cell::beside(None, 1.0, 6), Cell::Empty);
    }

    #[test]
    fn figures_and_tables_are_numbered_and_numbers_aligned() {
        let mut page = Page::default();
        page.section("One");
        page.figure("First", "<svg></svg>");
        page.figure("Second", "<svg></svg>");
        page.table("Empty", &Table::new(["a"]));
        let mut table = Table::new(["a", "#b"]);
        table.row([Cell::text("x"), Cell::rounded(1.25, 5)]);
        table.row([Cell::text("y"), Cell::rounded(-10.0, 5)]);
        table.total([Cell::text("z"), Cell::Empty]);
        page.table("Numbers", &table);
        page.section("Two");
        let html = page.finish("t", "", "");
        assert!(html.contains("<b>Figure 2.</b> Second"));
        assert!(html.contains("<b>Table 1.</b> Numbers"), "an empty table has no number");
        assert!(html.contains("<td class=\"n\">1<span class=\"f\" style=\"--f:3\">.25</span></td>"));
        assert!(html.contains("<td class=\"n\">\u{2212}10<span class=\"f\" style=\"--f:3\"></span></td>"));
        assert_eq!(html.matches("<section").count(), html.matches("</section>").count());
    }
}
