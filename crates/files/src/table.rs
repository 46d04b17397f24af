//! Comma-separated tables that grow by whole rows: writing and reading.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use mpm_core::counted::counted;
use mpm_core::input_file::{self, InputFileError};

use super::replace::replace_file;
use super::{invalid, shortest};

/// Largest size of a table from another source, [byte].
const LARGEST_FOREIGN: u64 = 64 << 20;

/// An entry of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry {
    /// A whole number.
    Integer(i64),
    /// A finite number, written so that it reads back exactly.
    Number(f64),
    /// A missing value, written as an empty entry.
    Missing,
}

impl From<i64> for Entry {
    fn from(value: i64) -> Entry {
        Entry::Integer(value)
    }
}

impl From<Option<f64>> for Entry {
    fn from(value: Option<f64>) -> Entry {
        value.map_or(Entry::Missing, Entry::Number)
    }
}

impl From<f64> for Entry {
    fn from(value: f64) -> Entry {
        Entry::Number(value)
    }
}

/// A `.csv` table with one header line.
#[derive(Debug)]
pub struct Table {
    path: PathBuf,
    file: File,
    /// Length of the whole rows in the file, [byte].
    length: u64,
    columns: Vec<String>,
}

/// The rows of an existing table that are kept when a run is resumed.
#[derive(Debug)]
pub struct Kept {
    path: PathBuf,
    columns: Vec<String>,
    text: String,
}

impl Kept {
    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The entries of some columns, row by row, as whole numbers; `None` for entries that are not whole numbers.
    pub(super) fn numbers<const N: usize>(&self, columns: [&str; N]) -> Vec<[Option<usize>; N]> {
        let places = columns.map(|name| self.columns.iter().position(|column| column == name));
        let rows = self.text.lines().skip(1).map(|row| row.split(',').collect::<Vec<_>>());
        rows.map(|row| places.map(|place| row.get(place?)?.parse().ok())).collect()
    }

    /// Replaces the content of the file by the rows that are kept, and opens the file to be extended.
    ///
    /// Errors: file-system errors.
    pub(super) fn reopen(self) -> io::Result<Table> {
        Table::begin(self.path, self.columns, &self.text)
    }
}

impl Table {
    /// Creates the file, or replaces it, with only the header.
    ///
    /// Errors: file-system errors; `InvalidInput` if there is no column or two have the same name.
    pub fn create(path: impl AsRef<Path>, columns: &[impl AsRef<str>]) -> io::Result<Table> {
        let path = path.as_ref().to_owned();
        let columns: Vec<String> = columns.iter().map(|name| name.as_ref().to_owned()).collect();
        let header =
            header(&columns).map_err(|what| invalid(format!("{} would have {what}", path.display())))?;
        Table::begin(path, columns, &header)
    }

    /// Creates a file with this text, to be extended; the file never lacks its header, even if the run is killed.
    fn begin(path: PathBuf, columns: Vec<String>, text: &str) -> io::Result<Table> {
        replace_file(&path, |file| file.write_all(text.as_bytes()))?;
        let file = fs::OpenOptions::new().append(true).open(&path)?;
        Ok(Table { path, file, columns, length: text.len() as u64 })
    }

    /// Reads, from a file with these columns, the rows to keep: the rows whose first entry is at most `last`. The file
    /// is not changed.
    ///
    /// Errors, which name the file: file-system errors; `InvalidData` if the file has other columns, is damaged, or has
    /// no row with `last` although `last` is not 0.
    pub fn keep(path: impl AsRef<Path>, columns: &[impl AsRef<str>], last: usize) -> io::Result<Kept> {
        let path = path.as_ref().to_owned();
        let columns: Vec<String> = columns.iter().map(|name| name.as_ref().to_owned()).collect();
        let text = input_file::read_text(&path).map_err(|error| {
            let what = match error.kind() {
                io::ErrorKind::NotFound => "is missing".to_owned(),
                _ => format!("cannot be read: {error}"),
            };
            io::Error::new(error.kind(), format!("`{}` {what}", path.display()))
        })?;
        let wrong =
            |what: &str| io::Error::new(io::ErrorKind::InvalidData, format!("`{}` {what}", path.display()));
        let (header, rows) = text.split_once('\n').ok_or_else(|| wrong("is empty"))?;
        if unquoted(header) != columns {
            return Err(wrong("has other columns"));
        }
        let mut kept = format!("{header}\n");
        let mut reached = 0;
        for row in rows.split_inclusive('\n').filter(|row| row.ends_with('\n')) {
            let step = row.split(',').next().and_then(|entry| entry.parse::<usize>().ok());
            let step = step.ok_or_else(|| wrong("has a row without a step"))?;
            if step <= last {
                kept.push_str(row);
                reached = step;
            }
        }
        if reached != last {
            return Err(wrong(&format!("does not reach step {last}")));
        }
        Columns::parse(&kept).map_err(|what| wrong(&format!("is damaged: {what}")))?;
        Ok(Kept { path, columns, text: kept })
    }

