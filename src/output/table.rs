//! Comma-separated tables that grow by whole rows.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::{invalid, shortest};

/// An entry of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Entry {
    /// A whole number.
    Integer(i64),
    /// A finite number, written so that it reads back exactly.
    Number(f64),
}

impl From<i64> for Entry {
    fn from(value: i64) -> Entry {
        Entry::Integer(value)
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
    columns: Vec<String>,
}

impl Table {
    /// Creates the file, or empties it, and writes the header.
    ///
    /// Errors: those of the file system; `InvalidInput` if there is no column or two have the same name.
    pub fn create(path: impl AsRef<Path>, columns: &[impl AsRef<str>]) -> io::Result<Table> {
        let path = path.as_ref().to_owned();
        let columns: Vec<String> = columns.iter().map(|name| name.as_ref().to_owned()).collect();
        if columns.is_empty() {
            return Err(invalid(format!("{} would have no column", path.display())));
        }
        if let Some(index) = (1..columns.len()).find(|&i| columns[..i].contains(&columns[i])) {
            return Err(invalid(format!("{} would have two columns `{}`", path.display(), columns[index])));
        }
        let mut file = File::create(&path)?;
        let header: Vec<String> = columns.iter().map(|name| quoted(name)).collect();
        file.write_all(format!("{}\n", header.join(",")).as_bytes())?;
        Ok(Table { path, file, columns })
    }

    /// Appends a row with one entry per column; it is in the file when this returns.
    ///
    /// Errors: those of the file system; `InvalidInput` if the number of entries is wrong or one is not finite, and
    /// then nothing is written.
    pub fn push(&mut self, row: &[Entry]) -> io::Result<()> {
        if row.len() != self.columns.len() {
            let (path, wanted) = (self.path.display(), self.columns.len());
            return Err(invalid(format!("{path} has {wanted} columns, the row has {}", row.len())));
        }
        let mut line = String::new();
        for (entry, column) in row.iter().zip(&self.columns) {
            if !line.is_empty() {
                line.push(',');
            }
            match entry {
                Entry::Integer(value) => line.push_str(&value.to_string()),
                Entry::Number(value) if value.is_finite() => line.push_str(&shortest(*value)),
                Entry::Number(value) => {
                    return Err(invalid(format!("{value} for column `{column}` of {}", self.path.display())));
                }
            }
        }
        line.push('\n');
        // One unbuffered write per row: whoever reads the file, or kills the run, meets whole rows.
        self.file.write_all(line.as_bytes())
    }
}

/// A text as a field of a line, quoted where it would otherwise break the line.
pub(crate) fn quoted(name: &str) -> String {
    if name.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

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
