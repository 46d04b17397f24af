//! How the program ends where the system will not let it go on: no memory for what it has to keep, no more bytes for a
//! file.
//!
//! Rust ends a program whose allocation fails by SIGABRT, without a way back. A thread that needs no memory waits for
//! that signal and says what has happened, with the exit code of a failed analysis; meanwhile the thread that asked for
//! memory must not go on, so that the last action of the signal's handler is to write to a pipe that is full.

#[cfg(unix)]
pub use unix::{limits_are_errors, wait_for_lack_of_memory};

/// Other systems have no such signal.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn limits_are_errors() -> anyhow::Result<()> {
    Ok(())
}

/// On other systems a failed allocation ends the program with the message of Rust.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn wait_for_lack_of_memory() -> anyhow::Result<()> {
    Ok(())
}

#[cfg(unix)]
mod unix {
    use std::io::{self, PipeReader, Read, Write};
    use std::os::fd::OwnedFd;
    use std::os::unix::net::UnixStream;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::{panic, process};

    use anyhow::Context;
    use signal_hook::consts::{SIGABRT, SIGXFSZ};
    use signal_hook::low_level::{self, pipe};

    use crate::exit::FAILED;

    const NO_MEMORY: &[u8] = b"error[S008]: not enough memory: the system refuses what the analysis asks for\n  results up \
        to the last equilibrated step are in its directory\n  help: use larger cells or fewer points, run on a machine \
        with more memory, or raise `ulimit -v`\n";

    /// What a panic of zlib-rs says where memory is what it lacks.
    const ZLIB_WITHOUT_MEMORY: &str = "left: MemError";

    /// Stack of the waiting thread, [byte].
    const STACK: usize = 64 << 10;

    /// Lets a file that reaches the limit of its size, `ulimit -f`, be an error like a full disk.
    ///
    /// # Errors
    /// When the signal cannot be handled.
    pub fn limits_are_errors() -> anyhow::Result<()> {
        // Where the signal is taken, the write that caused it returns an error.
        signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))
            .context("the signal of files that are too large cannot be handled")?;
        Ok(())
    }

    /// Lets a failed allocation end the program with a message and the exit code of a failed analysis.
    ///
    /// # Errors
    /// When the signal cannot be handled or the thread that waits cannot be started.
    pub fn wait_for_lack_of_memory() -> anyhow::Result<()> {
        let (mut awaited, waker) = UnixStream::pair().context("no sockets can be made")?;
        pipe::register(SIGABRT, waker).context("failed allocations cannot be handled")?;
        let reader = block_on_abort().context("failed allocations cannot be handled")?;
        std::thread::Builder::new()
            .name("last words".to_owned())
            .stack_size(STACK)
            .spawn(move || {
                let mut byte = [0];
                if awaited.read_exact(&mut byte).is_ok() {
                    let _ = io::stderr().write_all(NO_MEMORY);
                    low_level::exit(i32::from(FAILED));
                }
                drop(reader);
            })
            .context("the threads cannot be started")?;
        let otherwise = panic::take_hook();
        panic::set_hook(Box::new(move |panic| {
            // The compression library asserts that it is given memory.
            if panic.payload().downcast_ref::<String>().is_some_and(|said| said.contains(ZLIB_WITHOUT_MEMORY))
            {
                process::abort();
            }
            otherwise(panic);
        }));
        Ok(())
    }

    /// Makes the handler of SIGABRT wait for ever, as long as nobody reads from the pipe that is returned.
    fn block_on_abort() -> io::Result<PipeReader> {
        let (reader, writer) = io::pipe()?;
        let mut same = writer.try_clone()?;
        let switch = UnixStream::from(OwnedFd::from(writer.try_clone()?));
        // From now on the pipe refuses what has no room in it, ...
        pipe::register(SIGABRT, writer)?;
        while same.write(&[0; 4096]).is_ok() {}
        while same.write(&[0]).is_ok() {}
        // ... and from here on it waits again until there is room.
        switch.set_nonblocking(false)?;
        Ok(reader)
    }
}