    /// Checks that the file is still the one that this table wrote, with the same length.
    ///
    /// Errors, which name the file: file-system errors; `Other` if the file was removed, replaced or changed.
    pub fn check(&self) -> io::Result<()> {
        let wrong =
            |what: &str| io::Error::other(format!("`{}` was {what} during the run", self.path.display()));
        let there = match fs::metadata(&self.path) {
            Ok(there) => there,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Err(wrong("removed")),
            Err(error) => {
                return Err(io::Error::new(error.kind(), format!("`{}`: {error}", self.path.display())));
            }
        };
        if !is_same(&there, &self.file.metadata()?) {
            return Err(wrong("replaced"));
        }
        if there.len() == self.length { Ok(()) } else { Err(wrong("changed")) }
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.columns.len()
    }

    /// Appends a row with one entry per column; it is in the file when this function returns.
    ///
    /// Errors: file-system errors; `InvalidInput` if the number of entries is wrong or an entry is not finite. No part
    /// of the row is then left in the file, if the file can be cut back.
    pub fn push(&mut self, row: &[Entry]) -> io::Result<()> {
        let line =
            line(row, &self.columns).map_err(|what| invalid(format!("{what} of {}", self.path.display())))?;
        // One unbuffered write per row, so that the file has whole rows at all times.
        if let Err(error) = self.file.write_all(line.as_bytes()) {
            // A full disk may take the first bytes of a row. If they cannot be removed either, the first error is
            // reported.
            let _ = self.file.set_len(self.length);
            return Err(io::Error::new(error.kind(), format!("`{}`: {error}", self.path.display())));
        }
        self.length += line.len() as u64;
        Ok(())
    }
}

/// A table as text, for output other than a file that grows.
///
/// # Errors
/// `InvalidInput` if there is no column, two columns have the same name, a row has the wrong number of entries, or an
/// entry is not finite.
pub fn text_of(columns: &[String], rows: impl IntoIterator<Item = Vec<Entry>>) -> io::Result<String> {
    let mut text = header(columns).map_err(|what| invalid(format!("the table would have {what}")))?;
    for row in rows {
        text.push_str(&line(&row, columns).map_err(|what| invalid(format!("{what} of the table")))?);
    }
    Ok(text)
}

/// Checks the names of columns.
///
/// # Errors
/// `InvalidInput` if there is no column or two have the same name.
pub(super) fn check_columns(columns: &[String]) -> io::Result<()> {
    header(columns).map(drop).map_err(|what| invalid(format!("a table would have {what}")))
}

/// The line of column names.
fn header(columns: &[String]) -> Result<String, String> {
    if columns.is_empty() {
        return Err("no column".to_owned());
    }
    if let Some(index) = (1..columns.len()).find(|&i| columns[..i].contains(&columns[i])) {
        return Err(format!("two columns `{}`", columns[index]));
    }
    let names: Vec<String> = columns.iter().map(|name| quoted(name)).collect();
    Ok(names.join(",") + "\n")
}

/// The line of a row.
fn line(row: &[Entry], columns: &[String]) -> Result<String, String> {
    if row.len() != columns.len() {
        let entries = counted(row.len(), "entry", "entries");
        return Err(format!("{entries} for the {}", counted(columns.len(), "column", "columns")));
    }
    let mut line = String::new();
    for (number, (entry, column)) in row.iter().zip(columns).enumerate() {
        if number > 0 {
            line.push(',');
        }
        match entry {
            Entry::Integer(value) => line.push_str(&value.to_string()),
            Entry::Missing => {}
            Entry::Number(value) if value.is_finite() => line.push_str(&shortest(*value)),
            Entry::Number(value) => return Err(format!("{value} for column `{column}`")),
        }
    }
    line.push('\n');
    Ok(line)
}

