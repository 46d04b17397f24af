//! ParaView time series: a `.pvd` file that names one data file per time.

use std::io;
use std::path::PathBuf;

use super::replace::replace_file;
use super::{escape_xml, invalid, shortest};

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

    /// Adds the data file of a time, [time], named relative to the directory of the series, and rewrites the series.
    ///
    /// Errors: those of the file system; `InvalidInput` if the time is not finite or not later than the last one.
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
            writeln!(out, r#"<?xml version="1.0" encoding="UTF-8"?>"#)?;
            writeln!(out, r#"<VTKFile type="Collection" version="1.0" byte_order="LittleEndian">"#)?;
            writeln!(out, "  <Collection>")?;
            for (time, file) in &self.entries {
                let (time, file) = (shortest(*time), escape_xml(file));
                writeln!(out, r#"    <DataSet timestep="{time}" group="" part="0" file="{file}"/>"#)?;
            }
            writeln!(out, "  </Collection>")?;
            writeln!(out, "</VTKFile>")
        })
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
