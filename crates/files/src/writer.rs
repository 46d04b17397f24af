//! Writes the frames of a step while the next step is computed.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{Builder, JoinHandle};
use std::time::Duration;

use super::directory::SERIES;
use super::frames::{Frame, List};
use super::series::Series;

/// Pause while there is no work to help with.
const PAUSE: Duration = Duration::from_micros(100);

/// Writes frames, one step at a time, and adds them to their series. If the run has more than one thread, frames are
/// written concurrently with it; the contents of the files are the same either way.
pub(super) struct Writer {
    directory: PathBuf,
    series: Arc<Mutex<[Series; SERIES.len()]>>,
    at_work: Option<JoinHandle<io::Result<()>>>,
}

impl Writer {
    pub fn new(directory: &Path, series: [Series; SERIES.len()]) -> Writer {
        Writer { directory: directory.to_owned(), series: Arc::new(Mutex::new(series)), at_work: None }
    }

    /// Begins to write frames once the previous ones are written.
    ///
    /// # Errors
    /// A file-system error, possibly about the previous frames.
    pub fn begin(&mut self, frames: Vec<Frame>) -> io::Result<()> {
        self.settle()?;
        if rayon::current_num_threads() < 2 {
            return write(&self.directory, &self.series, &frames);
        }
        let frames = Arc::new(frames);
        let (directory, series, same) =
            (self.directory.clone(), Arc::clone(&self.series), Arc::clone(&frames));
        let work = move || write(&directory, &series, &same);
        match Builder::new().name("output".to_owned()).spawn(work) {
            Ok(thread) => {
                self.at_work = Some(thread);
                Ok(())
            }
            // The system allows no further thread, so the current one writes.
            Err(_) => write(&self.directory, &self.series, &frames),
        }
    }

    /// Writes lists of the pieces that all ranks have written, and adds each list to its series.
    ///
    /// # Errors
    /// A file-system error.
    pub fn list(&self, lists: &[List]) -> io::Result<()> {
        for list in lists {
            list.pieces.write(&self.directory.join(&list.name))?;
            let mut series: MutexGuard<_> = self.series.lock().unwrap_or_else(PoisonError::into_inner);
            series[list.series].push(list.step.end, &list.name)?;
        }
        Ok(())
    }

    /// Time of the last file of the first series, [time].
    pub fn reached(&self) -> Option<f64> {
        let series = self.series.lock().unwrap_or_else(PoisonError::into_inner);
        series[0].last().map(|(time, _)| time)
    }

    /// True if frames are being written.
    pub fn is_at_work(&self) -> bool {
        self.at_work.as_ref().is_some_and(|thread| !thread.is_finished())
    }

    /// Waits for the frames that are being written, and helps with other work of the pool meanwhile.
    ///
    /// # Errors
    /// A file-system error.
    pub fn settle(&mut self) -> io::Result<()> {
        while self.is_at_work() {
            if rayon::yield_now() != Some(rayon::Yield::Executed) {
                std::thread::sleep(PAUSE);
            }
        }
        match self.at_work.take().map(JoinHandle::join) {
            None => Ok(()),
            Some(Ok(outcome)) => outcome,
            Some(Err(_)) => Err(io::Error::other("the thread that writes results has died")),
        }
    }
}

impl Drop for Writer {
    /// A run that ends properly leaves no half-written file.
    fn drop(&mut self) {
        let _ = self.settle(); // a caller that needs the error calls `settle` itself
    }
}

fn write(directory: &Path, series: &Mutex<[Series; SERIES.len()]>, frames: &[Frame]) -> io::Result<()> {
    for frame in frames {
        frame.file.write(&directory.join(&frame.name))?;
        if frame.is_piece {
            continue;
        }
        let mut series: MutexGuard<_> = series.lock().unwrap_or_else(PoisonError::into_inner);
        series[frame.series].push(frame.step.end, &frame.name)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vtu::{CellKind, Cells, Encoded, File, Kinds, Precision, Room, Values};
    use mpm_core::solver::Step;

    fn frame(index: usize) -> Frame {
        let room = Room::default();
        let places = vec![index as f64; 3000];
        let places = Encoded::positions(1000, Values::Float64(&places), Precision::Double, &room).unwrap();
        let vertices: Vec<i64> = (0..1000).collect();
        let cells = Cells::new(1000, &Kinds::All(CellKind::Vertex), &vertices, &room).unwrap();
        let (places, cells) = (Arc::new(places), Arc::new(cells));
        Frame {
            series: 0,
            name: format!("points_{index:04}.vtu"),
            step: Step { index, start: index as f64 - 1.0, end: index as f64 },
            file: File::new(index as f64, index as i64, places, cells, vec![], vec![]).unwrap(),
            is_piece: false,
        }
    }

    fn writer(directory: &Path) -> Writer {
        Writer::new(directory, SERIES.map(|s| Series::new(directory.join(format!("{s}.pvd")))))
    }

    #[test]
    fn files_are_the_same_beside_the_run_and_in_it() {
        let read = |threads: usize| {
            let directory = tempfile::tempdir().unwrap();
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let mut writer = writer(directory.path());
                (1..4).for_each(|index| writer.begin(vec![frame(index)]).unwrap());
                writer.settle().unwrap();
                assert!(!writer.is_at_work());
            });
            let file = |name: &str| std::fs::read(directory.path().join(name)).unwrap();
            ["points.pvd", "points_0001.vtu", "points_0002.vtu", "points_0003.vtu"].map(file)
        };
        assert_eq!(read(1), read(2));
    }

    #[test]
    fn a_failure_is_reported_by_the_next_call_and_its_file_is_in_no_series() {
        let directory = tempfile::tempdir().unwrap();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
        pool.install(|| {
            let mut writer = writer(directory.path());
            writer.begin(vec![frame(1)]).unwrap();
            writer.settle().unwrap();
            // A directory blocks the path of the file.
            std::fs::create_dir_all(directory.path().join("points_0002.vtu/inside")).unwrap();
            writer.begin(vec![frame(2)]).unwrap();
            assert!(writer.begin(vec![frame(3)]).is_err());
            writer.settle().unwrap(); // reported once
        });
        let series = std::fs::read_to_string(directory.path().join("points.pvd")).unwrap();
        assert!(series.contains("points_0001") && !series.contains("points_0002"), "{series}");
    }
}