/// True if two sets of metadata belong to the same file.
#[cfg(unix)]
fn is_same(a: &fs::Metadata, b: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// True if two sets of metadata may belong to the same file.
#[cfg(not(unix))]
fn is_same(a: &fs::Metadata, b: &fs::Metadata) -> bool {
    a.is_file() && a.created().ok() == b.created().ok()
}

/// Formats a string as a field of a line, in quotes if necessary.
pub fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

/// A table of numbers read from a file.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Columns {
    names: Vec<String>,
    /// The values of the first column, of the second, and so on; NaN for missing entries.
    values: Vec<Vec<f64>>,
}

impl Columns {
    /// Reads a table written by [`Table`].
    ///
    /// Errors: file-system errors; `InvalidData` with file and line if there is no header, a row has the wrong number
    /// of entries, an entry is not a number, or the last row is cut off.
    pub fn read(path: &Path) -> io::Result<Columns> {
        let text = input_file::read_text(path)?;
        Columns::parse(&text)
            .map_err(|what| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display())))
    }

    /// Reads a table from any source, such as a spreadsheet: entries may have spaces around them, lines may end in CR
    /// LF, and the last line need not end with a newline.
    ///
    /// Errors: as for [`Columns::read`]; also `InvalidData` if the file is larger than 64 MiB or not UTF-8.
    pub fn read_foreign(path: &Path) -> io::Result<Columns> {
        let damaged =
            |what: &str| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display()));
        let bytes = input_file::read(path, LARGEST_FOREIGN).map_err(|error| match error {
            InputFileError::Io(error) => error,
            InputFileError::TooLarge { .. } => damaged("the file is larger than 64 MiB"),
            error => damaged(&error.to_string()),
        })?;
        let text = String::from_utf8(bytes).map_err(|_| damaged("the file is not UTF-8 text"))?;
        let trimmed = |line: &str| line.split(',').map(str::trim).collect::<Vec<_>>().join(",");
        let lines: Vec<String> =
            text.trim_start_matches('\u{feff}').trim_end().lines().map(trimmed).collect();
        match lines.first() {
            None => Err(damaged("the file is empty")),
            Some(names) if names.contains(';') && !names.contains(',') => {
                Err(damaged("line 1: entries are separated by semicolons; separate them by commas"))
            }
            Some(_) => Columns::parse(&(lines.join("\n") + "\n")).map_err(|what| damaged(&what)),
        }
    }

    fn parse(text: &str) -> Result<Columns, String> {
        let (header, body) = text.split_once('\n').ok_or("there is no complete header")?;
        let names = unquoted(header);
        let mut values = vec![Vec::new(); names.len()];
        for (index, line) in body.split_terminator('\n').enumerate() {
            let number = index + 2;
            let entries: Vec<&str> = line.split(',').collect();
            if entries.len() != names.len() {
                let (found, wanted) = (counted(entries.len(), "entry", "entries"), names.len());
                return Err(format!("line {number} has {found}, but the header has {wanted}"));
            }
            for (entry, column) in entries.iter().zip(&mut values) {
                match entry.parse::<f64>() {
                    Err(_) if entry.is_empty() => column.push(f64::NAN),
                    Ok(value) if value.is_finite() => column.push(value),
                    _ => return Err(format!("line {number}: {entry:?} is not a number")),
                }
            }
        }
        if !text.ends_with('\n') {
            return Err(format!("line {} is cut off", body.lines().count() + 1));
        }
        Ok(Columns { names, values })
    }

    /// Keeps the rows for which `has` is true of the value in a column; keeps all rows if there is no such column.
    pub fn where_column(mut self, name: &str, has: impl Fn(f64) -> bool) -> Columns {
        let Some(kept) = self.column(name).map(|column| column.iter().map(|v| has(*v)).collect::<Vec<_>>())
        else {
            return self;
        };
        for column in &mut self.values {
            let mut kept = kept.iter();
            column.retain(|_| kept.next() == Some(&true));
        }
        self
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of rows.
    pub fn rows(&self) -> usize {
        self.values.first().map_or(0, Vec::len)
    }

    /// The values of a column.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        let index = self.names.iter().position(|known| known == name)?;
        Some(&self.values[index])
    }

    /// Names and values of all columns.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.names.iter().map(String::as_str).zip(self.values.iter().map(Vec::as_slice))
    }
}

