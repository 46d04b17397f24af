//! ParaView time series: a `.pvd` file that names one data file per time.

use std::io;
use std::path::{Path, PathBuf};

use mpm_core::input_file;
use quick_xml::XmlVersion;
use quick_xml::events::Event;

use super::replace::replace_file;
use super::{escape_xml, invalid, shortest};

/// First bytes of every file.
pub(super) const HEAD: &str = concat!(
    r#"<?xml version="1.0" encoding="UTF-8"?>"#,
    "\n",
    r#"<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">"#,
    "\n  <Collection>\n"
);

/// A `.pvd` time series that is complete on disk after every step.
#[derive(Debug)]
pub struct Series {
    path: PathBuf,
    entries: Vec<(f64, String)>,
}

impl Series {
    /// An empty series that will be kept in `path`; nothing is written yet.
    pub fn new(path: impl Into<PathBuf>) -> Series {
        Series { path: path.into(), entries: Vec::new() }
    }

    /// Reopens a series with the entries of its file up to a time, [time], whose data files exist and are accepted by
    /// `is_kept`; the series is empty if there is no file.
    ///
    /// Errors: as for [`read`]; file-system errors.
    pub fn reopen(
        path: impl Into<PathBuf>,
        until: f64,
        is_kept: impl Fn(&str) -> bool,
    ) -> io::Result<Series> {
        let path = path.into();
        let before = match read(&path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Series::new(path)),
            found => found?,
        };
        let mut entries = Vec::new();
        for DataSet { time, path } in before.into_iter().filter(|entry| entry.time <= until) {
            let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            if path.is_file() && is_kept(name) {
                entries.push((time, name.to_owned()));
            }
        }
        let series = Series { path, entries };
        series.write()?;
        Ok(series)
    }

    /// Time, [time], and name of the last data file.
    pub fn last(&self) -> Option<(f64, &str)> {
        self.entries.last().map(|(time, name)| (*time, name.as_str()))
    }

    /// Adds the data file of a time, [time], named relative to the directory of the series, and rewrites the series
    /// file.
    ///
    /// Errors: file-system errors; `InvalidInput` if the time is not finite or not later than the last one.
    /// A failed push leaves the series as it was.
    pub fn push(&mut self, time: f64, file_name: &str) -> io::Result<()> {
        if !time.is_finite() {
            return Err(invalid(format!("time {time} of {file_name} is not finite")));
        }
        if let Some((last, _)) = self.entries.last().filter(|(last, _)| time <= *last) {
            return Err(invalid(format!("time {time} of {file_name} is not later than {last}")));
        }
        self.entries.push((time, file_name.to_owned()));
        let written = self.write();
        if written.is_err() {
            self.entries.pop();
        }
        written
    }

    /// Writes all entries.
    fn write(&self) -> io::Result<()> {
        replace_file(&self.path, |out| {
            out.write_all(HEAD.as_bytes())?;
            for (time, file) in &self.entries {
                let (time, file) = (shortest(*time), escape_xml(file));
                writeln!(out, r#"    <DataSet timestep="{time}" group="" part="0" file="{file}"/>"#)?;
            }
            writeln!(out, "  </Collection>")?;
            writeln!(out, "</VTKFile>")
        })
    }
}

/// An entry of a series.
#[derive(Debug, Clone, PartialEq)]
pub struct DataSet {
    /// Time, [time].
    pub time: f64,
    /// Path of the data file.
    pub path: PathBuf,
}

/// Reads a `.pvd` time series, in the order of the file.
///
/// Errors: file-system errors; `InvalidData` with the name of the file if it is cut off or is not a series.
pub fn read(path: &Path) -> io::Result<Vec<DataSet>> {
    let text = input_file::read_text(path)?;
    let directory = path.parent().unwrap_or(Path::new(""));
    parse(&text, directory)
        .map_err(|what| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display())))
}

fn parse(text: &str, directory: &Path) -> Result<Vec<DataSet>, String> {
    let mut reader = quick_xml::Reader::from_str(text);
    let mut entries = Vec::new();
    loop {
        match reader.read_event().map_err(|error| format!("cut off or not XML: {error}"))? {
            Event::Start(tag) | Event::Empty(tag) if tag.name().as_ref() == "DataSet" => {
                let attribute = |name: &str| {
                    let found = tag.try_get_attribute(name).ok().flatten()?;
                    Some(found.normalized_value(XmlVersion::Implicit1_0).ok()?.into_owned())
                };
                let time =
                    attribute("timestep").and_then(|text| text.parse().ok()).filter(|t: &f64| t.is_finite());
                let (Some(time), Some(file)) = (time, attribute("file")) else {
                    return Err(format!("entry {} has no time or no file", entries.len() + 1));
                };
                entries.push(DataSet { time, path: directory.join(file) });
            }
            Event::Eof if text.trim_end().ends_with("</VTKFile>") => return Ok(entries),
            Event::Eof => return Err("the file is cut off".to_owned()),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn is_complete_after_every_step() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("points.pvd");
        let mut series = Series::new(&path);
        assert!(!path.exists());
        series.push(0.0, "points_0000.vtu").unwrap();
        series.push(1.0 / 3.0, "points_0001.vtu").unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let expected = r#"<?xml version="1.0" encoding="UTF-8"?>
<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">
  <Collection>
    <DataSet timestep="0" group="" part="0" file="points_0000.vtu"/>
    <DataSet timestep="0.3333333333333333" group="" part="0" file="points_0001.vtu"/>
  </Collection>
</VTKFile>
"#;
        assert_eq!(text, expected);
        assert_eq!(fs::read_dir(directory.path()).unwrap().count(), 1, "a temporary file is left");
        let read = read(&path).unwrap();
        assert_eq!(read.iter().map(|entry| entry.time).collect::<Vec<f64>>(), [0.0, 1.0 / 3.0]);
        assert_eq!(read[1].path, directory.path().join("points_0001.vtu"));
        for end in 0..text.trim_end().len() {
            fs::write(&path, &text[..end]).unwrap();
            assert!(super::read(&path).is_err(), "{}", &text[..end]);
        }
    }

    #[test]
    fn refuses_times_without_order() {
        let directory = tempfile::tempdir().unwrap();
        let mut series = Series::new(directory.path().join("s.pvd"));
        series.push(1.0, "a.vtu").unwrap();
        for time in [1.0, 0.5, f64::NAN, f64::INFINITY] {
            assert_eq!(series.push(time, "b.vtu").unwrap_err().kind(), io::ErrorKind::InvalidInput);
        }
        series.push(2.0, "b.vtu").unwrap();
        assert_eq!(
            fs::read_to_string(directory.path().join("s.pvd")).unwrap().matches("<DataSet").count(),
            2
        );
    }

    #[test]
    fn failed_push_can_be_repeated() {
        let directory = tempfile::tempdir().unwrap();
        let missing = directory.path().join("missing");
        let mut series = Series::new(missing.join("s.pvd"));
        assert!(series.push(0.0, "a.vtu").is_err());
        fs::create_dir(&missing).unwrap();
        series.push(0.0, "a.vtu").unwrap();
    }
}