/// The fields of a line made with [`quoted`].
fn unquoted(line: &str) -> Vec<String> {
    let (mut fields, mut field, mut inside) = (Vec::new(), String::new(), false);
    let mut rest = line.chars().peekable();
    while let Some(c) = rest.next() {
        match c {
            '"' if inside && rest.peek() == Some(&'"') => {
                rest.next();
                field.push('"');
            }
            '"' => inside = !inside,
            ',' if !inside => fields.push(std::mem::take(&mut field)),
            c => field.push(c),
        }
    }
    fields.push(field);
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_read_back_exactly() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("t.csv");
        let mut table = Table::create(&path, &["step", "a, \"b\""]).unwrap();
        assert_eq!(Columns::read(&path).unwrap().rows(), 0);
        for (step, value) in [(1, 1.0 / 3.0), (2, -5e-324), (3, 12e6)] {
            table.push(&[step.into(), value.into()]).unwrap();
        }
        let read = Columns::read(&path).unwrap();
        assert_eq!(read.names(), ["step", "a, \"b\""]);
        assert_eq!(read.column("a, \"b\""), Some(&[1.0 / 3.0, -5e-324, 12e6][..]));
        assert_eq!(read.column("b"), None);
        assert_eq!(read.iter().last(), Some(("a, \"b\"", &[1.0 / 3.0, -5e-324, 12e6][..])));
    }

    #[test]
    fn tables_of_spreadsheets_are_read() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("t.csv");
        for text in ["\u{feff}a, b\r\n1 ,-2e3\r\n3,\r\n\r\n", "a,b\n1,-2000\n3,"] {
            fs::write(&path, text).unwrap();
            let read = Columns::read_foreign(&path).unwrap();
            assert_eq!(
                (read.names(), read.column("a")),
                (&["a".into(), "b".into()][..], Some(&[1.0, 3.0][..]))
            );
            assert!(matches!(read.column("b"), Some([-2000.0, missing]) if missing.is_nan()));
        }
        for (bytes, complaint) in [
            (&b""[..], "t.csv: the file is empty"),
            (b" \r\n\r\n", "the file is empty"),
            (b"a;b\n1,5;2\n", "line 1: entries are separated by semicolons"),
            (b"a\n1\nx\n", "line 3: \"x\" is not a number"),
            (b"a\n\xff", "the file is not UTF-8 text"),
        ] {
            fs::write(&path, bytes).unwrap();
            let error = Columns::read_foreign(&path).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidData);
            assert!(error.to_string().contains(complaint), "{error}");
        }
    }

    #[test]
    fn damaged_tables_are_refused_with_the_line() {
        for (text, complaint) in [
            ("", "header"),
            ("step,a", "header"),
            ("step,a\n1,2\n3", "line 3 has 1 entry, but"),
            ("step,a\n1,2\n3,4", "line 3 is cut off"),
            ("step,a\n1,2\n3,x\n", "line 3: \"x\" is not a number"),
            ("step,a\n1,NaN\n", "line 2"),
            ("step,a\n\n1,2\n", "line 2 has 1 entry, but"),
        ] {
            let error = Columns::parse(text).unwrap_err();
            assert!(error.contains(complaint), "{text:?}: {error}");
        }
    }

    #[test]
    fn rows_are_on_disk_at_once() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("history.csv");
        let mut table = Table::create(&path, &["step", "time", "a, \"b\""]).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "step,time,\"a, \"\"b\"\"\"\n");
        table.push(&[0.into(), 0.0.into(), (-1.5e-12).into()]).unwrap();
        table.push(&[1.into(), (1.0 / 3.0).into(), 12e6.into()]).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let rows: Vec<&str> = text.lines().skip(1).collect();
        assert_eq!(rows, ["0,0,-1.5e-12", "1,0.3333333333333333,12000000"]);
    }

    #[test]
    fn refuses_what_cannot_be_read_back() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("t.csv");
        assert_eq!(Table::create(&path, &["a", "b", "a"]).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        assert!(Table::create(&path, &[] as &[&str]).is_err());
        let mut table = Table::create(&path, &["a", "b"]).unwrap();
        for row in [&[1.0.into(), f64::NAN.into()][..], &[f64::INFINITY.into(), 0.into()], &[1.into()], &[]] {
            assert_eq!(table.push(row).unwrap_err().kind(), io::ErrorKind::InvalidInput);
        }
        assert_eq!(fs::read_to_string(&path).unwrap(), "a,b\n");
    }
}
